#include "cutting/trial.h"

#include "base/check.h"
#include "base/clock.h"
#include "cutting/inside.h"

#include <time.h>

// A vertex may merge with one nearer than 1e-3 mm: that near to a surface anything may be.
#define UNSURE_MM 2e-3

void trial_init(struct trial *trial, const struct mesh *mesh) {
    *trial = (struct trial){.original = mesh->vertex_count};
    CHECK(cut_mesh_create(mesh, &trial->mesh, &trial->err) == RESULT_OK);
    snapshot_of_cut(trial->mesh, &trial->now);
}

void trial_fini(struct trial *trial) {
    cut_mesh_destroy(&trial->mesh);
    cut_change_fini(&trial->change);
    snapshot_fini(&trial->before);
    snapshot_fini(&trial->now);
}

static const char *fault_of(const struct trial *trial, const struct convex *parts, int part_count) {
    if (trial->outcome != CUT_CHANGED)
        return snapshot_equals(&trial->before, &trial->now)
                   ? NULL
                   : "a cut without change changed the mesh";
    struct cut_tried tried = {.before = &trial->before,
                              .after = &trial->now,
                              .volume_before = trial->volume_before,
                              .original = trial->original,
                              .parts = parts,
                              .part_count = part_count};
    return change_fault(&tried, trial->mesh, &trial->change);
}

static int64_t thread_now_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return NS_PER_S * now.tv_sec + now.tv_nsec;
}

void trial_cut(struct trial *trial, const struct convex *parts, int part_count) {
    cut_change_fini(&trial->change);
    snapshot_fini(&trial->before);
    trial->before = trial->now;
    trial->volume_before = snapshot_volume(&trial->before);
    int64_t own_start = thread_now_ns(), start = clock_now_ns();
    trial->outcome = cut_apply(trial->mesh, parts, part_count, &trial->change, &trial->err);
    trial->took_ns = clock_now_ns() - start;
    trial->own_ns = thread_now_ns() - own_start;
    snapshot_of_cut(trial->mesh, &trial->now);
    trial->fault = fault_of(trial, parts, part_count);
}

static bool in_a_piece(const struct cut_change *change, vec3 p) {
    bool inside = false;
    for (int i = 0; i < change->piece_count && !inside; i++) {
        struct snapshot surface;
        snapshot_of_mesh(&change->pieces[i].mesh, &surface);
        inside = winding_inside(&surface, p);
        snapshot_fini(&surface);
    }
    return inside;
}

const char *trial_points_fault(const struct trial *trial, const struct convex *parts,
                               int part_count, int points, struct random *random, int *inside) {
    vec3 margin = {0.3, 0.3, 0.3};
    struct box box = parts_box(parts, part_count);
    box = (struct box){vec3_sub(box.min, margin), vec3_add(box.max, margin)};
    for (int i = 0; i < points; i++) {
        vec3 p = point_in_box(random, box);
        bool was = winding_inside(&trial->before, p);
        bool due = was && !parts_contain(parts, part_count, p);
        bool is = winding_inside(&trial->now, p) || in_a_piece(&trial->change, p);
        *inside += was;
        if (due != is && parts_clearance(parts, part_count, p) > UNSURE_MM &&
            snapshot_distance(&trial->before, p) > UNSURE_MM)
            return due ? "tissue that no part holds is missing" : "tissue is where a part was";
    }
    return NULL;
}
