#include "base/check.h"
#include "fidelity.h"

#include <stdio.h>

// A point of an instrument is put on the surface S of one group, clear of all others, and then a
// little off it along the normal. It should go where its point of S goes, and keep its place to
// it: to y + Δ(x). Counted where there is something to get wrong: some displacement within reach.
// The same for points that a tracker's noise took off S; and the gain of points beside it.
#define REACH_MM 12
#define MATTERS_MM 1e-3
#define NOISE_MM 0.1 // standard deviation of the length
#define BESIDE_MM 2

static const double offsets_mm[] = {0, 0.05, 0.1, 0.3};
static const double flexions_deg[] = {0, 30};

#define OFFSET_COUNT (sizeof offsets_mm / sizeof offsets_mm[0])
#define FLEXION_COUNT (sizeof flexions_deg / sizeof flexions_deg[0])

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
        struct closest c;
        vec3 p = pose_apply_inverse(anatomy->T_world_body[surface->body], touch->point);
        if (i == group || !query_closest(surface->query, p, REACH_MM, MESH_NONE, &c))
            continue;
        if (c.distance < ANATOMY_CLEAR_MM)
            return false;
        matters = matters || vec3_length(warp_of_contact(&anatomy->scene, i, &c)) > MATTERS_MM;
    }
    return matters;
}

static double touch_error(const struct anatomy *anatomy, enum variant variant,
                          const struct touch *touch, vec3 y) {
    return vec3_distance(variant_warp(anatomy, variant, y).displacement, touch->delta);
}

// What the sideways part of the noise alone does: no field that is exact on the surface can tell
// which point of it was meant.
static double sideways_error(const struct anatomy *anatomy, int group, const struct touch *touch,
                             vec3 y) {
    const struct warp_surface *surface = &anatomy->surfaces[group];
    vec3 p = pose_apply_inverse(anatomy->T_world_body[surface->body], y);
    struct closest c;
    bool found = query_closest(surface->query, p, INFINITY, MESH_NONE, &c);
    CHECK(found);
    return vec3_distance(warp_of_contact(&anatomy->scene, group, &c), touch->delta);
}

static struct touch touch_on(const struct anatomy *anatomy, int group, uint32_t triangle,
                             struct random *r) {
    const struct mesh *mesh = anatomy->surfaces[group].mesh;
    pose B = anatomy->T_world_body[anatomy->surfaces[group].body];
    double root = sqrt(random_between(r, 0, 1)), share = random_between(r, 0, 1);
    double u = root * (1 - share), v = root * share; // even over the triangle
    vec3 a = mesh_corner(mesh, triangle, 0);
    vec3 ab = vec3_sub(mesh_corner(mesh, triangle, 1), a);
    vec3 ac = vec3_sub(mesh_corner(mesh, triangle, 2), a);
    struct closest on = {.point = vec3_add_scaled(vec3_add_scaled(a, u, ab), v, ac),
                         .triangle = triangle,
                         .weights = {1 - u - v, u, v}};
    vec3 normal = vec3_unit_or(vec3_cross(ab, ac), (vec3){0});
    if (anatomy->hollow >> group & 1)
        normal = vec3_scale(-1, normal);
    return (struct touch){pose_apply(B, on.point), quat_rotate(B.rotation, normal),
                          warp_of_contact(&anatomy->scene, group, &on)};
}

// ---- many ----

struct errors {
    struct samples of[OFFSET_COUNT], noisy, gain;
};

struct all_errors {
    struct errors of[VARIANT_COUNT];
    struct samples sideways;
};

static void add_errors(const struct scene_of_lesion *scene, int group, const struct touch *touch,
                       struct random *r, struct all_errors *all) {
    struct errors *errors = all->of;
    const struct anatomy *anatomy = scene->anatomy;
    bool is_hollow = anatomy->hollow >> group & 1;
    vec3 noisy = vec3_add_scaled(touch->point, NOISE_MM * random_normal(r), random_direction(r));
    vec3 beside = vec3_add_scaled(touch->point, random_between(r, 0, BESIDE_MM), touch->normal);
    if (!is_hollow)
        samples_add(&all->sideways, sideways_error(anatomy, group, touch, noisy));
    for (int k = 0; k < VARIANT_COUNT; k++) {
        enum variant variant = (enum variant)k;
        if (!fidelity_takes(scene, variant) || (is_hollow && k >= VARIANT_INTEGRAL))
            continue; // what is hollow is none of its surfaces
        for (size_t i = 0; i < OFFSET_COUNT; i++) {
            vec3 y = vec3_add_scaled(touch->point, offsets_mm[i], touch->normal);
            samples_add(&errors[k].of[i], touch_error(anatomy, variant, touch, y));
        }
        samples_add(&errors[k].noisy, touch_error(anatomy, variant, touch, noisy));
        mat3 gradient = variant_warp(anatomy, variant, beside).gradient;
        samples_add(&errors[k].gain, mat3_norm(mat3_add_scaled(mat3_identity(), 1, gradient)));
    }
}

// One point for each `spacing` of area.
static void touch_group(const struct scene_of_lesion *scene, int group, double spacing,
                        struct all_errors *errors) {
    const struct mesh *mesh = scene->anatomy->surfaces[group].mesh;
    struct random r = {1000 * scene->seed + (uint64_t)group};
    double due = 0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        vec3 a = mesh_corner(mesh, t, 0);
        vec3 ab = vec3_sub(mesh_corner(mesh, t, 1), a), ac = vec3_sub(mesh_corner(mesh, t, 2), a);
        for (due += vec3_length(vec3_cross(ab, ac)) / 2; due > spacing; due -= spacing) {
            struct touch touch = touch_on(scene->anatomy, group, t, &r);
            if (is_counted(scene->anatomy, group, &touch))
                add_errors(scene, group, &touch, &r, errors);
        }
    }
}

static void report_errors(const struct scene_of_lesion *scene, struct all_errors *all) {
    struct errors *errors = all->of;
    for (int k = 0; k < VARIANT_COUNT; k++) {
        enum variant variant = (enum variant)k;
        if (!fidelity_takes(scene, variant))
            continue;
        for (size_t i = 0; i < OFFSET_COUNT; i++) {
            char what[32];
            snprintf(what, sizeof what, "touch/%g mm off", offsets_mm[i]);
            fidelity_samples(scene, variant, what, "mm", &errors[k].of[i]);
        }
        fidelity_samples(scene, variant, "touch/noise", "mm", &errors[k].noisy);
        fidelity_samples(scene, variant, "touch/gain beside", "times", &errors[k].gain);
        fidelity_worst(scene, WORST_TOUCH, samples_max(&errors[k].of[0]));
    }
    const struct samples *noisy = &errors[VARIANT_INTEGRAL_SKIN].noisy;
    if (!scene->is_moved)
        fidelity_figure(scene, VARIANT_INTEGRAL_SKIN, "touch/noise/over no skin", "times",
                        samples_mean(noisy) / samples_mean(&errors[VARIANT_INTEGRAL].noisy));
    report_figure(scene->fidelity->report, samples_mean(&all->sideways), "mm",
                  "%s/touch/noise sideways alone", scene->name);
    CHECK(noisy->count == all->sideways.count);
    for (size_t i = 0; i < noisy->count; i++) {
        samples_add(&scene->fidelity->noisy, noisy->values[i]);
        samples_add(&scene->fidelity->sideways, all->sideways.values[i]);
    }
}

void fidelity_touch(const struct scene_of_lesion *scene) {
    struct all_errors all = {0};
    struct errors *errors = all.of;
    for (size_t f = 0; f < FLEXION_COUNT; f++) {
        anatomy_flex(scene->anatomy, flexions_deg[f]);
        for (int i = 0; i < scene->anatomy->scene.surface_count; i++)
            touch_group(scene, i, scene->fidelity->quick ? 16 : 2, &all);
    }
    anatomy_flex(scene->anatomy, 0);
    report_figure(scene->fidelity->report, (double)errors[VARIANT_INTEGRAL_SKIN].noisy.count,
                  "points", "%s/touched", scene->name);
    if (errors[VARIANT_INTEGRAL_SKIN].noisy.count)
        report_errors(scene, &all);
    for (int k = 0; k < VARIANT_COUNT; k++) {
        for (size_t i = 0; i < OFFSET_COUNT; i++)
            samples_fini(&errors[k].of[i]);
        samples_fini(&errors[k].noisy);
        samples_fini(&errors[k].gain);
    }
    samples_fini(&all.sideways);
}
