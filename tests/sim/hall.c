#include "sim/hall.h"

#include "base/check.h"
#include "base/clock.h"
#include "sim/disk.h"
#include "sim/net.h"
#include "sim/report.h"
#include "sim/streams.h"
#include "sim/watch.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define WAIT_S 30

static struct {
    struct sim_process process, second;
    struct sim_thread *main, *instructor;
    struct sessions_config config;
    struct session_station stations[SIM_STATIONS_MAX];
    struct sessions *sessions;
    atomic_bool cancelled;
    bool ends, hands_over, freely;
    struct random random;
    struct hall_counts counts;
} hall;

// ---- the instructor -----------------------------------------------------------------------------

static arthron_Command_Kind random_kind(void) {
    static const arthron_Command_Kind kinds[] = {
        arthron_Command_Kind_NOTE,  arthron_Command_Kind_NOTE,  arthron_Command_Kind_NOTE,
        arthron_Command_Kind_UNDO,  arthron_Command_Kind_UNDO,  arthron_Command_Kind_PAUSE,
        arthron_Command_Kind_START, arthron_Command_Kind_START, arthron_Command_Kind_SHOW,
        arthron_Command_Kind_LIST,  arthron_Command_Kind_RESET, arthron_Command_Kind_STOP,
        arthron_Command_Kind_CASE,  arthron_Command_Kind_COPY,  arthron_Command_Kind_ASSIGN,
    };
    return kinds[random_bits(&hall.random) % (sizeof kinds / sizeof *kinds)];
}

static void fill_command(int station, arthron_Command *command) {
    snprintf(command->station, sizeof command->station, "room-%d", station + 1);
    snprintf(command->trainee, sizeof command->trainee, "anna");
    if (command->kind == arthron_Command_Kind_CASE)
        snprintf(command->case_name, sizeof command->case_name, "boxes%d",
                 (int)(random_bits(&hall.random) % 2));
    if (command->kind == arthron_Command_Kind_COPY) {
        watch_some_session(station, command->from);
        command->at_s = random_between(&hall.random, 0, 5);
    }
    if (command->kind == arthron_Command_Kind_NOTE) {
        command->has_remark = true;
        snprintf(command->remark.text, sizeof command->remark.text, "note %llu",
                 (unsigned long long)hall.counts.commands);
    }
}

static void give_command(int station, arthron_Command_Kind kind) {
    arthron_Command *command = alloc(1, sizeof *command);
    arthron_CommandReply *reply = alloc(1, sizeof *reply);
    command->kind = kind;
    fill_command(station, command);
    hall.counts.commands++;
    uint64_t session = watch_session(station);
    sessions_command(hall.sessions, "otto", command, reply);
    if (!sim_is_dead()) {
        hall.counts.done += reply->ok;
        happened("command %d to room-%d: %s%s", (int)kind, station + 1, reply->ok ? "ok " : "",
                 reply->text);
        if (reply->ok && kind == arthron_Command_Kind_NOTE)
            watch_noted(station, session, command->remark.text);
    }
    free(command);
    free(reply);
}

static void bring_back(int station) {
    struct station_status status;
    sessions_status(hall.sessions, station, &status);
    if (status.connected && status.state != SESSION_RUNNING)
        give_command(station, arthron_Command_Kind_START);
}

static void *instruct(void *nothing) {
    while (!hall.ends) {
        sim_wait(&hall.ends,
                 sim_now_ns() + (int64_t)(random_bits(&hall.random) % 2000) * NS_PER_MS);
        int station = (int)(random_bits(&hall.random) % (uint64_t)hall.config.station_count);
        if (hall.ends || !hall.sessions)
            continue;
        if (hall.freely && random_bits(&hall.random) % 3)
            give_command(station, random_kind());
        else
            bring_back(station);
    }
    return nothing;
}

// ---- the process --------------------------------------------------------------------------------

static void *serve(void *nothing) {
    struct error err;
    struct sessions *sessions;
    enum result result = sessions_create(&hall.config, &hall.cancelled, &sessions, &err);
    if (result != RESULT_OK) {
        hall.counts.failed_starts++;
        happened("the server does not start: %s", err.text);
        return nothing;
    }
    hall.sessions = sessions;
    if (!sim_is_dead()) {
        happened("the server is up");
        watch_up((WAIT_S - 1) * NS_PER_S);
    }
    hall.instructor = sim_start(&hall.process, instruct, NULL);
    while (!hall.ends)
        sim_wait(&hall.ends, INT64_MAX);
    sessions_break_off(sessions);
    while (!sim_is_done(hall.instructor))
        sim_wait(hall.instructor, INT64_MAX);
    sim_forget(&hall.instructor);
    hall.sessions = NULL;
    if (hall.hands_over)
        sessions_hand_over(&sessions);
    else
        sessions_destroy(&sessions);
    happened("the server has ended");
    return nothing;
}

static void configure(const char *dir, int stations) {
    struct sessions_config *c = &hall.config;
    *c = (struct sessions_config){.address = "127.0.0.1",
                                  .port = 4700,
                                  .workers = stations > 2 ? 2 : 1,
                                  .wait_s = WAIT_S,
                                  .calibration_days = 30,
                                  .calibration_mm = 1,
                                  .calibration_deg = 1,
                                  .case_count = 2,
                                  .station_count = stations};
    c->settings = session_settings_default();
    if (random_bits(&hall.random) % 8) // the cheapest warp: these runs are not about it
        c->settings.field = field_default(FIELD_INVERSE_DISTANCE), c->settings.avatar = AVATAR_TIP;
    c->stations = hall.stations;
    CHECK(stations <= SIM_STATIONS_MAX);
    snprintf(c->keys_dir, sizeof c->keys_dir, "%s/keys", dir);
    snprintf(c->traces_dir, sizeof c->traces_dir, "%s/traces", dir);
    snprintf(c->records, sizeof c->records, "%s/records.db", dir);
    for (int i = 0; i < c->case_count; i++) {
        snprintf(c->cases[i].name, sizeof c->cases[i].name, "boxes%d", i);
        snprintf(c->cases[i].dir, sizeof c->cases[i].dir, "%s/case", dir);
    }
    for (int i = 0; i < stations; i++) {
        struct session_station *s = &c->stations[i];
        s->optic = (struct view_optic){.tilt_deg = 70, .field_deg = 105};
        snprintf(s->name, sizeof s->name, "room-%d", i + 1);
        snprintf(s->case_name, sizeof s->case_name, "boxes0");
    }
}

void hall_begin(uint64_t seed, const char *dir, int stations) {
    memset(&hall, 0, sizeof hall);
    hall.random = (struct random){seed};
    hall.process = (struct sim_process){.name = "server", .index = SIM_SERVER};
    hall.second = (struct sim_process){.name = "a second server", .index = SIM_SERVER};
    configure(dir, stations);
}

void hall_start(void) {
    CHECK(!hall.main);
    hall.counts.starts++;
    hall.ends = hall.hands_over = false;
    atomic_store(&hall.cancelled, false);
    hall.process.dead = false;
    hall.process.incarnation++;
    // Another machine, or the same one after its start: its clock begins elsewhere.
    hall.process.ahead_ns = -(int64_t)(random_bits(&hall.random) % 900) * NS_PER_S;
    hall.process.drift_ppm = (int64_t)(random_bits(&hall.random) % 41) - 20;
    streams_go_silent(false);
    happened("the server is started");
    hall.main = sim_start(&hall.process, serve, NULL);
}

// A server on the same folders, while this one serves. It is refused before it waits for anything.
static void *serve_too(void *nothing) {
    struct error err;
    struct sessions *sessions;
    enum result result = sessions_create(&hall.config, &hall.cancelled, &sessions, &err);
    if (result == RESULT_OK)
        broken("no session is served by two", "a second server starts");
    happened("a second server: %s", err.text);
    return nothing;
}

void hall_try_second(void) {
    struct sim_thread *second = sim_start(&hall.second, serve_too, NULL);
    hall.second.dead = true; // what it does is seen by nobody
    sim_run_dead(&hall.second, second);
    sim_forget(&second);
}

static void ask_to_end(void) {
    hall.ends = true;
    atomic_store(&hall.cancelled, true);
    sim_wake(&hall.ends);
}

void hall_end(enum hall_death death) {
    static const char *const deaths[] = {"ends", "hands over", "is killed", "loses its power"};
    happened("the server %s", deaths[death]);
    if (death == DEATH_ENDED || death == DEATH_HANDED_OVER) {
        hall.hands_over = death == DEATH_HANDED_OVER;
        ask_to_end();
        return;
    }
    hall.process.dead = true;
    watch_killed(death == DEATH_POWER);
    streams_go_silent(death == DEATH_POWER);
    net_drop(&hall.process);
    ask_to_end();
    sim_run_dead(&hall.process, hall.main);
    sim_forget(&hall.main);
    hall.sessions = NULL;
    if (death == DEATH_POWER)
        disk_lose_power();
    watch_look_at_traces();
}

bool hall_is_up(void) {
    return hall.sessions && !hall.ends;
}

bool hall_has_ended(void) {
    if (hall.main && sim_is_done(hall.main))
        sim_forget(&hall.main);
    return !hall.main;
}

struct sessions *hall_sessions(void) {
    return hall.sessions;
}

struct hall_counts hall_counts(void) {
    return hall.counts;
}

void hall_command_freely(bool freely) {
    hall.freely = freely;
}
