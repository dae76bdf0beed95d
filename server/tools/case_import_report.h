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
};

// On stdout: a line, and three more where anything was wrong: what was, what was done, what
// remains.
void import_print(const struct import_said *said);

// {group, file, vertices, triangles, clipped, wrong, done, remains}; the last three hold a count
// for each thing, 0 where there is none.
json_t *import_json(const struct import_said *said);
