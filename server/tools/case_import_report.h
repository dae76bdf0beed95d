// What arthron-case import says of each mesh.
#pragma once

#include "case_import_clip.h"
#include "import/import.h"

#include <jansson.h>

struct import_said {
    const char *group, *file;
    const struct mesh *mesh; // as it is in the case
    const struct repair_report *report;
    const struct clip_report *clip;
    const struct knee_case *knee; // how the scan lies
};

// On stdout: a line, and three more where anything was wrong: what was, what was done, what
// remains; and the place of each, in the case and in the scan.
void import_print(const struct import_said *said);

// {group, file, vertices, triangles, cuttable, clipped, wrong, done, remains, places}. wrong, done
// and remains hold a count for each thing, 0 where there is none; places a place for those of done
// and remains that have one.
json_t *import_json(const struct import_said *said);

// A point of the case in the scan: mm, in the scan's axes.
vec3 import_in_scan(const struct knee_case *knee, vec3 p);
