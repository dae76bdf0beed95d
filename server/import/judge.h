// What the surfaces of a scan, all together, say of its unit, its axes and the side of the knee.
#pragma once

#include "base/joint.h"
#include "import/frame.h"
#include "import/reader.h"

#define IMPORT_UNITS 3
extern const struct import_unit {
    const char *name;
    double mm;
} import_units[IMPORT_UNITS]; // of a file: mm, cm, m

struct import_surface {
    const char *group, *path;
    double mm_per_unit; // 0: not known yet
    pose T_common_file; // after scaling to mm
    struct import_arrays arrays;
};

enum import_trust { TRUST_GIVEN, TRUST_SURE, TRUST_LIKELY, TRUST_ASSUMED };

const char *import_trust_name(enum import_trust trust); // "given", "sure", "likely", "assumed"

struct import_judgement {
    enum import_trust trust;
    char value[8]; // "mm", "LPS", "left"
    char why[200]; // from what
};

// Where the femur has a unit, that is given: says it, or "several" where not all have the same.
// Else sets that of all surfaces: mm, cm or m, that of which tibia and femur have the size of a
// knee. Then refuses, by group and path, a surface that disagrees with the others: one far from the
// bones, or whose length is not that of its kind, with the unit that would fit. Needs a tibia and a
// femur; refused where no unit fits them.
enum result import_judge_unit(struct import_surface *surfaces, int count,
                              struct import_judgement *out, struct error *err);

// The axes of the common frame: up from tibia to femur, and front from femur to patella. Where
// there is no patella, or neither direction is near an axis, those that the files declare, else
// RAS. Refused where files declare others than the knee has, or contradict each other. Units are
// known.
enum result import_judge_axes(const struct import_surface *surfaces, int count,
                              struct import_judgement *out, struct error *err);

// The side, by where the parts that lie lateral and medial are: menisci, lcl and mcl, the fibula.
// Refused where they contradict each other. TRUST_ASSUMED and an empty value where there are none.
enum result import_judge_side(const struct import_surface *surfaces, int count,
                              const struct import_frame *frame, struct import_judgement *out,
                              struct error *err);

// A surface of the group, the one with the most triangles; NULL where there is none.
const struct import_surface *import_main_surface(const struct import_surface *surfaces, int count,
                                                 const char *group);
// The first vertex of a surface, in the common frame.
vec3 import_first_vertex(const struct import_surface *surface);
