// A parametric knee, made from a recipe: no scan, no patient.
//
// The geometry is that of generate/shape.h, scaled by `size` and mirrored for a left knee. The same
// recipe gives the same bytes.
#pragma once

#include "generate/pathology.h"

#define RECIPE_CAVITIES_MAX 8
#define RECIPE_WEAR_MAX 8
#define RECIPE_MENISCUS_MAX 4 // tears, and plans
#define RECIPE_TISSUES_MAX 8
#define RECIPE_STEPS_MAX                                                                           \
    (CASE_LIGAMENTS_MAX + RECIPE_CAVITIES_MAX + RECIPE_WEAR_MAX + 2 * RECIPE_MENISCUS_MAX +        \
     RECIPE_TISSUES_MAX + CASE_LOOSE_MAX)

struct recipe {
    char name[CASE_NAME_MAX]; // the recipe's folder
    char title[128];
    enum side side;
    double size;                // 1: a tibial plateau 77 mm wide
    double resolution_mm;       // edges of a bone's triangles; fine parts get finer ones
    double meniscus_medial_cm3; // volumes at size 1
    double meniscus_lateral_cm3;
    double rim_mm; // of the menisci's maxcut; 0: they have none
    int step_count;
    // Made by their kind: ligaments, cavities, wear, tears, plans, tissues, loose bodies. Places
    // are as for a knee of size 1; radius, depth, width and thickness are not scaled.
    struct pathology steps[RECIPE_STEPS_MAX];
};

// Reads a recipe: a folder with recipe.ini, or the file itself. cases/README.md describes it.
// Unknown sections and keys, keys given twice and values out of range are refused; the error
// names file, section, key and range.
enum result recipe_load(const char *path, struct recipe *out_recipe, struct error *err);

// RESULT_INVALID where a step cannot be made (generate/pathology.h). The caller destroys *out_case.
enum result generate_knee(const struct recipe *recipe, struct knee_case **out_case,
                          struct error *err);
