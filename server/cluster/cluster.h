// Several servers that share stations: one of them serves a station at a time, and another one can
// go on with its session. This is one server's part in it.
//
// Two threads beside those of libnats: one renews the lease and waits for nothing else; the other
// writes the journals, and reads states from the disk for them.
#pragma once

#include "cluster/journal.h"

#include <stdatomic.h>

struct cluster_settings {
    struct jet_settings jet;            // with the server's name
    char stations[SERVER_ADDRESS_SIZE]; // where stations reach this server, HOST:PORT
    char pages[SERVER_ADDRESS_SIZE];    // where browsers do
};

// Called on the cluster's thread; must not wait, and must not call the cluster.
struct cluster_handler {
    void *user;
    // The station is this server's by this token, anew perhaps. Its session may be one of another
    // server (cluster_read).
    void (*owned)(void *user, int station, uint64_t token);
    // It is not this server's, perhaps no more.
    void (*lost)(void *user, int station);
};

struct cluster;

// The servers whose keys are there now, without being one of them: who lives of them is not told.
// It waits for some seconds at most. The error: as jet_look.
enum result cluster_look(const struct cluster_settings *settings, struct cluster_peer *out_peers,
                         int room, int *out_count, struct error *err);

// names: of the stations; they must outlive the cluster. life: the path of a file of this server
// alone, by which it knows itself after a restart. Connects in the background. RESULT_MISSING,
// RESULT_INVALID: as jet_create. RESULT_IO: of the file.
enum result cluster_create(const struct cluster_settings *settings, const char *const *names,
                           int station_count, const char *life,
                           const struct cluster_handler *handler, struct cluster **out_cluster,
                           struct error *err);
// Gives all its stations free, as far as NATS answers, and calls its handler no more.
void cluster_leave_all(struct cluster *cluster);
// Behind cluster_leave_all. NULL inside is fine.
void cluster_destroy(struct cluster **cluster);

// ---- who serves; from any thread but a worker's

// A station asks for its session here. out_server: where it is served (OWNER_ELSEWHERE), else
// empty. out_token: of OWNER_SELF, else 0.
enum station_owner cluster_want(struct cluster *cluster, int station,
                                char out_server[SERVER_ADDRESS_SIZE], uint64_t *out_token);
// Where another server serves it, as far as is known; else empty.
void cluster_server(struct cluster *cluster, int station, char out_server[SERVER_ADDRESS_SIZE]);
// The station is given free: waits until others can know it. RESULT_TIMEOUT: they do not yet.
enum result cluster_release(struct cluster *cluster, int station, int64_t until_ns,
                            struct error *err);
// Where stations reach another server that lives; which: spreads them. False: there is none.
bool cluster_other(struct cluster *cluster, int which, char out_server[SERVER_ADDRESS_SIZE]);
// The name of another server that serves the station and lives; else empty.
void cluster_server_name(struct cluster *cluster, int station, char out_name[SERVER_NAME_SIZE]);
// The other servers that are known, also those that do not live; at most `room`. Returns how many.
int cluster_peers(struct cluster *cluster, struct cluster_peer *out_peers, int room);
// This server, as others see it.
void cluster_self(struct cluster *cluster, struct cluster_peer *out_peer);
// Until when this server may serve unasked (runtime/types.h); lives as long as the cluster.
const atomic_int_fast64_t *cluster_serves_until(const struct cluster *cluster);
bool cluster_is_connected(const struct cluster *cluster); // to NATS
// The other servers that were ever seen, and who serves each station (ownership_served_by).
int cluster_whose(struct cluster *cluster, struct cluster_peer *out_peers, int room,
                  int *out_served_by);

// The records at `path` become those that all servers share (shared_records.h, which has the
// errors). Before anybody else opens them. It waits until *ends is true.
enum result cluster_share_records(struct cluster *cluster, const char *path,
                                  const atomic_bool *ends, struct error *err);

// ---- a station's journal; from any thread but a worker's

void cluster_begin(struct cluster *cluster, int station, const struct trace_header *header,
                   const char *trace, const struct job *asked);
void cluster_record(struct cluster *cluster, int station, const struct trace_record *tapped);
void cluster_kept(struct cluster *cluster, int station);
void cluster_end(struct cluster *cluster, int station);
void cluster_leave(struct cluster *cluster, int station);
// Whether another server could go on with the session, and would lack at most what came in the last
// seconds.
bool cluster_protects(struct cluster *cluster, int station);
// The next state of the session that is kept makes a base of the journal, if there is anything to
// run again behind the last one. Fresh: others have it.
void cluster_refresh(struct cluster *cluster, int station);
bool cluster_is_fresh(struct cluster *cluster, int station);
// Waits until it would lack nothing but poses. RESULT_TIMEOUT.
enum result cluster_flush(struct cluster *cluster, int station, int64_t until_ns,
                          struct error *err);

// Reads what others wrote; what a server that had the station before writes from now on is void.
// Nothing is written until it is known: cluster_go_on.
// It waits. RESULT_TIMEOUT: NATS does not answer.
enum result cluster_read(struct cluster *cluster, int station, struct journal_reader *reader,
                         struct error *err);
// What was read by this token is taken into account: from now on the session here is the newest.
void cluster_go_on(struct cluster *cluster, int station, uint64_t token);
