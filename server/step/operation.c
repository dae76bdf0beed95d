#include "step/operation.h"

#include "base/check.h"
#include "mesh/query.h"
#include "step/scene_parts.h"

#include <stdlib.h>
#include <string.h>
#include <xxhash.h>

#define PROBES_MAX 32 // points of a cut's surface whose distance to the warped surface is measured
#define NEAR_MM 4.0

// A state is kept before a stroke when so many cuts have been made since the last one; the newest
// few stay.
#define CHECKPOINT_EVERY 32
#define CHECKPOINTS_MAX 2

// Tissue as far as it is cut.
struct tissue_state {
    struct cut_mesh *mesh;
    struct match *match; // NULL where the group has no S'_max
    struct quality *quality;
    struct tissue_figures figures;
};

// A cut that changed the tissue.
struct past_cut {
    uint64_t number; // counts all cuts of the operation
    uint32_t stroke;
    struct blade_move move;
    struct tissue_figures before;
};

struct checkpoint {
    uint32_t cuts; // that were made by then; 0: nothing is kept
    struct tissue_state state;
};

struct operated_tissue {
    const struct scene_tissue *scene;
    const struct case_group *group;
    struct tissue_state now;
    struct past_cut *cuts; // since it was whole
    uint32_t cut_count, cut_room;
    struct checkpoint checkpoints[CHECKPOINTS_MAX]; // the newest first
};

struct operation {
    int count;
    uint64_t cuts; // so many were made, undone ones too
    struct operated_tissue tissues[TISSUES_MAX];
};

// ---- whole tissue -------------------------------------------------------------------------------

static struct tissue_state whole(const struct operated_tissue *t, uint32_t mesh_number) {
    struct tissue_state r = {
        .mesh = cut_mesh_copy(t->scene->mesh),
        .match = t->scene->match ? match_create(t->scene->match) : NULL,
        .quality = quality_create(t->scene->plan),
    };
    r.figures = (struct tissue_figures){
        .mesh_number = mesh_number,
        .volume_mm3 = cut_mesh_volume(r.mesh),
        .warped_mm3 = r.match ? match_volume(r.match) : 0,
    };
    quality_report(r.quality, &r.figures.quality);
    return r;
}

static struct tissue_state copy_of(const struct tissue_state *r) {
    return (struct tissue_state){
        .mesh = cut_mesh_copy(r->mesh),
        .match = r->match ? match_copy(r->match) : NULL,
        .quality = quality_copy(r->quality),
        .figures = r->figures,
    };
}

static void release(struct tissue_state *r) {
    cut_mesh_destroy(&r->mesh);
    match_destroy(&r->match);
    quality_destroy(&r->quality);
}

static void drop(struct checkpoint *checkpoint) {
    if (checkpoint->cuts)
        release(&checkpoint->state);
    checkpoint->cuts = 0;
}

static void forget_cuts(struct operated_tissue *t) {
    for (int i = 0; i < CHECKPOINTS_MAX; i++)
        drop(&t->checkpoints[i]);
    free(t->cuts);
    t->cuts = NULL;
    t->cut_count = t->cut_room = 0;
}

struct operation *operation_create(const struct scene *scene) {
    struct operation *operation = alloc(1, sizeof *operation);
    operation->count = scene->tissue_count;
    for (int i = 0; i < operation->count; i++) {
        struct operated_tissue *t = &operation->tissues[i];
        t->scene = &scene->tissues[i];
        t->group = &scene->knee->groups[t->scene->group];
        t->now = whole(t, 1);
    }
    return operation;
}

void operation_destroy(struct operation **operation) {
    if (!*operation)
        return;
    for (int i = 0; i < (*operation)->count; i++) {
        release(&(*operation)->tissues[i].now);
        forget_cuts(&(*operation)->tissues[i]);
    }
    free(*operation);
    *operation = NULL;
}

static void take_blend(struct job_result *result, uint32_t vertex, double blend) {
    result->vertices[result->blend_count] = vertex;
    result->blends[result->blend_count++] = blend;
}

static void make_room(struct job_result *result, uint32_t count) {
    result->vertices = alloc(count, sizeof *result->vertices);
    result->blends = alloc(count, sizeof *result->blends);
}

static void restore(struct operated_tissue *t, struct job_result *result) {
    uint32_t number = t->now.figures.mesh_number + 1;
    release(&t->now);
    forget_cuts(t);
    t->now = whole(t, number);
    if (!t->now.match)
        return;
    make_room(result, t->group->mesh.vertex_count);
    for (uint32_t i = 0; i < t->group->mesh.vertex_count; i++)
        take_blend(result, i, 0);
}

// ---- a cut --------------------------------------------------------------------------------------

// What the tissue's own volume lost, S'' is to lose too.
static void match_cut(struct operated_tissue *t, const struct cut_change *change,
                      struct job_result *result) {
    double gone = t->now.figures.removed_mm3 + t->now.figures.pieces_mm3;
    t->now.figures.left_mm3 = gone;
    if (!t->now.match)
        return;
    struct brush *brushes = alloc((size_t)change->patch_count + 1, sizeof *brushes);
    for (int i = 0; i < change->patch_count; i++)
        brushes[i] = (struct brush){change->patches[i].centroid, change->patches[i].extent};
    struct match_report report;
    match_to_volume(t->now.match, brushes, change->patch_count,
                    match_surface_volume(t->scene->match) - gone, &report);
    free(brushes);
    t->now.figures.warped_mm3 = report.volume_mm3;
    t->now.figures.left_mm3 = report.left_mm3;
    make_room(result, report.changed_count);
    for (uint32_t i = 0; i < report.changed_count; i++)
        take_blend(result, report.changed[i], match_blends(t->now.match)[report.changed[i]]);
}

// Whether a triangle may come within reach of the cut's new surface: false only where it does not.
static bool may_reach(const struct mesh *mesh, const uint32_t corners[3],
                      const struct cut_change *change, double reach_mm) {
    vec3 a = mesh_vertex(mesh, corners[0]);
    double size = fmax(vec3_distance(a, mesh_vertex(mesh, corners[1])),
                       vec3_distance(a, mesh_vertex(mesh, corners[2])));
    for (int k = 0; k < change->patch_count; k++) {
        const struct cut_patch *patch = &change->patches[k];
        if (vec3_distance(a, patch->centroid) <= size + patch->extent + reach_mm)
            return true;
    }
    return false;
}

// The triangles of S'' within reach of the cut's new surface, and others that are not far.
static void near_triangles(const struct operated_tissue *t, const struct cut_change *change,
                           double reach_mm, struct mesh *out_mesh) {
    const struct mesh *mesh = &t->group->mesh;
    mesh_init(out_mesh, mesh->vertex_count, mesh->triangle_count);
    for (uint32_t i = 0; i < mesh->vertex_count; i++)
        mesh_set_vertex(out_mesh, i, match_vertex(t->now.match, i));
    out_mesh->triangle_count = 0;
    for (uint32_t i = 0; i < mesh->triangle_count; i++) {
        const uint32_t *corners = mesh->triangles + 3 * (size_t)i;
        if (may_reach(out_mesh, corners, change, reach_mm))
            memcpy(out_mesh->triangles + 3 * (size_t)out_mesh->triangle_count++, corners,
                   3 * sizeof *corners);
    }
}

// The largest distance of points of the cut's new surface to S'', exact where it is within reach.
static double distance_within(const struct operated_tissue *t, const struct cut_change *change,
                              double reach_mm) {
    struct mesh warped;
    double largest = 0;
    near_triangles(t, change, reach_mm, &warped);
    uint32_t stride = 1 + change->vertex_count / PROBES_MAX;
    for (uint32_t i = 0; i < change->vertex_count; i += stride) {
        double nearest = INFINITY;
        for (uint32_t k = 0; k < warped.triangle_count; k++) {
            struct closest closest;
            closest_on_triangle(&warped, k, cut_mesh_vertex(t->now.mesh, change->vertices[i]),
                                &closest);
            nearest = fmin(nearest, closest.distance);
        }
        largest = fmax(largest, nearest);
    }
    mesh_fini(&warped);
    return largest;
}

static double distance_to_warped(const struct operated_tissue *t, const struct cut_change *change) {
    if (!change->patch_count)
        return 0;
    double distance_mm = distance_within(t, change, NEAR_MM);
    return distance_mm <= NEAR_MM ? distance_mm : distance_within(t, change, INFINITY);
}

static void count_cut(struct operated_tissue *t, const struct cut_change *change) {
    struct tissue_figures *f = &t->now.figures;
    f->mesh_number++;
    f->cuts++;
    f->volume_mm3 = change->volume_mm3;
    f->removed_mm3 += change->removed_mm3;
    for (int i = 0; i < change->piece_count; i++)
        f->pieces_mm3 += change->pieces[i].volume;
    f->pieces += (uint32_t)change->piece_count;
}

// What undoing makes again: all but the figures of the resection.
static void take_out(struct operated_tissue *t, const struct blade_move *move,
                     struct job_result *result) {
    static const enum job_outcome outcomes[] = {
        [CUT_CHANGED] = JOB_DONE, [CUT_NOTHING] = JOB_NOTHING, [CUT_REFUSED] = JOB_REFUSED};
    struct convex *parts = alloc(CUT_PARTS_MAX, sizeof *parts);
    struct cut_change *change = &result->change;
    int count = blade_parts(move, parts, &result->why);
    result->outcome = count < 0 ? JOB_REFUSED : JOB_NOTHING;
    if (count > 0)
        result->outcome = outcomes[cut_apply(t->now.mesh, parts, count, change, &result->why)];
    if (result->outcome == JOB_DONE) {
        count_cut(t, change);
        match_cut(t, change, result);
        quality_take_parts(t->now.quality, parts, count);
        for (int i = 0; i < change->piece_count; i++)
            quality_take_piece(t->now.quality, &change->pieces[i].mesh);
    }
    free(parts);
}

static void note_cut(struct operated_tissue *t, const struct past_cut *cut) {
    if (t->cut_count == t->cut_room) {
        t->cut_room = 2 * t->cut_room + 64;
        t->cuts = alloc_resize(t->cuts, t->cut_room, sizeof *t->cuts);
    }
    t->cuts[t->cut_count++] = *cut;
}

// After so many cuts, before one of that stroke.
static void keep(struct operated_tissue *t, uint32_t cuts, uint32_t stroke) {
    if (cuts < t->checkpoints[0].cuts + CHECKPOINT_EVERY || t->cuts[cuts - 1].stroke == stroke)
        return;
    drop(&t->checkpoints[CHECKPOINTS_MAX - 1]);
    memmove(t->checkpoints + 1, t->checkpoints, (CHECKPOINTS_MAX - 1) * sizeof *t->checkpoints);
    t->checkpoints[0] = (struct checkpoint){cuts, copy_of(&t->now)};
}

static void tell_blends(const struct match *before, const struct operated_tissue *t,
                        struct job_result *result) {
    if (!before)
        return;
    make_room(result, t->group->mesh.vertex_count);
    for (uint32_t i = 0; i < t->group->mesh.vertex_count; i++)
        if (match_blends(t->now.match)[i] != match_blends(before)[i])
            take_blend(result, i, match_blends(t->now.match)[i]);
}

static uint64_t hash_of(const struct cut_mesh *mesh, const struct job_result *result) {
    const struct cut_change *change = &result->change;
    XXH3_state_t *state = XXH3_createState();
    XXH3_64bits_reset(state);
    XXH3_64bits_update(state, result->vertices, result->blend_count * sizeof *result->vertices);
    XXH3_64bits_update(state, result->blends, result->blend_count * sizeof *result->blends);
    XXH3_64bits_update(state, change->freed, change->freed_count * sizeof *change->freed);
    XXH3_64bits_update(state, change->made, change->made_count * sizeof *change->made);
    XXH3_64bits_update(state, change->vertices, change->vertex_count * sizeof *change->vertices);
    for (uint32_t i = 0; i < change->made_count; i++)
        XXH3_64bits_update(state, cut_mesh_triangle(mesh, change->made[i]), 3 * sizeof(uint32_t));
    for (uint32_t i = 0; i < change->vertex_count; i++) {
        vec3 p = cut_mesh_vertex(mesh, change->vertices[i]);
        XXH3_64bits_update(state, &p, sizeof p);
    }
    uint64_t hash = XXH3_64bits_digest(state);
    XXH3_freeState(state);
    return hash;
}

static void cut_move(struct operation *operation, struct operated_tissue *t, uint32_t stroke,
                     const struct blade_move *move, struct job_result *result) {
    struct past_cut past = {operation->cuts + 1, stroke, *move, t->now.figures};
    keep(t, t->cut_count, stroke);
    take_out(t, move, result);
    if (result->outcome == JOB_REFUSED)
        t->now.figures.refused++;
    if (result->outcome != JOB_DONE)
        return;
    quality_report(t->now.quality, &t->now.figures.quality);
    t->now.figures.distance_mm = t->now.match ? distance_to_warped(t, &result->change) : 0;
    operation->cuts++;
    note_cut(t, &past);
}

static enum job_outcome both(enum job_outcome a, enum job_outcome b) {
    if (a == JOB_DONE || b == JOB_DONE)
        return JOB_DONE;
    return a == JOB_REFUSED || b == JOB_REFUSED ? JOB_REFUSED : JOB_NOTHING;
}

static void move_pieces(struct cut_change *from, struct cut_change *to) {
    if (!from->piece_count)
        return;
    size_t count = (size_t)(to->piece_count + from->piece_count);
    to->pieces = alloc_resize(to->pieces, count, sizeof *to->pieces);
    memcpy(to->pieces + to->piece_count, from->pieces,
           (size_t)from->piece_count * sizeof *from->pieces);
    to->piece_count += from->piece_count;
    from->piece_count = 0;
}

// One move after the other; for the session and its stations they are one cut and one mesh.
static void cut_way(struct operation *operation, struct operated_tissue *t, const struct job *job,
                    struct job_result *result) {
    struct match *before = t->now.match ? match_copy(t->now.match) : NULL;
    uint32_t number = t->now.figures.mesh_number, cuts = t->now.figures.cuts;
    double distance_mm = 0;
    result->outcome = JOB_NOTHING;
    for (int i = 0; i < job->move_count; i++) {
        struct job_result *one = alloc(1, sizeof *one);
        cut_move(operation, t, job->stroke, &job->moves[i], one);
        result->outcome = both(result->outcome, one->outcome);
        if (one->outcome == JOB_DONE)
            distance_mm = fmax(distance_mm, t->now.figures.distance_mm);
        if (one->outcome == JOB_REFUSED)
            result->why = one->why;
        result->hash =
            XXH3_64bits_withSeed(&result->hash, sizeof result->hash, hash_of(t->now.mesh, one));
        move_pieces(&one->change, &result->change);
        job_result_destroy(&one);
    }
    if (result->outcome == JOB_DONE) {
        t->now.figures.distance_mm = distance_mm;
        t->now.figures.mesh_number = number + 1;
        t->now.figures.cuts = cuts + 1;
        tell_blends(before, t, result);
    }
    match_destroy(&before);
}

// ---- undoing ------------------------------------------------------------------------------------

// NULL where none was.
static struct operated_tissue *tissue_cut_last(struct operation *operation) {
    struct operated_tissue *last = NULL;
    uint64_t number = 0;
    for (int i = 0; i < operation->count; i++) {
        struct operated_tissue *t = &operation->tissues[i];
        if (!t->cut_count || t->cuts[t->cut_count - 1].number < number)
            continue;
        last = t;
        number = t->cuts[t->cut_count - 1].number;
    }
    return last;
}

// The tissue as it was after all cuts that are left, but for its figures.
static void make_again(struct operated_tissue *t) {
    while (t->checkpoints[0].cuts > t->cut_count) {
        drop(&t->checkpoints[0]);
        memmove(t->checkpoints, t->checkpoints + 1, (CHECKPOINTS_MAX - 1) * sizeof *t->checkpoints);
        t->checkpoints[CHECKPOINTS_MAX - 1] = (struct checkpoint){0};
    }
    uint32_t made = t->checkpoints[0].cuts;
    t->now = made ? copy_of(&t->checkpoints[0].state) : whole(t, 1);
    while (made < t->cut_count) {
        struct job_result *again = alloc(1, sizeof *again);
        keep(t, made, t->cuts[made].stroke);
        take_out(t, &t->cuts[made++].move, again);
        CHECK(again->outcome == JOB_DONE);
        job_result_destroy(&again);
    }
}

// The number of the last cut that is not of the last stroke; 0 where there is none.
static uint64_t end_before(const struct operation *operation, uint32_t stroke) {
    uint64_t end = 0;
    for (int i = 0; i < operation->count; i++) {
        const struct operated_tissue *t = &operation->tissues[i];
        uint32_t left = t->cut_count;
        while (left && t->cuts[left - 1].stroke == stroke)
            left--;
        if (left && t->cuts[left - 1].number > end)
            end = t->cuts[left - 1].number;
    }
    return end;
}

static struct tissue_figures take_back(struct operated_tissue *t, uint64_t end) {
    struct tissue_figures figures = t->now.figures;
    while (t->cut_count && t->cuts[t->cut_count - 1].number > end)
        figures = t->cuts[--t->cut_count].before;
    figures.mesh_number = t->now.figures.mesh_number + 1;
    figures.refused = t->now.figures.refused;
    return figures;
}

static void undo(struct operation *operation, struct job_result *result) {
    struct operated_tissue *t = tissue_cut_last(operation);
    if (!t) {
        result->outcome = JOB_NOTHING;
        return;
    }
    struct tissue_state before = t->now;
    uint64_t end = end_before(operation, t->cuts[t->cut_count - 1].stroke);
    struct tissue_figures figures = take_back(t, end);
    make_again(t);
    t->now.figures = figures;
    tell_blends(before.match, t, result);
    const struct operated_tissue *next = tissue_cut_last(operation);
    result->tissue = (int)(t - operation->tissues);
    result->more = next && next->cuts[next->cut_count - 1].number > end;
    result->cuts_back = before.figures.cuts - figures.cuts;
    result->mm3_back = figures.volume_mm3 - before.figures.volume_mm3;
    release(&before);
}

// ---- jobs ---------------------------------------------------------------------------------------

struct job_result *operation_run(struct operation *operation, const struct job *job) {
    CHECK(job->tissue >= 0 && job->tissue < operation->count);
    CHECK(job->kind != JOB_CUT || (job->move_count >= 1 && job->move_count <= JOB_MOVES_MAX));
    struct job_result *result = alloc(1, sizeof *result);
    result->job = job->id;
    result->kind = job->kind;
    result->tissue = job->tissue;
    if (job->kind == JOB_UNDO)
        undo(operation, result);
    else if (job->kind == JOB_RESTORE)
        restore(&operation->tissues[job->tissue], result);
    else if (job->move_count == 1)
        cut_move(operation, &operation->tissues[job->tissue], job->stroke, &job->moves[0], result);
    else
        cut_way(operation, &operation->tissues[job->tissue], job, result);
    const struct operated_tissue *t = &operation->tissues[result->tissue];
    result->figures = t->now.figures;
    if (job->kind != JOB_CUT || job->move_count == 1)
        result->hash = hash_of(t->now.mesh, result);
    return result;
}

const struct cut_mesh *operation_mesh(const struct operation *operation, int tissue) {
    return operation->tissues[tissue].now.mesh;
}

const struct match *operation_match(const struct operation *operation, int tissue) {
    return operation->tissues[tissue].now.match;
}

const struct tissue_figures *operation_figures(const struct operation *operation, int tissue) {
    return &operation->tissues[tissue].now.figures;
}
