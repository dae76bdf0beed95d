#include "conform_body.h"

#include "cutting/crossings.h"
#include "generate/tube.h"
#include "match/mismatch.h"
#include "scene/shapes.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

// ---- tissue -------------------------------------------------------------------------------------

// way_mm: by which S'_max moves each vertex.
static void body_take(struct body *b, struct mesh mesh, double way_mm) {
    struct error err;
    b->whole = mesh;
    b->maxcut = calloc(3 * (size_t)mesh.vertex_count, sizeof *b->maxcut);
    for (uint32_t v = 0; v < mesh.vertex_count; v++)
        b->maxcut[3 * (size_t)v] = (float)way_mm;
    b->surface = match_surface_create(&b->whole, NULL, b->maxcut);
    b->conform = conform_create(b->surface);
    assert_ok(cut_mesh_create(&b->whole, &b->cut, &err));
}

void body_sphere(struct body *b, int n) {
    struct mesh mesh;
    shape_sphere(&mesh, 6, n);
    body_take(b, mesh, 0);
}

void body_giving_meniscus(struct body *b, double way_mm) {
    struct mesh mesh;
    assert_true(tube_meniscus(false, 2360, 1.2, &mesh));
    body_take(b, mesh, way_mm);
}

void body_meniscus(struct body *b) {
    body_giving_meniscus(b, 0);
}

void body_lens(struct body *b, int n) {
    struct mesh mesh;
    shape_sphere(&mesh, 6, n);
    for (uint32_t v = 0; v < mesh.vertex_count; v++)
        mesh.positions[3 * (size_t)v + 2] *= 0.15F;
    body_take(b, mesh, 0);
}

void body_fini(struct body *b) {
    conform_destroy(&b->conform);
    match_surface_destroy(&b->surface);
    cut_mesh_destroy(&b->cut);
    mesh_fini(&b->whole);
    free(b->maxcut);
}

// ---- cuts ---------------------------------------------------------------------------------------

static struct convex cuboid(vec3 centre, quat turn, struct random *r) {
    struct plane planes[6];
    struct convex convex;
    struct error err;
    for (int i = 0; i < 6; i++) {
        vec3 axis = {i / 2 == 0, i / 2 == 1, i / 2 == 2};
        vec3 normal = quat_rotate(turn, vec3_scale(i % 2 ? 1 : -1, axis));
        planes[i] = (struct plane){normal, vec3_dot(normal, centre) + random_between(r, 0.6, 1.6)};
    }
    assert_ok(convex_create(planes, 6, &convex, &err));
    return convex;
}

void cut_state_fini(struct cut_state *state) {
    mesh_fini(&state->mesh);
    free(state->fresh);
}

static bool is_made(const struct cut_change *change, uint32_t id) {
    for (uint32_t i = 0; i < change->made_count; i++)
        if (change->made[i] == id)
            return true;
    return false;
}

// False where it changed nothing.
static bool take(struct body *b, const struct convex *part, struct cut_state *out) {
    struct cut_change change = {0};
    struct error err;
    uint32_t *ids;
    if (cut_apply(b->cut, part, 1, &change, &err) != CUT_CHANGED)
        return false;
    cut_mesh_flatten(b->cut, &out->mesh, NULL, &ids);
    out->fresh = calloc(out->mesh.triangle_count, sizeof *out->fresh);
    for (uint32_t i = 0; i < out->mesh.triangle_count; i++)
        out->fresh[i] = cut_mesh_label(b->cut, ids[i]) && is_made(&change, ids[i]);
    out->volume = change.volume_mm3;
    free(ids);
    cut_change_fini(&change);
    return true;
}

bool body_bite(struct body *b, struct random *r, struct cut_state *out) {
    struct mesh before;
    cut_mesh_flatten(b->cut, &before, NULL, NULL);
    vec3 at = mesh_vertex(&before, (uint32_t)(random_bits(r) % before.vertex_count));
    struct convex part = cuboid(at, random_pose(r, 0).rotation, r);
    mesh_fini(&before);
    return take(b, &part, out);
}

void body_take_section(struct body *b, struct cut_state *out) {
    struct plane planes[6] = {{{1, 0, 0}, 60}, {{-1, 0, 0}, 60}, {{0, 1, 0}, 8},
                              {{0, -1, 0}, 2}, {{0, 0, 1}, 60},  {{0, 0, -1}, 60}};
    struct convex section;
    struct error err;
    assert_ok(convex_create(planes, 6, &section, &err));
    assert_true(take(b, &section, out));
}

static struct conform_report follow_by(struct conform *conform, const struct cut_state *state,
                                       bool lays, bool quickly) {
    struct conform_target target = {&state->mesh, state->fresh, state->volume, lays, quickly};
    struct conform_report report;
    conform_to(conform, &target, &report);
    return report;
}

struct conform_report follow(struct conform *conform, const struct cut_state *state, bool lays) {
    return follow_by(conform, state, lays, true);
}

struct conform_report follow_thoroughly(struct conform *conform, const struct cut_state *state) {
    return follow_by(conform, state, false, false);
}

// ---- oracles ------------------------------------------------------------------------------------

static void touched_of(const struct body *b, struct snapshot *out) {
    snapshot_of_mesh(&b->whole, out);
    for (uint32_t v = 0; v < b->whole.vertex_count; v++)
        out->vertices[v] = conform_vertex(b->conform, v);
}

int body_crossings(const struct body *b) {
    struct snapshot touched;
    touched_of(b, &touched);
    int count = snapshot_crossings(&touched);
    snapshot_fini(&touched);
    return count;
}

double body_volume(const struct body *b) {
    struct snapshot touched;
    touched_of(b, &touched);
    double volume = snapshot_volume(&touched);
    snapshot_fini(&touched);
    return volume;
}

bool same_bits(const struct conform *a, const struct conform *b, uint32_t count) {
    for (uint32_t v = 0; v < count; v++) {
        vec3 p = conform_vertex(a, v), q = conform_vertex(b, v);
        if (memcmp(&p, &q, sizeof p) != 0)
            return false;
    }
    return true;
}

double body_apart_mm3(const struct body *b, const struct cut_state *state, bool fitted) {
    struct mesh touched;
    struct mismatch m;
    mesh_copy(&touched, &b->whole);
    for (uint32_t v = 0; fitted && v < touched.vertex_count; v++)
        mesh_set_vertex(&touched, v, conform_vertex(b->conform, v));
    mismatch_measure(
        &(struct mismatch_setting){.touched = &state->mesh, .tissue = &touched, .step_mm = 0.1},
        &m);
    mesh_fini(&touched);
    return m.touched_mm3 + m.seen_mm3;
}
