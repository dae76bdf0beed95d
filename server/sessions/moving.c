#include "sessions/moving.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "sessions/manager.h"
#include "sessions/sharing.h"
#include "sessions/takeover.h"

#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#define RETRY_MS 50
#define AWAY_RETRY_MS 500
#define MOVE_NS (5 * NS_PER_S)
#define REFRESH_NS (NS_PER_S)
static const struct timespec moment = {.tv_nsec = NS_PER_MS};

// ---- taking and losing, on a thread of the manager's pool ---------------------------------------

// The session here is left as it is.
static bool leave_session(struct sessions *s, int station) {
    struct station_status status;
    int64_t until_ns = clock_now_ns() + MOVE_NS;
    station_slot_status(&s->slots[station], &status);
    if (status.phase != SLOT_ATTACHED && status.phase != SLOT_ENDING)
        return true;
    if (!runtime_hand_over(s->runtime, station) ||
        !station_slot_wait_ended(&s->slots[station], status.about.serial, until_ns))
        return false;
    station_slot_set_state(&s->slots[station], status.about.serial, SESSION_CLOSED);
    return true;
}

static bool has_session(struct sessions *s, int station) {
    struct station_status status;
    station_slot_status(&s->slots[station], &status);
    return status.phase != SLOT_EMPTY;
}

// True where the station can be served.
static bool take_session(struct sessions *s, int station, uint64_t token) {
    struct journal_session session = {0};
    struct error err = {0};
    struct journal_reader *reader = journal_reader_create();
    enum result result = cluster_read(s->sharing->cluster, station, reader, &err);
    if (result == RESULT_OK)
        result = journal_read(reader, &session, &err);
    // Else a server of NATS lags, or another server has the station.
    bool is_known = session.newest_token == token;
    uint64_t begun = atomic_load(&shared(s, station)->begun);
    bool is_here = has_session(s, station);
    if (is_known && is_here && result == RESULT_OK && session.token > begun)
        is_here = !leave_session(s, station);
    if (is_known && !is_here && result == RESULT_OK && !session.has_ended)
        result = takeover_run(s, station, token, &session, reader, &err);
    if (result != RESULT_OK && result != RESULT_MISSING)
        log_error("sessions", "station %s: its session at another server %s: %s",
                  station_name(s, station), is_known ? "cannot go on here" : "is not known",
                  err.text);
    journal_reader_destroy(&reader);
    return is_known;
}

static void take_moved_station(struct sessions *s, int station) {
    struct shared_station *one = shared(s, station);
    uint64_t token = atomic_load(&one->token);
    atomic_store(&one->takes, false);
    if (!token || atomic_load(&one->ready) == token || sessions_are_ending(s) ||
        !take_session(s, station, token))
        return;
    cluster_go_on(s->sharing->cluster, station, token);
    atomic_store(&one->ready, token);
    log_info("sessions", "station %s is this server's", station_name(s, station));
    manager_call(s, station);
}

static void lose_station(struct sessions *s, int station) {
    struct shared_station *one = shared(s, station);
    if (atomic_load(&one->token) || atomic_load(&one->moves) || !has_session(s, station))
        return;
    log_warning("sessions", "station %s: another server has it now; its session here ends",
                station_name(s, station));
    if (!leave_session(s, station))
        log_error("sessions", "station %s: its session here could not be left",
                  station_name(s, station));
    sharing_send_on(s, station);
}

// ---- what the cluster tells ---------------------------------------------------------------------

static void run_soon(struct sessions *s, int station,
                     void (*work)(struct sessions *sessions, int station)) {
    pthread_mutex_lock(&s->sharing->lock);
    if (!s->sharing->is_over)
        manager_run(s, station, work);
    pthread_mutex_unlock(&s->sharing->lock);
}

static void take_soon(struct sessions *s, int station) {
    if (!atomic_exchange(&shared(s, station)->takes, true))
        run_soon(s, station, take_moved_station);
}

static void on_owned(void *user, int station, uint64_t token) {
    struct sessions *s = user;
    atomic_store(&shared(s, station)->token, token);
    atomic_store(&shared(s, station)->moves, false);
    take_soon(s, station);
}

static void on_lost(void *user, int station) {
    struct sessions *s = user;
    atomic_store(&shared(s, station)->token, 0);
    atomic_store(&shared(s, station)->ready, 0);
    run_soon(s, station, lose_station); // behind a take that is under way
}

enum result moving_create(struct sessions *s, struct error *err) {
    return sharing_create(s, &(struct cluster_handler){s, on_owned, on_lost}, err);
}

// ---- hello --------------------------------------------------------------------------------------

static void say_elsewhere(const char *station, const char *server, arthron_Refusal *refusal) {
    refusal->reason = arthron_Refusal_Reason_ELSEWHERE;
    snprintf(refusal->server, sizeof refusal->server, "%s", server);
    snprintf(refusal->text, sizeof refusal->text, "station %s is served by %s", station, server);
}

static void say_later(const char *station, bool is_away, arthron_Refusal *refusal) {
    refusal->reason = arthron_Refusal_Reason_BUSY;
    refusal->retry_ms = is_away ? AWAY_RETRY_MS : RETRY_MS;
    snprintf(refusal->text, sizeof refusal->text,
             is_away ? "station %s: this server cannot tell who serves it, as NATS does not answer"
                     : "station %s: this server takes it over",
             station);
}

bool moving_hello(struct sessions *s, int station, arthron_Refusal *refusal, uint64_t *out_token) {
    char server[SERVER_ADDRESS_SIZE];
    *out_token = 0;
    if (!s->sharing)
        return true;
    if (atomic_load(&shared(s, station)->moves) &&
        cluster_other(s->sharing->cluster, station, server)) {
        say_elsewhere(station_name(s, station), server, refusal);
        return false;
    }
    enum station_owner owner = cluster_want(s->sharing->cluster, station, server, out_token);
    if (sharing_serves(s, station))
        return true;
    if (owner == OWNER_SELF)
        take_soon(s, station);
    if (owner == OWNER_ELSEWHERE && server[0])
        say_elsewhere(station_name(s, station), server, refusal);
    else
        say_later(station_name(s, station), owner == OWNER_NONE, refusal);
    return false;
}

// ---- away ---------------------------------------------------------------------------------------

void moving_end(struct sessions *s) {
    if (!s->sharing)
        return;
    pthread_mutex_lock(&s->sharing->lock);
    s->sharing->is_over = true;
    pthread_mutex_unlock(&s->sharing->lock);
}

static bool is_attached(struct sessions *s, int station) {
    struct station_status status;
    station_slot_status(&s->slots[station], &status);
    return status.phase == SLOT_ATTACHED;
}

// While the sessions still run here: what the next server would run again is made little.
static void refresh_journals(struct sessions *s) {
    int64_t until_ns = clock_now_ns() + REFRESH_NS;
    for (int i = 0; i < s->config.station_count; i++)
        if (is_attached(s, i)) {
            cluster_refresh(s->sharing->cluster, i);
            runtime_keep(s->runtime, i);
        }
    for (int i = 0; i < s->config.station_count; i++)
        while (is_attached(s, i) && !cluster_is_fresh(s->sharing->cluster, i) &&
               clock_now_ns() < until_ns)
            nanosleep(&moment, NULL);
}

void moving_all(struct sessions *s) {
    if (!s->sharing)
        return;
    refresh_journals(s);
    int64_t until_ns = clock_now_ns() + MOVE_NS;
    uint64_t *serials = alloc((size_t)s->config.station_count, sizeof *serials);
    for (int i = 0; i < s->config.station_count; i++) {
        struct station_status status;
        station_slot_status(&s->slots[i], &status);
        bool has_one = status.phase == SLOT_ATTACHED || status.phase == SLOT_ENDING;
        atomic_store(&shared(s, i)->ready, 0);
        atomic_store(&shared(s, i)->moves, true);
        if (has_one && runtime_hand_over(s->runtime, i))
            serials[i] = status.about.serial;
        else if (atomic_load(&shared(s, i)->token))
            sharing_give_away(s, i);
    }
    for (int i = 0; i < s->config.station_count; i++)
        while (serials[i] && atomic_load(&shared(s, i)->token) && clock_now_ns() < until_ns)
            nanosleep(&moment, NULL);
    free(serials);
}
