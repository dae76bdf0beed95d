#include "runtime/step_snapshot.h"

#include "base/clock.h"
#include "runtime/reply.h"

#include <math.h>
#include <string.h>

#define SPEED_NS (50 * NS_PER_MS)
#define RATE_USUAL_HZ 30
#define RATE_MOST_HZ 120

void snapshot_begin(struct snapshot_maker *m, uint64_t session, int64_t start_ns) {
    memset(m, 0, sizeof *m);
    m->now.session = session;
    m->start_ns = start_ns;
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        m->now.instruments[i].validity = VALIDITY_LOST;
}

// Whoever was away begins at rest.
static double follow_speed(vec3 *velocity, const struct snapshot_instrument *before, vec3 tip,
                           int64_t passed_ns) {
    if (!before->seen || before->validity == VALIDITY_LOST)
        *velocity = (vec3){0, 0, 0};
    else if (passed_ns > 0) {
        vec3 way = vec3_sub(tip, before->tip.translation);
        vec3 measured = vec3_scale((double)NS_PER_S / (double)passed_ns, way);
        *velocity =
            vec3_lerp(*velocity, measured, (double)passed_ns / (double)(SPEED_NS + passed_ns));
    }
    return vec3_length(*velocity);
}

// A session that is closed places no instruments: those that it had then are not lost.
static void stand_still(struct snapshot_instrument *out, enum session_state state) {
    out->speed_mm_s = 0;
    out->handle.buttons = 0;
    if (state == SESSION_CLOSED)
        return;
    out->validity = VALIDITY_LOST;
    out->warp_mm = 0;
}

static void take_instrument(struct snapshot_maker *m, int index, int64_t passed_ns,
                            const struct instrument_output *o) {
    struct snapshot_instrument *out = &m->now.instruments[index];
    if (!o->present) {
        stand_still(out, m->now.state);
        return;
    }
    double speed = follow_speed(&m->velocities[index], out, o->T_mockup_tip.translation, passed_ns);
    *out = (struct snapshot_instrument){
        .seen = true,
        .validity = o->validity,
        .tip = o->T_mockup_tip,
        .warped = o->T_mockup_warped,
        .nearest_mm = isfinite(o->warp.nearest_mm) ? o->warp.nearest_mm : -1,
        .penetration_mm = o->penetration_mm,
        .warp_mm = vec3_length(o->warp.displacement),
        .gain = o->discrepancy.gain,
        .gain_least = o->discrepancy.gain_least,
        .speed_mm_s = speed,
        .handle = o->handle,
    };
}

void snapshot_step(struct snapshot_maker *m, const struct session_output *output) {
    struct step_snapshot *now = &m->now;
    int64_t passed_ns = m->stepped_ns ? output->time_ns - m->stepped_ns : 0;
    m->stepped_ns = output->time_ns;
    now->step = output->step;
    now->time_ns = output->time_ns;
    now->since_ns = output->time_ns - m->start_ns;
    now->state = output->state;
    now->joint_validity = output->joint_validity;
    now->joint = output->joint;
    memcpy(now->T_mockup_body, output->T_mockup_body, sizeof now->T_mockup_body);
    memcpy(now->T_mockup_virtual, output->T_mockup_virtual, sizeof now->T_mockup_virtual);
    now->loose_count = output->loose_count;
    memcpy(now->loose, output->loose, sizeof now->loose);
    for (int i = 0; i < EVENT_COUNT; i++)
        now->events[i] += output->events >> i & 1;
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        take_instrument(m, i, passed_ns, &output->instruments[i]);
}

void snapshot_forces(struct snapshot_maker *m, const struct metrics *metrics) {
    for (int i = 0; i < INSTRUMENT_COUNT; i++) {
        const struct gauge *gauge = &metrics->instruments[i].gauge;
        m->now.instruments[i].has_force = gauge->known && gauge->validity != VALIDITY_LOST;
        m->now.instruments[i].force_n = gauge->force_n;
    }
}

// ---- on the wire --------------------------------------------------------------------------------

static arthron_BodyMoment body_to_wire(const struct step_snapshot *m, int body) {
    const pose *physical = &m->T_mockup_body[body], *seen = &m->T_mockup_virtual[body];
    bool elsewhere = memcmp(physical, seen, sizeof *seen) != 0;
    arthron_BodyMoment message = {.body = (arthron_Body)body, .has_pose = true};
    message.pose = wire_short_pose_from(*physical);
    message.has_virtual_pose = elsewhere;
    if (elsewhere)
        message.virtual_pose = wire_short_pose_from(*seen);
    return message;
}

static arthron_InstrumentMoment instrument_to_wire(const struct snapshot_instrument *m, int index) {
    return (arthron_InstrumentMoment){
        .channel = (uint8_t)(CHANNEL_FIRST_INSTRUMENT + index),
        .validity = (arthron_Validity)m->validity,
        .has_tip = true,
        .tip = wire_short_pose_from(m->tip),
        .has_warped = true,
        .warped = wire_short_pose_from(m->warped),
        .nearest_mm = (float)m->nearest_mm,
        .penetration_mm = (float)m->penetration_mm,
        .warp_mm = (float)m->warp_mm,
        .gain = (float)m->gain,
        .gain_least = (float)m->gain_least,
        .speed_mm_s = (float)m->speed_mm_s,
        .opening = (float)m->handle.opening,
        .buttons = m->handle.buttons,
        .has_force_n = m->has_force,
        .force_n = m->has_force ? (float)m->force_n : 0,
    };
}

static arthron_LooseMoment loose_to_wire(const struct loose_output *loose) {
    return (arthron_LooseMoment){
        .state = (arthron_LooseMoment_State)loose->state,
        .on = reply_carrier(loose->carrier),
        .has_pose = true,
        .pose = wire_short_pose_from(loose->T_mockup_loose),
    };
}

_Static_assert(sizeof((arthron_Moment *)0)->loose / sizeof(arthron_LooseMoment) == CASE_LOOSE_MAX &&
                   (int)_arthron_LooseMoment_State_ARRAYSIZE == LOOSE_STATE_COUNT,
               "every loose body is told");
_Static_assert(sizeof((arthron_Moment *)0)->events / sizeof(uint32_t) >= EVENT_COUNT,
               "every event is told");

void snapshot_to_wire(const struct step_snapshot *m, uint32_t station, arthron_Moment *out) {
    *out = (arthron_Moment){
        .station_number = station,
        .step = m->step,
        .time_ns = m->since_ns,
        .state = (arthron_SessionState)m->state,
        .joint_validity = (arthron_Validity)m->joint_validity,
        .has_joint = true,
        .joint = wire_joint_from(&m->joint),
        .bodies_count = BODY_COUNT,
        .events_count = EVENT_COUNT,
        .attempt = m->attempt,
        .attempt_ns = m->attempt_ns,
    };
    for (int i = 0; i < BODY_COUNT; i++)
        out->bodies[i] = body_to_wire(m, i);
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        if (m->instruments[i].seen)
            out->instruments[out->instruments_count++] = instrument_to_wire(&m->instruments[i], i);
    out->loose_count = (pb_size_t)m->loose_count;
    for (int i = 0; i < m->loose_count; i++)
        out->loose[i] = loose_to_wire(&m->loose[i]);
    memcpy(out->events, m->events, sizeof m->events);
}

int64_t snapshot_period_ns(const arthron_Watch *watch) {
    uint32_t rate_hz = watch->rate_hz ? watch->rate_hz : RATE_USUAL_HZ;
    return NS_PER_S / (rate_hz < RATE_MOST_HZ ? rate_hz : RATE_MOST_HZ);
}

// ---- keeping ------------------------------------------------------------------------------------

static bool is_sound(const struct step_snapshot *s) {
    bool sound = (unsigned)s->state < SESSION_STATE_COUNT &&
                 (unsigned)s->joint_validity < VALIDITY_COUNT && s->loose_count >= 0 &&
                 s->loose_count <= CASE_LOOSE_MAX;
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        sound = sound && (unsigned)s->instruments[i].validity < VALIDITY_COUNT;
    for (int i = 0; i < CASE_LOOSE_MAX; i++)
        sound = sound && (unsigned)s->loose[i].state < LOOSE_STATE_COUNT;
    return sound;
}

void snapshot_keep(struct snapshot_maker *maker, struct kept *k) {
    struct snapshot_maker was = *maker;
    kept_bytes(k, maker, sizeof *maker);
    kept_holds(k, is_sound(&maker->now));
    if (!k->reads)
        return;
    maker->now.session = was.now.session;
    maker->start_ns = was.start_ns;
}
