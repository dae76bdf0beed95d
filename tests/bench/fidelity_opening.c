// Torn ligaments on an ideal joint: the opening curve (Fig. 10), and what may not happen beside it.
#include "fidelity.h"
#include "scene/torn.h"

#include <stdio.h>

#define FULL_DEG 6.0 // of valgus: that of the keys
#define EXTRA_DEG 10.0
#define OVER_DEG 12.0
#define BACK_MM 6.0 // of the tibia backward
#define FIRST_DEG 15
#define LAST_DEG 65
#define REST_STEPS 1200 // of 0.1 degree

static const double key_flexions_deg[] = {45, 15, 65}; // one key: the first
static const int key_counts[] = {0, 1, 3};

// ---- what is reported ----

static void make_curve(struct torn *torn, enum adaptive_kind kind, int keys, uint64_t seed) {
    struct random r = {seed};
    torn_start(torn, torn_joint(&r));
    for (int i = 0; i < keys; i++)
        torn_add_valgus(torn, key_flexions_deg[i], EXTRA_DEG);
    torn_build(torn, kind);
}

static void report_range(struct report *report, const struct torn *torn, const char *name,
                         const char *what, double valgus) {
    double least = INFINITY, most = -INFINITY;
    for (int flexion = FIRST_DEG; flexion <= LAST_DEG; flexion++) {
        double extra = torn_extra_valgus(torn, flexion, valgus);
        least = fmin(least, extra);
        most = fmax(most, extra);
    }
    report_figure(report, least, "deg", "%s/%s/least", name, what);
    report_figure(report, most, "deg", "%s/%s/most", name, what);
}

static void report_curve(struct report *report, enum adaptive_kind kind, int keys) {
    struct torn torn;
    char name[64];
    make_curve(&torn, kind, keys, 1);
    snprintf(name, sizeof name, "opening/%s/%d keys", adaptive_name(kind), keys);
    for (int flexion = 0; flexion <= 90; flexion += 5)
        report_figure(report, torn_extra_valgus(&torn, flexion, FULL_DEG), "deg",
                      "%s/at %d deg of flexion", name, flexion);
    report_range(report, &torn, name, "full", FULL_DEG);
    report_range(report, &torn, name, "half", FULL_DEG / 2);
    report_range(report, &torn, name, "over-opened", OVER_DEG);
    report_range(report, &torn, name, "rest", 0);
    report_range(report, &torn, name, "varus", -FULL_DEG);
    torn_destroy(&torn);
}

// ---- what has marks ----

struct opening {
    double key_error_mm, rest_mm, opposite_deg, over, spread;
};

static double turn_deg(const struct torn *torn, struct joint_angles angles) {
    pose A = torn_pose(torn, angles);
    return DEG_PER_RAD * quat_angle(A.rotation, torn_seen(torn, A).rotation);
}

static void look_at_keys(const struct torn *torn, struct opening *out) {
    for (int i = 0; i < torn->setup.key_count; i++) {
        pose seen = torn_seen(torn, torn->keys[i].T_femur_tibia);
        out->key_error_mm = fmax(out->key_error_mm, torn_apart(torn, seen, torn->keys[i].target));
    }
}

static void look_at_rest(const struct torn *torn, struct opening *out) {
    for (int i = 0; i <= REST_STEPS; i++) {
        double flexion = 0.1 * i;
        pose A = torn_pose(torn, (struct joint_angles){.flexion_deg = flexion});
        out->rest_mm = fmax(out->rest_mm, torn_apart(torn, torn_seen(torn, A), A));
        struct joint_angles varus = {.flexion_deg = flexion, .varus_deg = FULL_DEG};
        struct joint_angles back = {.flexion_deg = flexion, .drawer_mm = -BACK_MM};
        out->opposite_deg =
            fmax(out->opposite_deg, fmax(turn_deg(torn, varus), turn_deg(torn, back)));
    }
}

static void look_at_opening(const struct torn *torn, struct opening *out) {
    for (double flexion = FIRST_DEG; flexion <= LAST_DEG; flexion += 0.25) {
        double full = torn_extra_valgus(torn, flexion, FULL_DEG);
        double over = torn_extra_valgus(torn, flexion, OVER_DEG);
        out->spread = fmax(out->spread, fabs(full - EXTRA_DEG) / EXTRA_DEG);
        out->over = fmax(out->over, over / EXTRA_DEG);
    }
}

// The joint's frames, and the side, come from the seed.
static struct opening measure(uint64_t seed) {
    struct opening opening = {0};
    for (int which = 1; which < 4; which++) { // medial ligament, anterior cruciate, both
        struct random r = {seed};
        struct torn torn;
        torn_create(&torn, &r, which & 1, which & 2);
        look_at_keys(&torn, &opening);
        look_at_rest(&torn, &opening);
        if (which & 1)
            look_at_opening(&torn, &opening);
        torn_destroy(&torn);
    }
    return opening;
}

void fidelity_opening(struct fidelity *f) {
    struct report *report = f->report;
    for (int kind = 0; kind < ADAPTIVE_COUNT; kind++)
        for (int i = 0; i < 3; i++)
            report_curve(report, (enum adaptive_kind)kind, key_counts[i]);
    struct opening a = measure(1), b = measure(2);
    f->key_error_mm = fmax(a.key_error_mm, b.key_error_mm);
    f->rest_mm = fmax(a.rest_mm, b.rest_mm);
    report_mark(report, "opposite_extra_deg", fmax(a.opposite_deg, b.opposite_deg), "deg", 1e-6,
                BETTER_LOW);
    report_mark(report, "overopen_over_key", fmax(a.over, b.over), "times", 1.001, BETTER_LOW);
    report_mark(report, "opening_spread", fmax(a.spread, b.spread), "times", 0.005, BETTER_LOW);
}
