#include "sim/station.h"

#include "base/check.h"
#include "base/clock.h"
#include "loop/loop.h"
#include "samples/runner.h"
#include "sim/report.h"
#include "sim/streams.h"
#include "sim/watch.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define DEVICE_NS (8 * NS_PER_MS)
#define STROKE_S 25.0 // from one stroke of the burr to the next
#define SHAVING_S 0.3
#define HOLD_NS (100 * NS_PER_MS)

struct sim_station {
    struct sim_process process;
    struct sim_thread *main;
    struct station_config *config;
    struct link *link;
    volatile sig_atomic_t stop;
    double phase;
    int64_t silent_ns[STATION_DEVICES]; // since when, true time; 0: it is not
};

static struct sim_station stations[SIM_STATIONS_MAX];

// ---- hands --------------------------------------------------------------------------------------

// The probe goes over the tibia; the burr goes along the meniscus now and then.
static vec3 probe_at(double t) {
    return (vec3){-18 + 9 * sin(0.7 * t), 11 * sin(1.1 * t), -15 + 4 * sin(0.53 * t)};
}

static bool is_shaving(double t) {
    return fmod(t, STROKE_S) < SHAVING_S;
}

static vec3 burr_at(double t) {
    double share = fmod(t, STROKE_S) / SHAVING_S, row = fmod(floor(t / STROKE_S), 7);
    if (!is_shaving(t))
        return (vec3){-5 - 3 * sin(t), 3 * sin(0.9 * t), -8};
    return (vec3){-19, -14 + 4 * (row + share), -11};
}

static void add(struct frame *frame, struct sample sample, int device, int64_t time_ns,
                int64_t now_ns) {
    int64_t age_ns = now_ns - time_ns;
    sample.device = (uint8_t)device;
    sample.time_ns = time_ns;
    sample.validity = age_ns < 2 * DEVICE_NS ? VALIDITY_OK
                      : age_ns < HOLD_NS     ? VALIDITY_HELD
                                             : VALIDITY_LOST;
    frame->samples[frame->count++] = sample;
}

// When the device last measured, by the station's clock.
static int64_t measured_ns(const struct sim_station *s, int device, int64_t now_ns) {
    int64_t last_ns = now_ns - now_ns % DEVICE_NS;
    if (!s->silent_ns[device])
        return last_ns;
    int64_t silent_ns = sim_local_ns(&s->process, s->silent_ns[device]);
    return silent_ns < last_ns ? silent_ns : last_ns;
}

static double true_seconds(const struct sim_station *s, int64_t local_ns) {
    return (double)(sim_true_ns(&s->process, local_ns) - SIM_BEGIN_NS) / NS_PER_S + s->phase;
}

// ---- devices ------------------------------------------------------------------------------------

struct runner {
    struct sim_station *station;
};

static struct sim_station *myself(void) {
    return &stations[sim_process()->index];
}

enum result __wrap_runner_create(const struct device_config *configs, int count,
                                 struct runner **out_runner, struct error *err);
enum result __wrap_runner_create(const struct device_config *configs, int count,
                                 struct runner **out_runner, struct error *err) {
    (void)configs, (void)count, (void)err;
    *out_runner = alloc(1, sizeof **out_runner);
    (*out_runner)->station = myself();
    return RESULT_OK;
}

void __wrap_runner_destroy(struct runner **runner);
void __wrap_runner_destroy(struct runner **runner) {
    free(*runner);
    *runner = NULL;
}

int __wrap_runner_count(const struct runner *runner);
int __wrap_runner_count(const struct runner *runner) {
    (void)runner;
    return 0;
}

bool __wrap_runner_has_markers(const struct runner *runner);
bool __wrap_runner_has_markers(const struct runner *runner) {
    (void)runner;
    return false;
}

bool __wrap_runner_next_marker(struct runner *runner, struct marker *out);
bool __wrap_runner_next_marker(struct runner *runner, struct marker *out) {
    (void)runner;
    (void)out;
    return false;
}

void __wrap_runner_collect(struct runner *runner, int64_t now_ns, struct frame *frame);
void __wrap_runner_collect(struct runner *runner, int64_t now_ns, struct frame *frame) {
    const struct sim_station *s = runner->station;
    int64_t first_ns = measured_ns(s, 0, now_ns), second_ns = measured_ns(s, 1, now_ns);
    double t = true_seconds(s, first_ns), u = true_seconds(s, second_ns);
    struct sample joint = {.channel = CHANNEL_JOINT, .kind = SAMPLE_JOINT};
    joint.joint.flexion_deg = 30 + 20 * sin(0.3 * t);
    add(frame, joint, 0, first_ns, now_ns);
    add(frame,
        (struct sample){.channel = CHANNEL_PROBE,
                        .kind = SAMPLE_POSE,
                        .T_mockup_body = {quat_identity(), probe_at(t)}},
        0, first_ns, now_ns);
    add(frame,
        (struct sample){.channel = CHANNEL_PROBE, .kind = SAMPLE_FORCE, .force_n = 4 * sin(2 * u)},
        1, second_ns, now_ns);
    add(frame,
        (struct sample){.channel = CHANNEL_SHAVER,
                        .kind = SAMPLE_POSE,
                        .T_mockup_body = {quat_identity(), burr_at(u)}},
        1, second_ns, now_ns);
    add(frame,
        (struct sample){
            .channel = CHANNEL_SHAVER, .kind = SAMPLE_HANDLE, .handle = {0, is_shaving(u)}},
        1, second_ns, now_ns);
}

void station_silence(int station, int device, bool silent) {
    stations[station].silent_ns[device] = silent ? sim_now_ns() : 0;
}

// ---- what is sent and shown ---------------------------------------------------------------------

bool __real_link_send(struct link *link, const struct frame *frame);
bool __wrap_link_send(struct link *link, const struct frame *frame);
bool __wrap_link_send(struct link *link, const struct frame *frame) {
    struct link_status status;
    struct sim_station *s = myself();
    s->link = link;
    bool sent = __real_link_send(link, frame);
    if (sent && !sim_is_dead()) {
        link_get_status(link, &status);
        watch_sent(s->process.index, s->process.incarnation, status.connects, frame->number);
    }
    return sent;
}

enum result __wrap_token_check(const char *path, struct error *err);
enum result __wrap_token_check(const char *path, struct error *err) {
    (void)path, (void)err;
    return RESULT_OK;
}

enum result __wrap_view_create(const struct view_config *config, struct view **out_view,
                               struct error *err);
enum result __wrap_view_create(const struct view_config *config, struct view **out_view,
                               struct error *err) {
    (void)config, (void)err;
    *out_view = (struct view *)myself();
    return RESULT_OK;
}

void __wrap_view_destroy(struct view **view);
void __wrap_view_destroy(struct view **view) {
    *view = NULL;
}

bool __wrap_view_is_watched(const struct view *view);
bool __wrap_view_is_watched(const struct view *view) {
    (void)view;
    return true;
}

void __wrap_view_show(struct view *view, arthron_View *message);
void __wrap_view_show(struct view *view, arthron_View *message) {
    (void)view;
    if (!sim_is_dead())
        watch_shown(myself()->process.index, myself()->process.incarnation, message);
}

// ---- the process --------------------------------------------------------------------------------

static void *run(void *user) {
    struct sim_station *s = user;
    struct loop_options options = {0};
    struct error err;
    if (loop_run(s->config, &options, &s->stop, &err) != RESULT_OK)
        broken("a station runs", "%s", err.text);
    s->link = NULL;
    return NULL;
}

static void configure(struct sim_station *s, int station) {
    struct station_config *c = s->config = alloc(1, sizeof *c);
    snprintf(c->name, sizeof c->name, "room-%d", station + 1);
    c->servers[0] = (struct server_address){"localhost", 4700};
    c->server_count = 1;
    snprintf(c->keys_dir, sizeof c->keys_dir, "/nowhere");
    c->rate_hz = STATION_RATE_HZ;
    c->datagrams = true;
    c->view.port = 1;
}

void stations_begin(uint64_t seed, int count) {
    struct random random = {seed};
    for (int i = 0; i < count; i++) {
        struct sim_station *s = &stations[i];
        *s = (struct sim_station){.phase = random_between(&random, 0, STROKE_S)};
        s->process = (struct sim_process){.name = "a station", .index = i};
        s->process.ahead_ns = (int64_t)(random_bits(&random) % 5000) * NS_PER_S;
        s->process.drift_ppm = (int64_t)(random_bits(&random) % 81) - 40;
        s->process.utc_ahead_ns = (int64_t)(random_bits(&random) % 7000) * NS_PER_MS;
    }
}

void station_start(int station) {
    struct sim_station *s = &stations[station];
    CHECK(!s->main);
    configure(s, station);
    s->stop = 0;
    s->process.dead = false;
    s->process.incarnation++;
    happened("room-%d is started", station + 1);
    watch_began(station);
    s->main = sim_start(&s->process, run, s);
}

static void forget(struct sim_station *s) {
    sim_forget(&s->main);
    free(s->config);
    s->config = NULL;
}

void station_kill(int station) {
    struct sim_station *s = &stations[station];
    happened("room-%d is killed", station + 1);
    s->process.dead = true;
    net_drop(&s->process);
    s->stop = 1;
    sim_run_dead(&s->process, s->main);
    forget(s);
}

void station_stop(int station) {
    happened("room-%d stops", station + 1);
    stations[station].stop = 1;
}

bool station_has_ended(int station) {
    struct sim_station *s = &stations[station];
    if (s->main && sim_is_done(s->main))
        forget(s);
    return !s->main;
}

struct link *station_link(int station) {
    return stations[station].main ? stations[station].link : NULL;
}

struct sim_process *station_process(int station) {
    return &stations[station].process;
}
