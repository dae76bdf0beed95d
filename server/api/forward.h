// Of several servers: what another one has to answer is passed on to it, with the caller's token.
// It decides itself whether the caller may.
#pragma once

#include "api/routes.h"
#include "peers/ask.h"

struct forwards;

struct forwards *forwards_create(const char *keys_dir);
void forwards_break_off(struct forwards *forwards);
void forwards_destroy(struct forwards **forwards); // NULL inside is fine

// Whether the request is another server's to answer: then it has been refused, or will be answered
// later. What another server has passed on is answered here.
bool forward_takes(struct api_call *call, const struct route *route);

// Asks another server by its own secret; the answer's JSON is the caller's. RESULT_REFUSED: by its
// status. Otherwise as peer_ask.
enum result forward_ask(struct api *api, const struct cluster_peer *peer, const char *path,
                        json_t *body, json_t **out_json, struct error *err);

// The name of the server that has the trace of the path's session, where the caller may know of it;
// else empty. In sessions.c.
void session_server(struct api_call *call, char out_name[STORE_NAME_MAX]);
