#include "avatar.h"

#include "samples.h"
#include "scene/probe.h"
#include "warp/avatar.h"

#define POINTS 8
#define SPACING_MM 7.0
#define STEP_MM 0.05 // as in warp.c
#define STEPS 40000

static const pose bodies_at[3] = {
    {{1, 0, 0, 0}, {0, 0, 0}}, {{1, 0, 0, 0}, {0, 0, 0}}, {{1, 0, 0, 0}, {0, 0, 0}}};

struct bench {
    struct bodies knee, virtual;
    struct warp_scene scene;
    struct field field;
    struct avatar_point points[POINTS];
};

static void prepare(struct bench *b) {
    bodies_knee(&b->knee, 50);
    bodies_smooth(&b->knee);
    bodies_integrate(&b->knee);
    bodies_displaced(&b->virtual, &b->knee);
    b->scene = (struct warp_scene){b->knee.surfaces, b->knee.count, bodies_at, NULL};
    b->field = field_default(FIELD_INVERSE_DISTANCE);
    for (int i = 0; i < POINTS; i++)
        b->points[i] = (struct avatar_point){{0, 0, -SPACING_MM * i}, 0};
}

static struct avatar warp_at(const struct bench *b, enum avatar_mode mode, vec3 portal, pose T,
                             struct avatar_memory *memory) {
    struct avatar_body body = {mode, b->points, POINTS};
    struct avatar avatar;
    avatar_warp(&b->scene, &b->field, &body, portal, T, memory, &avatar);
    return avatar;
}

// ---- time ---------------------------------------------------------------------------------------

// The median, in µs, along the path of warp.c.
static double time_mode(const struct bench *b, enum avatar_mode mode, struct report *report) {
    const vec3 portal = {28, 50, 6};
    struct samples us = {0};
    struct avatar_memory memory;
    avatar_memory_init(&memory);
    for (int i = -100; i < STEPS; i++) { // the first ones warm up
        vec3 way = vec3_sub(bodies_knee_path(STEP_MM * i), portal);
        pose T = probe_aim(portal, way, vec3_length(way));
        double before = samples_own_us();
        warp_at(b, mode, portal, T, &memory);
        if (i >= 0)
            samples_add_own(&us, before);
    }
    double median = samples_quantile(&us, 0.5), p99 = samples_quantile(&us, 0.99);
    const char *field = field_name(b->field.kind), *name = avatar_mode_name(mode);
    report_figure(report, median, "us", "20k/avatar/%s/%s/median", field, name);
    report_figure(report, p99, "us", "20k/avatar/%s/%s/p99", field, name);
    samples_fini(&us);
    return median;
}

// With each field; for inverse-distance `rigid` over `tip`.
static double time_modes(struct bench *b, struct report *report) {
    const struct field field = b->field;
    double us[FIELD_COUNT][AVATAR_MODE_COUNT];
    for (int kind = 0; kind < FIELD_COUNT; kind++) {
        b->field = field_default((enum field_kind)kind);
        for (int m = 0; m < AVATAR_MODE_COUNT; m++)
            us[kind][m] = time_mode(b, (enum avatar_mode)m, report);
    }
    b->field = field;
    return us[FIELD_INVERSE_DISTANCE][AVATAR_RIGID] / us[FIELD_INVERSE_DISTANCE][AVATAR_TIP];
}

// ---- touch --------------------------------------------------------------------------------------

// Of one mode and one kind of touch, mm: the deepest point of the body, and of the whole shaft;
// what the tip's gap grew by where it touches.
struct depths {
    struct samples points, shaft, gap;
};

static double deepest(const struct bodies *virtual, pose T, double step_mm) {
    double depth = 0;
    for (double z = 0; z >= -SPACING_MM * (POINTS - 1); z -= step_mm)
        depth = fmax(depth, -bodies_gap(virtual, pose_apply(T, (vec3){0, 0, z})));
    return depth;
}

static void add_depths(const struct bench *b, enum avatar_mode mode, const struct probe *probe,
                       struct depths *out) {
    struct avatar_memory memory;
    avatar_memory_init(&memory);
    pose T = warp_at(b, mode, probe->portal, probe->T_world_tip, &memory).T_world_warped;
    double gap = bodies_gap(&b->knee, probe->T_world_tip.translation);
    samples_add(&out->points, deepest(&b->virtual, T, SPACING_MM));
    samples_add(&out->shaft, deepest(&b->virtual, T, 0.5));
    if (gap < 0.1)
        samples_add(&out->gap, bodies_gap(&b->virtual, T.translation) - gap);
}

static void report_depths(struct report *report, const char *touch, enum avatar_mode mode,
                          struct depths *depths) {
    const char *name = avatar_mode_name(mode);
    report_figure(report, samples_mean(&depths->points), "mm", "touch/%s/%s/depth of its points",
                  touch, name);
    report_figure(report, samples_mean(&depths->shaft), "mm", "touch/%s/%s/depth of its shaft",
                  touch, name);
    report_figure(report, samples_quantile(&depths->gap, 0.99), "mm",
                  "touch/%s/%s/gap of the tip/p99", touch, name);
}

static void report_ratios(struct report *report, const char *touch,
                          const struct depths depths[AVATAR_MODE_COUNT]) {
    const struct depths *tip = &depths[AVATAR_TIP], *rigid = &depths[AVATAR_RIGID];
    report_figure(report, samples_mean(&rigid->points) / samples_mean(&tip->points), "times",
                  "touch/%s/rigid over tip/depth of its points", touch);
    report_figure(report, samples_mean(&rigid->shaft) / samples_mean(&tip->shaft), "times",
                  "touch/%s/rigid over tip/depth of its shaft", touch);
}

static void touch_knee(const struct bench *b, int poses, struct report *report,
                       struct avatar_touch *out) {
    static const char *const names[PROBE_TOUCHES] = {"tip", "shaft", "both"};
    struct depths depths[PROBE_TOUCHES][AVATAR_MODE_COUNT] = {0};
    struct random r = {3};
    for (int i = 0; i < poses; i++) {
        enum probe_touch touch;
        struct probe probe = probe_in_touch(&b->knee, &r, &touch);
        for (int m = 0; m < AVATAR_MODE_COUNT; m++)
            add_depths(b, (enum avatar_mode)m, &probe, &depths[touch][m]);
    }
    for (int t = 0; t < PROBE_TOUCHES; t++) {
        for (int m = 0; m < AVATAR_MODE_COUNT; m++)
            report_depths(report, names[t], (enum avatar_mode)m, &depths[t][m]);
        report_ratios(report, names[t], depths[t]);
        const struct depths *rigid = &depths[t][AVATAR_RIGID], *tip = &depths[t][AVATAR_TIP];
        if (t == PROBE_SHAFT)
            out->rigid_over_tip = samples_mean(&rigid->points) / samples_mean(&tip->points);
        else
            out->tip_gap_p99_mm =
                fmax(out->tip_gap_p99_mm, samples_quantile(&depths[t][AVATAR_RIGID].gap, 0.99));
        for (int m = 0; m < AVATAR_MODE_COUNT; m++) {
            samples_fini(&depths[t][m].points);
            samples_fini(&depths[t][m].shaft);
            samples_fini(&depths[t][m].gap);
        }
    }
}

struct avatar_touch bench_avatar_touch(const struct bench_options *options, struct report *report) {
    struct bench b = {0};
    struct avatar_touch touch = {0};
    prepare(&b);
    touch_knee(&b, options->quick ? 500 : 1500, report, &touch);
    bodies_fini(&b.virtual);
    bodies_fini(&b.knee);
    return touch;
}

void bench_avatars(const struct bench_options *options, struct report *report) {
    struct bench b = {0};
    prepare(&b);
    double times = time_modes(&b, report);
    report_mark(report, "rigid_over_tip_time", times, "times", 8, BETTER_LOW);
    bodies_fini(&b.virtual);
    bodies_fini(&b.knee);
    bench_avatar_touch(options, report);
}
