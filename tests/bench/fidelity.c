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

bool fidelity_takes(const struct scene_of_lesion *scene, enum variant variant) {
    return !scene->is_moved || variant == VARIANT_INTEGRAL_SKIN;
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
    snprintf(scene->name, sizeof scene->name, "%s%s/%s/%d", knee->name,
             scene->is_moved ? ", moved" : "", lesion_name(scene->lesion), (int)scene->seed);
    struct box box;
    scene->largest_mm = anatomy_largest(&scene->anatomy->scene, &box);
    fidelity_fields(scene);
    fidelity_touch(scene);
    if (scene->is_moved)
        return RESULT_OK;
    fidelity_motion(scene);
    return fidelity_instruments(scene, err);
}

static void take_means(struct fidelity *f, const char *name) {
    take_worst(&f->worst[WORST_NOISE], samples_mean(&f->noisy), name);
    take_worst(&f->worst[WORST_LATE], samples_mean(&f->late), name);
    report_figure(f->report, samples_mean(&f->noisy), "mm", "%s/touch under noise", name);
    report_figure(f->report, samples_mean(&f->sideways), "mm",
                  "%s/touch under noise, sideways alone", name);
    report_figure(f->report, samples_mean(&f->late), "mm", "%s/late in cavities", name);
    samples_fini(&f->noisy);
    samples_fini(&f->sideways);
    samples_fini(&f->late);
}

static enum result measure_lesions(struct fidelity *f, struct anatomy *anatomy, bool is_moved,
                                   struct error *err) {
    enum result result = RESULT_OK;
    char name[128];
    for (size_t s = 0; s < sizeof seeds / sizeof seeds[0]; s++)
        for (int i = 0; result == RESULT_OK && i < LESION_COUNT; i++) {
            struct scene_of_lesion scene = {.fidelity = f,
                                            .anatomy = anatomy,
                                            .lesion = (enum lesion)i,
                                            .seed = seeds[s],
                                            .is_moved = is_moved};
            result = measure_lesion(&scene, err);
        }
    snprintf(name, sizeof name, "%s%s", anatomy->knee->name, is_moved ? ", moved" : "");
    take_means(f, name);
    return result;
}

// As a scan that lies 1.5 m from its origin.
static void move_far(struct knee_case *knee) {
    const pose far = {quat_identity(), {900, -1000, 700}};
    const pose back = pose_inverse(far);
    for (int i = 0; i < knee->group_count; i++) {
        struct mesh *mesh = &knee->groups[i].mesh;
        for (uint32_t v = 0; v < mesh->vertex_count; v++)
            mesh_set_vertex(mesh, v, pose_apply(far, mesh_vertex(mesh, v)));
    }
    knee->joint.T_femur_joint = pose_compose(far, knee->joint.T_femur_joint);
    knee->joint.T_tibia_joint = pose_compose(far, knee->joint.T_tibia_joint);
    for (int i = 0; i < knee->patella_key_count; i++) {
        pose *T = &knee->patella_keys[i].T_femur_patella;
        *T = pose_compose(far, pose_compose(*T, back));
    }
}

// Takes the case. A moved one needs its surfaces anew.
static enum result measure_knee(struct fidelity *f, struct knee_case **knee, struct error *err) {
    enum result result = RESULT_OK;
    for (int is_moved = 0; result == RESULT_OK && is_moved < 2; is_moved++) {
        struct anatomy anatomy;
        if (is_moved)
            move_far(*knee);
        result = anatomy_init(&anatomy, knee, err);
        if (result != RESULT_OK)
            break;
        result = measure_lesions(f, &anatomy, is_moved, err);
        *knee = anatomy.knee;
        anatomy.knee = NULL;
        anatomy_fini(&anatomy);
    }
    case_destroy(knee);
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
    [WORST_JUMP] = {"jump_mm", "mm", 0.001},
    [WORST_NOISE] = {"touch_noise_mm", "mm", 0.008},
    [WORST_LATE] = {"late_error_mm_25mms_20ms", "mm", 0.01},
};

static void mark(struct fidelity *f, const char *name, double value, const char *unit,
                 double limit) {
    report_mark(f->report, name, value, unit, limit, BETTER_LOW);
}

static void mark_lesions(struct fidelity *f) {
    for (int i = 0; i < WORST_COUNT; i++) {
        char name[64];
        mark(f, marks[i].name, f->worst[i].value, marks[i].unit, marks[i].mark);
        snprintf(name, sizeof name, "%s, worst", marks[i].name);
        report_text(f->report, name, f->worst[i].where);
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
    {"the field of the marks", "integral with a contact skin of 0.1 mm, that of sessions. The skin "
                               "of the knee is none of its surfaces"},
    {"moved", "the same knee 1.5 m from its origin, as a scan may lie"},
    {"the space",
     "inside the skin, or the hull of all groups and 10 mm; outside solids; at least 0.5 mm from a "
     "second surface; where the harmonic displacement is above 1 % of the largest. The harmonic is "
     "0 "
     "beyond that hull and 15 mm around what is displaced"},
    {"rms and gain over harmonic",
     "on the finer of the two grids; gain: |change of W| over the way between neighbouring nodes, "
     "the largest over the harmonic's largest"},
    {"jump_mm",
     "what of W's change over 0.01 mm its derivative at either end does not account for. "
     "The whole change is told beside it; even the harmonic changes by its gain times "
     "0.01 mm"},
    {"touch_noise_mm",
     "of a knee, the mean over its lesions of |W - displacement of the point that "
     "is touched|. Sideways alone: what of that a field cannot help, the displacement of the point "
     "nearest to the noisy one in its place"},
    {"late_error_mm_25mms_20ms",
     "of a knee, the mean over cavities, exposed and under the meniscus, with the derivative"},
    {"unit_dependence_mm", "a coordinate that is rounded otherwise may give another tree"},
    {"folds",
     "nodes of all recipes in cases/, over flexion at rest and in the keys of torn ligaments, by "
     "the closed derivative, where the harmonic displacement does not fold. Beside them all folds, "
     "as the check of a case tells them apart: in gaps that the displacements fill; with one "
     "surface in reach, off which the field fades; and others"},
    {"rigid_over_tip_penetration", "mean depth of the instrument's points where its shaft touches; "
                                   "the tip's gap where it touches"},
    {"seeds", "each lesion twice: the last part of its name"},
};

static void explain(struct report *report) {
    for (size_t i = 0; i < sizeof explanations / sizeof explanations[0]; i++)
        report_text(report, explanations[i].name, explanations[i].text);
}

enum result bench_fidelity(const struct bench_options *options, struct report *report,
                           struct error *err) {
    struct fidelity f = {.report = report, .quick = options->quick};
    for (int i = 0; i < WORST_COUNT; i++)
        f.worst[i].value = -1;
    explain(report);
    enum result result = measure_knees(&f, options, err);
    if (result == RESULT_OK) {
        mark_lesions(&f);
        result = measure_rest(&f, options, err);
    }
    return result;
}
