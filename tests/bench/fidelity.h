// What the files of `arthron-bench fidelity` share: a lesion on a knee, measured field by field.
#pragma once

#include "anatomy.h"
#include "bench.h"
#include "random.h"
#include "samples.h"
#include "scene/lesions.h"

// ---- fields ----

enum variant {
    VARIANT_GAUSSIAN_CM,
    VARIANT_GAUSSIAN_MM,
    VARIANT_INVERSE,
    VARIANT_INVERSE_SKIN,
    VARIANT_SMOOTH,
    VARIANT_SMOOTH_SKIN,
    VARIANT_INTEGRAL,      // without what is hollow
    VARIANT_INTEGRAL_SKIN, // what sessions have, and the marks speak of
    VARIANT_COUNT
};

const char *variant_name(enum variant variant);
struct field variant_field(enum variant variant);
struct warp variant_warp(const struct anatomy *anatomy, enum variant variant, vec3 y);

// ---- marks: each is the worst of all that is measured ----

enum worst {
    WORST_RMS,
    WORST_GAIN,
    WORST_TOUCH,
    WORST_JUMP,
    WORST_NOISE, // a knee's mean
    WORST_LATE,  // a knee's mean
    WORST_COUNT
};

struct worst_of {
    double value; // −1 where nothing was measured
    char where[128];
};

struct fidelity {
    struct report *report;
    bool quick;
    struct worst_of worst[WORST_COUNT];
    // Of one knee: errors under noise, those of its sideways part alone, late replies in cavities.
    struct samples noisy, sideways, late;
    double key_error_mm, rest_mm; // of torn ligaments, the largest
    size_t folds;                 // of the cases that ship, but where the harmonic folds
};

// Where the figures of one lesion go, and what they are of.
struct scene_of_lesion {
    struct fidelity *fidelity;
    struct anatomy *anatomy;
    enum lesion lesion;
    uint64_t seed;
    double largest_mm; // Δ
    bool is_moved;     // the knee lies far from its origin: only the field of sessions
    char name[96];     // "healthy/cavity/1"
};

void fidelity_worst(const struct scene_of_lesion *scene, enum worst worst, double value);

// Whether a variant is measured on it.
bool fidelity_takes(const struct scene_of_lesion *scene, enum variant variant);

// Mean, 99th percentile and largest of one figure of a variant.
void fidelity_samples(const struct scene_of_lesion *scene, enum variant variant, const char *what,
                      const char *unit, struct samples *samples);
void fidelity_figure(const struct scene_of_lesion *scene, enum variant variant, const char *what,
                     const char *unit, double value);

// ---- places ----

// A point of a surface where it is displaced by a tenth of the largest Δ and more, and the way off
// it; false where none was found.
bool fidelity_place(const struct scene_of_lesion *scene, struct random *r, vec3 *out_point,
                    vec3 *out_normal);

// ---- what is measured ----

// Beside the harmonic displacement on two grids: rms, gain, folds; jumps; late replies.
void fidelity_fields(const struct scene_of_lesion *scene);
// On the surface, a little off it, and under noise.
void fidelity_touch(const struct scene_of_lesion *scene);

// Along recordings of hands, from many places.
void fidelity_motion(const struct scene_of_lesion *scene);
// Straight instruments through the portals of the case, in each mode: false touch.
enum result fidelity_instruments(const struct scene_of_lesion *scene, struct error *err);

// Torn ligaments on an ideal joint: the opening curve, with its marks.
void fidelity_opening(struct fidelity *fidelity);
// The cases that ship, made in memory: keys, rest, and folds of the space around.
enum result fidelity_shipped(struct fidelity *fidelity, struct error *err);
// One case written in m, cm and mm, and loaded again. largest: of what the sessions' warps differ
// by, mm.
enum result fidelity_units(struct fidelity *fidelity, double *out_largest_mm, struct error *err);
