#include "base/check.h"
#include "fidelity.h"
#include "harmonic.h"

#include <stdio.h>
#include <stdlib.h>

#define AROUND_MM 15.0     // of the displaced surface: the box that is solved
#define MATTERS_SHARE 0.01 // of the largest displacement
#define ENOUGH_NODES 2000  // before that the grid is made finer
#define JUMP_MM 0.01
#define JUMP_EDGES 400 // those that change most are looked into, and
#define JUMP_EDGES_QUICK 40

// The nodes of a grid where one can be and something is displaced.
struct nodes {
    struct harmonic harmonic;
    double spacing_mm, largest_mm;
    size_t count, left_out;
    bool is_finest;  // of a scene: what marks speak of
    uint32_t *of;    // index of each in the harmonic
    uint32_t *place; // of each node of the harmonic in `of`, or HARMONIC_NONE
};

static void nodes_init(struct nodes *out, const struct anatomy *anatomy, double spacing_mm) {
    struct hull hull;
    struct box box;
    anatomy_hull(&anatomy->scene, &hull);
    double largest = anatomy_largest(&anatomy->scene, &box);
    vec3 around = {AROUND_MM, AROUND_MM, AROUND_MM};
    struct harmonic_setup setup = {.scene = &anatomy->scene,
                                   .hollow = anatomy->hollow,
                                   .box = {vec3_sub(box.min, around), vec3_add(box.max, around)},
                                   .spacing_mm = spacing_mm,
                                   .is_within = hull_holds,
                                   .context = &hull};
    *out = (struct nodes){.spacing_mm = spacing_mm, .largest_mm = largest};
    harmonic_solve(&setup, &out->harmonic);
    out->of = alloc(out->harmonic.count, sizeof *out->of);
    out->place = alloc(out->harmonic.count, sizeof *out->place);
    for (uint32_t i = 0; i < out->harmonic.count; i++) {
        double length = vec3_length(out->harmonic.values[i]);
        bool matters = length > MATTERS_SHARE * out->largest_mm;
        bool reached = matters && anatomy_reaches(&anatomy->scene, anatomy->hollow,
                                                  harmonic_place(&out->harmonic, i));
        out->left_out += matters && !reached;
        out->place[i] = reached ? (uint32_t)out->count : HARMONIC_NONE;
        if (reached)
            out->of[out->count++] = i;
    }
}

static void nodes_fini(struct nodes *nodes) {
    harmonic_fini(&nodes->harmonic);
    free(nodes->of);
    free(nodes->place);
}

static vec3 node_at(const struct nodes *nodes, size_t i) {
    return harmonic_place(&nodes->harmonic, nodes->of[i]);
}

// The next node along an axis, HARMONIC_NONE where it is none of these.
static uint32_t next_node(const struct nodes *nodes, size_t i, int axis) {
    uint32_t next = nodes->harmonic.neighbours[nodes->of[i]][2 * axis + 1];
    return next == HARMONIC_NONE ? HARMONIC_NONE : nodes->place[next];
}

// ---- beside the harmonic ------------------------------------------------------------------------

// Of neighbouring nodes: how much W changes over the way between them.
static void add_gains(const struct nodes *nodes, const vec3 *W, struct samples *out) {
    for (size_t i = 0; i < nodes->count; i++)
        for (int axis = 0; axis < 3; axis++) {
            uint32_t next = next_node(nodes, i, axis);
            if (next != HARMONIC_NONE)
                samples_add(out, vec3_distance(W[i], W[next]) / nodes->spacing_mm);
        }
}

static void report_gains(const struct scene_of_lesion *scene, enum variant variant,
                         const struct nodes *nodes, struct samples *gains,
                         struct samples *harmonic) {
    char what[64];
    double largest = samples_max(gains) / samples_max(harmonic);
    double p999 = samples_quantile(gains, 0.999) / samples_quantile(harmonic, 0.999);
    snprintf(what, sizeof what, "%g mm/gain over harmonic/max", nodes->spacing_mm);
    fidelity_figure(scene, variant, what, "times", largest);
    snprintf(what, sizeof what, "%g mm/gain over harmonic/p99.9", nodes->spacing_mm);
    fidelity_figure(scene, variant, what, "times", p999);
    if (nodes->is_finest && variant == VARIANT_INTEGRAL_SKIN)
        fidelity_worst(scene, WORST_GAIN, largest);
}

static void compare(const struct scene_of_lesion *scene, enum variant variant,
                    const struct nodes *nodes, vec3 *W, struct samples *harmonic) {
    double square = 0;
    size_t folds = 0;
    for (size_t i = 0; i < nodes->count; i++) {
        struct warp warp = variant_warp(scene->anatomy, variant, node_at(nodes, i));
        double off = vec3_distance(warp.displacement, nodes->harmonic.values[nodes->of[i]]);
        W[i] = warp.displacement;
        square += off * off;
        folds += mat3_determinant(mat3_add_scaled(mat3_identity(), 1, warp.gradient)) <= 0;
    }
    char what[64];
    double count = (double)nodes->count, rms = sqrt(square / count);
    snprintf(what, sizeof what, "%g mm/rms off harmonic", nodes->spacing_mm);
    fidelity_figure(scene, variant, what, "mm", rms);
    snprintf(what, sizeof what, "%g mm/rms over largest", nodes->spacing_mm);
    fidelity_figure(scene, variant, what, "times", rms / nodes->largest_mm);
    snprintf(what, sizeof what, "%g mm/folds", nodes->spacing_mm);
    fidelity_figure(scene, variant, what, "share", (double)folds / count);
    if (nodes->is_finest && variant == VARIANT_INTEGRAL_SKIN)
        fidelity_worst(scene, WORST_RMS, rms / nodes->largest_mm);
    struct samples gains = {0};
    add_gains(nodes, W, &gains);
    if (gains.count)
        report_gains(scene, variant, nodes, &gains, harmonic);
    samples_fini(&gains);
}

// What the derivative of the harmonic itself leaves out over the way to the next node: half of its
// second difference. No late reply can do much better.
static double harmonic_bend(const struct nodes *nodes) {
    double sum = 0, count = 0;
    for (size_t i = 0; i < nodes->count; i++)
        for (int axis = 0; axis < 3; axis++) {
            const uint32_t *near = nodes->harmonic.neighbours[nodes->of[i]] + 2 * axis;
            if (next_node(nodes, i, axis) == HARMONIC_NONE || near[0] == HARMONIC_NONE ||
                nodes->place[near[0]] == HARMONIC_NONE)
                continue;
            const vec3 *W = nodes->harmonic.values;
            vec3 both = vec3_add(W[near[0]], W[near[1]]);
            sum += 0.5 * vec3_length(vec3_add_scaled(both, -2, W[nodes->of[i]]));
            count++;
        }
    return count > 0 ? sum / count : 0;
}

static void report_harmonic(const struct scene_of_lesion *scene, const struct nodes *nodes,
                            struct samples *gains) {
    struct report *report = scene->fidelity->report;
    size_t folds = 0;
    for (size_t i = 0; i < nodes->count; i++) {
        mat3 gradient;
        folds += harmonic_gradient(&nodes->harmonic, nodes->of[i], &gradient) &&
                 mat3_determinant(mat3_add_scaled(mat3_identity(), 1, gradient)) <= 0;
    }
    double h = nodes->spacing_mm;
    report_figure(report, (double)nodes->count, "nodes", "%s/harmonic/%g mm/nodes", scene->name, h);
    report_figure(report, (double)nodes->left_out, "nodes", "%s/harmonic/%g mm/left out",
                  scene->name, h);
    report_figure(report, samples_max(gains), "times", "%s/harmonic/%g mm/gain/max", scene->name,
                  h);
    report_figure(report, samples_quantile(gains, 0.999), "times", "%s/harmonic/%g mm/gain/p99.9",
                  scene->name, h);
    report_figure(report, (double)folds / (double)nodes->count, "share", "%s/harmonic/%g mm/folds",
                  scene->name, h);
    report_figure(report, harmonic_bend(nodes), "mm", "%s/harmonic/%g mm/bend", scene->name, h);
}

static void compare_all(const struct scene_of_lesion *scene, const struct nodes *nodes) {
    vec3 *W = alloc(nodes->count, sizeof *W);
    struct samples gains = {0};
    for (size_t i = 0; i < nodes->count; i++)
        W[i] = nodes->harmonic.values[nodes->of[i]];
    add_gains(nodes, W, &gains);
    report_harmonic(scene, nodes, &gains);
    for (int v = 0; v < VARIANT_COUNT; v++)
        if (fidelity_takes(scene, (enum variant)v))
            compare(scene, (enum variant)v, nodes, W, &gains);
    samples_fini(&gains);
    free(W);
}

// How far the two grids are apart where both have nodes: what the harmonic itself is good for.
static void report_grids(const struct scene_of_lesion *scene, const struct nodes *coarse,
                         const struct nodes *fine) {
    double square = 0, count = 0;
    for (size_t i = 0; i < coarse->count; i++) {
        uint32_t j = harmonic_find(&fine->harmonic, node_at(coarse, i));
        if (j == HARMONIC_NONE)
            continue;
        double off =
            vec3_distance(coarse->harmonic.values[coarse->of[i]], fine->harmonic.values[j]);
        square += off * off;
        count++;
    }
    report_figure(scene->fidelity->report, sqrt(square / count) / fine->largest_mm, "times",
                  "%s/harmonic/%g to %g mm/rms over largest", scene->name, coarse->spacing_mm,
                  fine->spacing_mm);
}

// ---- jumps --------------------------------------------------------------------------------------

struct edge {
    vec3 from, to;
    double change, jump;
};

// Of W from one place to another: how much it changes, and how much of that the derivative, as it
// is at either end, does not account for.
static void judge(struct edge *edge, const struct warp *from, const struct warp *to) {
    vec3 way = vec3_sub(edge->to, edge->from);
    edge->change = vec3_distance(from->displacement, to->displacement);
    edge->jump = edge->change - fmax(vec3_length(mat3_apply(from->gradient, way)),
                                     vec3_length(mat3_apply(to->gradient, way)));
}

static void look_at(const struct scene_of_lesion *scene, enum variant variant, struct edge *edge) {
    struct warp from = variant_warp(scene->anatomy, variant, edge->from);
    struct warp to = variant_warp(scene->anatomy, variant, edge->to);
    judge(edge, &from, &to);
}

static int by_jump(const void *a, const void *b) {
    double x = ((const struct edge *)a)->jump, y = ((const struct edge *)b)->jump;
    return (x < y) - (x > y);
}

static int by_change(const void *a, const void *b) {
    double x = ((const struct edge *)a)->change, y = ((const struct edge *)b)->change;
    return (x < y) - (x > y);
}

// JUMP_MM of an edge, where half after half has more of it (`by`) than the other.
static struct edge narrow(const struct scene_of_lesion *scene, enum variant variant,
                          struct edge edge, int (*by)(const void *, const void *)) {
    while (vec3_distance(edge.from, edge.to) > 2 * JUMP_MM) {
        vec3 middle = vec3_lerp(edge.from, edge.to, 0.5);
        struct edge first = {edge.from, middle, 0, 0}, second = {middle, edge.to, 0, 0};
        look_at(scene, variant, &first);
        look_at(scene, variant, &second);
        edge = by(&first, &second) < 0 ? first : second;
    }
    vec3 half = vec3_scale(JUMP_MM / 2, vec3_unit_or(vec3_sub(edge.to, edge.from), (vec3){0}));
    vec3 middle = vec3_lerp(edge.from, edge.to, 0.5);
    edge.from = vec3_sub(middle, half);
    edge.to = vec3_add(middle, half);
    look_at(scene, variant, &edge);
    return edge;
}

static struct edge *edges_of(const struct scene_of_lesion *scene, enum variant variant,
                             const struct nodes *nodes, size_t *out_count) {
    struct edge *edges = alloc(3 * nodes->count, sizeof *edges);
    struct warp *warps = alloc(nodes->count, sizeof *warps);
    *out_count = 0;
    for (size_t i = 0; i < nodes->count; i++)
        warps[i] = variant_warp(scene->anatomy, variant, node_at(nodes, i));
    for (size_t i = 0; i < nodes->count; i++)
        for (int axis = 0; axis < 3; axis++) {
            uint32_t next = next_node(nodes, i, axis);
            if (next == HARMONIC_NONE)
                continue;
            struct edge *edge = &edges[(*out_count)++];
            *edge = (struct edge){node_at(nodes, i), node_at(nodes, next), 0, 0};
            judge(edge, &warps[i], &warps[next]);
        }
    free(warps);
    return edges;
}

static void measure_jumps(const struct scene_of_lesion *scene, enum variant variant,
                          const struct nodes *nodes) {
    size_t count, looked_into = scene->fidelity->quick ? JUMP_EDGES_QUICK : JUMP_EDGES;
    struct edge *edges = edges_of(scene, variant, nodes, &count);
    double change = 0, jump = 0;
    qsort(edges, count, sizeof *edges, by_change);
    for (size_t i = 0; i < count && i < looked_into; i++)
        change = fmax(change, narrow(scene, variant, edges[i], by_change).change);
    qsort(edges, count, sizeof *edges, by_jump);
    for (size_t i = 0; i < count && i < looked_into; i++)
        jump = fmax(jump, narrow(scene, variant, edges[i], by_jump).jump);
    fidelity_figure(scene, variant, "0.01 mm of hand/change", "mm", change);
    fidelity_figure(scene, variant, "0.01 mm of hand/jump", "mm", jump);
    if (variant == VARIANT_INTEGRAL_SKIN)
        fidelity_worst(scene, WORST_JUMP, jump);
    free(edges);
}

// ---- late replies -------------------------------------------------------------------------------

#define LATE_S 0.020

// What is wrong once the hand has gone on: with the late pose, with the late Δ at the newest pose,
// with the derivative.
struct late {
    struct samples pose, delta, derivative;
};

static void add_late(const struct scene_of_lesion *scene, enum variant variant, vec3 sent, vec3 way,
                     struct late *out) {
    struct warp warp = variant_warp(scene->anatomy, variant, sent);
    vec3 now = variant_warp(scene->anatomy, variant, vec3_add(sent, way)).displacement;
    vec3 off = vec3_sub(now, warp.displacement);
    double trusted = fmin(1, warp.trust_radius_mm / vec3_length(way));
    vec3 foreseen = mat3_apply(warp.gradient, vec3_scale(trusted, way));
    samples_add(&out->pose, vec3_length(vec3_add(off, way)));
    samples_add(&out->delta, vec3_length(off));
    samples_add(&out->derivative, vec3_distance(off, foreseen));
}

static bool is_free(const struct scene_of_lesion *scene, vec3 from, vec3 way) {
    const struct anatomy *a = scene->anatomy;
    return anatomy_reaches(&a->scene, a->hollow, vec3_add_scaled(from, 0.5, way)) &&
           anatomy_reaches(&a->scene, a->hollow, vec3_add(from, way));
}

static void measure_late(const struct scene_of_lesion *scene, enum variant variant,
                         const struct nodes *nodes, double speed_mm_s) {
    struct random r = {scene->seed};
    struct late late = {0};
    char what[64];
    int count = scene->fidelity->quick ? 500 : 4000;
    for (int i = 0; i < count; i++) {
        vec3 sent = node_at(nodes, random_bits(&r) % nodes->count);
        vec3 way = vec3_scale(speed_mm_s * LATE_S, random_direction(&r));
        if (is_free(scene, sent, way))
            add_late(scene, variant, sent, way, &late);
    }
    snprintf(what, sizeof what, "late at %g mm/s/pose", speed_mm_s);
    fidelity_samples(scene, variant, what, "mm", &late.pose);
    snprintf(what, sizeof what, "late at %g mm/s/delta", speed_mm_s);
    fidelity_samples(scene, variant, what, "mm", &late.delta);
    snprintf(what, sizeof what, "late at %g mm/s/derivative", speed_mm_s);
    fidelity_samples(scene, variant, what, "mm", &late.derivative);
    bool counts = variant == VARIANT_INTEGRAL_SKIN && scene->lesion <= LESION_UNDER_MENISCUS &&
                  speed_mm_s == 25;
    for (size_t i = 0; counts && i < late.derivative.count; i++)
        samples_add(&scene->fidelity->late, late.derivative.values[i]);
    samples_fini(&late.pose);
    samples_fini(&late.delta);
    samples_fini(&late.derivative);
}

void fidelity_fields(const struct scene_of_lesion *scene) {
    struct nodes coarse, fine;
    bool quick = scene->fidelity->quick;
    double least_mm = quick ? 0.5 : 0.25;
    nodes_init(&coarse, scene->anatomy, 4 * least_mm);
    nodes_init(&fine, scene->anatomy, 2 * least_mm);
    while (fine.count < ENOUGH_NODES && fine.spacing_mm > least_mm) {
        double half = fine.spacing_mm / 2;
        nodes_fini(&coarse);
        coarse = fine;
        nodes_init(&fine, scene->anatomy, half);
    }
    fine.is_finest = true;
    report_grids(scene, &coarse, &fine);
    if (coarse.count)
        compare_all(scene, &coarse);
    if (fine.count) {
        compare_all(scene, &fine);
        for (int v = quick ? VARIANT_INVERSE : 0; v < VARIANT_COUNT; v++) {
            if (!fidelity_takes(scene, (enum variant)v))
                continue;
            measure_jumps(scene, (enum variant)v, &fine);
            measure_late(scene, (enum variant)v, &fine, 25);
            measure_late(scene, (enum variant)v, &fine, 100);
        }
    }
    nodes_fini(&coarse);
    nodes_fini(&fine);
}
