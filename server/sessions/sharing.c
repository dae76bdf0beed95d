#include "sessions/sharing.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "cluster/cluster.h"
#include "sessions/manager.h"
#include "sessions/resume.h"
#include "sessions/takeover.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define RETRY_MS 50
#define AWAY_RETRY_MS 500
#define FLUSH_NS (2 * NS_PER_S)
#define MOVE_NS (5 * NS_PER_S)
static const struct timespec moment = {.tv_nsec = NS_PER_MS};

struct shared_station {
    struct sessions *sessions;
    int station;
    struct trace_tap tap;
    atomic_uint_fast64_t token; // by which this server has the station; 0: it has not
    atomic_uint_fast64_t
        ready; // the token by which it serves it: its session is here, if it has one
    atomic_uint_fast64_t begun; // the token by which the session here was begun or taken over
    atomic_bool takes, moves;
    pthread_mutex_t lock; // of the trace's path
    char trace[SESSIONS_PATH_MAX];
};

struct sharing {
    struct cluster *cluster;
    const char **names;
    struct shared_station *stations;
};

static struct shared_station *shared(const struct sessions *s, int station) {
    return &s->sharing->stations[station];
}

// ---- what the cluster tells ---------------------------------------------------------------------

static void take_soon(struct sessions *s, int station) {
    if (!atomic_exchange(&shared(s, station)->takes, true))
        manager_take(s, station);
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
    manager_lose(s, station); // behind a take that is under way
}

static void on_record(void *user, const struct trace_record *record) {
    struct shared_station *one = user;
    cluster_record(one->sessions->sharing->cluster, one->station, record);
}

// ---- begin and end ------------------------------------------------------------------------------

static void create_stations(struct sessions *s, struct sharing *sharing) {
    size_t count = (size_t)s->config.station_count;
    sharing->names = alloc(count, sizeof *sharing->names);
    sharing->stations = alloc(count, sizeof *sharing->stations);
    for (int i = 0; i < s->config.station_count; i++) {
        struct shared_station *one = &sharing->stations[i];
        sharing->names[i] = station_name(s, i);
        one->sessions = s;
        one->station = i;
        one->tap = (struct trace_tap){on_record, one};
        pthread_mutex_init(&one->lock, NULL);
    }
}

static void release(struct sessions *s, struct sharing *sharing) {
    for (int i = 0; i < s->config.station_count; i++)
        pthread_mutex_destroy(&sharing->stations[i].lock);
    free(sharing->names);
    free(sharing->stations);
    free(sharing);
}

enum result sharing_create(struct sessions *s, struct error *err) {
    char life[SESSIONS_PATH_MAX + 16];
    const struct cluster_handler handler = {s, on_owned, on_lost};
    if (!s->config.cluster.jet.name[0])
        return RESULT_OK;
    s->sharing = alloc(1, sizeof *s->sharing);
    create_stations(s, s->sharing);
    snprintf(life, sizeof life, "%s/cluster.life", s->config.traces_dir);
    enum result result =
        cluster_create(&s->config.cluster, s->sharing->names, s->config.station_count, life,
                       &handler, &s->sharing->cluster, err);
    if (result == RESULT_OK)
        return RESULT_OK;
    release(s, s->sharing);
    s->sharing = NULL;
    return fail_in(err, result, "[cluster] ");
}

void sharing_destroy(struct sessions *s) {
    if (!s->sharing)
        return;
    cluster_destroy(&s->sharing->cluster);
    release(s, s->sharing);
    s->sharing = NULL;
}

const atomic_int_fast64_t *sharing_serves_until(const struct sessions *s) {
    return s->sharing ? cluster_serves_until(s->sharing->cluster) : NULL;
}

// ---- whom it serves -----------------------------------------------------------------------------

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

bool sharing_hello(struct sessions *s, int station, arthron_Refusal *refusal, uint64_t *out_token) {
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

bool sharing_serves(const struct sessions *s, int station) {
    if (!s->sharing)
        return true;
    uint64_t ready = atomic_load(&shared(s, station)->ready);
    return ready && ready == atomic_load(&shared(s, station)->token);
}

bool sharing_protects(const struct sessions *s, int station) {
    return !s->sharing || cluster_protects(s->sharing->cluster, station);
}

void sharing_server(const struct sessions *s, int station, char *out, size_t size) {
    char server[SERVER_ADDRESS_SIZE] = "";
    if (s->sharing && !atomic_load(&shared(s, station)->token))
        cluster_server(s->sharing->cluster, station, server);
    snprintf(out, size, "%s", server);
}

// ---- a session here -----------------------------------------------------------------------------

void sharing_header(const struct sessions *s, int station, struct trace_header *header) {
    if (!s->sharing)
        return;
    snprintf(header->server, sizeof header->server, "%s", s->config.cluster.jet.name);
    header->token = atomic_load(&shared(s, station)->token);
}

const struct trace_tap *sharing_tap(const struct sessions *s, int station) {
    return s->sharing ? &shared(s, station)->tap : NULL;
}

static void set_trace(struct shared_station *one, const char *trace) {
    pthread_mutex_lock(&one->lock);
    snprintf(one->trace, sizeof one->trace, "%s", trace);
    pthread_mutex_unlock(&one->lock);
}

static void tell_standing(struct sessions *s, int station, const struct restored *restored) {
    struct trace_record record;
    size_t at = 0;
    while (trace_record_unpack(restored->standing, restored->standing_size,
                               restored->header.settings.rules, &at, &record, NULL) == RESULT_OK)
        cluster_record(s->sharing->cluster, station, &record);
}

void sharing_begun(struct sessions *s, int station, const struct trace_header *header,
                   const char *trace, const struct restored *restored) {
    static const struct job none;
    if (!s->sharing)
        return;
    atomic_store(&shared(s, station)->begun, atomic_load(&shared(s, station)->token));
    set_trace(shared(s, station), trace);
    cluster_begin(s->sharing->cluster, station, header, trace, restored ? &restored->asked : &none);
    if (restored)
        tell_standing(s, station, restored);
}

static void send_on(struct sessions *s, int station) {
    char server[SERVER_ADDRESS_SIZE];
    struct station_status status;
    station_slot_status(&s->slots[station], &status);
    if (status.connected && cluster_other(s->sharing->cluster, station, server))
        control_move(s->control, status.peer, server);
}

// The next server can take the station once all is in the journal and the key is free.
static void give_away(struct sessions *s, int station) {
    struct error err;
    if (atomic_load(&shared(s, station)->begun) &&
        cluster_flush(s->sharing->cluster, station, clock_now_ns() + FLUSH_NS, &err) != RESULT_OK)
        log_warning("sessions", "%s: what it lacks is lost for the next server", err.text);
    cluster_leave(s->sharing->cluster, station);
    atomic_store(&shared(s, station)->token, 0);
    if (cluster_release(s->sharing->cluster, station, clock_now_ns() + FLUSH_NS, &err) != RESULT_OK)
        log_warning("sessions", "%s", err.text);
    send_on(s, station);
}

// Where another session has begun here since, the journal is of that one.
void sharing_ended(struct sessions *s, int station, const char *trace, bool goes_on) {
    if (!s->sharing)
        return;
    struct shared_station *one = shared(s, station);
    pthread_mutex_lock(&one->lock);
    bool is_last = !strcmp(one->trace, trace);
    pthread_mutex_unlock(&one->lock);
    if (!is_last)
        return;
    set_trace(one, "");
    if (!goes_on)
        cluster_end(s->sharing->cluster, station);
    else if (atomic_load(&one->moves))
        give_away(s, station);
    else
        cluster_leave(s->sharing->cluster, station);
    atomic_store(&one->begun, 0);
}

void sharing_kept(void *sessions, const char *trace) {
    struct sessions *s = sessions;
    for (int i = 0; s->sharing && i < s->config.station_count; i++) {
        struct shared_station *one = shared(s, i);
        pthread_mutex_lock(&one->lock);
        bool is_of = !strcmp(one->trace, trace);
        pthread_mutex_unlock(&one->lock);
        if (is_of)
            cluster_kept(s->sharing->cluster, i);
    }
}

// ---- taking and leaving -------------------------------------------------------------------------

// The session here is left as it is; its trace stays open.
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
static bool take(struct sessions *s, int station, uint64_t token) {
    struct journal_session session;
    struct error err = {0};
    struct journal_reader *reader = journal_reader_create();
    enum result result = cluster_read(s->sharing->cluster, station, reader, &err);
    bool is_known = result == RESULT_OK || result == RESULT_MISSING;
    if (result == RESULT_OK)
        result = journal_read(reader, &session, &err);
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

void sharing_take(struct sessions *s, int station) {
    struct shared_station *one = shared(s, station);
    uint64_t token = atomic_load(&one->token);
    atomic_store(&one->takes, false);
    if (!token || atomic_load(&one->ready) == token || sessions_are_ending(s) ||
        !take(s, station, token))
        return;
    atomic_store(&one->ready, token);
    log_info("sessions", "station %s is this server's", station_name(s, station));
    manager_call(s, station);
}

void sharing_lose(struct sessions *s, int station) {
    struct shared_station *one = shared(s, station);
    if (atomic_load(&one->token) || atomic_load(&one->moves) || !has_session(s, station))
        return;
    log_warning("sessions", "station %s: another server has it now; its session here ends",
                station_name(s, station));
    if (!leave_session(s, station))
        log_error("sessions", "station %s: its session here could not be left",
                  station_name(s, station));
    send_on(s, station);
}

void sharing_move_all(struct sessions *s) {
    if (!s->sharing)
        return;
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
            give_away(s, i);
    }
    for (int i = 0; i < s->config.station_count; i++)
        while (serials[i] && atomic_load(&shared(s, i)->token) && clock_now_ns() < until_ns)
            nanosleep(&moment, NULL);
    free(serials);
}
