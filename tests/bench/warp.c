#include "base/clock.h"
#include "bench.h"
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
        int64_t before = clock_now_ns();
        warp_point(run->scene, &run->field, y, &memory, &warp);
        int64_t after = clock_now_ns();
        if (i >= 0)
            samples_add(out_us, 1e-3 * (double)(after - before));
    }
}

// The median; and into the report, with the 99th percentile.
static double measure(const struct run *run, const char *size, struct report *report) {
    struct samples us = {0};
    time_queries(run, &us);
    double median = samples_quantile(&us, 0.5), p99 = samples_quantile(&us, 0.99);
    const char *where = run->far ? "far" : "near", *start = start_names[run->start];
    const char *field = field_name(run->field.kind);
    report_figure(report, median, "us", "%s/%s/%s/%s/median", size, where, field, start);
    report_figure(report, p99, "us", "%s/%s/%s/%s/p99", size, where, field, start);
    samples_fini(&us);
    return median;
}

static double measure_starts(struct run *run, const char *size, struct report *report) {
    double median[START_COUNT];
    for (int start = 0; start < START_COUNT; start++) {
        run->start = (enum start)start;
        median[start] = measure(run, size, report);
    }
    report_figure(report, median[START_FORGETFUL] / median[START_LAST], "times",
                  "%s/%s/%s/forgetful over following", size, run->far ? "far" : "near",
                  field_name(run->field.kind));
    return median[START_LAST];
}

// Median for inverse-distance, near, following.
static double measure_size(const struct warp_scene *scene, const char *size, int count,
                           struct report *report) {
    double result = 0;
    for (int far = 0; far < 2; far++)
        for (int kind = 0; kind < FIELD_COUNT; kind++) {
            struct run run = {scene, field_default((enum field_kind)kind), far, 0, count};
            double median = measure_starts(&run, size, report);
            if (!far && kind == FIELD_INVERSE_DISTANCE)
                result = median;
        }
    return result;
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

enum result bench_warp(const struct bench_options *options, struct report *report,
                       struct error *err) {
    (void)err;
    const pose B[3] = {pose_identity(), pose_identity(), pose_identity()};
    double error = 0;
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        struct bodies bodies;
        bodies_knee(&bodies, sizes[i].n);
        struct warp_scene scene = {bodies.surfaces, bodies.count, B, NULL};
        double us = measure_size(&scene, sizes[i].name, options->quick ? 4000 : 40000, report);
        report_figure(report, surfaces_in_reach(&bodies, 12), "surfaces",
                      "%s/near/within 12 mm of the tip, of %d", sizes[i].name, bodies.count);
        if (!strcmp(sizes[i].name, "20k"))
            report_mark(report, "warp_tip_us_20k", us, "us", 10, BETTER_LOW);
        int points = (options->quick ? 40000 : 400000) / (sizes[i].n * sizes[i].n) + 4;
        error = fmax(error, largest_error(&bodies, points));
        bodies_fini(&bodies);
    }
    report_mark(report, "closest_point_max_error_mm", error, "mm", 1e-4, BETTER_LOW);
    return RESULT_OK;
}
