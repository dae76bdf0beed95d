#include "cluster/cluster.h"

#include "base/chance.h"
#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "cluster/keys.h"
#include "cluster/posting.h"
#include "cluster/shared_records.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#define TICK_NS (100 * NS_PER_MS)
#define JOURNAL_NS (20 * NS_PER_MS)
#define MARKER_NS (5 * NS_PER_S)
#define UNPROTECTED_NS (2 * NS_PER_S) // a message is on its way for some ms with each cut
#define LEAVE_NS (2 * NS_PER_S)
#define OF_JOURNAL (UINT64_C(1) << 63) // ids of writes that are no keys'
#define FIRST_OF_BASE (UINT64_C(1) << 62)
#define STATION_SHIFT 40
#define TOKEN_MOST ((UINT64_C(1) << STATION_SHIFT) - 1)
static const struct timespec moment = {.tv_nsec = 2 * NS_PER_MS};

struct station_part {
    char subject[JET_TOKEN_SIZE + sizeof JET_JOURNAL];
    pthread_mutex_t lock; // of the journal
    struct journal_writer *journal;
    struct posting posting;
    atomic_int_fast64_t whole_ns; // when another server could last go on; 0: never
};

struct heard {
    bool is_answer;
    uint64_t id, revision;
    enum write_answer answer;
    char key[KEY_SIZE], value[KEY_VALUE_SIZE];
};

struct outgoing {
    uint64_t id, replaces;
    char key[KEY_SIZE], value[KEY_VALUE_SIZE];
};

struct cluster {
    struct cluster_handler handler;
    struct cluster_peer self; // but for its stations
    const char *const *names;
    int station_count;
    char life[JET_TEXT_SIZE];
    struct jet *jet;
    pthread_t lease_thread, journal_thread;
    atomic_bool ends;
    atomic_int_fast64_t serves_until;
    atomic_bool connected;

    pthread_mutex_t event_lock; // of events; held for copies
    pthread_cond_t event;
    struct heard *events;
    int event_count, event_room;
    bool called; // somebody wants something

    pthread_mutex_t lock; // of the ownership and of what it wants written
    struct ownership *ownership;
    struct outgoing *outgoing;
    int outgoing_count, outgoing_room;

    struct station_part *stations;
    struct shared_records *records; // NULL: they are this server's alone
};

// ---- the life -----------------------------------------------------------------------------------

static uint64_t life_before(const struct cluster *c) {
    uint64_t life = 0;
    FILE *file = fopen(c->life, "re");
    if (file && fscanf(file, "%" SCNx64, &life) != 1)
        life = 0;
    if (file)
        fclose(file);
    return life;
}

static enum result write_life(const struct cluster *c, uint64_t life, struct error *err) {
    int fd = open(c->life, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    bool written = fd >= 0 && dprintf(fd, "%016" PRIx64 "\n", life) > 0 && fsync(fd) == 0;
    int fault = errno;
    if (fd >= 0)
        close(fd);
    return written ? RESULT_OK : fail(err, RESULT_IO, "%s: %s", c->life, strerror(fault));
}

static uint64_t new_life(void *user) {
    struct cluster *c = user;
    struct error err;
    uint64_t life;
    chance_fill(&life, sizeof life);
    life |= 1;
    if (write_life(c, life, &err) != RESULT_OK)
        log_warning("cluster", "after a restart this server waits for its own lease: %s", err.text);
    return life;
}

// ---- events -------------------------------------------------------------------------------------

static void call(struct cluster *c) {
    pthread_mutex_lock(&c->event_lock);
    c->called = true;
    pthread_cond_signal(&c->event);
    pthread_mutex_unlock(&c->event_lock);
}

static void put_event(struct cluster *c, const struct heard *event) {
    pthread_mutex_lock(&c->event_lock);
    if (c->event_count == c->event_room) {
        c->event_room = 2 * c->event_room + 64;
        c->events = alloc_resize(c->events, (size_t)c->event_room, sizeof *c->events);
    }
    c->events[c->event_count++] = *event;
    pthread_cond_signal(&c->event);
    pthread_mutex_unlock(&c->event_lock);
}

static void journal_answered(struct cluster *c, uint64_t id, enum write_answer answer,
                             uint64_t sequence) {
    struct station_part *part = &c->stations[(id & ~(OF_JOURNAL | FIRST_OF_BASE)) >> STATION_SHIFT];
    posting_answered(&part->posting, id & TOKEN_MOST, id & FIRST_OF_BASE, answer, sequence);
}

static void on_answered(void *user, uint64_t id, enum write_answer answer, uint64_t revision) {
    struct cluster *c = user;
    if (id & OF_JOURNAL)
        journal_answered(c, id, answer, revision);
    else
        put_event(c, &(struct heard){
                         .is_answer = true, .id = id, .answer = answer, .revision = revision});
}

static void on_saw(void *user, const char *key, const char *value, size_t size, uint64_t revision) {
    struct heard event = {.revision = revision};
    if (size >= sizeof event.value || strlen(key) >= sizeof event.key)
        return;
    memcpy(event.value, value, size);
    snprintf(event.key, sizeof event.key, "%s", key);
    put_event(user, &event);
}

static void on_jet_connected(void *user, bool is_connected) {
    struct cluster *c = user;
    atomic_store(&c->connected, is_connected);
    if (is_connected)
        log_info("cluster", "NATS answers");
    else
        log_warning("cluster", "NATS does not answer: sessions go on, and no other server could "
                               "take them over as they are");
}

// ---- the lease's thread -------------------------------------------------------------------------

static int find_station(const struct cluster *c, const char *name) {
    for (int i = 0; i < c->station_count; i++)
        if (!strcmp(c->names[i], name))
            return i;
    return -1;
}

static void take_key(struct cluster *c, const struct heard *event, int64_t now_ns) {
    bool is_server;
    char name[SERVER_NAME_SIZE];
    struct server_value server;
    struct station_value station;
    size_t size = strlen(event->value);
    int index;
    if (!key_parse(event->key, &is_server, name))
        return;
    if (is_server && key_server_value(event->value, size, &server))
        ownership_saw_server(c->ownership, name, &server, event->revision, now_ns);
    else if (!is_server && (index = find_station(c, name)) >= 0 &&
             key_station_value(event->value, size, &station))
        ownership_saw_station(c->ownership, index, &station, event->revision, now_ns);
}

static void take_event(struct cluster *c, const struct heard *event, int64_t now_ns) {
    if (event->is_answer)
        ownership_answered(c->ownership, event->id, event->answer, event->revision, now_ns);
    else
        take_key(c, event, now_ns);
}

// By the ownership; sent once its lock is free.
static void on_write(void *user, const struct key_write *write) {
    struct cluster *c = user;
    if (c->outgoing_count == c->outgoing_room) {
        c->outgoing_room = 2 * c->outgoing_room + 64;
        c->outgoing = alloc_resize(c->outgoing, (size_t)c->outgoing_room, sizeof *c->outgoing);
    }
    struct outgoing *out = &c->outgoing[c->outgoing_count++];
    out->id = write->id;
    out->replaces = write->replaces;
    key_name(write->server != NULL, write->server ? write->server : c->names[write->station],
             out->key);
    if (write->server)
        key_server_text(&write->of_server, out->value);
    else
        key_station_text(&write->of_station, out->value);
}

static void on_changed(void *user, int station, enum station_owner owner) {
    struct cluster *c = user;
    struct station_part *part = &c->stations[station];
    if (owner == OWNER_SELF) {
        uint64_t token = ownership_token(c->ownership, station);
        pthread_mutex_lock(&part->lock);
        journal_own(part->journal, token);
        pthread_mutex_unlock(&part->lock);
        posting_own(&part->posting, token);
        c->handler.owned(c->handler.user, station, token);
    } else if (owner == OWNER_ELSEWHERE || owner == OWNER_NONE) {
        posting_own(&part->posting, 0);
        c->handler.lost(c->handler.user, station);
    }
}

static void wait_for_events(struct cluster *c, struct heard **out_events, int *out_count) {
    int64_t until_ns = clock_now_ns() + TICK_NS;
    struct timespec until = {until_ns / NS_PER_S, until_ns % NS_PER_S};
    pthread_mutex_lock(&c->event_lock);
    while (!c->event_count && !c->called && !atomic_load(&c->ends))
        if (pthread_cond_clockwait(&c->event, &c->event_lock, CLOCK_MONOTONIC, &until))
            break;
    *out_events = c->events;
    *out_count = c->event_count;
    c->events = NULL;
    c->event_count = c->event_room = 0;
    c->called = false;
    pthread_mutex_unlock(&c->event_lock);
}

static void send_outgoing(struct cluster *c) {
    pthread_mutex_lock(&c->lock);
    struct outgoing *all = c->outgoing;
    int count = c->outgoing_count;
    c->outgoing = NULL;
    c->outgoing_count = c->outgoing_room = 0;
    pthread_mutex_unlock(&c->lock);
    for (int i = 0; i < count; i++)
        jet_write_key(c->jet, all[i].id, all[i].key, all[i].replaces, all[i].value);
    free(all);
}

static void turn_cluster(struct cluster *c) {
    struct heard *events;
    int count;
    wait_for_events(c, &events, &count);
    pthread_mutex_lock(&c->lock);
    for (int i = 0; i < count; i++)
        take_event(c, &events[i], clock_now_ns());
    int64_t now_ns = clock_now_ns();
    ownership_tick(c->ownership, now_ns);
    atomic_store(&c->serves_until, ownership_serves_until_ns(c->ownership));
    bool namesake = ownership_has_namesake(c->ownership, now_ns);
    pthread_mutex_unlock(&c->lock);
    if (namesake)
        log_warning("cluster", "another server has this one's name, so this one serves nobody");
    free(events);
    send_outgoing(c);
}

static void *keep_lease(void *argument) {
    struct cluster *c = argument;
    while (!atomic_load(&c->ends))
        turn_cluster(c);
    return NULL;
}

// ---- the journals' thread -----------------------------------------------------------------------

static void put_state(struct station_part *part, const char *trace) {
    uint8_t *bytes = NULL;
    size_t size = 0;
    struct error err;
    if (trace_state_load(trace, &bytes, &size, &err) != RESULT_OK)
        log_debug("cluster", "%s", err.text);
    pthread_mutex_lock(&part->lock);
    journal_put_state(part->journal, bytes, size, clock_now_ns());
    pthread_mutex_unlock(&part->lock);
    free(bytes);
}

static struct jet_letter *next_letter(struct cluster *c, int station, uint64_t *out_id) {
    struct station_part *part = &c->stations[station];
    struct jet_letter *letter = NULL;
    struct jet_message message;
    bool begins_base;
    pthread_mutex_lock(&part->lock);
    if (posting_next(&part->posting, part->journal, &message, &begins_base)) {
        *out_id = OF_JOURNAL | (uint64_t)station << STATION_SHIFT | message.token |
                  (begins_base ? FIRST_OF_BASE : 0);
        message.subject = part->subject;
        letter = jet_pack(&message);
    }
    pthread_mutex_unlock(&part->lock);
    return letter;
}

// Outside the lock, which the writer of traces needs: NATS may take nothing for a while.
static void publish_station(struct cluster *c, int station) {
    struct jet_letter *letter;
    uint64_t id;
    while ((letter = next_letter(c, station, &id)) != NULL)
        jet_send(c->jet, id, letter);
}

static void purge(struct cluster *c, struct station_part *part) {
    bool serves = clock_now_ns() < atomic_load(&c->serves_until);
    uint64_t before = posting_purges(&part->posting, serves);
    if (before)
        jet_purge(c->jet, part->subject, before);
}

static bool is_whole(struct cluster *c, struct station_part *part) {
    pthread_mutex_lock(&part->lock);
    bool whole = journal_is_whole(part->journal);
    pthread_mutex_unlock(&part->lock);
    return whole && posting_is_done(&part->posting) && atomic_load(&c->connected);
}

// While NATS is away a newer state still makes the records behind it fewer.
static void serve_journal(struct cluster *c, int station) {
    struct station_part *part = &c->stations[station];
    char trace[JOURNAL_PATH_MAX] = "";
    bool is_away = !atomic_load(&c->connected);
    pthread_mutex_lock(&part->lock);
    if (posting_has_lost(&part->posting) || is_away)
        journal_break(part->journal);
    const char *wanted = is_away ? journal_newer_state(part->journal)
                                 : journal_wants_state(part->journal, clock_now_ns());
    if (wanted)
        snprintf(trace, sizeof trace, "%s", wanted);
    pthread_mutex_unlock(&part->lock);
    if (trace[0])
        put_state(part, trace);
    if (is_away)
        return;
    publish_station(c, station);
    purge(c, part);
    if (is_whole(c, part))
        atomic_store(&part->whole_ns, clock_now_ns());
}

static void *write_journals(void *argument) {
    static const struct timespec pause = {.tv_nsec = JOURNAL_NS};
    struct cluster *c = argument;
    while (!atomic_load(&c->ends)) {
        for (int i = 0; i < c->station_count; i++)
            serve_journal(c, i);
        nanosleep(&pause, NULL);
    }
    return NULL;
}

// ---- begin and end ------------------------------------------------------------------------------

static void create_stations(struct cluster *c) {
    c->stations = alloc((size_t)c->station_count, sizeof *c->stations);
    for (int i = 0; i < c->station_count; i++) {
        char token[JET_TOKEN_SIZE];
        jet_token(c->names[i], token);
        snprintf(c->stations[i].subject, sizeof c->stations[i].subject, JET_JOURNAL "%s", token);
        pthread_mutex_init(&c->stations[i].lock, NULL);
        c->stations[i].journal = journal_writer_create();
    }
}

static void release(struct cluster *c) {
    ownership_destroy(&c->ownership);
    for (int i = 0; i < c->station_count; i++) {
        journal_writer_destroy(&c->stations[i].journal);
        pthread_mutex_destroy(&c->stations[i].lock);
    }
    free(c->stations);
    free(c->events);
    free(c->outgoing);
    pthread_mutex_destroy(&c->lock);
    pthread_mutex_destroy(&c->event_lock);
    pthread_cond_destroy(&c->event);
    free(c);
}

static void start_threads(struct cluster *c) {
    int failed = pthread_create(&c->lease_thread, NULL, keep_lease, c);
    if (!failed)
        failed = pthread_create(&c->journal_thread, NULL, write_journals, c);
    NEED(!failed, "thread");
}

static void describe_self(const struct cluster_settings *settings, struct cluster_peer *out) {
    uint8_t secret[(SERVER_SECRET_SIZE - 1) / 2];
    *out = (struct cluster_peer){.lives = true};
    memcpy(out->name, settings->jet.name, sizeof out->name);
    memcpy(out->pages, settings->pages, sizeof out->pages);
    chance_fill(secret, sizeof secret);
    for (size_t i = 0; i < sizeof secret; i++)
        snprintf(out->secret + 2 * i, 3, "%02x", secret[i]);
}

enum result cluster_create(const struct cluster_settings *settings, const char *const *names,
                           int station_count, const char *life,
                           const struct cluster_handler *handler, struct cluster **out_cluster,
                           struct error *err) {
    struct cluster *c = alloc(1, sizeof *c);
    const struct ownership_handler of_ownership = {c, on_write, on_changed, new_life};
    const struct jet_handler of_jet = {c, on_answered, on_saw, on_jet_connected};
    struct server_value value = {0};
    c->handler = *handler;
    c->names = names;
    c->station_count = station_count;
    snprintf(c->life, sizeof c->life, "%s", life);
    describe_self(settings, &c->self);
    memcpy(value.stations, settings->stations, sizeof value.stations);
    memcpy(value.pages, c->self.pages, sizeof value.pages);
    memcpy(value.secret, c->self.secret, sizeof value.secret);
    pthread_mutex_init(&c->lock, NULL);
    pthread_mutex_init(&c->event_lock, NULL);
    pthread_cond_init(&c->event, NULL);
    create_stations(c);
    uint64_t before = life_before(c);
    c->ownership =
        ownership_create(settings->jet.name, &value, before, station_count, &of_ownership);
    enum result result = jet_create(&settings->jet, &of_jet, &c->jet, err);
    if (result == RESULT_OK) {
        start_threads(c);
    } else {
        release(c);
        c = NULL;
    }
    *out_cluster = c;
    return result;
}

// Until the journals are given out and the own key is replaced, so that nobody waits for its end.
static void leave_cluster(struct cluster *c) {
    int64_t until_ns = clock_now_ns() + LEAVE_NS;
    for (int i = 0; i < c->station_count && atomic_load(&c->connected); i++)
        while (atomic_load(&c->stations[i].posting.in_flight) && clock_now_ns() < until_ns)
            nanosleep(&moment, NULL);
    pthread_mutex_lock(&c->lock);
    ownership_leave(c->ownership, clock_now_ns());
    pthread_mutex_unlock(&c->lock);
    call(c);
    bool has_left = false;
    while (!has_left && atomic_load(&c->connected) && clock_now_ns() < until_ns) {
        nanosleep(&moment, NULL);
        pthread_mutex_lock(&c->lock);
        has_left = ownership_has_left(c->ownership);
        pthread_mutex_unlock(&c->lock);
    }
}

void cluster_leave_all(struct cluster *c) {
    leave_cluster(c);
    atomic_store(&c->ends, true);
    call(c);
    pthread_join(c->lease_thread, NULL);
    pthread_join(c->journal_thread, NULL);
}

void cluster_destroy(struct cluster **cluster) {
    struct cluster *c = *cluster;
    if (!c)
        return;
    shared_records_destroy(&c->records);
    jet_destroy(&c->jet);
    jet_end_library();
    release(c);
    *cluster = NULL;
}

enum result cluster_share_records(struct cluster *c, const char *path, const atomic_bool *ends,
                                  struct error *err) {
    return shared_records_create(c->jet, path, c->self.name, ends, &c->records, err);
}

// ---- a look from outside ------------------------------------------------------------------------

struct look {
    struct cluster_peer *peers;
    int count, room;
};

static void take_look(void *user, const char *key, const char *value, size_t size) {
    struct look *look = user;
    bool is_server;
    char name[SERVER_NAME_SIZE];
    struct server_value server;
    if (look->count == look->room || !key_parse(key, &is_server, name) || !is_server ||
        !key_server_value(value, size, &server))
        return;
    struct cluster_peer *peer = &look->peers[look->count++];
    *peer = (struct cluster_peer){0};
    memcpy(peer->name, name, sizeof peer->name);
    memcpy(peer->pages, server.pages, sizeof peer->pages);
    memcpy(peer->secret, server.secret, sizeof peer->secret);
}

enum result cluster_look(const struct cluster_settings *settings, struct cluster_peer *out_peers,
                         int room, int *out_count, struct error *err) {
    struct look look = {out_peers, 0, room};
    enum result result = jet_look(&settings->jet, take_look, &look, err);
    *out_count = look.count;
    return result;
}

// ---- who serves ---------------------------------------------------------------------------------

enum station_owner cluster_want(struct cluster *c, int station,
                                char out_server[SERVER_ADDRESS_SIZE], uint64_t *out_token) {
    pthread_mutex_lock(&c->lock);
    enum station_owner owner = ownership_want(c->ownership, station, clock_now_ns());
    snprintf(out_server, SERVER_ADDRESS_SIZE, "%s",
             owner == OWNER_ELSEWHERE ? ownership_address(c->ownership, station) : "");
    *out_token = ownership_token(c->ownership, station);
    pthread_mutex_unlock(&c->lock);
    call(c);
    return owner;
}

void cluster_server(struct cluster *c, int station, char out_server[SERVER_ADDRESS_SIZE]) {
    pthread_mutex_lock(&c->lock);
    snprintf(out_server, SERVER_ADDRESS_SIZE, "%s", ownership_address(c->ownership, station));
    pthread_mutex_unlock(&c->lock);
}

enum result cluster_release(struct cluster *c, int station, int64_t until_ns, struct error *err) {
    bool is_named = true;
    pthread_mutex_lock(&c->lock);
    ownership_release(c->ownership, station, clock_now_ns());
    pthread_mutex_unlock(&c->lock);
    call(c);
    while (is_named) {
        if (clock_now_ns() >= until_ns)
            return fail(err, RESULT_TIMEOUT, "station %s: NATS was not told that it is free",
                        c->names[station]);
        nanosleep(&moment, NULL);
        pthread_mutex_lock(&c->lock);
        is_named = ownership_is_named(c->ownership, station);
        pthread_mutex_unlock(&c->lock);
    }
    return RESULT_OK;
}

bool cluster_other(struct cluster *c, int which, char out_server[SERVER_ADDRESS_SIZE]) {
    pthread_mutex_lock(&c->lock);
    const char *address = ownership_other(c->ownership, which, clock_now_ns());
    snprintf(out_server, SERVER_ADDRESS_SIZE, "%s", address ? address : "");
    pthread_mutex_unlock(&c->lock);
    return out_server[0];
}

// The caller has the lock.
static int list_peers(struct cluster *c, struct cluster_peer *out, int room, int64_t now_ns) {
    int count = 0;
    while (count < room && ownership_peer(c->ownership, count, now_ns, &out[count]))
        count++;
    return count;
}

void cluster_server_name(struct cluster *c, int station, char out_name[SERVER_NAME_SIZE]) {
    struct cluster_peer peer;
    int64_t now_ns = clock_now_ns();
    out_name[0] = '\0';
    pthread_mutex_lock(&c->lock);
    int by = ownership_served_by(c->ownership, station, now_ns);
    if (by >= 0 && ownership_peer(c->ownership, by, now_ns, &peer))
        memcpy(out_name, peer.name, sizeof peer.name);
    pthread_mutex_unlock(&c->lock);
}

int cluster_whose(struct cluster *c, struct cluster_peer *out, int room, int *out_served_by) {
    int64_t now_ns = clock_now_ns();
    pthread_mutex_lock(&c->lock);
    int count = list_peers(c, out, room, now_ns);
    for (int i = 0; i < c->station_count; i++) {
        int by = ownership_served_by(c->ownership, i, now_ns);
        out_served_by[i] = by < room ? by : SERVED_NOWHERE;
    }
    pthread_mutex_unlock(&c->lock);
    return count;
}

int cluster_peers(struct cluster *c, struct cluster_peer *out, int room) {
    int *served_by = alloc((size_t)c->station_count, sizeof *served_by);
    int count = cluster_whose(c, out, room, served_by);
    for (int i = 0; i < c->station_count; i++)
        if (served_by[i] >= 0)
            out[served_by[i]].stations++;
    free(served_by);
    return count;
}

void cluster_self(struct cluster *c, struct cluster_peer *out) {
    *out = c->self;
    pthread_mutex_lock(&c->lock);
    for (int i = 0; i < c->station_count; i++)
        out->stations += ownership_of(c->ownership, i) == OWNER_SELF;
    pthread_mutex_unlock(&c->lock);
}

bool cluster_is_connected(const struct cluster *c) {
    return atomic_load(&c->connected);
}

const atomic_int_fast64_t *cluster_serves_until(const struct cluster *c) {
    return &c->serves_until;
}

// ---- journals -----------------------------------------------------------------------------------

void cluster_begin(struct cluster *c, int station, const struct trace_header *header,
                   const char *trace, const struct job *asked) {
    atomic_store(&c->stations[station].whole_ns, 0);
    pthread_mutex_lock(&c->stations[station].lock);
    journal_begin(c->stations[station].journal, header, trace, asked);
    pthread_mutex_unlock(&c->stations[station].lock);
}

void cluster_record(struct cluster *c, int station, const struct trace_record *tapped) {
    pthread_mutex_lock(&c->stations[station].lock);
    journal_record(c->stations[station].journal, tapped);
    pthread_mutex_unlock(&c->stations[station].lock);
}

void cluster_kept(struct cluster *c, int station) {
    pthread_mutex_lock(&c->stations[station].lock);
    journal_kept(c->stations[station].journal);
    pthread_mutex_unlock(&c->stations[station].lock);
}

void cluster_end(struct cluster *c, int station) {
    pthread_mutex_lock(&c->stations[station].lock);
    journal_end(c->stations[station].journal);
    pthread_mutex_unlock(&c->stations[station].lock);
}

void cluster_leave(struct cluster *c, int station) {
    pthread_mutex_lock(&c->stations[station].lock);
    journal_leave(c->stations[station].journal);
    pthread_mutex_unlock(&c->stations[station].lock);
}

bool cluster_protects(struct cluster *c, int station) {
    int64_t whole_ns = atomic_load(&c->stations[station].whole_ns);
    return whole_ns && clock_now_ns() - whole_ns < UNPROTECTED_NS;
}

void cluster_refresh(struct cluster *c, int station) {
    pthread_mutex_lock(&c->stations[station].lock);
    journal_refresh(c->stations[station].journal);
    pthread_mutex_unlock(&c->stations[station].lock);
}

bool cluster_is_fresh(struct cluster *c, int station) {
    struct station_part *part = &c->stations[station];
    pthread_mutex_lock(&part->lock);
    bool fresh = journal_is_fresh(part->journal);
    pthread_mutex_unlock(&part->lock);
    return fresh && is_whole(c, part);
}

static bool has_nothing(struct station_part *part) {
    pthread_mutex_lock(&part->lock);
    bool empty = journal_is_empty(part->journal);
    pthread_mutex_unlock(&part->lock);
    return empty;
}

enum result cluster_flush(struct cluster *c, int station, int64_t until_ns, struct error *err) {
    struct station_part *part = &c->stations[station];
    while (!is_whole(c, part) && !has_nothing(part)) {
        if (clock_now_ns() >= until_ns)
            return fail(err, RESULT_TIMEOUT, "station %s: its journal is not whole in time",
                        c->names[station]);
        nanosleep(&moment, NULL);
    }
    return RESULT_OK;
}

static bool take_message(void *user, const struct jet_message *message, uint64_t sequence) {
    (void)sequence;
    journal_take(user, message);
    return true;
}

// Until the message that makes what others write void is in the stream.
static enum result wait_for_marker(struct cluster *c, int station, struct error *err) {
    struct station_part *part = &c->stations[station];
    int64_t until_ns = clock_now_ns() + MARKER_NS;
    bool is_given;
    do {
        if (atomic_load(&part->posting.lost) || clock_now_ns() >= until_ns)
            return fail(err, RESULT_TIMEOUT, "NATS does not answer");
        nanosleep(&moment, NULL);
        pthread_mutex_lock(&part->lock);
        is_given = journal_owns(part->journal);
        pthread_mutex_unlock(&part->lock);
    } while (!is_given || atomic_load(&part->posting.in_flight));
    return RESULT_OK;
}

enum result cluster_read(struct cluster *c, int station, struct journal_reader *reader,
                         struct error *err) {
    enum result result = wait_for_marker(c, station, err);
    if (result == RESULT_OK)
        result = jet_read(c->jet, c->stations[station].subject, 0, take_message, reader, err);
    return result;
}

void cluster_go_on(struct cluster *c, int station, uint64_t token) {
    pthread_mutex_lock(&c->stations[station].lock);
    journal_go_on(c->stations[station].journal, token);
    pthread_mutex_unlock(&c->stations[station].lock);
}
