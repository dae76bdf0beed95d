// How good the illusion is: lesions on knees, field by field, beside the harmonic displacement.
#include "fidelity.h"

#include "avatar.h"
#include "generate/generate.h"

#include <stdio.h>
#include <string.h>

// ---- fields -------------------------------------------------------------------------------------

static const struct {
    const char *name;
    enum field_kind kind;
    double unit_mm, skin_mm;
} variants[VARIANT_COUNT] = {
    [VARIANT_GAUSSIAN_CM] = {"gaussian, cm", FIELD_GAUSSIAN, 10, 0},
    [VARIANT_GAUSSIAN_MM] = {"gaussian, mm", FIELD_GAUSSIAN, 1, 0},
    [VARIANT_INVERSE] = {"inverse-distance", FIELD_INVERSE_DISTANCE, 1, 0},
    [VARIANT_INVERSE_SKIN] = {"inverse-distance, skin 0.1 mm", FIELD_INVERSE_DISTANCE, 1, 0.1},
    [VARIANT_SMOOTH] = {"smooth", FIELD_SMOOTH, 1, 0},
    [VARIANT_SMOOTH_SKIN] = {"smooth, skin 0.1 mm", FIELD_SMOOTH, 1, 0.1},
    [VARIANT_INTEGRAL] = {"integral", FIELD_INTEGRAL, 1, 0},
    [VARIANT_INTEGRAL_SKIN] = {"integral, skin 0.1 mm", FIELD_INTEGRAL, 1, 0.1},
};

const char *variant_name(enum variant variant) {
    return variants[variant].name;
}

struct field variant_field(enum variant variant) {
    struct field field = field_default(variants[variant].kind);
    field.unit_mm = variants[variant].unit_mm;
    field.skin_mm = variants[variant].skin_mm;
    return field;
}

struct warp variant_warp(const struct anatomy *anatomy, enum variant variant, vec3 y) {
    struct field field = variant_field(variant);
    struct warp_memory memory;
    struct warp warp;
    warp_memory_init(&memory);
    const struct warp_scene *scene =
        field.kind == FIELD_INTEGRAL ? &anatomy->solid : &anatomy->scene;
    warp_point(scene, &field, y, &memory, &warp);
    return warp;
}

// ---- figures ------------------------------------------------------------------------------------

static void take_worst(struct worst_of *of, double value, const char *where) {
    if (value <= of->value)
        return;
    of->value = value;
    snprintf(of->where, sizeof of->where, "%s", where);
}

void fidelity_worst(const struct scene_of_lesion *scene, enum worst worst, double value) {
    take_worst(&scene->fidelity->worst[worst], value, scene->name);
}

struct integral_figures *fidelity_integral(const struct scene_of_lesion *scene,
                                           enum variant variant) {
    return variant < VARIANT_INTEGRAL ? NULL
                                      : &scene->fidelity->integral[variant - VARIANT_INTEGRAL];
}

void fidelity_worst_integral(const struct scene_of_lesion *scene, enum variant variant,
                             enum worst worst, double value) {
    struct integral_figures *figures = fidelity_integral(scene, variant);
    if (figures)
        take_worst(&figures->worst[worst], value, scene->name);
}

void fidelity_figure(const struct scene_of_lesion *scene, enum variant variant, const char *what,
                     const char *unit, double value) {
    report_figure(scene->fidelity->report, value, unit, "%s/%s/%s", scene->name,
                  variant_name(variant), what);
}

void fidelity_samples(const struct scene_of_lesion *scene, enum variant variant, const char *what,
                      const char *unit, struct samples *samples) {
    struct report *report = scene->fidelity->report;
    const char *field = variant_name(variant);
    report_figure(report, samples_mean(samples), unit, "%s/%s/%s/mean", scene->name, field, what);
    report_figure(report, samples_quantile(samples, 0.99), unit, "%s/%s/%s/p99", scene->name, field,
                  what);
    report_figure(report, samples_max(samples), unit, "%s/%s/%s/max", scene->name, field, what);
}

// ---- places -------------------------------------------------------------------------------------

#define PLACE_TRIES 100000

bool fidelity_place(const struct scene_of_lesion *scene, struct random *r, vec3 *out_point,
                    vec3 *out_normal) {
    const struct warp_scene *warp_scene = &scene->anatomy->scene;
    for (int i = 0; i < PLACE_TRIES; i++) {
        int k = (int)(random_bits(r) % (uint64_t)warp_scene->surface_count);
        const struct warp_surface *s = &warp_scene->surfaces[k];
        uint32_t t = (uint32_t)(random_bits(r) % s->mesh->triangle_count);
        if (!s->displacement ||
            vec3_length(anatomy_delta(warp_scene, k, t, 0)) < 0.1 * scene->largest_mm)
            continue;
        vec3 p[3];
        for (int c = 0; c < 3; c++)
            p[c] = pose_apply(warp_scene->T_world_body[s->body], mesh_corner(s->mesh, t, c));
        vec3 across = vec3_cross(vec3_sub(p[1], p[0]), vec3_sub(p[2], p[0]));
        *out_point = vec3_lerp(vec3_lerp(p[0], p[1], 0.5), p[2], 1.0 / 3);
        *out_normal = vec3_unit_or(across, (vec3){0});
        return true;
    }
    return false;
}

// ---- knees --------------------------------------------------------------------------------------

static const uint64_t seeds[] = {1, 2};

static enum result measure_lesion(struct scene_of_lesion *scene, struct error *err) {
    const struct knee_case *knee = scene->anatomy->knee;
    enum result result = lesion_make(scene->anatomy->knee, scene->lesion, scene->seed, err);
    if (result != RESULT_OK)
        return result;
    anatomy_displace(scene->anatomy);
    scene->standard = lesion_is_concave(scene->lesion) ? VARIANT_SMOOTH_SKIN : VARIANT_INVERSE_SKIN;
    snprintf(scene->name, sizeof scene->name, "%s/%s/%d", knee->name, lesion_name(scene->lesion),
             (int)scene->seed);
    struct box box;
    scene->largest_mm = anatomy_largest(&scene->anatomy->scene, &box);
    fidelity_fields(scene);
    fidelity_touch(scene);
    fidelity_motion(scene);
    return fidelity_instruments(scene, err);
}

// Takes the case.
static enum result measure_knee(struct fidelity *f, struct knee_case **knee, struct error *err) {
    struct anatomy anatomy;
    enum result result = anatomy_init(&anatomy, knee, err);
    if (result != RESULT_OK) {
        case_destroy(knee);
        return result;
    }
    for (size_t s = 0; s < sizeof seeds / sizeof seeds[0]; s++)
        for (int i = 0; result == RESULT_OK && i < LESION_COUNT; i++) {
            struct scene_of_lesion scene = {
                .fidelity = f, .anatomy = &anatomy, .lesion = (enum lesion)i, .seed = seeds[s]};
            result = measure_lesion(&scene, err);
        }
    for (int i = 0; i < 2; i++) {
        struct integral_figures *figures = &f->integral[i];
        take_worst(&figures->worst[WORST_NOISE], samples_mean(&figures->noisy), anatomy.knee->name);
        samples_fini(&figures->noisy);
    }
    anatomy_fini(&anatomy);
    return result;
}

static enum result measure_knees(struct fidelity *f, const struct bench_options *options,
                                 struct error *err) {
    struct recipe recipe;
    struct knee_case *knee;
    enum result result = recipe_load(CASES "/healthy", &recipe, err);
    if (result == RESULT_OK)
        result = generate_knee(&recipe, &knee, err);
    if (result == RESULT_OK)
        result = measure_knee(f, &knee, err);
    for (int i = 0; result == RESULT_OK && i < options->input_count; i++) {
        result = case_load(options->inputs[i], NULL, &knee, err);
        if (result == RESULT_OK)
            result = measure_knee(f, &knee, err);
    }
    return result;
}

// ---- marks --------------------------------------------------------------------------------------

static const struct {
    const char *name, *unit;
    double mark;
} marks[WORST_COUNT] = {
    [WORST_RMS] = {"rms_over_harmonic", "times", 0.04},
    [WORST_GAIN] = {"gain_over_harmonic", "times", 1.2},
    [WORST_TOUCH] = {"touch_error_mm", "mm", 1e-4},
    [WORST_JUMP] = {"jump_mm", "mm", 0.005},
    [WORST_NOISE] = {"touch_noise_mm", "mm", 0.008},
};

static void mark(struct fidelity *f, const char *name, double value, const char *unit,
                 double limit) {
    report_mark(f->report, name, value, unit, limit, BETTER_LOW);
}

static void mark_lesions(struct fidelity *f) {
    for (int i = 0; i < WORST_NOISE; i++) {
        char name[64];
        mark(f, marks[i].name, f->worst[i].value, marks[i].unit, marks[i].mark);
        snprintf(name, sizeof name, "%s, worst", marks[i].name);
        report_text(f->report, name, f->worst[i].where);
    }
    mark(f, "touch_noise_over_plain", samples_mean(&f->noisy) / samples_mean(&f->noisy_plain),
         "times", 0.5);
    mark(f, "late_error_mm_25mms_20ms", samples_mean(&f->late), "mm", 0.015);
}

static void report_integral(struct fidelity *f) {
    static const char *const names[] = {"integral", "integral, skin 0.1 mm"};
    for (int i = 0; i < 2; i++) {
        const struct integral_figures *figures = &f->integral[i];
        for (int k = 0; k < WORST_COUNT; k++) {
            char name[96];
            report_figure(f->report, figures->worst[k].value, marks[k].unit, "%s/%s", names[i],
                          marks[k].name);
            snprintf(name, sizeof name, "%s/%s, worst", names[i], marks[k].name);
            report_text(f->report, name, figures->worst[k].where);
        }
        report_figure(f->report, samples_mean(&figures->late), "mm", "%s/late_error_mm_25mms_20ms",
                      names[i]);
        report_figure(f->report, (double)figures->folds, "nodes", "%s/folds", names[i]);
        report_figure(f->report, (double)figures->folds_beyond, "nodes", "%s/folds beyond harmonic",
                      names[i]);
    }
}

static enum result measure_rest(struct fidelity *f, const struct bench_options *options,
                                struct error *err) {
    double unit_mm = NAN;
    fidelity_opening(f);
    enum result result = fidelity_shipped(f, err);
    if (result == RESULT_OK)
        result = fidelity_units(f, &unit_mm, err);
    if (result != RESULT_OK)
        return result;
    mark(f, "key_pose_error", f->key_error_mm, "mm", 1e-9);
    mark(f, "rest_warp_mm", f->rest_mm, "mm", 1e-9);
    mark(f, "folds", (double)f->folds, "nodes", 0);
    mark(f, "unit_dependence_mm", unit_mm, "mm", 1e-4);
    struct avatar_touch touch = bench_avatar_touch(options, f->report);
    mark(f, "rigid_over_tip_penetration", touch.rigid_over_tip, "times", 0.15);
    mark(f, "rigid_tip_gap_p99_mm", touch.tip_gap_p99_mm, "mm", 1.0);
    return RESULT_OK;
}

// What the marks speak of.
static const struct {
    const char *name, *text;
} explanations[] = {
    {"the field of the marks",
     "inverse-distance with a skin of 0.1 mm, the default of sessions; smooth with it where a "
     "hollow "
     "group is displaced, a meniscus or the femur: all lesions but the cavity"},
    {"the space",
     "inside the skin, or the hull of all groups and 10 mm; outside solids; at least 0.5 mm from a "
     "second surface; where the harmonic displacement is above 1 % of the largest. The harmonic is "
     "0 "
     "beyond that hull and 15 mm around what is displaced"},
    {"integral",
     "the field that is to become the default, without and with a skin of 0.1 mm: told, not "
     "marked. The skin of the knee is none of its surfaces"},
    {"rms and gain over harmonic",
     "on the finer of the two grids; gain: |change of W| over the way between neighbouring nodes, "
     "the largest over the harmonic's largest"},
    {"jump_mm",
     "smooth without skin, on trimmed meniscus and notch osteophyte: what of W's change over 0.01 "
     "mm "
     "its derivative at either end does not account for. The whole change is told beside it; even "
     "the harmonic changes by its gain times 0.01 mm"},
    {"touch_noise_over_plain",
     "means over all lesions of this run, of |W - displacement of the point that is touched|"},
    {"late_error_mm_25mms_20ms",
     "mean over cavities, exposed and under the meniscus, with the derivative"},
    {"unit_dependence_mm",
     "the field of sessions. smooth differs by what its sums are good to, about 1e-4 of the "
     "displacement: a coordinate that is rounded otherwise gives another tree"},
    {"folds",
     "nodes of all recipes in cases/, over flexion at rest and in the keys of torn ligaments, by "
     "the "
     "closed derivative: all of them. Beside them, as the check of a case tells them apart: "
     "against "
     "the skin, which gives way but not here; in gaps that the displacements fill; with one "
     "surface "
     "in reach, off which the field fades within 15 mm, too fast where that is displaced by more "
     "than 15 mm along its normal; and others"},
    {"rigid_over_tip_penetration", "mean depth of the instrument's points where its shaft touches; "
                                   "the tip's gap where it touches"},
    {"seeds", "each lesion twice: the last part of its name"},
};

static void explain(struct report *report) {
    for (size_t i = 0; i < sizeof explanations / sizeof explanations[0]; i++)
        report_text(report, explanations[i].name, explanations[i].text);
}

static void fidelity_fini(struct fidelity *f) {
    samples_fini(&f->noisy);
    samples_fini(&f->noisy_plain);
    samples_fini(&f->late);
    for (int i = 0; i < 2; i++)
        samples_fini(&f->integral[i].late);
}

enum result bench_fidelity(const struct bench_options *options, struct report *report,
                           struct error *err) {
    struct fidelity f = {.report = report, .quick = options->quick};
    for (int i = 0; i < WORST_COUNT; i++)
        f.worst[i].value = f.integral[0].worst[i].value = f.integral[1].worst[i].value = -1;
    explain(report);
    enum result result = measure_knees(&f, options, err);
    if (result == RESULT_OK) {
        mark_lesions(&f);
        result = measure_rest(&f, options, err);
        report_integral(&f);
    }
    fidelity_fini(&f);
    return result;
}
