#include "unit/hall.h"

#include "base/clock.h"
#include "net/authority.h"
#include "runtime/parts.h"
#include "sessions/parts.h"
#include "sessions/station_handler.h"
#include "test.h"
#include "unit/case_knee.h"

#include <stdio.h>
#include <time.h>

#define FRAMES 400
#define BURST 40

char hall_dir[FOLDER_MAX];

// ---- sessions -----------------------------------------------------------------------------------

int hall_make(void **state) {
    (void)state;
    static const char *const hosts[] = {"localhost"};
    char folder[256];
    struct knee_case *knee = box_knee();
    folder_make(hall_dir);
    snprintf(folder, sizeof folder, "%s/keys", hall_dir);
    enum result made = authority_init(folder, hosts, 1, NULL);
    snprintf(folder, sizeof folder, "%s/case", hall_dir);
    enum result saved = case_save(knee, folder, NULL);
    case_destroy(&knee);
    return made == RESULT_OK && saved == RESULT_OK ? 0 : -1;
}

int hall_remove(void **state) {
    (void)state;
    folder_remove(hall_dir);
    return 0;
}

struct sessions *hall_open(void) {
    static struct sessions_config config;
    static struct session_station stations[1];
    static const atomic_bool cancelled;
    struct sessions *sessions;
    struct error err;
    config = (struct sessions_config){
        .address = "127.0.0.1", .workers = 1, .wait_s = 60, .case_count = 2, .station_count = 1};
    config.settings = session_settings_default();
    snprintf(config.keys_dir, sizeof config.keys_dir, "%s/keys", hall_dir);
    snprintf(config.traces_dir, sizeof config.traces_dir, "%s/traces", hall_dir);
    snprintf(config.socket, sizeof config.socket, "%s/s", hall_dir);
    snprintf(config.tasks_dir, sizeof config.tasks_dir, "%s/tasks", hall_dir);
    for (int i = 0; i < 2; i++) {
        snprintf(config.cases[i].name, sizeof config.cases[i].name, "boxes%d", i);
        snprintf(config.cases[i].dir, sizeof config.cases[i].dir, "%s/case", hall_dir);
    }
    config.stations = stations;
    config.stations[0].optic = (struct view_optic){.tilt_deg = 70, .field_deg = 105};
    snprintf(config.stations[0].name, sizeof config.stations[0].name, "room-1");
    snprintf(config.stations[0].case_name, sizeof config.stations[0].case_name, "boxes0");
    if (sessions_create(&config, &cancelled, &sessions, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return sessions;
}

void hall_wait_ms(long ms) {
    nanosleep(&(struct timespec){ms / 1000, ms % 1000 * NS_PER_MS}, NULL);
}

// ---- a station that is not there: what is sent to it goes nowhere -------------------------------

static const struct control_peer nobody = {1, UINT32_MAX};

arthron_Welcome hall_connect(struct sessions *sessions, uint64_t connection) {
    struct control_handler station = station_handler(sessions);
    arthron_Hello hello = {.station = "room-1", .connection = connection};
    arthron_Welcome welcome = {0};
    arthron_Refusal refusal = {0};
    if (station.on_hello(sessions, nobody, &hello, &welcome, &refusal) != RESULT_OK)
        fail_msg("%s", refusal.text);
    station.on_clock(sessions, nobody, 0, 0, 0);
    return welcome;
}

void hall_join(struct sessions *sessions) {
    hall_connect(sessions, 1);
    while (hall_status(sessions).state != SESSION_RUNNING)
        hall_wait_ms(1);
}

void hall_leave(struct sessions *sessions) {
    station_handler(sessions).on_gone(sessions, nobody);
}

const arthron_CommandReply *hall_try(struct sessions *sessions, arthron_Command_Kind kind) {
    static arthron_CommandReply reply;
    arthron_Command command = {.kind = kind, .station = "room-1", .case_name = "boxes1"};
    sessions_command(sessions, "otto", &command, &reply);
    return &reply;
}

const arthron_CommandReply *hall_command(struct sessions *sessions, arthron_Command_Kind kind) {
    const arthron_CommandReply *reply = hall_try(sessions, kind);
    if (!reply->ok)
        fail_msg("%s", reply->text);
    return reply;
}

atomic_int_fast64_t hall_serve_until_ns;

void hall_lease(struct sessions *sessions) {
    atomic_store(&hall_serve_until_ns, INT64_MAX);
    sessions_runtime(sessions)->config.serve_until_ns = &hall_serve_until_ns;
}

// A running burr on its way along the meniscus.
void hall_frame(struct sessions *sessions, vec3 tip) {
    hall_frame_of(sessions, tip, clock_now_ns());
}

void hall_frame_of(struct sessions *sessions, vec3 tip, int64_t now_ns) {
    static uint64_t number;
    struct frame frame = {.number = ++number, .time_ns = now_ns, .count = 2};
    frame.samples[0] = (struct sample){.channel = CHANNEL_SHAVER,
                                       .kind = SAMPLE_POSE,
                                       .time_ns = now_ns,
                                       .T_mockup_body = {quat_identity(), tip}};
    frame.samples[1] = (struct sample){
        .channel = CHANNEL_SHAVER, .kind = SAMPLE_HANDLE, .time_ns = now_ns, .handle = {0, 1}};
    const struct station_counts *counts = runtime_counts(sessions_runtime(sessions), 0);
    for (;;) { // the station's room for frames may be full
        uint64_t before = atomic_load(&counts->frames_excess);
        runtime_frame(sessions_runtime(sessions), 0, &frame, now_ns);
        if (atomic_load(&counts->frames_excess) == before)
            return;
        hall_wait_ms(1);
    }
}

void hall_mark(struct sessions *sessions, uint64_t number, int64_t time_ns) {
    arthron_Control message = {.which_message = arthron_Control_marker_tag,
                               .message.marker = {number, time_ns, "start", "pedal", 1}};
    station_handler(sessions).on_message(sessions, nobody, &message);
}

void hall_press(struct sessions *sessions, uint64_t number, const char *name, bool down) {
    arthron_Control message = {.which_message = arthron_Control_marker_tag,
                               .message.marker = {number, clock_now_ns(), "", "pedal", down}};
    snprintf(message.message.marker.name, sizeof message.message.marker.name, "%s", name);
    station_handler(sessions).on_message(sessions, nobody, &message);
}

struct station_status hall_status(struct sessions *sessions) {
    struct station_status status;
    sessions_status(sessions, 0, &status);
    return status;
}

struct tissue_report hall_tissues(struct sessions *sessions) {
    struct tissue_report report;
    runtime_tissues(sessions_runtime(sessions), 0, &report);
    return report;
}

void hall_shave(struct sessions *sessions) {
    hall_shave_part(sessions, 0, 1);
}

// In bursts, so that there is always more to be cut when a job is done; on a busy machine they wait
// for every second cut.
void hall_shave_part(struct sessions *sessions, double from, double to) {
    for (int i = 1 + (int)(from * FRAMES); i <= to * FRAMES; i++) {
        hall_frame(sessions, (vec3){-19, -14 + 28.0 * i / FRAMES, -11});
        if (i % BURST)
            continue;
        hall_wait_ms(20);
        for (int k = 0; k < 200 && (int)hall_tissues(sessions).figures[0].cuts < i / BURST / 2; k++)
            hall_wait_ms(20);
    }
}

bool hall_is_cutting(struct sessions *sessions) {
    const struct station_runtime *station = &sessions_runtime(sessions)->stations[0];
    return ring_count(station->frames) || atomic_load(&station->job);
}

#define QUIET 20

// When no cut is on its way and nothing has come for a while.
struct tissue_report hall_last_tissues(struct sessions *sessions) {
    struct tissue_report last = hall_tissues(sessions);
    for (int quiet = 0; quiet < QUIET; quiet++) {
        hall_wait_ms(20);
        struct tissue_report now = hall_tissues(sessions);
        if (hall_is_cutting(sessions) || now.figures[0].mesh_number != last.figures[0].mesh_number)
            quiet = 0;
        last = now;
    }
    return last;
}

struct station_counts *hall_counts(struct sessions *sessions) {
    return (struct station_counts *)runtime_counts(sessions_runtime(sessions), 0);
}

// The cut worker shows what it has cut.
void hall_hold_cuts(struct sessions *sessions) {
    pthread_mutex_lock(&sessions_runtime(sessions)->stations[0].tissues_lock);
}

void hall_let_cuts_go(struct sessions *sessions) {
    pthread_mutex_unlock(&sessions_runtime(sessions)->stations[0].tissues_lock);
}

void hall_hold_commands(struct sessions *sessions) {
    pthread_mutex_lock(&sessions->slots[0].command_lock);
}

void hall_let_commands_go(struct sessions *sessions) {
    pthread_mutex_unlock(&sessions->slots[0].command_lock);
}
