#include "loop/loop.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/service.h"
#include "link/link.h"
#include "loop/meter.h"
#include "loop/teller.h"
#include "samples/runner.h"
#include "view/openigtlink.h"
#include "view/predict.h"
#include "view/shown_attempt.h"
#include "view/token.h"

#include <inttypes.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LAST_REPLIES_NS (300 * NS_PER_MS)

struct loop {
    const struct station_config *config;
    const struct loop_options *options;
    const volatile sig_atomic_t *stop;
    struct runner *runner;
    struct link *link;
    struct predict *predict;
    struct view *view;               // NULL: there is none
    struct openigtlink *openigtlink; // NULL: there is none
    struct teller *teller;
    uint64_t session_seen;
    char server[SERVER_TEXT_SIZE]; // that has the session
    uint64_t attempt_seen;
    struct shown_attempt attempt;
    uint64_t sent, warped;
    struct tally { // of the server's, which begins anew with each connection
        uint32_t told;
        uint64_t all;
    } lost, late;
    uint64_t markers_lost;
    uint64_t connection;
    struct meter whole, second; // round trips: since the start, since the last second
    uint64_t warped_second;
    double alignment_ms;   // since the last second, at most
    struct sample pressed; // the largest force since then; its time is 0: none
};

// ---- frames and replies -------------------------------------------------------------------------

static void follow_session(struct loop *loop) {
    struct link_session s;
    if (!link_get_session(loop->link, &loop->session_seen, &s))
        return;
    if (s.connection != loop->connection)
        loop->lost.told = loop->late.told = 0;
    loop->connection = s.connection;
    server_write(&s.server, loop->server);
    predict_connection(loop->predict, s.connection);
    predict_session(loop->predict, s.state, s.case_name, s.case_hash, s.has_knee ? &s.knee : NULL);
}

static void follow_attempt(struct loop *loop, int64_t now_ns) {
    arthron_AttemptState told;
    bool runs = predict_state(loop->predict) == arthron_SessionState_RUNNING;
    shown_attempt_go_on(&loop->attempt, now_ns, runs);
    if (link_get_attempt(loop->link, &loop->attempt_seen, &told))
        shown_attempt_take(&loop->attempt, &told);
}

static void show(struct loop *loop) {
    arthron_View message;
    bool viewed = loop->view && view_is_watched(loop->view);
    bool outside =
        loop->openigtlink && openigtlink_follow(loop->openigtlink, predict_state(loop->predict));
    if (!viewed && !outside)
        return;
    predict_view(loop->predict, &message);
    shown_attempt_put(&loop->attempt, &message);
    memcpy(message.server, loop->server, sizeof message.server);
    if (viewed)
        view_show(loop->view, &message);
    if (outside)
        openigtlink_show(loop->openigtlink, &message);
}

static void note_forces(struct loop *loop, const struct frame *frame) {
    for (int i = 0; i < frame->count; i++) {
        const struct sample *s = &frame->samples[i];
        if (s->kind == SAMPLE_FORCE && s->validity == VALIDITY_OK &&
            (!loop->pressed.time_ns || fabs(s->force_n) > fabs(loop->pressed.force_n)))
            loop->pressed = *s;
    }
}

// What can be sent was preceded by word of its session.
static void send_frame(struct loop *loop) {
    struct frame frame = {.number = loop->sent + 1, .time_ns = clock_now_ns()};
    runner_collect(loop->runner, frame.time_ns, &frame);
    loop->alignment_ms = fmax(loop->alignment_ms, runner_alignment_ms(loop->runner));
    note_forces(loop, &frame);
    bool sent = link_send(loop->link, &frame);
    loop->sent += sent;
    follow_session(loop);
    follow_attempt(loop, frame.time_ns);
    predict_frame(loop->predict, &frame, sent);
    show(loop);
}

static void send_markers(struct loop *loop) {
    struct marker marker;
    while (runner_next_marker(loop->runner, &marker)) {
        loop->markers_lost += !link_mark(loop->link, &marker);
        if (loop->openigtlink)
            openigtlink_mark(loop->openigtlink, &marker);
    }
}

static void take_count(struct tally *tally, uint32_t told) {
    int32_t more = (int32_t)(told - tally->told);
    if (more <= 0) // an older reply
        return;
    tally->all += (uint32_t)more;
    tally->told = told;
}

static void take_reply(struct loop *loop, const arthron_Reply *reply) {
    int64_t round_trip_ns = clock_now_ns() - reply->frame_time_ns;
    meter_add(&loop->whole, round_trip_ns);
    meter_add(&loop->second, round_trip_ns);
    loop->warped++;
    loop->warped_second++;
    if (reply->has_frames_lost)
        take_count(&loop->lost, reply->frames_lost);
    if (reply->has_frames_late)
        take_count(&loop->late, reply->frames_late);
    predict_reply(loop->predict, reply);
}

// For at most so long, even if the clock goes back.
static void take_replies(struct loop *loop, int64_t until_ns, int64_t most_ns) {
    arthron_Reply reply;
    for (;;) {
        int64_t latest_ns = clock_now_ns() + most_ns;
        if (!link_wait(loop->link, until_ns < latest_ns ? until_ns : latest_ns, &reply))
            return;
        take_reply(loop, &reply);
    }
}

// ---- what a person sees -------------------------------------------------------------------------

static uint64_t count_unanswered(const struct loop *loop) {
    return loop->sent > loop->warped ? loop->sent - loop->warped : 0;
}

static void each_second(struct loop *loop) {
    const struct told_second second = {
        .warped = loop->warped_second,
        .unanswered = count_unanswered(loop),
        .markers_lost = loop->markers_lost,
        .p50_us = meter_percentile_us(&loop->second, 0.5),
        .p99_us = meter_percentile_us(&loop->second, 0.99),
        .warp_mm = predict_warp_mm(loop->predict),
        .alignment_ms = loop->alignment_ms,
        .pressed = loop->pressed,
    };
    teller_tell(loop->teller, &second);
    service_notify("WATCHDOG=1");
    meter_clear(&loop->second);
    loop->warped_second = 0;
    loop->alignment_ms = 0;
    loop->pressed.time_ns = 0;
}

static json_t *tissues_as_json(struct link *link) {
    struct link_tissue tissues[WIRE_MESH_GROUPS_MAX];
    json_t *list = json_array();
    int count = link_get_tissues(link, tissues);
    for (int i = 0; i < count; i++) {
        char hash[17];
        snprintf(hash, sizeof hash, "%016" PRIx64, tissues[i].hash);
        json_array_append_new(list, json_pack("{s:s, s:I, s:I, s:s}", "group", tissues[i].group,
                                              "number", (json_int_t)tissues[i].number, "triangles",
                                              (json_int_t)tissues[i].triangles, "hash", hash));
    }
    return list;
}

static void log_tissues(struct link *link) {
    struct link_tissue tissues[WIRE_MESH_GROUPS_MAX];
    int count = link_get_tissues(link, tissues);
    for (int i = 0; i < count; i++)
        log_info("station", "mesh %s: number %" PRIu32 ", %" PRIu32 " triangles, hash %016" PRIx64,
                 tissues[i].group, tissues[i].number, tissues[i].triangles, tissues[i].hash);
}

static void print_summary(const struct loop *loop) {
    double p50 = meter_percentile_us(&loop->whole, 0.5);
    double p99 = meter_percentile_us(&loop->whole, 0.99);
    double max = (double)loop->whole.max_ns / 1e3;
    if (!loop->options->json) {
        log_info("station",
                 "%" PRIu64 " poses sent, %" PRIu64 " warped, %" PRIu64 " unanswered (%" PRIu64
                 " lost on their way, %" PRIu64 " late), round trip %.0f us p50",
                 loop->sent, loop->warped, count_unanswered(loop), loop->lost.all, loop->late.all,
                 p50);
        log_tissues(loop->link);
        return;
    }
    json_t *summary = json_pack(
        "{s:I, s:I, s:I, s:I, s:I, s:{s:f, s:f, s:f}, s:o}", "poses_sent", (json_int_t)loop->sent,
        "poses_warped", (json_int_t)loop->warped, "unanswered", (json_int_t)count_unanswered(loop),
        "lost", (json_int_t)loop->lost.all, "late", (json_int_t)loop->late.all, "rtt_us", "p50",
        p50, "p99", p99, "max", max, "meshes", tissues_as_json(loop->link));
    json_dumpf(summary, stdout, JSON_COMPACT);
    putchar('\n');
    json_decref(summary);
}

// ---- time ---------------------------------------------------------------------------------------

static bool goes_on(const struct loop *loop, int64_t start_ns, int64_t now_ns) {
    double seconds = loop->options->seconds;
    return !*loop->stop && !(seconds > 0 && (double)(now_ns - start_ns) >= seconds * 1e9);
}

// Ticks lie on a fixed grid; after a stall the missed ones are left out rather than made up for.
static void run(struct loop *loop) {
    int64_t period_ns = (int64_t)(1e9 / loop->config->rate_hz);
    int64_t start_ns = clock_now_ns(), tick_ns = start_ns, second_ns = start_ns + NS_PER_S;
    for (int64_t now_ns = start_ns; goes_on(loop, start_ns, now_ns); now_ns = clock_now_ns()) {
        if (now_ns >= second_ns) {
            each_second(loop);
            second_ns += NS_PER_S;
        }
        send_frame(loop);
        send_markers(loop);
        tick_ns += period_ns;
        if (tick_ns < now_ns - period_ns || tick_ns > now_ns + period_ns)
            tick_ns = now_ns;
        take_replies(loop, tick_ns, period_ns);
    }
    take_replies(loop, clock_now_ns() + LAST_REPLIES_NS, LAST_REPLIES_NS);
}

// ---- making and releasing -----------------------------------------------------------------------

static arthron_Calibration calibration_from(const struct calibration *calibration) {
    struct calibration_summary summary = calibration_summarise(calibration);
    return (arthron_Calibration){summary.utc_s, summary.residual_mm, summary.residual_deg};
}

struct link_config loop_link_config(const struct station_config *config) {
    struct link_config link = {
        .server_count = config->server_count,
        .keys_dir = config->keys_dir,
        .station = config->name,
        .software = "arthron-station " ARTHRON_VERSION,
        .datagrams = config->datagrams,
        .meshes = true,
        .instruments = config->instruments,
        .device_count = config->device_count,
        .calibrated = config->calibration.count > 0,
    };
    memcpy(link.servers, config->servers, sizeof link.servers);
    if (link.calibrated)
        link.calibration = calibration_from(&config->calibration);
    for (int i = 0; i < config->device_count; i++) {
        const struct device_config *device = &config->devices[i].config;
        snprintf(link.devices[i].name, sizeof link.devices[i].name, "%s", device->name);
        for (int k = 0; k < device->option_count; k++)
            if (!strcmp(device->options[k].key, "driver"))
                snprintf(link.devices[i].driver, sizeof link.devices[i].driver, "%s",
                         device->options[k].value);
    }
    return link;
}

static enum result open_view(struct loop *loop, struct error *err) {
    const struct view_config *config = &loop->config->view;
    struct error careless;
    if (token_check(config->token_path, &careless) != RESULT_OK)
        log_warning("view", "%s", careless.text);
    enum result result = view_create(config, &loop->view, err);
    if (result == RESULT_OK)
        log_info("view", "serving ws://127.0.0.1:%d/view?token=TOKEN; the token is in %s",
                 config->port, config->token_path);
    return result;
}

static enum result start(struct loop *loop, struct error *err) {
    const struct station_config *config = loop->config;
    struct device_config devices[STATION_DEVICES_MAX];
    for (int i = 0; i < config->device_count; i++)
        devices[i] = config->devices[i].config;
    enum result result = runner_create(devices, config->device_count, &loop->runner, err);
    if (result != RESULT_OK)
        return result;
    if (config->openigtlink.port) // before the link, which tells it of meshes
        result = openigtlink_create(&config->openigtlink, &loop->openigtlink, err);
    if (result != RESULT_OK)
        return result;
    struct link_config link = loop_link_config(config);
    if (loop->openigtlink) {
        link.meshes_changed = openigtlink_mesh;
        link.meshes_user = loop->openigtlink;
    }
    link.markers = runner_has_markers(loop->runner);
    result = link_create(&link, &loop->link, err);
    return result == RESULT_OK && config->view.port ? open_view(loop, err) : result;
}

enum result loop_run(const struct station_config *config, const struct loop_options *options,
                     const volatile sig_atomic_t *stop, struct error *err) {
    struct loop *loop = alloc(1, sizeof *loop);
    loop->config = config;
    loop->options = options;
    loop->stop = stop;
    loop->predict = predict_create();
    enum result result = start(loop, err);
    if (result == RESULT_OK) {
        loop->teller = teller_create(loop->runner, loop->link, options->live);
        service_notify("READY=1");
        run(loop);
        service_notify("STOPPING=1");
        teller_destroy(&loop->teller);
        print_summary(loop);
    }
    view_destroy(&loop->view);
    predict_destroy(&loop->predict);
    if (loop->link)
        link_destroy(&loop->link);
    openigtlink_destroy(&loop->openigtlink);
    runner_destroy(&loop->runner);
    free(loop);
    return result;
}
