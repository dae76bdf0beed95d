#include "step/cutting.h"

#include "base/clock.h"

#include <string.h>

// A jaw bites when it has closed so far, a burr and a knife when they have moved so far; a burr
// that stands takes what comes to it so often.
#define BITE_OPENING 0.2
#define SHUT_OPENING 0.02
#define SWEEP_MM 0.2
#define SWEEP_DEG 2.0
#define BURR_REST_NS (50 * NS_PER_MS)
#define JUMP_MM 10.0 // no hand moves so far from one step to the next: the move is not swept
#define PAUSE_NS (NS_PER_S / 2)

#define SHAVER_RUNS 1u // button 0

static bool blade_of_channel(enum channel channel, enum blade_kind *out_kind) {
    *out_kind = channel == CHANNEL_PUNCH    ? BLADE_PUNCH
                : channel == CHANNEL_SHAVER ? BLADE_SHAVER
                                            : BLADE_KNIFE;
    return channel == CHANNEL_PUNCH || channel == CHANNEL_SHAVER || channel == CHANNEL_KNIFE;
}

// A handle that is lost neither closes nor runs.
static bool is_working(enum blade_kind kind, const struct instrument_output *o) {
    if (!o->present)
        return false;
    if (kind == BLADE_KNIFE)
        return true;
    bool runs = kind == BLADE_PUNCH || o->handle.buttons & SHAVER_RUNS;
    return o->handle_validity != VALIDITY_LOST && runs;
}

static bool box_has(const struct box *box, vec3 p, double margin) {
    return p.x > box->min.x - margin && p.x < box->max.x + margin && p.y > box->min.y - margin &&
           p.y < box->max.y + margin && p.z > box->min.z - margin && p.z < box->max.z + margin;
}

// The warped tip in the virtual mesh. What is composed of rotations that are nearly of unit length
// is made so again.
static struct sweep sweep_now(const struct scene_tissue *tissue, const struct scene *scene,
                              const struct session_output *out, const struct instrument_output *o) {
    pose T_mockup_mesh = out->T_mockup_virtual[scene->knee->groups[tissue->group].body];
    pose T_mesh_tip = pose_compose(pose_inverse(T_mockup_mesh), o->T_mockup_warped);
    T_mesh_tip.rotation = quat_unit(T_mesh_tip.rotation);
    return (struct sweep){
        .active = true,
        .T_mesh_tip = T_mesh_tip,
        .last = T_mesh_tip.translation,
        .opening = o->handle.opening,
        .time_ns = out->time_ns,
    };
}

static bool is_due(enum blade_kind kind, const struct sweep *from, const struct sweep *to) {
    double way = vec3_distance(from->T_mesh_tip.translation, to->T_mesh_tip.translation);
    double closed = from->opening - to->opening;
    if (kind == BLADE_PUNCH)
        return closed >= BITE_OPENING || (closed >= SHUT_OPENING && to->opening < SHUT_OPENING);
    if (kind == BLADE_KNIFE) {
        quat a = from->T_mesh_tip.rotation, b = to->T_mesh_tip.rotation;
        return way >= SWEEP_MM || quat_angle(a, b) * DEG_PER_RAD >= SWEEP_DEG;
    }
    return way >= SWEEP_MM || to->time_ns - from->time_ns >= BURR_REST_NS;
}

static bool starts_anew(enum blade_kind kind, const struct sweep *from, const struct sweep *to) {
    return !from->active || vec3_distance(from->last, to->last) > JUMP_MM ||
           (kind == BLADE_PUNCH && to->opening >= from->opening);
}

// True where the move from sweep to now is to be cut.
static bool watch(struct sweep *sweep, enum blade_kind kind, const struct sweep *now,
                  const struct box *box) {
    double reach = blade_reach_mm(kind);
    bool near_by = box_has(box, now->T_mesh_tip.translation, reach) ||
                   box_has(box, sweep->T_mesh_tip.translation, reach);
    if (starts_anew(kind, sweep, now) || !near_by) {
        *sweep = *now;
        return false;
    }
    sweep->last = now->last;
    return is_due(kind, sweep, now);
}

// ---- strokes ------------------------------------------------------------------------------------

static void watch_stroke(struct stroke *stroke, enum blade_kind kind,
                         const struct instrument_output *o) {
    bool opened = kind == BLADE_PUNCH && o->handle.opening >= stroke->closed + BITE_OPENING;
    if (!is_working(kind, o) || opened)
        stroke->active = false;
    stroke->closed = fmin(stroke->closed, o->handle.opening);
}

// That which a move belongs to.
static uint32_t stroke_of(struct cutting *cutting, int instrument, enum blade_kind kind,
                          const struct sweep *to) {
    struct stroke *stroke = &cutting->strokes[instrument];
    bool paused = kind != BLADE_PUNCH && to->time_ns - stroke->cut_ns > PAUSE_NS;
    if (!stroke->active || paused)
        *stroke = (struct stroke){++cutting->stroke_count, true, to->opening, to->time_ns};
    return stroke->number;
}

void cutting_rest(struct cutting *cutting) {
    memset(cutting->sweeps, 0, sizeof cutting->sweeps);
    cutting_end_strokes(cutting);
}

void cutting_end_strokes(struct cutting *cutting) {
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        cutting->strokes[i].active = false;
}

void cutting_landed(struct cutting *cutting, uint32_t stroke, int64_t time_ns) {
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        if (cutting->strokes[i].number == stroke)
            cutting->strokes[i].cut_ns = time_ns;
}

// ---- jobs ---------------------------------------------------------------------------------------

// The move that is to be cut now: of those that are due the one that began first, so that none
// waits for ever.
struct choice {
    struct sweep *from; // NULL: none is due
    struct sweep to;
    enum blade_kind kind;
    int instrument, tissue;
};

static void watch_instrument(struct cutting *cutting, const struct scene *scene,
                             const struct session_output *out, int instrument,
                             struct choice *choice) {
    const struct instrument_output *o = &out->instruments[instrument];
    enum blade_kind kind;
    if (!blade_of_channel((enum channel)(CHANNEL_FIRST_INSTRUMENT + instrument), &kind))
        return;
    watch_stroke(&cutting->strokes[instrument], kind, o);
    for (int t = 0; t < scene->tissue_count; t++) {
        struct sweep *sweep = &cutting->sweeps[instrument][t];
        if (!is_working(kind, o)) {
            sweep->active = false;
            continue;
        }
        struct sweep now = sweep_now(&scene->tissues[t], scene, out, o);
        if (watch(sweep, kind, &now, &scene->tissues[t].box) &&
            (!choice->from || sweep->time_ns < choice->from->time_ns))
            *choice = (struct choice){sweep, now, kind, instrument, t};
    }
}

bool cutting_step(struct cutting *cutting, const struct scene *scene,
                  const struct session_output *out, bool may_cut, struct job *out_job) {
    struct choice choice = {0};
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        watch_instrument(cutting, scene, out, i, &choice);
    struct sweep *from = choice.from;
    if (!from || !may_cut)
        return false;
    out_job->kind = JOB_CUT;
    out_job->tissue = choice.tissue;
    out_job->stroke = stroke_of(cutting, choice.instrument, choice.kind, &choice.to);
    out_job->move_count = 1;
    out_job->moves[0] = (struct blade_move){
        choice.kind, {from->T_mesh_tip, choice.to.T_mesh_tip}, {from->opening, choice.to.opening}};
    *from = choice.to;
    return true;
}
