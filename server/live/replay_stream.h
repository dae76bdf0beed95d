// A recorded session from its trace, as the messages of /live in the order of time: session,
// remarks and resections where they were made, moments, meshes as they were cut, in the end its
// metrics.
#pragma once

#include "sessions/sessions.h"

// Who sees it. Both return false where nobody looks any more.
struct replay_sink {
    void *user;
    bool (*say)(void *user, const arthron_Live *item);
    bool (*say_mesh)(void *user, const struct mesh_payload *payload);
    arthron_Live *item; // room for one
};

// watch: a session of the server's traces or records, its rate and whether with meshes, and another
// case on which the same hands are to be seen, or its own. RESULT_MISSING where there is no such
// session, case or trace; RESULT_CLOSED where the sink has gone; what is wrong with the trace
// itself is told on the sink, and all before it is cache. Takes its time, reads files.
enum result replay_stream_run(struct sessions *sessions, const arthron_Watch *watch,
                              const struct replay_sink *sink, struct error *err);
