// What is wrong with a patient's knee: steps that are made one after another on any case, generated
// or imported. A recipe is a list of them, and each is a command of arthron-case.
#pragma once

#include "generate/add_loose.h"
#include "generate/add_tissue.h"
#include "generate/deform.h"
#include "generate/tear.h"
#include "generate/wear.h"

#define PATHOLOGY_VALUES_MAX 8

enum pathology_kind {
    PATHOLOGY_LIGAMENT, // a torn one
    PATHOLOGY_CAVITY,
    PATHOLOGY_WEAR,   // of a bone's cartilage
    PATHOLOGY_TEAR,   // of a meniscus, with the plan that takes it out
    PATHOLOGY_PLAN,   // a planned resection, in place of the one that there is
    PATHOLOGY_TISSUE, // a group that is added, or described
    PATHOLOGY_LOOSE,  // loose bodies
    PATHOLOGY_KIND_COUNT
};

const char *pathology_kind_name(enum pathology_kind kind); // "ligament", "cavity", "wear", ...

// On a bone. Its nearest vertex is the middle of what is made there.
struct pathology_place {
    enum body body;
    vec3 at;                      // from the joint's origin: x lateral, y anterior, z proximal
    char landmark[CASE_NAME_MAX]; // of the body, in place of `at`; empty: none
};

// A dent of a bone. All groups of the body follow the same smooth, one-to-one map of space, so
// facing surfaces (a meniscus and its tibia) stay as clear of one another as they were.
struct pathology_cavity {
    struct pathology_place place; // of femur or tibia
    double radius_mm, depth_mm;   // as struct deform_cavity
};

// What an arthroscope sees of arthrosis. It changes no shape: a cavity does.
struct pathology_wear {
    struct pathology_place place;
    double radius_mm, grade; // as struct wear_patch
};

struct pathology_tear {
    char group[CASE_NAME_MAX];
    struct tear tear;
};

struct pathology_plan {
    char group[CASE_NAME_MAX];
    struct resection resection;
};

// A value for each of a ligament's keys: none is 0 for all, one holds for all.
struct pathology_values {
    int count;
    double values[PATHOLOGY_VALUES_MAX];
};

// A torn ligament: where the mock-up's holds the joint, and how much further the patient's goes.
struct pathology_ligament {
    struct pathology_values flexion_deg;
    struct pathology_values valgus_deg, internal_deg, drawer_mm; // as motion/joint.h
    struct pathology_values extra_valgus_deg, extra_internal_deg, extra_drawer_mm;
};

struct pathology {
    enum pathology_kind kind;
    char name[CASE_NAME_MAX]; // a ligament's own, or a group's; of others for errors
    union {
        struct pathology_cavity cavity;
        struct pathology_wear wear;
        struct pathology_tear tear;
        struct pathology_plan plan;
        struct pathology_ligament ligament;
        struct add_tissue tissue;
        struct add_loose loose;
    };
};

// The name fits and, of a ligament or a tissue, is valid.
void pathology_init(struct pathology *step, enum pathology_kind kind, const char *name);

// Takes one word of a recipe (cases/README.md). RESULT_INVALID: an unknown key, or a value out of
// range; the error names both.
enum result pathology_take(struct pathology *step, const char *key, const char *value,
                           struct error *err);

// Whether all words that it needs were taken, and go together.
enum result pathology_check(const struct pathology *step, struct error *err);

// Makes the step on a case that is valid. rim_mm: what resections leave at the capsule, 0 or as
// maxcut.h. A meniscus that is torn or planned becomes cuttable and gets a maxcut, where it is not
// and has none. A cavity makes the maxcut of what it moves anew. Refused, naming group and reason:
// what is not there; a cavity or wear nowhere near its bone; a cavity below a lesion, which would
// not follow; a tear or plan that does not fit; a ligament that is torn already. The case may have
// changed then, and is of no further use.
enum result pathology_apply(struct knee_case *knee, const struct pathology *step, double rim_mm,
                            struct error *err);
