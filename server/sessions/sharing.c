#include "sessions/sharing.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define FLUSH_NS (2 * NS_PER_S)

static void on_shared_record(void *user, const struct trace_record *record) {
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
        one->tap = (struct trace_tap){on_shared_record, one};
        pthread_mutex_init(&one->lock, NULL);
    }
}

static void release_sharing(struct sessions *s, struct sharing *sharing) {
    for (int i = 0; i < s->config.station_count; i++)
        pthread_mutex_destroy(&sharing->stations[i].lock);
    pthread_mutex_destroy(&sharing->lock);
    free(sharing->names);
    free(sharing->stations);
    free(sharing);
}

enum result sharing_create(struct sessions *s, const struct cluster_handler *handler,
                           struct error *err) {
    char life[SESSIONS_PATH_MAX + 16];
    if (!s->config.cluster.jet.name[0])
        return RESULT_OK;
    s->sharing = alloc(1, sizeof *s->sharing);
    pthread_mutex_init(&s->sharing->lock, NULL);
    create_stations(s, s->sharing);
    snprintf(life, sizeof life, "%s/cluster.life", s->config.traces_dir);
    enum result result =
        cluster_create(&s->config.cluster, s->sharing->names, s->config.station_count, life,
                       handler, &s->sharing->cluster, err);
    if (result == RESULT_OK && s->config.records[0])
        result = cluster_share_records(s->sharing->cluster, s->config.records, s->cancelled, err);
    if (result == RESULT_OK)
        return RESULT_OK;
    if (s->sharing->cluster)
        cluster_leave_all(s->sharing->cluster);
    cluster_destroy(&s->sharing->cluster);
    release_sharing(s, s->sharing);
    s->sharing = NULL;
    return fail_in(err, result, "[cluster] ");
}

void sharing_leave(struct sessions *s) {
    if (s->sharing)
        cluster_leave_all(s->sharing->cluster);
}

void sharing_destroy(struct sessions *s) {
    if (!s->sharing)
        return;
    cluster_destroy(&s->sharing->cluster);
    release_sharing(s, s->sharing);
    s->sharing = NULL;
}

const atomic_int_fast64_t *sharing_serves_until(const struct sessions *s) {
    return s->sharing ? cluster_serves_until(s->sharing->cluster) : NULL;
}

// ---- whom it serves -----------------------------------------------------------------------------

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

int sharing_whose(const struct sessions *s, struct cluster_peer *out, int max, int *out_served_by) {
    int count = s->sharing ? cluster_whose(s->sharing->cluster, out, max, out_served_by) : 0;
    for (int i = 0; i < s->config.station_count; i++)
        if (!s->sharing)
            out_served_by[i] = SERVED_HERE;
        else if (out_served_by[i] == SERVED_HERE && !sharing_serves(s, i))
            out_served_by[i] = SERVED_NOWHERE; // its session is not here yet
    return count;
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

static void tell_lasting(struct sessions *s, int station, const struct lasting_records *lasting,
                         int rules) {
    struct trace_record record;
    size_t at = 0;
    while (trace_record_unpack(lasting->bytes, lasting->size, rules, &at, &record, NULL) ==
           RESULT_OK)
        cluster_record(s->sharing->cluster, station, &record);
}

void sharing_begun(struct sessions *s, int station, const struct trace_header *header,
                   const char *trace, const struct job *asked,
                   const struct lasting_records *lasting) {
    if (!s->sharing)
        return;
    atomic_store(&shared(s, station)->begun, atomic_load(&shared(s, station)->token));
    set_trace(shared(s, station), trace);
    cluster_begin(s->sharing->cluster, station, header, trace, asked);
    tell_lasting(s, station, lasting, header->settings.rules);
}

void sharing_send_on(struct sessions *s, int station) {
    char server[SERVER_ADDRESS_SIZE];
    struct station_status status;
    station_slot_status(&s->slots[station], &status);
    if (status.connected && cluster_other(s->sharing->cluster, station, server))
        control_move(s->control, status.peer, server);
}

void sharing_give_away(struct sessions *s, int station) {
    struct error err;
    if (atomic_load(&shared(s, station)->begun) &&
        cluster_flush(s->sharing->cluster, station, clock_now_ns() + FLUSH_NS, &err) != RESULT_OK)
        log_warning("sessions", "%s: what it lacks is lost for the next server", err.text);
    cluster_leave(s->sharing->cluster, station);
    atomic_store(&shared(s, station)->token, 0);
    if (cluster_release(s->sharing->cluster, station, clock_now_ns() + FLUSH_NS, &err) != RESULT_OK)
        log_warning("sessions", "%s", err.text);
    sharing_send_on(s, station);
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
        sharing_give_away(s, station);
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
