// Stations that come here from other servers with their sessions, and go to others (sharing.h).
#pragma once

#include "sessions/parts.h"

// Before the runtime is made. Without [cluster] in the config it does nothing. The error names file
// or address.
enum result moving_create(struct sessions *sessions, struct error *err);

// A station says hello. False: it has to go elsewhere or to ask again, and *refusal says so.
// out_token: for its welcome.
bool moving_hello(struct sessions *sessions, int station, arthron_Refusal *refusal,
                  uint64_t *out_token);

// Before the manager ends: it gets no more work from here.
void moving_end(struct sessions *sessions);

// Before the server ends: all stations go on at other servers, with their sessions. It waits.
void moving_all(struct sessions *sessions);
