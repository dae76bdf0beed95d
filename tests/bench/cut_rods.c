#include "cut.h"
#include "cutting/bites.h"
#include "generate/tube.h"

#include <math.h>

// ---- two rods -----------------------------------------------------------------------------------
//
// Elliptical, along z from 0: up to 90 mm both have the same rings.

static const double half_width = 4.5, half_thickness = 3, edge = 0.5;
static const double short_mm = 104, long_mm = 524; // 192 triangles a mm

static void make_rod(double length, struct mesh *out) {
    struct ligament rod = {"rod",
                           {{0}, {0, 0, length / 3}, {0, 0, 2 * length / 3}, {0, 0, length}},
                           {1, 0, 0},
                           half_width,
                           half_thickness};
    tube_ligament(&rod, edge, out);
}

static void next_bite(struct random *r, struct convex *out) {
    double angle = random_between(r, 0, 6.283185307179586), z = random_between(r, 12, 90);
    vec3 centre = {half_width * cos(angle), half_thickness * sin(angle), z};
    convex_random(r, centre, random_between(r, 0.4, 1.2), out);
}

double cut_growth_far(int bites, struct report *report, struct cut_totals *totals) {
    struct mesh meshes[2];
    struct trial trials[2];
    struct samples ms[2] = {{0}};
    struct random random = {4};
    for (int i = 0; i < 2; i++) {
        make_rod(i ? long_mm : short_mm, &meshes[i]);
        trial_init(&trials[i], &meshes[i]);
    }
    for (int bite = 0; bite < bites; bite++) {
        struct convex blade;
        next_bite(&random, &blade);
        for (int i = 0; i < 2; i++) {
            trial_cut(&trials[i], &blade, 1);
            cut_count(totals, &trials[i], i ? "long rod" : "short rod", bite);
            if (trials[i].outcome == CUT_CHANGED)
                samples_add(&ms[i], 1e-6 * (double)trials[i].took_ns);
        }
    }
    double p50[2];
    for (int i = 0; i < 2; i++) {
        p50[i] = samples_quantile(&ms[i], 0.5);
        report_figure(report, p50[i], "ms", "rod of %d triangles/p50",
                      (int)meshes[i].triangle_count);
        report_figure(report, samples_quantile(&ms[i], 0.95), "ms", "rod of %d triangles/p95",
                      (int)meshes[i].triangle_count);
        samples_fini(&ms[i]);
        trial_fini(&trials[i]);
        mesh_fini(&meshes[i]);
    }
    return p50[1] / p50[0];
}
