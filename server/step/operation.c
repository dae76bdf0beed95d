#include "step/operation.h"

#include "base/check.h"
#include "step/operation_parts.h"
#include "step/settings.h"

#include <stdlib.h>
#include <string.h>
#include <xxhash.h>

// A state is kept before a stroke when so many cuts have been made since the last one; the newest
// few stay.
#define CHECKPOINT_EVERY 32

// ---- whole tissue -------------------------------------------------------------------------------

static void drop_checkpoint(struct checkpoint *checkpoint) {
    if (checkpoint->cuts)
        tissue_state_release(&checkpoint->state);
    checkpoint->cuts = 0;
}

static void forget_cuts(struct operated_tissue *t) {
    for (int i = 0; i < CHECKPOINTS_MAX; i++)
        drop_checkpoint(&t->checkpoints[i]);
    free(t->cuts);
    t->cuts = NULL;
    t->cut_count = t->cut_room = 0;
}

struct operation *operation_create(const struct scene *scene, int rules,
                                   const struct instruments *instruments) {
    struct operation *operation = alloc(1, sizeof *operation);
    operation->instruments = *instruments;
    operation->count = scene->tissue_count;
    for (int i = 0; i < operation->count; i++) {
        struct operated_tissue *t = &operation->tissues[i];
        t->scene = &scene->tissues[i];
        t->group = &scene->knee->groups[t->scene->group];
        t->rules = rules;
        t->instruments = &operation->instruments;
        t->now.figures = t->scene->whole;
        t->now.figures.mesh_number = 1;
    }
    return operation;
}

void operated_take_over(struct operated_tissue *t) {
    if (t->now.mesh)
        return;
    uint32_t refused = t->now.figures.refused; // of a session that was read again
    t->now = tissue_state_whole(t->scene, t->rules, t->now.figures.mesh_number);
    t->now.figures.refused = refused;
    if (operated_touch_width(t) == 3)
        t->fitting = fitting_create(t->scene->match, &t->group->mesh, t->rules);
    t->touch_before = alloc((size_t)operated_touch_width(t) * t->group->mesh.vertex_count,
                            sizeof *t->touch_before);
}

// Once it is whole again.
static void give_up(struct operated_tissue *t) {
    tissue_state_release(&t->now);
    fitting_destroy(&t->fitting);
    free(t->touch_before);
    t->touch_before = NULL;
}

void operation_destroy(struct operation **operation) {
    if (!*operation)
        return;
    for (int i = 0; i < (*operation)->count; i++) {
        forget_cuts(&(*operation)->tissues[i]);
        give_up(&(*operation)->tissues[i]);
    }
    free(*operation);
    *operation = NULL;
}

// ---- the touch ----------------------------------------------------------------------------------

static void touch_of(const struct operated_tissue *t, uint32_t vertex, double out_values[3]) {
    if (!t->now.mesh) {
        memset(out_values, 0, (size_t)operated_touch_width(t) * sizeof *out_values);
        return;
    }
    if (t->now.match) {
        out_values[0] = match_blends(t->now.match)[vertex];
        return;
    }
    vec3 offset = fitting_offset(t->fitting, vertex);
    memcpy(out_values, &offset, sizeof offset);
}

static double *touch_before(const struct operated_tissue *t, uint32_t vertex) {
    return t->touch_before + (size_t)operated_touch_width(t) * vertex;
}

// Of all vertices.
static void touch_of_all(const struct operated_tissue *t, double *out_values) {
    size_t width = (size_t)operated_touch_width(t);
    if (t->fitting && t->now.mesh)
        fitting_offsets(t->fitting, out_values);
    else
        for (uint32_t i = 0; width && i < t->group->mesh.vertex_count; i++)
            touch_of(t, i, out_values + width * i);
}

static void note_touch(struct operated_tissue *t) {
    touch_of_all(t, t->touch_before);
}

// The vertices whose values are others than before, or all.
static void tell_touch(const struct operated_tissue *t, bool all, struct touch_change *out) {
    int width = operated_touch_width(t);
    size_t size = (size_t)width * sizeof(double);
    if (!width)
        return;
    touch_change_make_room(out, width, t->group->mesh.vertex_count);
    touch_of_all(t, out->values);
    for (uint32_t i = 0; i < t->group->mesh.vertex_count; i++) {
        const double *values = out->values + (size_t)width * i;
        if (!all && memcmp(values, touch_before(t, i), size) == 0)
            continue;
        memmove(out->values + (size_t)width * out->count, values, size);
        out->vertices[out->count++] = i;
    }
    if (t->fitting)
        touch_encode(out);
}

static void restore(struct operated_tissue *t, struct job_result *result) {
    uint32_t number = t->now.figures.mesh_number + 1;
    note_touch(t);
    tissue_state_release(&t->now);
    forget_cuts(t);
    t->now = tissue_state_whole(t->scene, t->rules, number);
    if (t->fitting)
        fitting_go_back(t->fitting, 0);
    tell_touch(t, !t->fitting, &result->touch);
}

// ---- a cut --------------------------------------------------------------------------------------

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
    drop_checkpoint(&t->checkpoints[CHECKPOINTS_MAX - 1]);
    memmove(t->checkpoints + 1, t->checkpoints, (CHECKPOINTS_MAX - 1) * sizeof *t->checkpoints);
    t->checkpoints[0] = (struct checkpoint){cuts, tissue_state_copy(&t->now)};
}

static uint64_t hash_of(const struct cut_mesh *mesh, const struct job_result *result) {
    const struct cut_change *change = &result->change;
    const struct touch_change *touch = &result->touch;
    XXH3_state_t *state = XXH3_createState();
    XXH3_64bits_reset(state);
    if (touch->width == 1) { // offsets have a hash of their own
        XXH3_64bits_update(state, touch->vertices, touch->count * sizeof *touch->vertices);
        XXH3_64bits_update(state, touch->values, touch->count * sizeof *touch->values);
    }
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

static uint64_t hash_on(uint64_t before, uint64_t hash) {
    return XXH3_64bits_withSeed(&before, sizeof before, hash);
}

// Under older rules all of a bite is where the tip is after it.
static struct blade_move move_under(const struct operated_tissue *t,
                                    const struct blade_move *move) {
    struct blade_move out = *move;
    const struct instrument *tool = &t->instruments->of[instrument_of_blade(move->blade)];
    if (t->rules < RULES_WITHOUT_FILMS && tool->kind == INSTRUMENT_JAW)
        out.T_mesh_tip[0] = move->T_mesh_tip[1];
    return out;
}

static void cut_move(struct operation *operation, struct operated_tissue *t, uint32_t stroke,
                     const struct blade_move *move, struct job_result *result) {
    struct past_cut past = {operation->cuts + 1, stroke, move_under(t, move), t->now.figures,
                            t->fitting ? fitting_count(t->fitting) : 0};
    keep(t, t->cut_count, stroke);
    tissue_state_cut(&t->now, t->scene, t->instruments, &past.move, t->rules, result);
    if (result->outcome == JOB_REFUSED)
        t->now.figures.refused++;
    if (result->outcome != JOB_DONE)
        return;
    quality_report(t->now.quality, &t->now.figures.quality);
    t->now.figures.distance_mm = tissue_state_apart_mm(&t->now, &t->group->mesh, &result->change);
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
        result->hash = hash_on(result->hash, hash_of(t->now.mesh, one));
        move_pieces(&one->change, &result->change);
        job_result_destroy(&one);
    }
    if (result->outcome == JOB_DONE) {
        t->now.figures.distance_mm = distance_mm;
        t->now.figures.mesh_number = number + 1;
        t->now.figures.cuts = cuts + 1;
        if (!t->fitting)
            tell_touch(t, false, &result->touch);
    }
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
        drop_checkpoint(&t->checkpoints[0]);
        memmove(t->checkpoints, t->checkpoints + 1, (CHECKPOINTS_MAX - 1) * sizeof *t->checkpoints);
        t->checkpoints[CHECKPOINTS_MAX - 1] = (struct checkpoint){0};
    }
    uint32_t made = t->checkpoints[0].cuts;
    t->now = made ? tissue_state_copy(&t->checkpoints[0].state)
                  : tissue_state_whole(t->scene, t->rules, 1);
    while (made < t->cut_count) {
        struct job_result *again = alloc(1, sizeof *again);
        keep(t, made, t->cuts[made].stroke);
        tissue_state_cut(&t->now, t->scene, t->instruments, &t->cuts[made++].move, t->rules, again);
        CHECK(again->outcome == JOB_DONE || t->was_read);
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
    while (t->cut_count && t->cuts[t->cut_count - 1].number > end) {
        const struct past_cut *cut = &t->cuts[--t->cut_count];
        figures = cut->before;
        if (t->fitting)
            fitting_go_back(t->fitting, cut->fits);
    }
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
    note_touch(t);
    struct tissue_figures figures = take_back(t, end);
    make_again(t);
    t->now.figures = figures;
    tell_touch(t, false, &result->touch);
    const struct operated_tissue *next = tissue_cut_last(operation);
    result->tissue = (int)(t - operation->tissues);
    result->more = next && next->cuts[next->cut_count - 1].number > end;
    result->cuts_back = before.figures.cuts - figures.cuts;
    result->mm3_back = figures.volume_mm3 - before.figures.volume_mm3;
    tissue_state_release(&before);
}

// ---- jobs ---------------------------------------------------------------------------------------

static void take_report(struct operated_tissue *t, const struct fitting_report *report) {
    struct tissue_figures *f = &t->now.figures;
    f->warped_mm3 = report->volume_mm3;
    f->left_mm3 = report->left_mm3;
    f->distance_mm = report->distance_mm;
    operated_measure_mismatch(t);
}

// The touch after all moves of a job.
static void fit(struct operated_tissue *t, uint32_t since, struct job_result *result) {
    struct fitting_report report;
    uint32_t number;
    const struct cut_mesh *target = tissue_state_target(&t->now, &number);
    fitting_follow(t->fitting, target, since, &report);
    t->fitted_since = since;
    take_report(t, &report);
    tell_touch(t, false, &result->touch);
}

static void cut(struct operation *operation, struct operated_tissue *t, const struct job *job,
                struct job_result *result) {
    uint32_t since;
    bool was_solid = t->now.solid;
    tissue_state_target(&t->now, &since);
    note_touch(t);
    if (job->move_count == 1)
        cut_move(operation, t, job->stroke, &job->moves[0], result);
    else
        cut_way(operation, t, job, result);
    if (result->outcome == JOB_DONE && !operated_touch_width(t) && t->rules >= RULES_STILL_TOLD)
        t->now.figures.touched_unseen_mm3 = t->now.figures.left_mm3;
    if (t->fitting && result->outcome == JOB_DONE)
        fit(t, was_solid && !t->now.solid ? 0 : since, result); // 0: tears are new to it
}

static void run_on(struct operation *operation, struct operated_tissue *t, const struct job *job,
                   struct job_result *result) {
    operated_take_over(t);
    if (job->kind == JOB_RESTORE)
        restore(t, result);
    else
        cut(operation, t, job, result);
}

struct job_result *operation_run(struct operation *operation, const struct job *job) {
    CHECK(job->tissue >= 0 && job->tissue < operation->count);
    CHECK(job->kind != JOB_CUT || (job->move_count >= 1 && job->move_count <= JOB_MOVES_MAX));
    struct job_result *result = alloc(1, sizeof *result);
    result->job = job->id;
    result->kind = job->kind;
    result->tissue = job->tissue;
    if (job->kind == JOB_UNDO)
        undo(operation, result);
    else
        run_on(operation, &operation->tissues[job->tissue], job, result);
    struct operated_tissue *t = &operation->tissues[result->tissue];
    result->figures = t->now.figures;
    if (job->kind != JOB_CUT || job->move_count == 1) // else it has a hash of its moves
        result->hash = hash_of(operated_mesh(t), result);
    if (job->kind == JOB_RESTORE)
        give_up(t);
    result->touch_hash = touch_hash(&result->touch);
    return result;
}

// ---- a touch from elsewhere ---------------------------------------------------------------------

static vec3 offset_at(const double *values) {
    return (vec3){values[0], values[1], values[2]};
}

static bool same_touch(const struct touch_change *a, const struct touch_change *b) {
    return a->size == b->size && !memcmp(a->bytes, b->bytes, a->size);
}

// The largest distance between vertices of S'' and their places by the touch.
static double place_touch(struct operated_tissue *t, const struct touch_change *own,
                          const struct touch_change *touch) {
    double largest = 0;
    vec3 *places = alloc(t->group->mesh.vertex_count, sizeof *places);
    for (uint32_t i = 0; i < own->count; i++)
        places[own->vertices[i]] = offset_at(touch_before(t, own->vertices[i]));
    for (uint32_t i = 0; i < touch->count; i++)
        places[touch->vertices[i]] = offset_at(touch->values + 3 * (size_t)i);
    for (int k = 0; k < 2; k++) {
        const struct touch_change *change = k ? touch : own;
        for (uint32_t i = 0; i < change->count; i++) {
            uint32_t v = change->vertices[i];
            largest = fmax(largest, vec3_distance(places[v], fitting_offset(t->fitting, v)));
            fitting_place(t->fitting, v, places[v]);
        }
    }
    free(places);
    return largest;
}

bool operation_allows_touch(const struct operation *operation, const struct job_result *result,
                            const struct touch_change *touch) {
    const struct operated_tissue *t = &operation->tissues[result->tissue];
    return t->fitting && result->kind == JOB_CUT && result->outcome == JOB_DONE &&
           touch->width == 3 && touch->count > 0 &&
           touch->vertices[touch->count - 1] < t->group->mesh.vertex_count;
}

double operation_take_touch(struct operation *operation, struct job_result *result,
                            const struct touch_change *touch) {
    struct operated_tissue *t = &operation->tissues[result->tissue];
    struct fitting_report report;
    uint32_t number;
    CHECK(operation_allows_touch(operation, result, touch));
    if (same_touch(&result->touch, touch))
        return 0;
    double apart_mm = place_touch(t, &result->touch, touch);
    fitting_follow_as_placed(t->fitting, tissue_state_target(&t->now, &number), t->fitted_since,
                             &report);
    take_report(t, &report);
    touch_change_fini(&result->touch);
    tell_touch(t, false, &result->touch);
    result->figures = t->now.figures;
    result->touch_hash = touch_hash(&result->touch);
    return apart_mm;
}

// ---- what there is ------------------------------------------------------------------------------

const struct cut_mesh *operation_mesh(const struct operation *operation, int tissue) {
    return operated_mesh(&operation->tissues[tissue]);
}

int operation_touch_width(const struct operation *operation, int tissue) {
    return operated_touch_width(&operation->tissues[tissue]);
}

void operation_touch(const struct operation *operation, int tissue, uint32_t vertex,
                     double out_values[3]) {
    touch_of(&operation->tissues[tissue], vertex, out_values);
}

bool operation_is_whole(const struct operation *operation, int tissue) {
    return !operation->tissues[tissue].now.mesh;
}

vec3 operation_touched(const struct operation *operation, int tissue, uint32_t vertex) {
    return operated_touched(&operation->tissues[tissue], vertex);
}

const struct tissue_figures *operation_figures(const struct operation *operation, int tissue) {
    return &operation->tissues[tissue].now.figures;
}
