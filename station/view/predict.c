#include "view/predict.h"

#include "base/check.h"
#include "base/clock.h"
#include "view/bones.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

_Static_assert((int)_arthron_Body_ARRAYSIZE == BONE_COUNT &&
                   (int)arthron_Body_BODY_TIBIA == BONE_TIBIA &&
                   (int)arthron_Body_BODY_PATELLA == BONE_PATELLA,
               "bones are the bodies on the wire");

#define WAY_MEMORY 128 // answers

#define EVENT_BITS (sizeof((arthron_View){0}.events) / sizeof(uint32_t))

// A frame that was sent.
struct sent_frame {
    uint64_t number; // 0: none
    int64_t time_ns;
    pose T_mockup_body[BONE_COUNT];
    bool has_tip[INSTRUMENT_COUNT];
    pose T_mockup_tip[INSTRUMENT_COUNT];
};

// The last answer about an instrument, in the frame of its body.
struct prediction {
    bool known;
    enum bone bone;
    struct avatar_extrapolation extrapolation;
    pose T_body_sent; // the tip in the frame that was answered
};

// The last answer about a loose body.
struct carried {
    bool known;
    arthron_LooseMoment_State state;
    int on; // a bone, or an instrument's channel
    pose T_carrier_loose;
};

struct predict {
    arthron_SessionState state;
    char case_name[64];
    uint64_t case_hash;
    struct bones bones;
    struct frame frame; // the newest
    struct bone_place places[BONE_COUNT];
    uint64_t answered;   // number of the newest frame that was
    int64_t answered_ns; // its time
    int64_t way_ns;      // how old answers have lately been when they came
    struct prediction answers[INSTRUMENT_COUNT];
    struct carried loose[WIRE_LOOSE_MAX];
    pose T_body_virtual[BONE_COUNT];
    double warp_mm;
    uint64_t connection;
    uint32_t told[EVENT_BITS]; // by the replies of this connection
    uint32_t events[EVENT_BITS];
    struct sent_frame sent[PREDICT_REMEMBERED];
};

static void forget_answers(struct predict *p) {
    memset(p->answers, 0, sizeof p->answers);
    memset(p->loose, 0, sizeof p->loose);
    memset(p->sent, 0, sizeof p->sent);
    p->way_ns = 0;
    for (int i = 0; i < BONE_COUNT; i++)
        p->T_body_virtual[i] = pose_identity();
    p->warp_mm = 0;
}

struct predict *predict_create(void) {
    struct predict *p = alloc(1, sizeof *p);
    forget_answers(p);
    bones_place(&p->bones, p->places);
    return p;
}

void predict_destroy(struct predict **predict) {
    free(*predict);
    *predict = NULL;
}

void predict_session(struct predict *p, arthron_SessionState state, const char *case_name,
                     uint64_t case_hash, const struct knee_frame *knee) {
    if (case_hash != p->case_hash)
        forget_answers(p);
    p->state = state;
    snprintf(p->case_name, sizeof p->case_name, "%s", case_name);
    p->case_hash = case_hash;
    p->bones.has_knee = knee != NULL;
    if (knee)
        p->bones.knee = *knee;
}

void predict_connection(struct predict *p, uint64_t connection) {
    if (connection != p->connection)
        memset(p->told, 0, sizeof p->told);
    p->connection = connection;
}

// ---- frames -------------------------------------------------------------------------------------

static void remember(struct predict *p) {
    struct sent_frame *sent = &p->sent[p->frame.number % PREDICT_REMEMBERED];
    *sent = (struct sent_frame){.number = p->frame.number, .time_ns = p->frame.time_ns};
    for (int i = 0; i < BONE_COUNT; i++)
        sent->T_mockup_body[i] = p->places[i].T_mockup_body;
    for (int i = 0; i < p->frame.count; i++) {
        const struct sample *sample = &p->frame.samples[i];
        int instrument = (int)sample->channel - CHANNEL_FIRST_INSTRUMENT;
        if (instrument < 0 || sample->kind != SAMPLE_POSE || sample->validity == VALIDITY_LOST)
            continue;
        sent->has_tip[instrument] = true;
        sent->T_mockup_tip[instrument] = sample->T_mockup_body;
    }
}

void predict_frame(struct predict *p, const struct frame *frame, bool sent) {
    p->frame = *frame;
    bones_take(&p->bones, frame);
    bones_place(&p->bones, p->places);
    if (sent)
        remember(p);
}

// ---- replies ------------------------------------------------------------------------------------

// A reply counts what the ones before it told, the lost ones too. One without counts has its bits.
static void count_events(struct predict *p, const arthron_Reply *reply) {
    for (unsigned bit = 0; bit < EVENT_BITS; bit++) {
        int32_t more = (int32_t)(reply->events >> bit & 1);
        if (reply->event_counts_count)
            more = bit < reply->event_counts_count
                       ? (int32_t)(reply->event_counts[bit] - p->told[bit])
                       : 0;
        if (more <= 0) // an older reply
            continue;
        p->told[bit] += (uint32_t)more;
        p->events[bit] += (uint32_t)more;
    }
}

static void take_instrument(struct predict *p, const struct sent_frame *sent,
                            const arthron_WarpedInstrument *m) {
    int instrument = (int)m->channel - CHANNEL_FIRST_INSTRUMENT;
    if (m->validity == arthron_Validity_LOST || !sent->has_tip[instrument])
        return;
    struct prediction *answer = &p->answers[instrument];
    *answer = (struct prediction){
        .known = true, .bone = (enum bone)m->body, .extrapolation = wire_extrapolation_to(m)};
    answer->T_body_sent = pose_compose(pose_inverse(sent->T_mockup_body[answer->bone]),
                                       sent->T_mockup_tip[instrument]);
    double warp_mm =
        vec3_distance(wire_pose_to(&m->pose).translation, answer->T_body_sent.translation);
    p->warp_mm = fmax(p->warp_mm, warp_mm);
}

static void take_loose(struct predict *p, const arthron_CarriedLoose *m) {
    struct carried *loose = &p->loose[m->number];
    *loose = (struct carried){.known = true, .state = m->state, .on = m->on};
    if (m->state == arthron_LooseMoment_State_OUT)
        return;
    loose->T_carrier_loose = wire_short_pose_to(&m->pose);
    loose->T_carrier_loose.rotation = quat_unit(loose->T_carrier_loose.rotation);
}

// The longest way counts at once, and is forgotten slowly.
static void note_way(struct predict *p, int64_t sent_ns) {
    int64_t way_ns = p->frame.time_ns - sent_ns;
    if (way_ns > PREDICT_WAY_MAX_NS)
        way_ns = PREDICT_WAY_MAX_NS;
    p->way_ns = way_ns > p->way_ns ? way_ns : p->way_ns - (p->way_ns - way_ns) / WAY_MEMORY;
}

// In a full reply instruments may take turns: an answer then counts until its next turn.
static void forget_unanswered(struct predict *p, const struct sent_frame *sent,
                              const arthron_Reply *reply) {
    bool turns = reply->instruments_count == WIRE_REPLY_INSTRUMENTS;
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        if (!turns || !sent->has_tip[i])
            p->answers[i] = (struct prediction){0};
}

bool predict_reply(struct predict *p, const arthron_Reply *reply) {
    const struct sent_frame *sent = &p->sent[reply->frame_number % PREDICT_REMEMBERED];
    count_events(p, reply);
    if (!reply->frame_number || sent->number != reply->frame_number ||
        reply->frame_number < p->answered)
        return false;
    p->state = reply->state;
    p->answered = sent->number;
    p->answered_ns = sent->time_ns;
    note_way(p, sent->time_ns);
    p->warp_mm = 0;
    forget_unanswered(p, sent, reply);
    for (pb_size_t i = 0; i < reply->instruments_count; i++)
        take_instrument(p, sent, &reply->instruments[i]);
    for (int i = 0; i < BONE_COUNT; i++)
        p->T_body_virtual[i] = pose_identity();
    for (pb_size_t i = 0; i < reply->corrections_count; i++)
        p->T_body_virtual[reply->corrections[i].body] =
            wire_pose_to(&reply->corrections[i].correction);
    for (pb_size_t i = 0; i < reply->loose_count; i++)
        take_loose(p, &reply->loose[i]);
    return true;
}

double predict_warp_mm(const struct predict *p) {
    return p->warp_mm;
}

arthron_SessionState predict_state(const struct predict *p) {
    return p->state;
}

// ---- the view -----------------------------------------------------------------------------------

static arthron_Validity answer_validity(const struct predict *p) {
    int64_t age_ns = p->frame.time_ns - p->answered_ns - p->way_ns;
    return age_ns <= PREDICT_GOOD_NS   ? arthron_Validity_OK
           : age_ns <= PREDICT_LOST_NS ? arthron_Validity_HELD
                                       : arthron_Validity_LOST;
}

static void show_warp(const struct predict *p, const struct prediction *answer, pose T_mockup_tip,
                      arthron_ViewInstrument *out) {
    int64_t age_ns = p->frame.time_ns - p->answered_ns;
    out->warp_validity = answer->known ? answer_validity(p) : arthron_Validity_LOST;
    if (out->warp_validity == arthron_Validity_LOST)
        return;
    const struct avatar_extrapolation *extrapolation = &answer->extrapolation;
    pose T_mockup_body = p->places[answer->bone].T_mockup_body;
    pose T_body_now = pose_compose(pose_inverse(T_mockup_body), T_mockup_tip);
    struct avatar_motion motion =
        avatar_extrapolate(extrapolation, answer->T_body_sent, T_body_now);
    pose T_body_warped =
        avatar_place(extrapolation->mode, extrapolation->portal, &motion, T_body_now);
    out->has_warped = true;
    out->warped = wire_pose_from(pose_compose(T_mockup_body, T_body_warped));
    out->age_ms = (float)age_ns / NS_PER_MS;
    out->clamped = avatar_share(extrapolation, answer->T_body_sent, T_body_now) < 1;
}

static arthron_ViewInstrument *shown_instrument(arthron_View *view, enum channel channel) {
    for (pb_size_t i = 0; i < view->instruments_count; i++)
        if ((enum channel)view->instruments[i].channel == channel)
            return &view->instruments[i];
    arthron_ViewInstrument *out = &view->instruments[view->instruments_count++];
    *out = (arthron_ViewInstrument){.channel = (uint8_t)channel,
                                    .validity = arthron_Validity_LOST,
                                    .warp_validity = arthron_Validity_LOST};
    snprintf(out->name, sizeof out->name, "%s", channel_name(channel));
    return out;
}

static void show_instrument(const struct predict *p, const struct sample *sample,
                            arthron_View *view) {
    arthron_ViewInstrument *out = shown_instrument(view, sample->channel);
    if (sample->validity == VALIDITY_LOST)
        return;
    if (sample->kind == SAMPLE_FORCE) {
        out->has_force_n = true;
        out->force_n = sample->force_n;
        return;
    }
    if (sample->kind == SAMPLE_HANDLE) {
        out->has_handle = true;
        out->handle = (arthron_Handle){sample->handle.opening, sample->handle.buttons};
        return;
    }
    out->validity = (arthron_Validity)sample->validity;
    out->time_ns = sample->time_ns;
    out->has_tip = true;
    out->tip = wire_pose_from(sample->T_mockup_body);
    show_warp(p, &p->answers[sample->channel - CHANNEL_FIRST_INSTRUMENT], sample->T_mockup_body,
              out);
}

static void show_bones(const struct predict *p, arthron_View *view) {
    for (int i = 0; i < BONE_COUNT; i++) {
        pose T_mockup_body = p->places[i].T_mockup_body;
        view->bodies[view->bodies_count++] = (arthron_ViewBody){
            .body = (arthron_Body)i,
            .validity = (arthron_Validity)p->places[i].validity,
            .has_pose = true,
            .pose = wire_pose_from(T_mockup_body),
            .has_virtual_pose = true,
            .virtual_pose = wire_pose_from(pose_compose(T_mockup_body, p->T_body_virtual[i]))};
    }
}

// Where what carries it is shown. False: it is not.
static bool shown_carrier(const struct carried *loose, const arthron_View *view, pose *out) {
    if (loose->state == arthron_LooseMoment_State_LYING) {
        *out = wire_pose_to(&view->bodies[loose->on].virtual_pose);
        return true;
    }
    for (pb_size_t i = 0; i < view->instruments_count; i++) {
        const arthron_ViewInstrument *instrument = &view->instruments[i];
        if (instrument->channel != loose->on || !instrument->has_warped)
            continue;
        *out = wire_pose_to(&instrument->warped);
        return true;
    }
    return false;
}

static void show_loose(const struct predict *p, arthron_View *view) {
    bool good = answer_validity(p) != arthron_Validity_LOST;
    for (int i = 0; i < WIRE_LOOSE_MAX; i++) {
        const struct carried *loose = &p->loose[i];
        pose T_mockup_carrier;
        if (!loose->known)
            continue;
        arthron_ViewLoose *out = &view->loose[view->loose_count++];
        *out = (arthron_ViewLoose){
            .number = (uint8_t)i, .state = loose->state, .on = (uint8_t)loose->on};
        out->has_pose = good && loose->state != arthron_LooseMoment_State_OUT &&
                        shown_carrier(loose, view, &T_mockup_carrier);
        if (out->has_pose)
            out->pose = wire_pose_from(pose_compose(T_mockup_carrier, loose->T_carrier_loose));
    }
}

void predict_view(const struct predict *p, arthron_View *view) {
    memset(view, 0, sizeof *view);
    view->time_ns = p->frame.time_ns;
    view->state = p->state;
    memcpy(view->case_name, p->case_name, sizeof view->case_name);
    view->case_hash = p->case_hash;
    show_bones(p, view);
    for (int i = 0; i < p->frame.count; i++)
        if (p->frame.samples[i].channel >= CHANNEL_FIRST_INSTRUMENT)
            show_instrument(p, &p->frame.samples[i], view);
    show_loose(p, view);
    view->events_count = EVENT_BITS;
    memcpy(view->events, p->events, sizeof view->events);
}
