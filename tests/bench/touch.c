#include "bench.h"
#include "case/case.h"
#include "mesh/query.h"
#include "random.h"
#include "samples.h"
#include "warp/warp.h"

#include <math.h>

// A point of an instrument is put on the surface S of one group, clear of all others, and then a
// little off it along the normal. It should go where its point of S goes, and keep its place to
// it: to y + Δ(x). Counted where there is something to get wrong: some displacement within reach.
#define CLEARANCE_MM 0.5
#define REACH_MM 12
#define MATTERS_MM 1e-3

static const double offsets_mm[] = {0, 0.05, 0.1, 0.3};
static const double flexions_deg[] = {0, 30};

#define OFFSET_COUNT (sizeof offsets_mm / sizeof offsets_mm[0])
#define FLEXION_COUNT (sizeof flexions_deg / sizeof flexions_deg[0])

struct anatomy {
    struct knee_case *knee;
    struct query *queries[CASE_GROUPS_MAX];
    struct warp_surface surfaces[CASE_GROUPS_MAX];
    pose T_world_body[BODY_COUNT];
    struct warp_scene scene;
};

static void anatomy_fini(struct anatomy *anatomy) {
    for (int i = 0; i < CASE_GROUPS_MAX; i++)
        query_destroy(&anatomy->queries[i]);
    case_destroy(&anatomy->knee);
}

static enum result anatomy_init(struct anatomy *out, const char *dir, struct error *err) {
    *out = (struct anatomy){0};
    enum result result = case_load(dir, NULL, &out->knee, err);
    for (int i = 0; result == RESULT_OK && i < out->knee->group_count; i++) {
        const struct case_group *group = &out->knee->groups[i];
        result = query_create(&group->mesh, &out->queries[i], err);
        out->surfaces[i] =
            (struct warp_surface){&group->mesh, out->queries[i], group->warp, (int)group->body};
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

static double touch_error(const struct anatomy *anatomy, const struct field *field,
                          const struct touch *touch, double offset_mm) {
    struct warp_memory memory;
    struct warp warp;
    warp_memory_init(&memory);
    vec3 y = vec3_add_scaled(touch->point, offset_mm, touch->normal);
    warp_point(&anatomy->scene, field, y, &memory, &warp);
    return vec3_distance(warp.displacement, touch->delta);
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
    struct samples of[FIELD_COUNT][OFFSET_COUNT];
};

static void add_errors(const struct anatomy *anatomy, const struct touch *touch,
                       struct errors *errors) {
    for (int kind = 0; kind < FIELD_COUNT; kind++) {
        struct field field = field_default((enum field_kind)kind);
        for (size_t i = 0; i < OFFSET_COUNT; i++)
            samples_add(&errors->of[kind][i], touch_error(anatomy, &field, touch, offsets_mm[i]));
    }
}

// One point for each `spacing` of area.
static void touch_group(const struct anatomy *anatomy, int group, double spacing,
                        struct errors *errors) {
    const struct mesh *mesh = anatomy->surfaces[group].mesh;
    struct random r = {(uint64_t)group};
    double due = 0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        vec3 a = mesh_corner(mesh, t, 0);
        vec3 ab = vec3_sub(mesh_corner(mesh, t, 1), a), ac = vec3_sub(mesh_corner(mesh, t, 2), a);
        for (due += vec3_length(vec3_cross(ab, ac)) / 2; due > spacing; due -= spacing) {
            struct touch touch = touch_on(anatomy, group, t, &r);
            if (is_counted(anatomy, group, &touch))
                add_errors(anatomy, &touch, errors);
        }
    }
}

static double report_errors(struct errors *errors, const char *name, struct report *report) {
    double at_contact = 0;
    for (int kind = 0; kind < FIELD_COUNT; kind++)
        for (size_t i = 0; i < OFFSET_COUNT; i++) {
            struct samples *mm = &errors->of[kind][i];
            const char *field = field_name((enum field_kind)kind);
            double offset = offsets_mm[i], max = samples_max(mm);
            report_figure(report, samples_mean(mm), "mm", "%s/%s/%g mm off/mean", name, field,
                          offset);
            report_figure(report, samples_quantile(mm, 0.99), "mm", "%s/%s/%g mm off/p99", name,
                          field, offset);
            report_figure(report, max, "mm", "%s/%s/%g mm off/max", name, field, offset);
            if (offset == 0)
                at_contact = fmax(at_contact, max);
        }
    return at_contact;
}

static void errors_fini(struct errors *errors) {
    for (int kind = 0; kind < FIELD_COUNT; kind++)
        for (size_t i = 0; i < OFFSET_COUNT; i++)
            samples_fini(&errors->of[kind][i]);
}

static enum result measure_case(const char *dir, bool quick, struct report *report,
                                double *out_at_contact, struct error *err) {
    struct anatomy anatomy;
    struct errors errors = {0};
    enum result result = anatomy_init(&anatomy, dir, err);
    if (result != RESULT_OK)
        return result;
    const char *name = anatomy.knee->name;
    for (size_t f = 0; f < FLEXION_COUNT; f++) {
        flex(&anatomy, flexions_deg[f]);
        for (int i = 0; i < anatomy.scene.surface_count; i++)
            touch_group(&anatomy, i, quick ? 4 : 0.5, &errors);
    }
    size_t points = errors.of[0][0].count;
    report_figure(report, (double)points, "points", "%s/touched", name);
    if (points)
        *out_at_contact = fmax(*out_at_contact, report_errors(&errors, name, report));
    else
        result = fail(err, RESULT_MISSING, "case %s: nothing in it is displaced", dir);
    errors_fini(&errors);
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
