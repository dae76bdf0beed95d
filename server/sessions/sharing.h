// Several servers that share stations (server/cluster), as the sessions see it: which stations this
// one serves, how it goes on with a session of another one, and how it gives one away. A server
// alone (no [cluster] in its config) serves all, and these functions do nothing for it.
#pragma once

#include "sessions/restore.h"

struct sharing;

// Before the runtime is made. The error names file or address.
enum result sharing_create(struct sessions *sessions, struct error *err);
// After all sessions have been released: gives all stations free.
void sharing_destroy(struct sessions *sessions);

// Until when this server may serve unasked (runtime/types.h); NULL: for ever.
const atomic_int_fast64_t *sharing_serves_until(const struct sessions *sessions);

// A station says hello. False: it has to go elsewhere or to ask again, and *refusal says so.
// out_token: for its welcome.
bool sharing_hello(struct sessions *sessions, int station, arthron_Refusal *refusal,
                   uint64_t *out_token);
// Whether a session of the station may be opened here.
bool sharing_serves(const struct sessions *sessions, int station);
// Whether another server could go on with its session as it is, where there are several.
bool sharing_protects(const struct sessions *sessions, int station);
// Where the station is served by another server; else empty.
void sharing_server(const struct sessions *sessions, int station, char *out_server, size_t size);

// ---- a session here

// Fills in what a header tells of the server.
void sharing_header(const struct sessions *sessions, int station, struct trace_header *header);
// For its trace; NULL: nobody wants to know.
const struct trace_tap *sharing_tap(const struct sessions *sessions, int station);
// Before the session's first record. restored: NULL for one that begins now.
void sharing_begun(struct sessions *sessions, int station, const struct trace_header *header,
                   const char *trace, const struct restored *restored);
// Its trace is closed, or left to another server.
void sharing_ended(struct sessions *sessions, int station, const char *trace, bool goes_on);
// A state of the session with this trace is on disk. sessions: struct sessions
void sharing_kept(void *sessions, const char *trace);

// ---- on a thread of the manager's pool

// The station is this server's: goes on with the session that it has elsewhere.
void sharing_take(struct sessions *sessions, int station);
// Another server has the station: its session is left to that one.
void sharing_lose(struct sessions *sessions, int station);

// Before the server ends: all stations go on at other servers, with their sessions.
void sharing_move_all(struct sessions *sessions);
