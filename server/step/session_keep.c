#include "step/session_parts.h"

#define PENDING_MAX 8192 // vertices that are eased in: 28 bytes each

bool session_can_be_kept(const struct session *s, const struct job *asked) {
    uint32_t pending = 0;
    bool waits = false;
    for (int t = 0; t < s->scene->tissue_count; t++) {
        waits |= s->to_restore[t];
        pending += s->easings[t] ? easing_pending_count(s->easings[t]) : 0;
    }
    bool is_asked = asked->id && asked->kind != JOB_RESTORE;
    return s->settings.rules == RULES_NEWEST && !s->is_astray && !waits && pending <= PENDING_MAX &&
           (s->job_out == JOB_NONE || is_asked);
}

// ---- samples ------------------------------------------------------------------------------------

static bool is_sound(const struct sample *sample, int channel, int kind) {
    struct frame frame = {.number = 1, .count = 1, .samples = {*sample}};
    return sample->channel == (enum channel)channel && sample->kind == (enum sample_kind)kind &&
           frame_is_valid(&frame);
}

static void keep_samples(struct samples *samples, struct kept *k) {
    for (int c = 0; c < CHANNEL_COUNT; c++)
        for (int kind = 0; kind < SAMPLE_KIND_COUNT; kind++) {
            bool *known = &samples->known[c][kind];
            struct sample *newest = &samples->newest[c][kind];
            kept_flag(k, known);
            if (!*known)
                continue;
            kept_bytes(k, newest, sizeof *newest);
            kept_time(k, &newest->time_ns);
            kept_holds(k, !k->bad && is_sound(newest, c, kind));
            kept_time(k, &samples->since_ns[c][kind]);
        }
}

// ---- cutting ------------------------------------------------------------------------------------

static void keep_sweep(struct sweep *sweep, struct kept *k) {
    kept_flag(k, &sweep->active);
    if (!sweep->active)
        return;
    kept_pose(k, &sweep->T_mesh_tip);
    kept_real(k, &sweep->opening, 0, 1);
    kept_time(k, &sweep->time_ns);
    kept_point(k, &sweep->last);
}

static void keep_stroke(struct stroke *stroke, struct kept *k) {
    kept_bytes(k, &stroke->number, sizeof stroke->number);
    kept_flag(k, &stroke->active);
    kept_real(k, &stroke->closed, 0, 1);
    kept_time(k, &stroke->cut_ns);
}

static void keep_waiting(struct waiting_moves *waiting, const struct instruments *instruments,
                         struct kept *k) {
    kept_int(k, &waiting->count, 0, CUTTING_WAITING_MAX);
    for (int i = 0; i < waiting->count; i++) {
        struct waiting_move *move = &waiting->moves[i];
        kept_bytes(k, &move->stroke, sizeof move->stroke);
        kept_time(k, &move->begin_ns);
        blade_move_keep(&move->move, instruments, k);
    }
}

// The move that is due is of rules before those that are kept.
static void keep_cutting(struct cutting *cutting, int tissues, struct kept *k) {
    kept_bytes(k, &cutting->stroke_count, sizeof cutting->stroke_count);
    cutting->waiting_count = 0;
    for (int i = 0; i < INSTRUMENT_COUNT; i++) {
        keep_stroke(&cutting->strokes[i], k);
        for (int t = 0; t < tissues; t++) {
            keep_sweep(&cutting->sweeps[i][t], k);
            keep_waiting(&cutting->waiting[i][t], cutting->instruments, k);
            cutting->waiting_count += cutting->waiting[i][t].count;
        }
    }
}

// ---- instruments --------------------------------------------------------------------------------

// What the easing looks at: the triangles that each point was nearest to.
static void keep_memory(const struct session *s, struct avatar_memory *memory, struct kept *k) {
    for (int p = 0; p < AVATAR_POINTS_MAX; p++)
        for (int g = 0; g < s->scene->knee->group_count; g++) {
            uint32_t *triangle = &memory->points[p].triangle[g];
            kept_bytes(k, triangle, sizeof *triangle);
            kept_holds(k,
                       *triangle == MESH_NONE || *triangle < s->surfaces[g].mesh->triangle_count);
        }
}

static void keep_instrument(struct session *s, int i, struct kept *k) {
    kept_flag(k, &s->in_contact[i]);
    keep_memory(s, &s->memory[i], k);
    kept_int(k, &s->portals[i], -1, s->scene->knee->portal_count - 1);
    kept_flag(k, &s->seen[i]);
    if (s->seen[i])
        kept_pose(k, &s->tips[i]);
}

// ---- all ----------------------------------------------------------------------------------------

static void keep_job(struct session *s, struct job *asked, struct kept *k) {
    int kind = (int)s->job_out;
    kept_u64(k, &s->last_job);
    kept_int(k, &kind, JOB_NONE, JOB_KIND_COUNT - 1);
    s->job_out = (enum job_kind)kind;
    kept_bytes(k, &s->stroke_out, sizeof s->stroke_out);
    job_keep(asked, s->scene->tissue_count, &s->settings.instruments, k);
    kept_holds(k, asked->kind == s->job_out && (!asked->id || asked->id == s->last_job) &&
                      !asked->id == (asked->kind == JOB_NONE));
    kept_bytes(k, &s->to_undo, sizeof s->to_undo);
    kept_bytes(k, &s->undo_behind, sizeof s->undo_behind);
}

static void keep_tissues(struct session *s, const struct operation *operation, struct kept *k) {
    for (int t = 0; t < s->scene->tissue_count; t++) {
        kept_flag(k, &s->touched[t]);
        if (!s->easings[t])
            continue;
        easing_keep(s->easings[t], operation, t, k);
        session_take_surface(s, t);
    }
}

void session_keep(struct session *s, struct job *asked, const struct operation *operation,
                  struct kept *k) {
    int state = (int)s->state;
    kept_int(k, &state, 0, SESSION_CLOSED);
    s->state = (enum session_state)state;
    kept_u64(k, &s->step);
    kept_time(k, &s->time_ns);
    kept_time(k, &s->travel_ns);
    kept_u64(k, &s->hash);
    keep_samples(&s->samples, k);
    for (int i = 0; i < BODY_COUNT; i++)
        kept_pose(k, &s->correction[i]);
    bool is_seen = false;
    for (int i = 0; i < INSTRUMENT_COUNT; i++) {
        keep_instrument(s, i, k);
        is_seen |= s->seen[i];
    }
    for (int i = 0; is_seen && i < BODY_COUNT; i++)
        kept_pose(k, &s->bodies[i]);
    keep_cutting(&s->cutting, s->scene->tissue_count, k);
    keep_job(s, asked, k);
    keep_tissues(s, operation, k);
    if (s->loose)
        loose_keep(s->loose, k);
}

uint64_t session_hash(const struct session *session) {
    return session->hash;
}
