#include "base/check.h"
#include "cut.h"
#include "cut/blade.h"
#include "cutting/inside.h"

#include <math.h>

// Moves begin anywhere on the body's surface, by a tip from any side; a frame at 100 Hz.
#define STEP_MM 0.5
#define TURN_RAD 0.02 // of a calm hand

static vec3 random_vertex(struct random *r, const struct snapshot *surface) {
    for (;;) {
        uint32_t v = (uint32_t)(random_bits(r) % surface->vertex_bound);
        if (surface->vertex_alive[v])
            return surface->vertices[v];
    }
}

struct sweep {
    const char *name;
    int kind;
    double turn_rad[2]; // least and most
};

static void next_move(struct random *r, const struct snapshot *surface, const struct sweep *sweep,
                      struct blade_move *out) {
    pose from = {random_pose(r, 0).rotation, random_vertex(r, surface)}, to = from;
    to.translation = vec3_add_scaled(to.translation, STEP_MM, random_direction(r));
    double turn_rad = random_between(r, sweep->turn_rad[0], sweep->turn_rad[1]);
    quat turn = quat_from_axis_angle(random_direction(r), turn_rad);
    to.rotation = quat_multiply(turn, to.rotation);
    *out = (struct blade_move){sweep->kind, {from, to}, {1, 0}};
}

struct swept {
    struct samples ms, removed;
};

static void run(const struct sweep *sweep, const struct mesh *mesh, int moves, struct swept *out,
                struct cut_totals *totals) {
    struct trial trial;
    struct random random = {(uint64_t)sweep->kind};
    struct convex parts[CUT_PARTS_MAX];
    trial_init(&trial, mesh);
    for (int i = 0; i < moves; i++) {
        struct blade_move move;
        next_move(&random, &trial.now, sweep, &move);
        int count = blade_parts(instruments_usual(), &move, true, parts, NULL);
        CHECK(count >= 0);
        trial_cut(&trial, parts, count);
        cut_count(totals, &trial, sweep->name, i);
        if (trial.outcome != CUT_CHANGED)
            continue;
        samples_add(&out->ms, 1e-6 * (double)trial.own_ns);
        samples_add(&out->removed, trial.change.removed_mm3);
        if (cut_mesh_volume(trial.mesh) < mesh_volume(mesh) / 2) { // anew, before it is gone
            trial_fini(&trial);
            trial_init(&trial, mesh);
        }
    }
    trial_fini(&trial);
}

static void tell(const char *body, const struct sweep *sweep, struct swept *swept,
                 struct report *report) {
    const char *name = sweep->name;
    report_figure(report, (double)swept->ms.count, "cuts", "%s/%s/changes", body, name);
    report_figure(report, samples_quantile(&swept->ms, 0.5), "ms", "%s/%s/p50", body, name);
    report_figure(report, samples_quantile(&swept->ms, 0.95), "ms", "%s/%s/p95", body, name);
    report_figure(report, samples_max(&swept->ms), "ms", "%s/%s/max", body, name);
    report_figure(report, samples_quantile(&swept->removed, 0.5), "mm3", "%s/%s/removed, p50", body,
                  name);
    samples_fini(&swept->ms);
    samples_fini(&swept->removed);
}

void cut_instruments(const struct mesh *mesh, int moves, struct report *report,
                     struct cut_totals *totals) {
    for (int kind = 0; kind <= BLADE_KNIFE; kind++) {
        struct sweep sweep = {
            channel_name((enum channel)(kind + CHANNEL_PUNCH)), kind, {0, TURN_RAD}};
        struct swept swept = {0};
        run(&sweep, mesh, moves, &swept, totals);
        tell("20k", &sweep, &swept, report);
    }
}

void cut_by_knife(const char *name, const struct mesh *mesh, int moves, struct report *report,
                  struct cut_totals *totals) {
    static const struct sweep sweep = {
        "turning knife", BLADE_KNIFE, {5.1 * RAD_PER_DEG, 8 * RAD_PER_DEG}};
    struct swept swept = {0};
    run(&sweep, mesh, moves, &swept, totals);
    totals->knife_p95_ms = fmax(totals->knife_p95_ms, samples_quantile(&swept.ms, 0.95));
    tell(name, &sweep, &swept, report);
}
