// A plane section through a joint: the field that a tip meets in it, and the outlines of all
// surfaces. Millimetres, in the tibia's joint frame (x to the right, y anterior, z proximal).
#pragma once

#include "check/check.h"

enum section_kind { SECTION_CORONAL, SECTION_MEDIAL, SECTION_LATERAL, SECTION_KIND_COUNT };

const char *section_name(enum section_kind kind); // "coronal", "medial, sagittal", ...

// The larger coordinate to the right in a picture is x (coronal) or y; up is z.
struct section_cell {
    uint8_t place; // enum space_place
    bool close;    // left out: too near to a second group
    bool folds;
    bool still;    // W is 0
    uint8_t group; // that it is inside of, where it is PLACE_SOLID
    float gain;    // |∇W|
};

struct section_line {
    float from[2], to[2]; // right, up
    uint8_t group;
    bool is_virtual;
    bool filled, strained; // check/facing.h; of physical ones
};

// Zeroed: none.
struct section {
    enum section_kind kind;
    double at;        // where on the axis that is not seen
    double origin[2]; // of the first cell's middle: right, up
    double spacing_mm;
    int size[2];
    struct section_cell *cells; // [i + size[0] * k]: i to the right, k up
    size_t line_count;
    struct section_line *lines;
};

// Coronal through both contacts of femur and tibia, or sagittal through one of them: 100 mm wide
// and 70 mm high about it. RESULT_IO, RESULT_LIMIT. The caller releases it.
enum result section_make(const struct scene *scene, const struct check_settings *settings,
                         const struct joint_angles *joint, enum section_kind kind,
                         double spacing_mm, struct section *out_section, struct error *err);
void section_fini(struct section *section);
