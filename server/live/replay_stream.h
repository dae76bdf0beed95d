// A recorded session from its trace, as messages of /live in the order of time: the session; its
// moments, remarks, resections and meshes; at the end its metrics.
#pragma once

#include "sessions/sessions.h"

// The receiver of the messages. `say` and `say_mesh` return false once no page looks any more.
struct replay_sink {
    void *user;
    bool (*say)(void *user, const arthron_Live *item);
    bool (*say_mesh)(void *user, const struct mesh_payload *payload);
    arthron_Live *item; // room for one
    bool blind;         // the trainee's name is left out
};

// Whether this server has the trace of the session that is watched; where there are several, the
// newest part of it. out_server: the name of the other one that has that, where the records say it.
bool replay_stream_is_here(const struct sessions *sessions, const arthron_Watch *watch,
                           char out_server[SERVER_NAME_SIZE]);

// watch: a session of the server's traces or records; the rate; with or without meshes; and its own
// case or another one, on which the same hands are shown. RESULT_MISSING: there is no such session,
// case or trace. RESULT_CLOSED: the sink has gone. A fault of the trace goes to the sink as a
// message, after everything before it. Reads files and may take minutes.
enum result replay_stream_run(struct sessions *sessions, const arthron_Watch *watch,
                              const struct replay_sink *sink, struct error *err);
