// Several servers that share stations (server/cluster), as the sessions see it: which stations this
// one serves, and what others learn of its sessions. How stations come and go: moving.h. A server
// alone (no [cluster] in its config) serves all, and these functions do nothing for it.
#pragma once

#include "cluster/cluster.h"
#include "sessions/parts.h"

#include <pthread.h>

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
    pthread_mutex_t lock; // of is_over
    bool is_over;         // the manager takes no more work
    const char **names;
    struct shared_station *stations;
};

// Of a server that is not alone.
static inline struct shared_station *shared(const struct sessions *sessions, int station) {
    return &sessions->sharing->stations[station];
}

// Before the runtime is made. The error names file or address.
enum result sharing_create(struct sessions *sessions, const struct cluster_handler *handler,
                           struct error *err);
// After all sessions have been released: gives all stations free.
void sharing_leave(struct sessions *sessions);
// Behind sharing_leave, and behind the last that is written into the records.
void sharing_destroy(struct sessions *sessions);

// Until when this server may serve unasked (runtime/types.h); NULL: for ever.
const atomic_int_fast64_t *sharing_serves_until(const struct sessions *sessions);
// Whether a session of the station may be opened here.
bool sharing_serves(const struct sessions *sessions, int station);
// Whether another server could go on with its session as it is, where there are several.
bool sharing_protects(const struct sessions *sessions, int station);
// Where the station is served by another server; else empty.
void sharing_server(const struct sessions *sessions, int station, char *out_server, size_t size);

// cluster_whose of a server that is not alone. One alone serves all.
int sharing_whose(const struct sessions *sessions, struct cluster_peer *out, int max,
                  int *out_served_by);

// Sends a connected station to another server that lives, if there is one.
void sharing_send_on(struct sessions *sessions, int station);
// The next server can take the station once all is in the journal and the key is free. It waits.
void sharing_give_away(struct sessions *sessions, int station);

// ---- a session here

// Records that outlast a state, packed (trace/part.h), in order.
struct lasting_records {
    uint8_t *bytes;
    size_t size, room;
};

// Fills in what a header tells of the server.
void sharing_header(const struct sessions *sessions, int station, struct trace_header *header);
// For its trace; NULL: nobody wants to know.
const struct trace_tap *sharing_tap(const struct sessions *sessions, int station);
// Before the session's first record. asked, lasting: of one that goes on; else zero.
void sharing_begun(struct sessions *sessions, int station, const struct trace_header *header,
                   const char *trace, const struct job *asked,
                   const struct lasting_records *lasting);
// Its trace is closed. goes_on: at another server.
void sharing_ended(struct sessions *sessions, int station, const char *trace, bool goes_on);
// A state of the session with this trace is on disk. sessions: struct sessions
void sharing_kept(void *sessions, const char *trace);
