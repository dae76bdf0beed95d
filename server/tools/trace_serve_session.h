// A recorded session, told to an OpenIGTLink server as a station tells a live one.
#pragma once

#include "export/export.h"
#include "igtl/server.h"

struct served_session;

struct served_counts {
    uint64_t rounds, sets, strings, meshes;
};

// Reads the trace, and runs its cuts where the request has a scene: minutes for an hour's session.
// As export_mcap, but for damage: what can be read is served. request must outlive it.
enum result served_session_create(const struct export_request *request,
                                  struct served_session **out_session, struct error *err);
void served_session_destroy(struct served_session **session); // NULL inside is fine

const struct trace_header *served_session_header(const struct served_session *session);
double served_session_seconds(const struct served_session *session);

// Puts the state and the meshes with which it begins, for clients that come before it is played.
void served_session_show(struct served_session *session, struct igtl_server *server);

// Plays it once. Before each step `wait` waits until it is due, `seconds` after the first; false
// ends it. The times that it tells are those of the session; a further round goes on behind the one
// before.
enum result served_session_play(struct served_session *session, struct igtl_server *server,
                                bool (*wait)(void *user, double seconds), void *user,
                                struct error *err);

struct served_counts served_session_counts(const struct served_session *session);

// RESULT_OK where the trace is whole, else what is wrong with it.
enum result served_session_end(const struct served_session *session, struct error *err);
