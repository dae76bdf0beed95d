// What the server tells monitors of itself (docs/WATCHING.md).
#pragma once

#include "api/api.h"
#include "sessions/sessions.h"

struct watched {
    struct sessions *sessions;
    const struct api *api;
    struct web *const *web; // NULL inside while it is being made
    int64_t started_ns;
};

// As api_config wants them; watched: a struct watched.
void watched_write(void *watched, bool openmetrics, FILE *file);
// The loops of stations and workers go on.
bool watched_lives(void *watched, char out_why[API_WHY_MAX]);
// It takes stations and pages, the records are open, and the disk has room.
bool watched_is_ready(void *watched, char out_why[API_WHY_MAX]);
