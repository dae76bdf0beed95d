#include "avatar.h"
#include "bench.h"
#include "plain_query.h"
#include "random.h"
#include "samples.h"
#include "scene/bodies.h"
#include "scene/brute.h"

#include <string.h>

// The hand at 50 mm/s, asked a thousand times a second.
#define STEP_MM 0.05

struct size {
    const char *name;
    int n; // 8 n² triangles for each of five surfaces
};

static const struct size sizes[] = {{"5k", 25}, {"20k", 50}, {"100k", 112}};

enum start {
    START_ANYWHERE,  // scattered points, nothing known
    START_LAST,      // along a path, from the last answer
    START_FORGETFUL, // the same path, nothing known
    START_COUNT
};

static const char *const start_names[START_COUNT] = {"first", "following", "forgetful"};

// Near: between the surfaces. Far: beside them, the nearest 40 mm and more away.
static vec3 place(bool far, double t) {
    vec3 p = bodies_knee_path(t);
    if (far)
        p.y -= 110;
    return p;
}

struct run {
    const struct warp_scene *scene;
    struct field field;
    bool far;
    enum start start;
    int count;
};

static void time_queries(const struct run *run, struct samples *out_us) {
    struct random r = {1};
    struct warp_memory memory;
    struct warp warp;
    warp_memory_init(&memory);
    for (int i = -100; i < run->count; i++) { // the first ones warm up
        vec3 y = place(run->far, run->start ? STEP_MM * i : random_between(&r, 0, 5000));
        if (run->start != START_LAST)
            warp_memory_init(&memory);
        double before = samples_own_us();
        warp_point(run->scene, &run->field, y, &memory, &warp);
        if (i >= 0)
            samples_add_own(out_us, before);
    }
}

struct took {
    double median_us, p99_us;
};

// And into the report.
static struct took measure(const struct run *run, const char *size, struct report *report) {
    struct samples us = {0};
    time_queries(run, &us);
    double median = samples_quantile(&us, 0.5), p99 = samples_quantile(&us, 0.99);
    const char *where = run->far ? "far" : "near", *start = start_names[run->start];
    const char *field = field_name(run->field.kind);
    report_figure(report, median, "us", "%s/%s/%s/%s/median", size, where, field, start);
    report_figure(report, p99, "us", "%s/%s/%s/%s/p99", size, where, field, start);
    samples_fini(&us);
    return (struct took){median, p99};
}

static struct took measure_starts(struct run *run, const char *size, struct report *report) {
    struct took took[START_COUNT];
    for (int start = 0; start < START_COUNT; start++) {
        run->start = (enum start)start;
        took[start] = measure(run, size, report);
    }
    report_figure(report, took[START_FORGETFUL].median_us / took[START_LAST].median_us, "times",
                  "%s/%s/%s/forgetful over following", size, run->far ? "far" : "near",
                  field_name(run->field.kind));
    return took[START_LAST];
}

// By each field; out_near: near, following.
static void measure_size(const struct warp_scene *scene, const char *size, int count,
                         struct report *report, struct took out_near[FIELD_COUNT]) {
    for (int far = 0; far < 2; far++)
        for (int kind = 0; kind < FIELD_COUNT; kind++) {
            struct run run = {scene, field_default((enum field_kind)kind), far, 0, count};
            struct took took = measure_starts(&run, size, report);
            if (!far)
                out_near[kind] = took;
        }
}

// Every triangle of every surface, in turn: what a warp's time is compared with on any machine.
static double brute_force_us(const struct bodies *bodies) {
    struct samples us = {0};
    for (int i = 0; i < 20; i++) {
        double before = samples_own_us();
        for (int k = 0; k < bodies->count; k++)
            brute_distance(&bodies->meshes[k], place(false, 250 * i));
        samples_add(&us, samples_own_us() - before);
    }
    double median = samples_quantile(&us, 0.5);
    samples_fini(&us);
    return median;
}

// Embree's plain point query over ours, all surfaces at a place in turn.
static double plain_over_queries(const struct bodies *bodies, double reach_mm, int count) {
    struct plain_query *plain[BODIES_MAX];
    uint32_t last[BODIES_MAX];
    struct samples plain_us = {0}, us = {0};
    for (int k = 0; k < bodies->count; k++) {
        plain[k] = plain_query_create(&bodies->meshes[k]);
        last[k] = MESH_NONE;
    }
    for (int i = 0; i < count; i++) {
        vec3 p = place(false, STEP_MM * i);
        double before = samples_own_us();
        for (int k = 0; k < bodies->count; k++)
            plain_query_distance(plain[k], p, reach_mm);
        samples_add_own(&plain_us, before);
        before = samples_own_us();
        for (int k = 0; k < bodies->count; k++) {
            struct closest c = {.triangle = last[k]};
            query_closest(bodies->queries[k], p, reach_mm, last[k], &c);
            last[k] = c.triangle;
        }
        samples_add_own(&us, before);
    }
    double ratio = samples_quantile(&plain_us, 0.5) / samples_quantile(&us, 0.5);
    samples_fini(&plain_us);
    samples_fini(&us);
    for (int k = 0; k < bodies->count; k++)
        plain_query_destroy(&plain[k]);
    return ratio;
}

static double surfaces_in_reach(const struct bodies *bodies, double reach_mm) {
    const int points = 1000;
    int found = 0;
    for (int i = 0; i < points; i++)
        for (int k = 0; k < bodies->count; k++) {
            struct closest c;
            found +=
                query_closest(bodies->queries[k], place(false, 2 * i), reach_mm, MESH_NONE, &c);
        }
    return (double)found / points;
}

static double largest_error(const struct bodies *bodies, int points) {
    struct random r = {2};
    double largest = 0;
    for (int i = 0; i < points; i++) {
        vec3 p = place(i % 8 == 0, random_between(&r, 0, 5000));
        for (int k = 0; k < bodies->count; k++) {
            struct closest c;
            query_closest(bodies->queries[k], p, INFINITY, MESH_NONE, &c);
            double truth = brute_distance(&bodies->meshes[k], p);
            largest = fmax(largest, fabs(c.distance - truth));
            largest = fmax(largest, fabs(vec3_distance(p, c.point) - truth));
        }
    }
    return largest;
}

// ---- one warped concave surface, smooth ---------------------------------------------------------

static const double offs_mm[] = {0.001, 0.02, 0.1, 0.2, 0.5, 2, 8};

#define OFF_COUNT (sizeof offs_mm / sizeof offs_mm[0])
#define CUT_VERTICES 300 // whose displacements a cut changes

// Off a vertex, on any side of it.
static vec3 place_off(const struct mesh *mesh, double off_mm, struct random *r) {
    uint32_t vertex = (uint32_t)(random_bits(r) % mesh->vertex_count);
    return vec3_add_scaled(mesh_vertex(mesh, vertex), off_mm, random_direction(r));
}

static double measure_off(const struct bodies *ring, enum field_kind kind, double off_mm, int count,
                          struct report *report) {
    const pose B = pose_identity();
    const struct warp_scene scene = {ring->surfaces, ring->count, &B, NULL};
    struct field field = field_default(kind);
    struct random r = {3};
    struct samples us = {0};
    for (int i = 0; i < count; i++) {
        vec3 y = place_off(&ring->meshes[0], off_mm, &r);
        struct warp_memory memory;
        struct warp warp;
        warp_memory_init(&memory);
        warp_point(&scene, &field, y, &memory, &warp); // where the tip was a moment ago
        double before = samples_own_us();
        warp_point(&scene, &field, y, &memory, &warp);
        samples_add_own(&us, before);
    }
    double median = samples_quantile(&us, 0.5);
    report_figure(report, median, "us", "one ring/%s/%g mm off/median", field_name(kind), off_mm);
    report_figure(report, samples_quantile(&us, 0.99), "us", "one ring/%s/%g mm off/p99",
                  field_name(kind), off_mm);
    samples_fini(&us);
    return median;
}

// And the median time of the truth.
static double mean_error(const struct bodies *ring, int points, double *out_brute_us) {
    struct random r = {4};
    struct samples us = {0};
    double largest = 0;
    for (int i = 0; i < points; i++) {
        vec3 p = place_off(&ring->meshes[0], offs_mm[2 + (size_t)i % (OFF_COUNT - 2)], &r);
        struct surface_value value;
        double distance = brute_distance(&ring->meshes[0], p);
        if (!surface_mean_at(ring->means[0], p, distance, &value))
            return INFINITY;
        double before = samples_own_us();
        struct brute_mean truth = brute_mean(&ring->meshes[0], ring->displacements[0], p);
        samples_add(&us, samples_own_us() - before);
        largest = fmax(largest, vec3_distance(value.displacement, truth.displacement));
    }
    *out_brute_us = samples_quantile(&us, 0.5);
    samples_fini(&us);
    return largest;
}

static void measure_upkeep(struct bodies *ring, int count, struct report *report) {
    double before = samples_own_us();
    struct surface_tree *tree = surface_tree_create(&ring->meshes[0]);
    struct surface_mean *mean = surface_mean_create(tree, ring->displacements[0]);
    report_figure(report, 1e-3 * (samples_own_us() - before), "ms", "one ring/smooth/build");
    struct samples us = {0};
    for (int i = 0; i < count; i++) {
        uint32_t vertices[CUT_VERTICES];
        for (uint32_t k = 0; k < CUT_VERTICES; k++)
            vertices[k] = (uint32_t)i * 7 % (ring->meshes[0].vertex_count - CUT_VERTICES) + k;
        before = samples_own_us();
        surface_mean_update(mean, vertices, CUT_VERTICES);
        samples_add(&us, samples_own_us() - before);
    }
    report_figure(report, samples_quantile(&us, 0.5), "us", "one ring/smooth/update of %d vertices",
                  CUT_VERTICES);
    samples_fini(&us);
    surface_mean_destroy(&mean);
    surface_tree_destroy(&tree);
}

// The dearest distance counts.
static void measure_smooth(bool quick, struct report *report) {
    struct bodies ring = {0};
    struct mesh mesh;
    shape_torus(&mesh, 13, 3, 200, 50);
    float *displacement = shape_displacement(&mesh, 3, 12);
    bodies_add(&ring, &mesh, displacement, 0);
    bodies_smooth(&ring);
    double us = 0;
    bodies_integrate(&ring);
    for (size_t i = 0; i < OFF_COUNT; i++) {
        us = fmax(us, measure_off(&ring, FIELD_SMOOTH, offs_mm[i], quick ? 1000 : 10000, report));
        measure_off(&ring, FIELD_INTEGRAL, offs_mm[i], quick ? 1000 : 10000, report);
    }
    measure_upkeep(&ring, 200, report);
    double brute_us = 0, error = mean_error(&ring, quick ? 25 : 250, &brute_us);
    report_mark(report, "smooth_max_error_mm", error, "mm", 3e-3, BETTER_LOW);
    report_figure(report, brute_us / us, "times", "one ring/smooth/brute force over the dearest");
    bodies_fini(&ring);
}

// ---- all ----------------------------------------------------------------------------------------

static void report_20k(const struct bodies *bodies, const struct took near[FIELD_COUNT], int count,
                       struct report *report) {
    const struct took *usual = &near[FIELD_INTEGRAL];
    report_mark(report, "warp_tip_us_20k", usual->median_us, "us", 8, BETTER_LOW);
    report_mark(report, "warp_inverse_us_20k", near[FIELD_INVERSE_DISTANCE].median_us, "us", 3,
                BETTER_LOW);
    report_mark(report, "warp_tip_p99_over_median_20k", usual->p99_us / usual->median_us, "times",
                3, BETTER_LOW);
    report_figure(report,
                  plain_over_queries(bodies, field_default(FIELD_INTEGRAL).radius_mm, count),
                  "times", "embree_over_queries");
    report_figure(report, brute_force_us(bodies) / usual->median_us, "times",
                  "20k/near/brute force over following");
}

enum result bench_warp(const struct bench_options *options, struct report *report,
                       struct error *err) {
    (void)err;
    const pose B[3] = {pose_identity(), pose_identity(), pose_identity()};
    const int count = options->quick ? 4000 : 40000;
    double error = 0;
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        struct bodies bodies;
        struct took near[FIELD_COUNT];
        bodies_knee(&bodies, sizes[i].n);
        bodies_smooth(&bodies);
        bodies_integrate(&bodies);
        struct warp_scene scene = {bodies.surfaces, bodies.count, B, NULL};
        measure_size(&scene, sizes[i].name, count, report, near);
        report_figure(report, surfaces_in_reach(&bodies, field_default(FIELD_SMOOTH).radius_mm),
                      "surfaces", "%s/near/within reach of the tip, of %d", sizes[i].name,
                      bodies.count);
        if (!strcmp(sizes[i].name, "20k"))
            report_20k(&bodies, near, count, report);
        int points = (options->quick ? 40000 : 400000) / (sizes[i].n * sizes[i].n) + 4;
        error = fmax(error, largest_error(&bodies, points));
        bodies_fini(&bodies);
    }
    measure_smooth(options->quick, report);
    report_mark(report, "closest_point_max_error_mm", error, "mm", 1e-4, BETTER_LOW);
    bench_avatars(options, report);
    return RESULT_OK;
}
