#include "step/job.h"

#include <stdlib.h>

const char *job_kind_name(enum job_kind kind) {
    static const char *const names[JOB_KIND_COUNT] = {"none", "cut", "restore", "undo"};
    return (unsigned)kind < JOB_KIND_COUNT ? names[kind] : "unknown";
}

const char *job_outcome_name(enum job_outcome outcome) {
    static const char *const names[JOB_OUTCOME_COUNT] = {"done", "nothing", "refused"};
    return (unsigned)outcome < JOB_OUTCOME_COUNT ? names[outcome] : "unknown";
}

void blade_move_keep(struct blade_move *move, const struct instruments *instruments,
                     struct kept *k) {
    kept_int(k, &move->blade, 0, BLADE_MOST);
    int tool = instrument_of_blade(move->blade);
    kept_holds(k, tool < instruments->count && instrument_cuts(&instruments->of[tool]));
    for (int i = 0; i < 2; i++) {
        kept_pose(k, &move->T_mesh_tip[i]);
        kept_real(k, &move->opening[i], 0, 1);
    }
}

void job_keep(struct job *job, int tissues, const struct instruments *instruments, struct kept *k) {
    int kind = (int)job->kind;
    kept_u64(k, &job->id);
    kept_int(k, &kind, JOB_NONE, JOB_KIND_COUNT - 1);
    job->kind = (enum job_kind)kind;
    kept_int(k, &job->tissue, 0, tissues > 0 ? tissues - 1 : 0);
    kept_bytes(k, &job->stroke, sizeof job->stroke);
    kept_int(k, &job->move_count, job->kind == JOB_CUT, job->kind == JOB_CUT ? JOB_MOVES_MAX : 0);
    for (int i = 0; i < job->move_count; i++)
        blade_move_keep(&job->moves[i], instruments, k);
}

// As it would be read.
bool job_is_valid(const struct job *job, int tissues, const struct instruments *instruments) {
    uint8_t bytes[sizeof(struct job)];
    struct job copy = *job;
    struct kept to = kept_into(bytes, sizeof bytes);
    bool has_room = (unsigned)job->move_count <= JOB_MOVES_MAX && job->id;
    if (!has_room)
        return false;
    job_keep(&copy, tissues, instruments, &to);
    struct kept from = kept_from(bytes, to.used);
    job_keep(&copy, tissues, instruments, &from);
    return !to.bad && !from.bad && job->kind != JOB_NONE;
}

void job_result_destroy(struct job_result **result) {
    if (!*result)
        return;
    cut_change_fini(&(*result)->change);
    touch_change_fini(&(*result)->touch);
    free(*result);
    *result = NULL;
}
