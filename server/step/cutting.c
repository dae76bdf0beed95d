#include "step/cutting.h"

#include "base/clock.h"
#include "step/settings.h"

#include <string.h>

// A jaw bites when it has closed so far, a burr and a blade when they have moved so far; a burr
// that stands takes what comes to it so often.
#define BITE_OPENING 0.2
#define SHUT_OPENING 0.02
#define SWEEP_MM 0.2
#define SWEEP_DEG 2.0
#define BURR_REST_NS (50 * NS_PER_MS)
#define JUMP_MM 10.0 // no hand moves so far from one step to the next: the move is not swept
#define PAUSE_NS (NS_PER_S / 2)

// A handle that is lost neither closes nor runs.
static bool is_working(const struct instrument *tool, const struct instrument_output *o) {
    if (!o->present)
        return false;
    if (tool->kind == INSTRUMENT_BLADE)
        return true;
    bool runs = tool->kind == INSTRUMENT_JAW || o->handle.buttons >> tool->button & 1;
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

static bool is_due(enum instrument_kind kind, const struct sweep *from, const struct sweep *to) {
    double way = vec3_distance(from->T_mesh_tip.translation, to->T_mesh_tip.translation);
    double closed = from->opening - to->opening;
    if (kind == INSTRUMENT_JAW)
        return closed >= BITE_OPENING || (closed >= SHUT_OPENING && to->opening < SHUT_OPENING);
    if (kind == INSTRUMENT_BLADE) {
        quat a = from->T_mesh_tip.rotation, b = to->T_mesh_tip.rotation;
        return way >= SWEEP_MM || quat_angle(a, b) * DEG_PER_RAD >= SWEEP_DEG;
    }
    return way >= SWEEP_MM || to->time_ns - from->time_ns >= BURR_REST_NS;
}

static bool starts_anew(enum instrument_kind kind, const struct sweep *from,
                        const struct sweep *to) {
    return !from->active || vec3_distance(from->last, to->last) > JUMP_MM ||
           (kind == INSTRUMENT_JAW && to->opening >= from->opening);
}

// True where the move from sweep to now is to be cut.
static bool watch(struct sweep *sweep, const struct instrument *tool, const struct sweep *now,
                  const struct box *box) {
    double reach = blade_reach_mm(tool);
    bool near_by = box_has(box, now->T_mesh_tip.translation, reach) ||
                   box_has(box, sweep->T_mesh_tip.translation, reach);
    if (starts_anew(tool->kind, sweep, now) || !near_by) {
        *sweep = *now;
        return false;
    }
    sweep->last = now->last;
    return is_due(tool->kind, sweep, now);
}

// ---- strokes ------------------------------------------------------------------------------------

static void watch_stroke(struct stroke *stroke, const struct instrument *tool,
                         const struct instrument_output *o) {
    bool opened =
        tool->kind == INSTRUMENT_JAW && o->handle.opening >= stroke->closed + BITE_OPENING;
    if (!is_working(tool, o) || opened)
        stroke->active = false;
    stroke->closed = fmin(stroke->closed, o->handle.opening);
}

// That which a move belongs to.
static uint32_t stroke_of(struct cutting *cutting, int instrument, const struct sweep *to) {
    bool jaw = cutting->instruments->of[instrument].kind == INSTRUMENT_JAW;
    struct stroke *stroke = &cutting->strokes[instrument];
    bool waits = false;
    for (int t = 0; t < TISSUES_MAX; t++)
        waits |= cutting->waiting[instrument][t].count > 0;
    bool paused = !jaw && !waits && to->time_ns - stroke->cut_ns > PAUSE_NS;
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

// ---- moves that wait ----------------------------------------------------------------------------

// Those between which the tip jumped are not one.
static bool can_be_one(const struct waiting_move *a, const struct waiting_move *b) {
    vec3 end = a->move.T_mesh_tip[1].translation, begin = b->move.T_mesh_tip[0].translation;
    return a->stroke == b->stroke && vec3_distance(end, begin) == 0;
}

// How far the way leaves the straight one, where b's begin is left out.
static double bend_mm(const struct waiting_move *a, const struct waiting_move *b) {
    vec3 from = a->move.T_mesh_tip[0].translation, to = b->move.T_mesh_tip[1].translation;
    vec3 way = vec3_sub(to, from), middle = vec3_sub(b->move.T_mesh_tip[0].translation, from);
    double length2 = vec3_dot(way, way);
    double share = length2 > 0 ? fmin(fmax(vec3_dot(middle, way) / length2, 0), 1) : 0;
    return vec3_distance(middle, vec3_scale(share, way));
}

static void remove_waiting(struct cutting *cutting, struct waiting_moves *w, int first, int count) {
    cutting->waiting_count -= count;
    w->count -= count;
    memmove(w->moves + first, w->moves + first + count,
            (size_t)(w->count - first) * sizeof *w->moves);
}

// Two neighbours whose way bends the least become one. False where there are none. A bite is of one
// place: not for a jaw.
static bool make_room(struct cutting *cutting, struct waiting_moves *w) {
    int best = -1;
    for (int i = 0; i + 1 < w->count; i++)
        if (can_be_one(&w->moves[i], &w->moves[i + 1]) &&
            (best < 0 || bend_mm(&w->moves[i], &w->moves[i + 1]) <
                             bend_mm(&w->moves[best], &w->moves[best + 1])))
            best = i;
    if (best < 0)
        return false;
    w->moves[best].move.T_mesh_tip[1] = w->moves[best + 1].move.T_mesh_tip[1];
    w->moves[best].move.opening[1] = w->moves[best + 1].move.opening[1];
    remove_waiting(cutting, w, best + 1, 1);
    return true;
}

static struct blade_move move_of(int instrument, const struct sweep *from, const struct sweep *to) {
    return (struct blade_move){blade_of_instrument(instrument),
                               {from->T_mesh_tip, to->T_mesh_tip},
                               {from->opening, to->opening}};
}

// Returns how many moves are lost: 0 or 1.
static int let_wait(struct cutting *cutting, int instrument, int tissue, const struct sweep *from,
                    const struct sweep *to) {
    struct waiting_moves *w = &cutting->waiting[instrument][tissue];
    uint32_t stroke = stroke_of(cutting, instrument, to);
    bool jaw = cutting->instruments->of[instrument].kind == INSTRUMENT_JAW;
    if (w->count == CUTTING_WAITING_MAX && (jaw || !make_room(cutting, w)))
        return 1;
    cutting->waiting_count++;
    w->moves[w->count++] =
        (struct waiting_move){stroke, from->time_ns, move_of(instrument, from, to)};
    return 0;
}

int cutting_drop_waiting(struct cutting *cutting) {
    int count = cutting->waiting_count;
    for (int i = 0; count && i < INSTRUMENT_COUNT; i++)
        for (int t = 0; t < TISSUES_MAX; t++)
            cutting->waiting[i][t].count = 0;
    cutting->waiting_count = 0;
    return count;
}

bool cutting_waits(const struct cutting *cutting, uint32_t stroke) {
    for (int i = 0; cutting->waiting_count && i < INSTRUMENT_COUNT; i++)
        for (int t = 0; t < TISSUES_MAX; t++) {
            const struct waiting_moves *w = &cutting->waiting[i][t]; // the oldest stroke first
            if (w->count && w->moves[0].stroke <= stroke)
                return true;
        }
    return false;
}

// ---- watching -----------------------------------------------------------------------------------

static bool is_cut_at_once(const struct cutting *cutting) {
    return cutting->rules < RULES_WITH_WAITING_MOVES;
}

static int watch_instrument(struct cutting *cutting, const struct scene *scene,
                            const struct session_output *out, int instrument,
                            struct due_move *due) {
    const struct instrument_output *o = &out->instruments[instrument];
    const struct instrument *tool = &cutting->instruments->of[instrument];
    int lost = 0;
    if (!instrument_cuts(tool))
        return 0;
    watch_stroke(&cutting->strokes[instrument], tool, o);
    for (int t = 0; t < scene->tissue_count; t++) {
        struct sweep *sweep = &cutting->sweeps[instrument][t];
        if (!is_working(tool, o)) {
            sweep->active = false;
            continue;
        }
        struct sweep now = sweep_now(&scene->tissues[t], scene, out, o);
        if (!watch(sweep, tool, &now, &scene->tissues[t].box))
            continue;
        if (!is_cut_at_once(cutting)) {
            lost += let_wait(cutting, instrument, t, sweep, &now);
            *sweep = now;
        } else if (!due->from || sweep->time_ns < due->from->time_ns) {
            *due = (struct due_move){sweep, now, instrument, t};
        }
    }
    return lost;
}

int cutting_watch(struct cutting *cutting, const struct scene *scene,
                  const struct session_output *out) {
    int lost = 0;
    cutting->due = (struct due_move){0};
    for (int i = 0; i < cutting->instruments->count; i++)
        lost += watch_instrument(cutting, scene, out, i, &cutting->due);
    return lost;
}

// ---- jobs ---------------------------------------------------------------------------------------

static bool take_due(struct cutting *cutting, struct job *out_job) {
    struct due_move *due = &cutting->due;
    struct sweep *from = due->from;
    if (!from)
        return false;
    out_job->kind = JOB_CUT;
    out_job->tissue = due->tissue;
    out_job->stroke = stroke_of(cutting, due->instrument, &due->to);
    out_job->move_count = 1;
    out_job->moves[0] = move_of(due->instrument, from, &due->to);
    *from = due->to;
    due->from = NULL;
    return true;
}

static struct waiting_moves *waited_longest(struct cutting *cutting, int *out_tissue) {
    struct waiting_moves *longest = NULL;
    for (int i = 0; cutting->waiting_count && i < INSTRUMENT_COUNT; i++)
        for (int t = 0; t < TISSUES_MAX; t++) {
            struct waiting_moves *w = &cutting->waiting[i][t];
            if (!w->count || (longest && w->moves[0].begin_ns >= longest->moves[0].begin_ns))
                continue;
            longest = w;
            *out_tissue = t;
        }
    return longest;
}

bool cutting_take(struct cutting *cutting, struct job *out_job) {
    if (is_cut_at_once(cutting))
        return take_due(cutting, out_job);
    struct waiting_moves *w = waited_longest(cutting, &out_job->tissue);
    if (!w)
        return false;
    int count = 0;
    for (; count < w->count && count < JOB_MOVES_MAX; count++) {
        if (w->moves[count].stroke != w->moves[0].stroke)
            break;
        out_job->moves[count] = w->moves[count].move;
    }
    out_job->kind = JOB_CUT;
    out_job->stroke = w->moves[0].stroke;
    out_job->move_count = count;
    remove_waiting(cutting, w, 0, count);
    return true;
}
