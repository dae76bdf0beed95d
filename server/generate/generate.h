// A parametric knee, made from a recipe: no scan, no patient.
//
// The geometry is that of generate/shape.h, scaled by `size` and mirrored for a left knee. The same
// recipe gives the same bytes.
#pragma once

#include "generate/deform.h"
#include "generate/tear.h"

#define RECIPE_CAVITIES_MAX 8
#define RECIPE_TEARS_MAX 4
#define RECIPE_SERIES_MAX 8

// A dent of a bone. All groups of the body follow the same smooth, one-to-one map of space, so
// facing surfaces (a meniscus and its tibia) stay as clear of one another as they were.
struct recipe_cavity {
    char name[CASE_NAME_MAX];
    enum body body;            // femur or tibia
    struct deform_cavity dent; // `at` in a right knee of size 1; radius and depth as they are
};

// A tear of a meniscus, in the shape that the cavities have given it.
struct recipe_tear {
    char name[CASE_NAME_MAX];
    char group[CASE_NAME_MAX];
    struct tear tear;
};

// A value for each of a ligament's keys: none is 0 for all, one holds for all.
struct recipe_series {
    int count;
    double values[RECIPE_SERIES_MAX];
};

// A torn ligament: where the mock-up's holds the joint, and how much further the patient's goes.
struct recipe_ligament {
    char name[CASE_NAME_MAX];
    struct recipe_series flexion_deg;
    struct recipe_series valgus_deg, internal_deg, drawer_mm; // as motion/joint.h
    struct recipe_series extra_valgus_deg, extra_internal_deg, extra_drawer_mm;
};

struct recipe {
    char name[CASE_NAME_MAX]; // the recipe's folder
    char title[128];
    enum side side;
    double size;                // 1: a tibial plateau 77 mm wide
    double resolution_mm;       // edges of a bone's triangles; fine parts get finer ones
    double meniscus_medial_cm3; // volumes at size 1
    double meniscus_lateral_cm3;
    double rim_mm; // of the menisci's maxcut; 0: they have none
    int cavity_count;
    struct recipe_cavity cavities[RECIPE_CAVITIES_MAX];
    int tear_count;
    struct recipe_tear tears[RECIPE_TEARS_MAX];
    int ligament_count;
    struct recipe_ligament ligaments[CASE_LIGAMENTS_MAX];
};

// Reads a recipe: a folder with recipe.ini, or the file itself. cases/README.md describes it.
// Unknown sections and keys, keys given twice and values out of range are refused; the error
// names file, section, key and range.
enum result recipe_load(const char *path, struct recipe *out_recipe, struct error *err);

// RESULT_INVALID where a cavity is nowhere near its bone or a tear does not fit its meniscus. The
// caller destroys *out_case.
enum result generate_knee(const struct recipe *recipe, struct knee_case **out_case,
                          struct error *err);
