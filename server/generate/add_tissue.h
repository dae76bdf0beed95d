// A step of a recipe that describes a group of a case, or adds one: a plica, a loose body.
#pragma once

#include "case/case.h"

#define TISSUE_PATH_MAX 4

enum told { TOLD_NOTHING, TOLD_NO, TOLD_YES };

struct add_tissue {
    bool has_kind, has_colour, has_side;
    enum tissue_kind kind;
    enum tissue_side side;
    uint32_t colour;
    char label[TISSUE_LABEL_MAX]; // empty: none is given
    enum told zones, cuttable;
    enum body body, bridges; // BODY_COUNT: none is given
    // Of a new group: control points of a Bézier curve from end to end, from the joint's origin: x
    // lateral, y anterior, z proximal. 0: the group is there already.
    int path_count;
    vec3 path[TISSUE_PATH_MAX];
    vec3 flat; // about the direction in which it is thin
    double width_mm, thickness_mm;
};

void add_tissue_init(struct add_tissue *step);

// As pathology_take and pathology_check.
enum result add_tissue_take(struct add_tissue *step, const char *key, const char *value,
                            struct error *err);
enum result add_tissue_check(const struct add_tissue *step, struct error *err);

// Describes the group of this name, or adds it. As pathology_apply.
enum result add_tissue_apply(struct knee_case *knee, const char *name,
                             const struct add_tissue *step, struct error *err);
