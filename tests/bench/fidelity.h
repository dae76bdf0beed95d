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
    VARIANT_INVERSE_SKIN, // what sessions have
    VARIANT_SMOOTH,
    VARIANT_SMOOTH_SKIN, // what they are to have where what is displaced is hollow
    VARIANT_INTEGRAL,    // without what is hollow
    VARIANT_INTEGRAL_SKIN,
    VARIANT_COUNT
};

const char *variant_name(enum variant variant);
struct field variant_field(enum variant variant);
struct warp variant_warp(const struct anatomy *anatomy, enum variant variant, vec3 y);

// ---- marks: each is the worst of all that is measured ----

enum worst { WORST_RMS, WORST_GAIN, WORST_TOUCH, WORST_JUMP, WORST_NOISE, WORST_COUNT };

struct worst_of {
    double value; // −1 where nothing was measured
    char where[128];
};

// Of the integral field, which no session has yet: told, and not marked.
struct integral_figures {
    struct worst_of worst[WORST_COUNT];
    struct samples noisy, late; // noisy: of one knee
    size_t folds, folds_beyond; // beyond: where the harmonic displacement does not fold
};

struct fidelity {
    struct report *report;
    bool quick;
    struct worst_of worst[WORST_COUNT];
    struct integral_figures integral[2]; // without and with the skin
    // Of all lesions: errors under noise, with and without the skin; of cavities: those of late
    // replies.
    struct samples noisy, noisy_plain, late;
    double key_error_mm, rest_mm; // of torn ligaments, the largest
    size_t folds;                 // of the cases that ship, in all
};

// Where the figures of one lesion go, and what they are of.
struct scene_of_lesion {
    struct fidelity *fidelity;
    struct anatomy *anatomy;
    enum lesion lesion;
    uint64_t seed;
    double largest_mm;     // Δ
    enum variant standard; // the field that the marks speak of
    char name[96];         // "healthy/cavity/1"
};

void fidelity_worst(const struct scene_of_lesion *scene, enum worst worst, double value);

// NULL for other variants.
struct integral_figures *fidelity_integral(const struct scene_of_lesion *scene,
                                           enum variant variant);
// Of the integral field; nothing for other variants.
void fidelity_worst_integral(const struct scene_of_lesion *scene, enum variant variant,
                             enum worst worst, double value);

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
