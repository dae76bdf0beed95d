#include "cut/change.h"
#include "cut/clean.h"
#include "cut/edit.h"
#include "cut/stage.h"

#define LEAST_MM3 1e-4

static bool stage_part(struct cut_mesh *mesh, const struct convex *part, uint64_t seed,
                       int attempt) {
    struct stage *stage = mesh->scratch->stage;
    stage_begin(stage, part, seed, attempt);
    near_gather(mesh, stage);
    trace_triangles(mesh, stage);
    return wind_blade(mesh, stage) && cap_faces(mesh, stage) && fill_regions(mesh, stage) &&
           link_triangles(mesh, stage);
}

// A part that takes next to nothing is left out. *taken: mm³, of all parts so far.
static bool take_part(struct cut_mesh *mesh, const struct convex *part, int index,
                      struct cut_change *change, double *taken) {
    for (int attempt = 0; attempt < CUT_ATTEMPTS; attempt++) {
        struct vertex_mark mark = edit_mark_vertices(mesh);
        uint64_t seed =
            ((uint64_t)change->number << 16) + (uint64_t)(CUT_ATTEMPTS * index + attempt);
        bool fits = stage_part(mesh, part, seed, attempt);
        if (fits && mesh->scratch->stage->removed_mm3 >= LEAST_MM3 / CUT_PARTS_MAX) {
            link_commit(mesh, mesh->scratch->stage);
            *taken += mesh->scratch->stage->removed_mm3;
            return true;
        }
        edit_return_vertices(mesh, mark);
        if (fits)
            return true;
        change->retries++;
    }
    return false;
}

static double pieces_volume(const struct cut_change *change) {
    double sum = 0;
    for (int i = 0; i < change->piece_count; i++)
        sum += change->pieces[i].volume;
    return sum;
}

static enum cut_outcome give_up(struct cut_mesh *mesh, enum cut_outcome outcome) {
    edit_undo(mesh);
    return outcome;
}

static enum cut_outcome apply(struct cut_mesh *mesh, const struct convex *parts, int part_count,
                              struct cut_change *out_change, struct error *err) {
    struct cut_change change = {.number = mesh->number + 1};
    double before = mesh->volume, taken = 0;
    mesh->scratch->stage->number = change.number;
    edit_begin(mesh);
    for (int i = 0; i < part_count; i++)
        if (!take_part(mesh, &parts[i], i, &change, &taken)) {
            fail(err, RESULT_REFUSED, "part %d of the blade: %s", i, mesh->scratch->stage->refusal);
            return give_up(mesh, CUT_REFUSED);
        }
    if (taken < LEAST_MM3)
        return give_up(mesh, CUT_NOTHING);
    if (!mesh->living) {
        fail(err, RESULT_REFUSED, "the blade takes all that there is");
        return give_up(mesh, CUT_REFUSED);
    }
    mesh->number = change.number;
    clean(mesh);
    change_update_volume(mesh);
    change_take_pieces(mesh, &change);
    change.volume_mm3 = mesh->volume;
    change.removed_mm3 = before - mesh->volume - pieces_volume(&change);
    change_list_ids(mesh, &change);
    change_measure_patches(mesh, &change);
    edit_commit(mesh);
    *out_change = change;
    return CUT_CHANGED;
}

enum cut_outcome cut_apply(struct cut_mesh *mesh, const struct convex *parts, int part_count,
                           struct cut_change *out_change, struct error *err) {
    CHECK(part_count >= 0 && part_count <= CUT_PARTS_MAX);
    mesh->scratch = scratch_take();
    enum cut_outcome outcome = apply(mesh, parts, part_count, out_change, err);
    scratch_give(&mesh->scratch);
    return outcome;
}
