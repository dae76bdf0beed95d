#include "base/check.h"
#include "cut.h"
#include "cut/blade.h"
#include "cutting/inside.h"

#include <math.h>

// Moves begin anywhere on the body's surface, by a tip from any side; a frame at 100 Hz.
#define STEP_MM 0.5
#define TURN_RAD 0.02

static vec3 random_vertex(struct random *r, const struct snapshot *surface) {
    for (;;) {
        uint32_t v = (uint32_t)(random_bits(r) % surface->vertex_bound);
        if (surface->vertex_alive[v])
            return surface->vertices[v];
    }
}

static void next_move(struct random *r, const struct snapshot *surface, int kind,
                      struct blade_move *out) {
    pose from = {random_pose(r, 0).rotation, random_vertex(r, surface)}, to = from;
    to.translation = vec3_add_scaled(to.translation, STEP_MM, random_direction(r));
    quat turn = quat_from_axis_angle(random_direction(r), random_between(r, 0, TURN_RAD));
    to.rotation = quat_multiply(turn, to.rotation);
    *out = (struct blade_move){kind, {from, to}, {1, 0}};
}

static void run(int kind, const struct mesh *mesh, int moves, struct report *report,
                struct cut_totals *totals) {
    struct trial trial;
    struct random random = {(uint64_t)kind};
    struct samples ms = {0}, removed = {0};
    struct convex parts[CUT_PARTS_MAX];
    trial_init(&trial, mesh);
    for (int i = 0; i < moves; i++) {
        struct blade_move move;
        next_move(&random, &trial.now, kind, &move);
        int count = blade_parts(instruments_usual(), &move, parts, NULL);
        CHECK(count >= 0);
        trial_cut(&trial, parts, count);
        cut_count(totals, &trial, channel_name((enum channel)(kind + CHANNEL_PUNCH)), i);
        if (trial.outcome != CUT_CHANGED)
            continue;
        samples_add(&ms, 1e-6 * (double)trial.took_ns);
        samples_add(&removed, trial.change.removed_mm3);
        if (cut_mesh_volume(trial.mesh) < mesh_volume(mesh) / 2) { // anew, before it is gone
            trial_fini(&trial);
            trial_init(&trial, mesh);
        }
    }
    const char *name = channel_name((enum channel)(kind + CHANNEL_PUNCH));
    report_figure(report, (double)ms.count, "cuts", "20k/%s/changes", name);
    report_figure(report, samples_quantile(&ms, 0.5), "ms", "20k/%s/p50", name);
    report_figure(report, samples_quantile(&ms, 0.95), "ms", "20k/%s/p95", name);
    report_figure(report, samples_max(&ms), "ms", "20k/%s/max", name);
    report_figure(report, samples_quantile(&removed, 0.5), "mm3", "20k/%s/removed, p50", name);
    samples_fini(&ms);
    samples_fini(&removed);
    trial_fini(&trial);
}

void cut_instruments(const struct mesh *mesh, int moves, struct report *report,
                     struct cut_totals *totals) {
    for (int kind = 0; kind <= BLADE_KNIFE; kind++)
        run(kind, mesh, moves, report, totals);
}
