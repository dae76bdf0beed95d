#include "wire/valid_messages.h"

#include "wire/seal.h"

#include <string.h>

struct sample make_sample(struct random *random, enum channel channel) {
    struct sample sample = {.channel = channel, .kind = SAMPLE_POSE};
    sample.validity = (enum validity)(random_bits(random) % VALIDITY_COUNT);
    sample.device = (uint8_t)(random_bits(random) % WIRE_DEVICES_MAX);
    sample.time_ns = (int64_t)(random_bits(random) >> 4); // below WIRE_TIME_MAX_NS
    sample.filter = random_bits(random) % FILTER_KIND_COUNT;
    sample.filter_latency_us = sample.filter ? (uint16_t)random_bits(random) : 0;
    if (channel == CHANNEL_JOINT) {
        sample.kind = SAMPLE_JOINT;
        sample.joint = (struct joint_angles){random_between(random, -90, 90), -1.5, 2, 3, -4, 5};
    } else if (channel >= CHANNEL_FIRST_INSTRUMENT && random_bits(random) % 2) {
        sample.kind = SAMPLE_HANDLE;
        sample.handle = (struct handle){random_between(random, 0, 1), 0x80000001};
    } else if (random_bits(random) % 4 == 0) {
        sample.kind = SAMPLE_FORCE;
        sample.force_n = random_between(random, -FORCE_MAX_N, FORCE_MAX_N);
    } else {
        sample.T_mockup_body = random_pose(random, 500);
    }
    return sample;
}

static bool has_such(const struct frame *frame, const struct sample *sample) {
    for (int i = 0; i < frame->count; i++)
        if (frame->samples[i].channel == sample->channel && frame->samples[i].kind == sample->kind)
            return true;
    return false;
}

struct frame make_frame(struct random *random, int count) {
    struct frame frame = {.number = random_bits(random), .time_ns = 123456789};
    while (frame.count < count) {
        enum channel channel = (enum channel)(random_bits(random) % CHANNEL_COUNT);
        struct sample sample = make_sample(random, channel);
        if (!has_such(&frame, &sample))
            frame.samples[frame.count++] = sample;
    }
    return frame;
}

// No value of it is at its default.
struct avatar_extrapolation make_extrapolation(enum avatar_mode mode) {
    struct random random = {(uint64_t)mode};
    struct avatar_extrapolation extrapolation = {.mode = mode,
                                                 .portal = random_in_box(&random, 100),
                                                 .motion = {random_in_box(&random, 5), 1.5},
                                                 .reach_mm = 42,
                                                 .trust_radius_mm = 0.7};
    for (int i = 0; i < 4; i++)
        for (int k = 0; k < 6; k++)
            extrapolation.slope[i][k] = random_between(&random, -1, 1);
    return extrapolation;
}

// The longest reply about these instruments: no field is at its default.
arthron_Reply longest_reply(const bool there[CHANNEL_COUNT]) {
    arthron_Reply reply = {.frame_number = 7,
                           .frame_time_ns = -1,
                           .state = arthron_SessionState_CLOSED,
                           .events = 0xffffffff};
    for (int channel = CHANNEL_FIRST_INSTRUMENT; channel < CHANNEL_COUNT; channel++) {
        if (!there[channel] || reply.instruments_count == WIRE_REPLY_INSTRUMENTS)
            continue;
        arthron_WarpedInstrument *w = &reply.instruments[reply.instruments_count++];
        *w = (arthron_WarpedInstrument){
            .channel = (uint8_t)channel,
            .validity = arthron_Validity_HELD,
            .body = arthron_Body_BODY_PATELLA,
            .has_pose = true,
            .pose = {0.5, 0.5, -0.5, 0.5, 1e3, -2e3, 3e-3},
            .nearest_mm = -1,
        };
        struct avatar_extrapolation extrapolation = make_extrapolation(AVATAR_RIGID);
        wire_extrapolation_from(&extrapolation, w);
    }
    for (int body = arthron_Body_BODY_TIBIA; body <= arthron_Body_BODY_PATELLA; body++)
        reply.corrections[reply.corrections_count++] =
            (arthron_Correction){(arthron_Body)body, true, {0.5, 0.5, -0.5, 0.5, 1e3, -2e3, 3e-3}};
    return reply;
}

arthron_Reply full_reply(void) {
    bool all[CHANNEL_COUNT];
    memset(all, true, sizeof all);
    arthron_Reply reply = longest_reply(all);
    reply.event_counts_count = sizeof reply.event_counts / sizeof *reply.event_counts;
    memset(reply.event_counts, 0xff, sizeof reply.event_counts);
    reply.path_challenge = UINT64_MAX;
    reply.has_frames_lost = reply.has_frames_late = true;
    reply.frames_lost = reply.frames_late = UINT32_MAX;
    reply.loose_count = 1; // with two it is too long for a datagram
    reply.loose[0] =
        (arthron_CarriedLoose){.number = WIRE_LOOSE_MAX - 1,
                               .state = arthron_LooseMoment_State_HELD,
                               .on = CHANNEL_COUNT - 1,
                               .has_pose = true,
                               .pose = {4, {0.5f, 0.5f, -0.5f, 0.5f}, 3, {1e3f, -2e3f, 3e-3f}}};
    return reply;
}

static void fill_hello(arthron_Hello *hello) {
    *hello = (arthron_Hello){.version_min = 1,
                             .version_max = 3,
                             .capabilities_count = 2,
                             .capabilities = {"datagrams", "x"},
                             .station = "station-1",
                             .software = "arthron-station 1",
                             .devices_count = 2,
                             .devices = {{"encoders", "modbus"}, {"optical", "tracker"}},
                             .connection = 99,
                             .has_calibration = true,
                             .calibration = {1790000000, 0.25, 0.5},
                             .visit = true,
                             .instruments_count = 1,
                             .instruments = {{.channel = CHANNEL_FIRST_DESCRIBED,
                                              .name = "curette",
                                              .kind = arthron_Instrument_Kind_BLADE,
                                              .cuts = true,
                                              .length_mm = 4,
                                              .width_mm = 3,
                                              .thickness_mm = 0.5,
                                              .has_colour = true,
                                              .colour = 0xffcc00}}};
}

static void fill_keys(arthron_UdpKeys *keys) {
    *keys = (arthron_UdpKeys){.port = 4444, .connection = 0xfeedface, .epoch = 255};
    memset(keys->key_to_server, 1, sizeof keys->key_to_server);
    memset(keys->iv_to_server, 2, sizeof keys->iv_to_server);
    memset(keys->key_to_station, 3, sizeof keys->key_to_station);
    memset(keys->iv_to_station, 4, sizeof keys->iv_to_station);
}

static void fill_enrolled(arthron_Enrolled *enrolled) {
    enrolled->certificate_der.size = sizeof enrolled->certificate_der.bytes;
    enrolled->authority_der.size = 400;
    memset(enrolled->certificate_der.bytes, 0x30, sizeof enrolled->certificate_der.bytes);
}

static void fill_welcome(arthron_Welcome *welcome) {
    *welcome = (arthron_Welcome){.version = 1,
                                 .capabilities_count = 1,
                                 .capabilities = {"datagrams"},
                                 .software = "arthron-server 1",
                                 .session_id = {1, 2, 3},
                                 .case_name = "healthy",
                                 .case_hash = 5,
                                 .state = arthron_SessionState_PAUSED,
                                 .resumed = true,
                                 .hold_ms = 100,
                                 .utc_s = 1800000000,
                                 .token = UINT64_MAX};
}

void make_knee(struct knee_frame *out) {
    struct random random = {12};
    *out = (struct knee_frame){
        .joint = {SIDE_LEFT, random_pose(&random, 50), random_pose(&random, 50)},
        .patella_count = PATELLA_KEYS_MAX};
    for (int i = 0; i < PATELLA_KEYS_MAX; i++)
        out->patella[i] = (struct patella_key){2 * i - 10, random_pose(&random, 50)};
}

static void fill_attempt(arthron_AttemptState *out) {
    *out = (arthron_AttemptState){.number = 3,
                                  .task = "probe-in-order",
                                  .version = 2,
                                  .title = "Probing in order",
                                  .purpose = arthron_AttemptState_Purpose_EXAM,
                                  .hand = arthron_AttemptState_Hand_LEFT_HAND,
                                  .begun_step = 700,
                                  .last_step = 800,
                                  .time_ns = 12000000000,
                                  .limit_s = 300,
                                  .goals_count = 24,
                                  .errors_count = 12,
                                  .occurrences_count = 64,
                                  .end = arthron_AttemptState_End_DONE,
                                  .verdict = arthron_AttemptState_Verdict_PASSED,
                                  .pass_time_s = 95,
                                  .pass_errors = 1};
    for (int i = 0; i < 24; i++)
        out->goals[i] = (arthron_AttemptGoal){"a-goal", i < 3, i};
    for (int i = 0; i < 12; i++)
        out->errors[i] = (arthron_AttemptError){"an-error", 7, i == 0};
    for (int i = 0; i < 64; i++)
        out->occurrences[i] = (arthron_AttemptOccurrence){(uint32_t)i % 12, 2, 750, 9};
}

void fill_control(int which, arthron_Control *out) {
    struct random random = {3};
    memset(out, 0, sizeof *out);
    out->which_message = (pb_size_t)which;
    struct frame frame = make_frame(&random, FRAME_SAMPLES_MAX);
    struct knee_frame knee;
    switch (which) {
    case arthron_Control_hello_tag:
        fill_hello(&out->message.hello);
        break;
    case arthron_Control_welcome_tag:
        fill_welcome(&out->message.welcome);
        break;
    case arthron_Control_refusal_tag:
        out->message.refusal =
            (arthron_Refusal){arthron_Refusal_Reason_ELSEWHERE, "too many", "[fd00::2]:4810", 250};
        break;
    case arthron_Control_ping_tag:
        out->message.ping = (arthron_Ping){.sent_ns = 1, .rests = true};
        break;
    case arthron_Control_pong_tag:
        out->message.pong = (arthron_Pong){1, 2, -3};
        break;
    case arthron_Control_frame_tag:
        wire_frame_from(&frame, &out->message.frame);
        break;
    case arthron_Control_reply_tag:
        out->message.reply = full_reply();
        break;
    case arthron_Control_udp_keys_tag:
        fill_keys(&out->message.udp_keys);
        break;
    case arthron_Control_udp_path_tag:
        out->message.udp_path.challenge = 77;
        break;
    case arthron_Control_session_change_tag:
        out->message.session_change = (arthron_SessionChange){.state = arthron_SessionState_RUNNING,
                                                              .case_name = "healthy",
                                                              .case_hash = 5,
                                                              .text = "started",
                                                              .has_knee = true};
        make_knee(&knee);
        wire_knee_from(&knee, &out->message.session_change.knee);
        break;
    case arthron_Control_enrol_tag:
        strcpy(out->message.enrol.code, "ABCDEF-234567");
        out->message.enrol.request_der.size = 300;
        break;
    case arthron_Control_mesh_ask_tag:
        out->message.mesh_ask = (arthron_MeshAsk){2, {{"medial", 7, 8}, {"lateral", 9, 10}}};
        break;
    case arthron_Control_mesh_ack_tag:
        out->message.mesh_ack = (arthron_MeshState){"medial", 7, UINT64_MAX};
        break;
    case arthron_Control_marker_tag:
        out->message.marker = (arthron_Marker){UINT64_MAX, 77, "trial.start", "Gerät 1", -2.5};
        break;
    case arthron_Control_attempt_tag:
        fill_attempt(&out->message.attempt);
        break;
    case arthron_Control_marker_ack_tag:
        out->message.marker_ack.number = UINT64_MAX;
        break;
    case arthron_Control_moved_tag:
        out->message.moved = (arthron_Moved){"b.example.org:4810"};
        break;
    default:
        fill_enrolled(&out->message.enrolled);
    }
}

void fill_console(int which, arthron_Console *out) {
    memset(out, 0, sizeof *out);
    out->which_message = (pb_size_t)which;
    if (which == arthron_Console_command_tag) {
        out->message.command = (arthron_Command){
            .kind = arthron_Command_Kind_CASE,
            .station = "station-1",
            .case_name = "healthy",
            .has_strength = true,
            .strength = 0.25,
            .has_remark = true,
            .remark = {.number = 3,
                       .text = "Lift the hand – slowly",
                       .has_marker = true,
                       .body = arthron_Body_BODY_PATELLA,
                       .has_point = true,
                       .point = {1.5, -2, 3},
                       .withdrawn = true},
            .trainee = "anna",
        };
        return;
    }
    if (which == arthron_Console_metrics_ask_tag) {
        strcpy(out->message.metrics_ask.station, "station-1");
        return;
    }
    if (which == arthron_Console_metrics_tag) {
        out->message.metrics.metrics_count = 2;
        out->message.metrics.metrics[0] = (arthron_Metric){"time", "", "s", 1, 12.5, false};
        out->message.metrics.metrics[1] =
            (arthron_Metric){"path_seen", "probe", "mm", 2, INFINITY, true};
        return;
    }
    arthron_CommandReply *reply = &out->message.command_reply;
    strcpy(reply->text, "no such station");
    reply->sessions_count = 3;
    for (int i = 0; i < 3; i++) {
        reply->sessions[i].state = arthron_SessionState_RUNNING;
        reply->sessions[i].rtt_p50_us = 250.5;
        strcpy(reply->sessions[i].station, "station-1");
    }
    reply->has_joint = true;
    reply->joint = (arthron_JointReading){.step = 7,
                                          .validity = arthron_Validity_HELD,
                                          .has_joint = true,
                                          .joint = {30, -5, 0.5, 1, 2, 3},
                                          .has_pose = true,
                                          .pose = {0.6, 0.8, 0, 0, 1, 2, 3}};
}
