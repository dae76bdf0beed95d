#include "bench.h"
#include "case/case.h"
#include "mesh/query.h"
#include "random.h"
#include "samples.h"
#include "warp/warp.h"

#include <math.h>
#include <stdio.h>

// A point of an instrument is put on the surface S of one group, clear of all others, and then a
// little off it along the normal. It should go where its point of S goes, and keep its place to
// it: to y + Δ(x). Counted where there is something to get wrong: some displacement within reach.
// The same for points that a tracker's noise took off S; and the gain of points beside it.
#define CLEARANCE_MM 0.5
#define REACH_MM 12
#define MATTERS_MM 1e-3
#define NOISE_MM 0.1 // standard deviation of the length
#define BESIDE_MM 2

static const double offsets_mm[] = {0, 0.05, 0.1, 0.3};
static const double flexions_deg[] = {0, 30};

static const struct variant {
    const char *name;
    enum field_kind kind;
    double skin_mm;
} variants[] = {
    {"gaussian", FIELD_GAUSSIAN, 0},
    {"inverse-distance", FIELD_INVERSE_DISTANCE, 0},
    {"inverse-distance, skin 0.05 mm", FIELD_INVERSE_DISTANCE, 0.05},
    {"inverse-distance, skin 0.1 mm", FIELD_INVERSE_DISTANCE, 0.1},
    {"smooth", FIELD_SMOOTH, 0},
    {"smooth, skin 0.1 mm", FIELD_SMOOTH, 0.1},
};

#define VARIANT_COUNT (sizeof variants / sizeof variants[0])
#define OFFSET_COUNT (sizeof offsets_mm / sizeof offsets_mm[0])
#define FLEXION_COUNT (sizeof flexions_deg / sizeof flexions_deg[0])

struct anatomy {
    struct knee_case *knee;
    struct query *queries[CASE_GROUPS_MAX];
    struct surface_tree *trees[CASE_GROUPS_MAX];
    struct surface_mean *means[CASE_GROUPS_MAX];
    struct warp_surface surfaces[CASE_GROUPS_MAX];
    pose T_world_body[BODY_COUNT];
    struct warp_scene scene;
};

static void anatomy_fini(struct anatomy *anatomy) {
    for (int i = 0; i < CASE_GROUPS_MAX; i++) {
        surface_mean_destroy(&anatomy->means[i]);
        surface_tree_destroy(&anatomy->trees[i]);
        query_destroy(&anatomy->queries[i]);
    }
    case_destroy(&anatomy->knee);
}

static enum result anatomy_init(struct anatomy *out, const char *dir, struct error *err) {
    *out = (struct anatomy){0};
    enum result result = case_load(dir, NULL, &out->knee, err);
    for (int i = 0; result == RESULT_OK && i < out->knee->group_count; i++) {
        const struct case_group *group = &out->knee->groups[i];
        result = query_create(&group->mesh, &out->queries[i], err);
        if (group->warp) {
            out->trees[i] = surface_tree_create(&group->mesh);
            out->means[i] = surface_mean_create(out->trees[i], group->warp);
        }
        out->surfaces[i] = (struct warp_surface){.mesh = &group->mesh,
                                                 .query = out->queries[i],
                                                 .displacement = group->warp,
                                                 .body = (int)group->body,
                                                 .mean = out->means[i]};
    }
    if (result == RESULT_OK)
        out->scene =
            (struct warp_scene){out->surfaces, out->knee->group_count, out->T_world_body, NULL};
    else
        anatomy_fini(out);
    return result;
}

static void flex(struct anatomy *anatomy, double flexion_deg) {
    struct joint_angles angles = {.flexion_deg = flexion_deg};
    anatomy->T_world_body[BODY_FEMUR] = pose_identity();
    anatomy->T_world_body[BODY_TIBIA] = joint_to_pose(&anatomy->knee->joint, &angles);
    anatomy->T_world_body[BODY_PATELLA] = case_patella_pose(anatomy->knee, flexion_deg);
}

// ---- one point ----

struct touch {
    vec3 point, normal; // in the world
    vec3 delta;         // what takes it to S'
};

// Another group too near, or nothing displaced in reach.
static bool is_counted(const struct anatomy *anatomy, int group, const struct touch *touch) {
    bool matters = vec3_length(touch->delta) > MATTERS_MM;
    for (int i = 0; i < anatomy->scene.surface_count; i++) {
        const struct warp_surface *surface = &anatomy->surfaces[i];
        pose B = anatomy->T_world_body[surface->body];
        struct closest c;
        vec3 p = pose_apply_inverse(B, touch->point);
        if (i == group || !query_closest(surface->query, p, REACH_MM, MESH_NONE, &c))
            continue;
        if (c.distance < CLEARANCE_MM)
            return false;
        matters = matters || vec3_length(warp_of_contact(&anatomy->scene, i, &c)) > MATTERS_MM;
    }
    return matters;
}

static struct warp warp_at(const struct anatomy *anatomy, const struct variant *variant, vec3 y) {
    struct field field = field_default(variant->kind);
    struct warp_memory memory;
    struct warp warp;
    field.skin_mm = variant->skin_mm;
    warp_memory_init(&memory);
    warp_point(&anatomy->scene, &field, y, &memory, &warp);
    return warp;
}

static double touch_error(const struct anatomy *anatomy, const struct variant *variant,
                          const struct touch *touch, vec3 y) {
    return vec3_distance(warp_at(anatomy, variant, y).displacement, touch->delta);
}

static vec3 displaced_corner(const struct warp_surface *surface, uint32_t triangle, int corner) {
    uint32_t vertex = surface->mesh->triangles[3 * (size_t)triangle + (size_t)corner];
    const float *d = surface->displacement ? surface->displacement + 3 * (size_t)vertex
                                           : (const float[3]){0, 0, 0};
    return vec3_add(mesh_vertex(surface->mesh, vertex),
                    (vec3){(double)d[0], (double)d[1], (double)d[2]});
}

static vec3 blend_corners(const vec3 corners[3], double u, double v) {
    return vec3_add_scaled(vec3_add_scaled(vec3_scale(1 - u - v, corners[0]), u, corners[1]), v,
                           corners[2]);
}

static struct touch touch_on(const struct anatomy *anatomy, int group, uint32_t triangle,
                             struct random *r) {
    const struct warp_surface *surface = &anatomy->surfaces[group];
    pose B = anatomy->T_world_body[surface->body];
    double root = sqrt(random_between(r, 0, 1)), share = random_between(r, 0, 1);
    double u = root * (1 - share), v = root * share; // even over the triangle
    vec3 S[3], virtual[3];
    for (int i = 0; i < 3; i++) {
        S[i] = mesh_corner(surface->mesh, triangle, i);
        virtual[i] = displaced_corner(surface, triangle, i);
    }
    vec3 x = blend_corners(S, u, v), target = blend_corners(virtual, u, v);
    vec3 normal = vec3_unit_or(vec3_cross(vec3_sub(S[1], S[0]), vec3_sub(S[2], S[0])), (vec3){0});
    vec3 point = pose_apply(B, x);
    return (struct touch){point, quat_rotate(B.rotation, normal),
                          vec3_sub(pose_apply(B, target), point)};
}

// ---- many ----

struct errors {
    struct samples of[OFFSET_COUNT], noisy, gain;
};

static void add_errors(const struct anatomy *anatomy, const struct touch *touch, struct random *r,
                       struct errors errors[VARIANT_COUNT]) {
    vec3 noisy = vec3_add_scaled(touch->point, NOISE_MM * random_normal(r), random_direction(r));
    vec3 beside = vec3_add_scaled(touch->point, random_between(r, 0, BESIDE_MM), touch->normal);
    for (size_t k = 0; k < VARIANT_COUNT; k++) {
        const struct variant *variant = &variants[k];
        for (size_t i = 0; i < OFFSET_COUNT; i++) {
            vec3 y = vec3_add_scaled(touch->point, offsets_mm[i], touch->normal);
            samples_add(&errors[k].of[i], touch_error(anatomy, variant, touch, y));
        }
        samples_add(&errors[k].noisy, touch_error(anatomy, variant, touch, noisy));
        mat3 gradient = warp_at(anatomy, variant, beside).gradient;
        samples_add(&errors[k].gain, mat3_norm(mat3_add_scaled(mat3_identity(), 1, gradient)));
    }
}

// One point for each `spacing` of area.
static void touch_group(const struct anatomy *anatomy, int group, double spacing,
                        struct errors errors[VARIANT_COUNT]) {
    const struct mesh *mesh = anatomy->surfaces[group].mesh;
    struct random r = {(uint64_t)group};
    double due = 0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        vec3 a = mesh_corner(mesh, t, 0);
        vec3 ab = vec3_sub(mesh_corner(mesh, t, 1), a), ac = vec3_sub(mesh_corner(mesh, t, 2), a);
        for (due += vec3_length(vec3_cross(ab, ac)) / 2; due > spacing; due -= spacing) {
            struct touch touch = touch_on(anatomy, group, t, &r);
            if (is_counted(anatomy, group, &touch))
                add_errors(anatomy, &touch, &r, errors);
        }
    }
}

static void report_samples(struct report *report, struct samples *samples, const char *unit,
                           const char *name, const char *field, const char *what) {
    report_figure(report, samples_mean(samples), unit, "%s/%s/%s/mean", name, field, what);
    report_figure(report, samples_quantile(samples, 0.99), unit, "%s/%s/%s/p99", name, field, what);
    report_figure(report, samples_max(samples), unit, "%s/%s/%s/max", name, field, what);
}

static double report_errors(struct errors errors[VARIANT_COUNT], const char *name,
                            struct report *report) {
    double at_contact = 0;
    for (size_t k = 0; k < VARIANT_COUNT; k++) {
        for (size_t i = 0; i < OFFSET_COUNT; i++) {
            char what[32];
            snprintf(what, sizeof what, "%g mm off", offsets_mm[i]);
            report_samples(report, &errors[k].of[i], "mm", name, variants[k].name, what);
            if (offsets_mm[i] == 0)
                at_contact = fmax(at_contact, samples_max(&errors[k].of[i]));
        }
        report_samples(report, &errors[k].noisy, "mm", name, variants[k].name, "noise");
        report_samples(report, &errors[k].gain, "times", name, variants[k].name, "gain");
    }
    return at_contact;
}

static void errors_fini(struct errors errors[VARIANT_COUNT]) {
    for (size_t k = 0; k < VARIANT_COUNT; k++) {
        for (size_t i = 0; i < OFFSET_COUNT; i++)
            samples_fini(&errors[k].of[i]);
        samples_fini(&errors[k].noisy);
        samples_fini(&errors[k].gain);
    }
}

static enum result measure_case(const char *dir, bool quick, struct report *report,
                                double *out_at_contact, struct error *err) {
    struct anatomy anatomy;
    struct errors errors[VARIANT_COUNT] = {0};
    enum result result = anatomy_init(&anatomy, dir, err);
    if (result != RESULT_OK)
        return result;
    const char *name = anatomy.knee->name;
    for (size_t f = 0; f < FLEXION_COUNT; f++) {
        flex(&anatomy, flexions_deg[f]);
        for (int i = 0; i < anatomy.scene.surface_count; i++)
            touch_group(&anatomy, i, quick ? 4 : 0.5, errors);
    }
    size_t points = errors[0].of[0].count;
    report_figure(report, (double)points, "points", "%s/touched", name);
    if (points)
        *out_at_contact = fmax(*out_at_contact, report_errors(errors, name, report));
    else
        result = fail(err, RESULT_MISSING, "case %s: nothing in it is displaced", dir);
    errors_fini(errors);
    anatomy_fini(&anatomy);
    return result;
}

enum result bench_touch(const struct bench_options *options, struct report *report,
                        struct error *err) {
    double at_contact = 0;
    if (!options->input_count)
        return fail(err, RESULT_MISSING,
                    "needs --case DIR; make one with "
                    "`arthron-case generate cases/arthrosis --out DIR`");
    for (int i = 0; i < options->input_count; i++) {
        enum result result =
            measure_case(options->inputs[i], options->quick, report, &at_contact, err);
        if (result != RESULT_OK)
            return result;
    }
    report_mark(report, "touch_error_mm", at_contact, "mm", 1e-4, BETTER_LOW);
    return RESULT_OK;
}
