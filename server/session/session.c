#include "session/session.h"

#include "base/check.h"
#include "base/clock.h"
#include "session/digest.h"
#include "session/scene.h"

#include <stdlib.h>
#include <string.h>

#define CONTACT_MM 0.2
#define RELEASE_MM 0.4

struct session {
    const struct scene *scene;
    struct session_settings settings;
    enum session_state state;
    uint64_t step;
    int64_t time_ns;
    uint64_t hash;
    // The newest sample of each channel and kind; known says whether there was ever one.
    struct sample samples[CHANNEL_COUNT][SAMPLE_KIND_COUNT];
    bool known[CHANNEL_COUNT][SAMPLE_KIND_COUNT];
    bool in_contact[INSTRUMENT_COUNT];
    struct warp_memory memory[INSTRUMENT_COUNT];
};

struct session_settings session_settings_default(void) {
    return (struct session_settings){
        .field = field_default(FIELD_INVERSE_DISTANCE),
        .strength = 1,
        .hold_ns = 100 * NS_PER_MS,
    };
}

const char *session_state_name(enum session_state state) {
    static const char *const names[SESSION_STATE_COUNT] = {"waiting", "running", "paused",
                                                           "closed"};
    return (unsigned)state < SESSION_STATE_COUNT ? names[state] : "unknown";
}

const char *input_kind_name(enum input_kind kind) {
    static const char *const names[INPUT_KIND_COUNT] = {"frame", "empty", "start",
                                                        "pause", "stop",  "reset"};
    return (unsigned)kind < INPUT_KIND_COUNT ? names[kind] : "unknown";
}

static void forget(struct session *s) {
    memset(s->known, 0, sizeof s->known);
    memset(s->in_contact, 0, sizeof s->in_contact);
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        warp_memory_init(&s->memory[i]);
}

struct session *session_create(const struct scene *scene, const struct session_settings *settings) {
    CHECK(settings->strength >= 0 && settings->strength <= 1 && settings->hold_ns >= 0);
    struct session *s = alloc(1, sizeof *s);
    s->scene = scene;
    s->settings = *settings;
    forget(s);
    return s;
}

void session_destroy(struct session **session) {
    free(*session);
    *session = NULL;
}

// ---- inputs -------------------------------------------------------------------------------------

static enum session_state next_state(enum session_state state, enum input_kind kind) {
    if (state == SESSION_CLOSED)
        return SESSION_CLOSED;
    switch (kind) {
    case INPUT_START:
    case INPUT_RESET:
        return SESSION_RUNNING;
    case INPUT_PAUSE:
        return state == SESSION_RUNNING ? SESSION_PAUSED : state;
    case INPUT_STOP:
        return SESSION_CLOSED;
    default:
        return state;
    }
}

static uint32_t change_state(struct session *s, enum input_kind kind) {
    enum session_state before = s->state;
    s->state = next_state(before, kind);
    if (kind == INPUT_RESET && before != SESSION_CLOSED) {
        forget(s);
        return EVENT_STATE;
    }
    return s->state != before ? EVENT_STATE : 0;
}

static bool is_too_old(const struct session *s, const struct sample *sample) {
    return s->time_ns - sample->time_ns > s->settings.hold_ns;
}

// The last good value stays when a sample is lost. A time ahead of ours is clock error: taken as
// now, so that no sample is held for longer than another.
static uint32_t take_sample(struct session *s, const struct sample *sample) {
    struct sample *newest = &s->samples[sample->channel][sample->kind];
    bool *known = &s->known[sample->channel][sample->kind];
    bool was_lost = *known && newest->validity == VALIDITY_LOST;
    bool is_lost = sample->validity == VALIDITY_LOST || is_too_old(s, sample);
    if (is_lost) {
        newest->validity = VALIDITY_LOST;
        return *known && !was_lost ? EVENT_DEVICE_LOST : 0;
    }
    *newest = *sample;
    if (newest->time_ns > s->time_ns)
        newest->time_ns = s->time_ns;
    *known = true;
    return was_lost ? EVENT_DEVICE_BACK : 0;
}

// A sample that stopped coming is held, then lost.
static uint32_t age_samples(struct session *s) {
    uint32_t events = 0;
    for (int c = 0; c < CHANNEL_COUNT; c++)
        for (int k = 0; k < SAMPLE_KIND_COUNT; k++) {
            struct sample *sample = &s->samples[c][k];
            if (!s->known[c][k] || sample->validity == VALIDITY_LOST)
                continue;
            if (is_too_old(s, sample)) {
                sample->validity = VALIDITY_LOST;
                events |= EVENT_DEVICE_LOST;
            }
        }
    return events;
}

static uint32_t take_input(struct session *s, const struct session_input *input) {
    CHECK(input->time_ns >= s->time_ns);
    s->time_ns = input->time_ns;
    if (input->kind != INPUT_FRAME)
        return change_state(s, input->kind) | age_samples(s);
    CHECK(frame_is_valid(&input->frame));
    uint32_t events = 0;
    for (int i = 0; i < input->frame.count; i++)
        events |= take_sample(s, &input->frame.samples[i]);
    return events | age_samples(s);
}

// ---- bones --------------------------------------------------------------------------------------

static bool pose_is_known(const struct session *s, enum channel channel) {
    return s->known[channel][SAMPLE_POSE];
}

static pose last_pose(const struct session *s, enum channel channel) {
    return s->samples[channel][SAMPLE_POSE].T_mockup_body;
}

static enum validity pose_validity(const struct session *s, enum channel channel) {
    return s->samples[channel][SAMPLE_POSE].validity;
}

static enum validity worse(enum validity a, enum validity b) {
    return a > b ? a : b;
}

// A tracked tibia wins over the joint's encoders, unless it is lost and they are not.
static bool tibia_is_tracked(const struct session *s) {
    if (!pose_is_known(s, CHANNEL_TIBIA))
        return false;
    bool encoders_good = s->known[CHANNEL_JOINT][SAMPLE_JOINT] &&
                         s->samples[CHANNEL_JOINT][SAMPLE_JOINT].validity != VALIDITY_LOST;
    return pose_validity(s, CHANNEL_TIBIA) != VALIDITY_LOST || !encoders_good;
}

static void place_tibia(const struct session *s, struct session_output *out) {
    const struct joint_frame *joint = &s->scene->knee->joint;
    const struct sample *encoders = &s->samples[CHANNEL_JOINT][SAMPLE_JOINT];
    pose *bodies = out->T_mockup_body;
    if (tibia_is_tracked(s)) {
        bodies[BODY_TIBIA] = last_pose(s, CHANNEL_TIBIA);
        pose T_mockup_femur = bodies[BODY_FEMUR];
        out->joint =
            joint_from_pose(joint, pose_compose(pose_inverse(T_mockup_femur), bodies[BODY_TIBIA]));
        out->joint_validity = pose_validity(s, CHANNEL_TIBIA);
        if (pose_is_known(s, CHANNEL_FEMUR))
            out->joint_validity = worse(out->joint_validity, pose_validity(s, CHANNEL_FEMUR));
        return;
    }
    bool known = s->known[CHANNEL_JOINT][SAMPLE_JOINT];
    out->joint = known ? encoders->joint : (struct joint_angles){0};
    out->joint_validity = known ? encoders->validity : VALIDITY_LOST;
    bodies[BODY_TIBIA] = pose_compose(bodies[BODY_FEMUR], joint_to_pose(joint, &out->joint));
}

// An untracked femur is the mock-up's own frame. What is lost stays where it was last seen: a bone
// that jumped would take the surfaces under the instruments with it.
static void place_bones(const struct session *s, struct session_output *out) {
    pose *bodies = out->T_mockup_body;
    bodies[BODY_FEMUR] =
        pose_is_known(s, CHANNEL_FEMUR) ? last_pose(s, CHANNEL_FEMUR) : pose_identity();
    place_tibia(s, out);
    pose T_femur_patella = case_patella_pose(s->scene->knee, out->joint.flexion_deg);
    bodies[BODY_PATELLA] = pose_is_known(s, CHANNEL_PATELLA)
                               ? last_pose(s, CHANNEL_PATELLA)
                               : pose_compose(bodies[BODY_FEMUR], T_femur_patella);
}

// ---- instruments --------------------------------------------------------------------------------

static void warp_tip(struct session *s, const pose *bodies, int instrument, vec3 tip,
                     struct instrument_output *out) {
    struct warp_scene scene = {
        .surfaces = s->scene->surfaces,
        .surface_count = s->scene->knee->group_count,
        .T_world_body = bodies,
    };
    warp_point(&scene, &s->settings.field, tip, &s->memory[instrument], &out->warp);
    // Without corrections W is linear in the displacements, so the strength scales W itself.
    out->warp.displacement = vec3_scale(s->settings.strength, out->warp.displacement);
    mat3 zero = {0};
    out->warp.gradient = mat3_add_scaled(zero, s->settings.strength, out->warp.gradient);
    out->gain = mat3_norm(mat3_add_scaled(mat3_identity(), 1, out->warp.gradient));
}

static uint32_t feel_contact(struct session *s, int instrument, double distance_mm) {
    bool *in_contact = &s->in_contact[instrument];
    if (!*in_contact && distance_mm < CONTACT_MM) {
        *in_contact = true;
        return EVENT_CONTACT;
    }
    if (*in_contact && distance_mm > RELEASE_MM) {
        *in_contact = false;
        return EVENT_RELEASE;
    }
    return 0;
}

static uint32_t move_instrument(struct session *s, int instrument, struct session_output *out) {
    enum channel channel = (enum channel)(CHANNEL_FIRST_INSTRUMENT + instrument);
    struct instrument_output *o = &out->instruments[instrument];
    if (!pose_is_known(s, channel) || pose_validity(s, channel) == VALIDITY_LOST)
        return feel_contact(s, instrument, INFINITY);
    pose T_mockup_tip = last_pose(s, channel);
    o->present = true;
    o->validity = pose_validity(s, channel);
    o->T_mockup_tip = o->T_mockup_warped = T_mockup_tip;
    if (s->known[channel][SAMPLE_HANDLE])
        o->handle = s->samples[channel][SAMPLE_HANDLE].handle;
    warp_tip(s, out->T_mockup_body, instrument, T_mockup_tip.translation, o);
    o->T_mockup_warped.translation = vec3_add(T_mockup_tip.translation, o->warp.displacement);
    return feel_contact(s, instrument, o->warp.nearest_mm);
}

// ---- the step -----------------------------------------------------------------------------------

void session_step(struct session *s, const struct session_input *input,
                  struct session_output *out) {
    memset(out, 0, sizeof *out);
    out->events = take_input(s, input);
    out->step = ++s->step;
    out->frame_number = input->kind == INPUT_FRAME ? input->frame.number : 0;
    out->time_ns = s->time_ns;
    out->state = s->state;
    place_bones(s, out);
    for (int i = 0; s->state == SESSION_RUNNING && i < INSTRUMENT_COUNT; i++)
        out->events |= move_instrument(s, i, out);
    s->hash = digest_output(s->hash, out);
    out->hash = s->hash;
}
