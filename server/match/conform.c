#include "match/conform.h"

#include "base/check.h"
#include "match/conform_parts.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define TOLERANCE 1e-12 // of the whole volume

static const struct conform_plan thorough = {
    .beside_mm = 2,
    .pass_count = 5,
    .passes = {{3, 1e-8, 4}, {1.28, 1e-8, 4}, {0.55, 1e-8, 4}, {0.23, 1e-8, 4}, {0.1, 1e-8, 4}},
    .soft = {0.03, 1e-8, 4},
    .way_energy = 1e-8,
};

// The middles of triangles tell enough until a repair, and a rough solution does.
static const struct conform_plan quick = {
    .beside_mm = 1,
    .beside_edges = 2,
    .pass_count = 4,
    .passes = {{1, 1e-2, 1}, {0.37, 1e-2, 1}, {0.136, 1e-2, 1}, {0.05, 1e-3, 1}},
    .soft = {0.03, 1e-3, 4},
    .way_energy = 1e-2,
};

// ---- life ---------------------------------------------------------------------------------------

#define NEW(array, count) ((array) = alloc((count), sizeof *(array)))
// Undefined until a call fills it: what no call needs costs no page.
#define SCRATCH(array, count) ((array) = alloc_resize(NULL, (count), sizeof *(array)))

static void create_by_vertex(struct conform *c, uint32_t count) {
    NEW(c->positions, count);
    NEW(c->dirty, count);
    NEW(c->before, count);
    NEW(c->dirty_before, count);
    NEW(c->laid, count);
    NEW(c->laid_before, count);
    SCRATCH(c->sound, count);
    SCRATCH(c->kept, count);
    NEW(c->factor, count);
    SCRATCH(c->normals, count);
    NEW(c->slot, count);
    NEW(c->trust, count);
    NEW(c->bend, count);
    NEW(c->reach, count);
    NEW(c->ring, count);
    NEW(c->tied, count);
    NEW(c->off, count);
    NEW(c->moves, count);
    SCRATCH(c->active, count);
    SCRATCH(c->changed, count);
    SCRATCH(c->queue, count);
    SCRATCH(c->first, (size_t)count + 1);
    SCRATCH(c->diagonal, count);
    SCRATCH(c->inverse, count);
    SCRATCH(c->bending, count);
    SCRATCH(c->diagonal_columns, count);
    SCRATCH(c->inverse_columns, count);
    SCRATCH(c->bending_columns, count);
    SCRATCH(c->solution, count);
    SCRATCH(c->others, count);
    SCRATCH(c->gradient, count);
    SCRATCH(c->step, count);
    SCRATCH(c->along, count);
    SCRATCH(c->residual, count);
    SCRATCH(c->preconditioned, count);
    SCRATCH(c->direction, count);
    SCRATCH(c->product, count);
    SCRATCH(c->bent, count);
}

struct conform *conform_create(const struct match_surface *surface) {
    struct conform *c = alloc(1, sizeof *c);
    c->surface = surface;
    create_by_vertex(c, surface->vertex_count);
    NEW(c->live_of, surface->triangle_count);
    SCRATCH(c->live, surface->triangle_count);
    SCRATCH(c->near, surface->triangle_count);
    SCRATCH(c->beside, surface->triangle_count);
    SCRATCH(c->self_of, surface->triangle_count);
    SCRATCH(c->pulls, PULLS_PER_TRIANGLE * (size_t)surface->triangle_count);
    SCRATCH(c->rows, surface->triangle_count);
    memcpy(c->positions, surface->start, surface->vertex_count * sizeof *c->positions);
    memcpy(c->before, surface->start, surface->vertex_count * sizeof *c->before);
    return c;
}

struct conform *conform_copy(const struct conform *conform) {
    struct conform *copy = conform_create(conform->surface);
    uint32_t count = conform->surface->vertex_count;
    memcpy(copy->positions, conform->positions, count * sizeof *copy->positions);
    memcpy(copy->dirty, conform->dirty, count * sizeof *copy->dirty);
    memcpy(copy->laid, conform->laid, count * sizeof *copy->laid);
    memcpy(copy->laid_before, copy->laid, count * sizeof *copy->laid_before);
    memcpy(copy->before, copy->positions, count * sizeof *copy->before);
    memcpy(copy->dirty_before, copy->dirty, count * sizeof *copy->dirty_before);
    return copy;
}

static void free_all(void *const *arrays, size_t count) {
    for (size_t i = 0; i < count; i++)
        free(arrays[i]);
}

static void destroy_system(struct conform *c) {
    void *const arrays[] = {c->first,
                            c->columns,
                            c->blocks,
                            c->diagonal,
                            c->inverse,
                            c->bending,
                            c->gradient,
                            c->step,
                            c->along,
                            c->bent,
                            c->block_columns,
                            c->diagonal_columns,
                            c->inverse_columns,
                            c->bending_columns,
                            c->solution,
                            c->residual,
                            c->preconditioned,
                            c->direction,
                            c->product,
                            c->others,
                            c->rows};
    free_all(arrays, sizeof arrays / sizeof arrays[0]);
}

void conform_destroy(struct conform **conform) {
    struct conform *c = *conform;
    if (!c)
        return;
    void *const arrays[] = {
        c->positions, c->dirty,    c->dirty_before, c->before,      c->sound, c->kept,   c->factor,
        c->normals,   c->slot,     c->trust,        c->bend,        c->reach, c->ring,   c->tied,
        c->active,    c->changed,  c->queue,        c->live_of,     c->live,  c->near,   c->pulls,
        c->samples,   c->contacts, c->laid,         c->laid_before, c->moves, c->beside, c->self_of,
        c->across,    c->off,      c->parts,        c->firsts};
    free_all(arrays, sizeof arrays / sizeof arrays[0]);
    destroy_system(c);
    soup_fini(&c->target);
    soup_fini(&c->self);
    soup_fini(&c->whole_target);
    films_before_fini(&c->films);
    free(c);
    *conform = NULL;
}

vec3 conform_vertex(const struct conform *conform, uint32_t vertex) {
    CHECK(vertex < conform->surface->vertex_count);
    return conform->positions[vertex];
}

const vec3 *conform_vertices(const struct conform *conform) {
    return conform->positions;
}

void conform_place(struct conform *conform, uint32_t vertex, vec3 place) {
    CHECK(vertex < conform->surface->vertex_count);
    conform->positions[vertex] = place;
    conform->has_volume = false;
}

double conform_volume(struct conform *conform) {
    if (!conform->has_volume)
        conform->volume = surface_volume(conform->surface, conform->positions);
    conform->has_volume = true;
    return conform->volume;
}

// ---- a cut --------------------------------------------------------------------------------------

static void report_changes(struct conform *c, struct conform_report *out) {
    for (uint32_t v = 0; v < c->surface->vertex_count; v++)
        if (memcmp(&c->positions[v], &c->before[v], sizeof c->positions[v]) != 0)
            c->changed[out->changed_count++] = v;
}

static void fit(struct conform *c, const struct conform_goal *goal, struct conform_report *out) {
    const struct conform_plan *plan = c->plan;
    for (uint32_t v = 0; v < c->surface->vertex_count; v++) {
        c->trust[v] = 1;
        c->bend[v] = 0;
    }
    conform_begin_system(c);
    conform_take_samples(c);
    for (int i = 0; i < plan->pass_count; i++)
        conform_advance(c, &plan->passes[i], i + 1 == plan->pass_count ? goal : NULL);
    conform_untangle(c, goal, out);
}

void conform_to(struct conform *conform, const struct conform_target *target,
                struct conform_report *out_report) {
    struct conform *c = conform;
    CHECK(isfinite(target->volume_mm3));
    c->plan = target->quickly ? &quick : &thorough;
    memcpy(c->before, c->positions, c->surface->vertex_count * sizeof *c->before);
    memcpy(c->sound, c->positions, c->surface->vertex_count * sizeof *c->sound);
    memcpy(c->dirty_before, c->dirty, c->surface->vertex_count * sizeof *c->dirty_before);
    memcpy(c->laid_before, c->laid, c->surface->vertex_count * sizeof *c->laid_before);
    *out_report = (struct conform_report){.changed = c->changed};
    if (target->lays && conform_lay(c, target->mesh))
        c->has_volume = false;
    double volume = conform_volume(c), wanted = target->volume_mm3 + conform_sheet(c);
    c->active_count = c->live_count = 0;
    if (conform_gather(c, target)) {
        conform_make_self(c);
        conform_seed(c);
        conform_activate(c);
    }
    if (c->active_count) {
        struct conform_goal goal = {conform_live_volume(c) + wanted - volume,
                                    TOLERANCE * c->surface->volume};
        fit(c, &goal, out_report);
        c->has_volume = false;
    }
    report_changes(c, out_report);
    out_report->volume_mm3 = conform_volume(c);
    out_report->sheet_mm3 = conform_sheet(c);
    out_report->active_count = c->active_count;
    out_report->left_mm3 = out_report->volume_mm3 - target->volume_mm3;
}

// ---- back ---------------------------------------------------------------------------------------

static bool has_changed(const struct conform *c, uint32_t v) {
    return c->dirty[v] != c->dirty_before[v] || c->laid[v] != c->laid_before[v] ||
           memcmp(&c->positions[v], &c->before[v], sizeof c->positions[v]) != 0;
}

void conform_past(const struct conform *conform, struct conform_past *out_past) {
    uint32_t count = 0;
    for (uint32_t v = 0; v < conform->surface->vertex_count; v++)
        count += has_changed(conform, v);
    *out_past = (struct conform_past){0};
    NEW(out_past->vertices, count);
    NEW(out_past->positions, count);
    NEW(out_past->dirty, count);
    NEW(out_past->laid, count);
    for (uint32_t v = 0; v < conform->surface->vertex_count; v++) {
        if (!has_changed(conform, v))
            continue;
        out_past->vertices[out_past->count] = v;
        out_past->positions[out_past->count] = conform->before[v];
        out_past->laid[out_past->count] = conform->laid_before[v];
        out_past->dirty[out_past->count++] = conform->dirty_before[v];
    }
}

void conform_past_fini(struct conform_past *past) {
    free(past->vertices);
    free(past->positions);
    free(past->dirty);
    free(past->laid);
    *past = (struct conform_past){0};
}

void conform_take_back(struct conform *conform, const struct conform_past *past) {
    conform->has_volume = false;
    for (uint32_t i = 0; i < past->count; i++) {
        CHECK(past->vertices[i] < conform->surface->vertex_count);
        conform->positions[past->vertices[i]] = past->positions[i];
        conform->dirty[past->vertices[i]] = past->dirty[i];
        conform->laid[past->vertices[i]] = past->laid[i];
    }
}
