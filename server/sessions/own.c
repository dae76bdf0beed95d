#include "sessions/own.h"

#include "base/check.h"
#include "base/log.h"
#include "store/store.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct own_traces {
    size_t count;
    char (*paths)[SESSIONS_PATH_MAX];
};

static void take(void *user, const struct store_cell *cells, int count) {
    struct own_traces *own = user;
    if (count != 1 || cells[0].kind != STORE_TEXT)
        return;
    own->paths = alloc_resize(own->paths, own->count + 1, sizeof *own->paths);
    snprintf(own->paths[own->count++], sizeof *own->paths, "%s", cells[0].text);
}

void own_traces_read(struct sessions *s) {
    struct store *store;
    struct error err;
    if (!s->config.records[0])
        return;
    struct own_traces *own = alloc(1, sizeof *own);
    enum result result = store_open(s->config.records, STORE_THERE, "server", &store, &err);
    if (result == RESULT_OK)
        result = store_open_traces(store, take, own, &err);
    store_close(&store);
    s->own = own;
    if (result == RESULT_OK || result == RESULT_MISSING)
        return;
    log_warning("sessions", "%s: so all open traces count as this server's", err.text);
    own_traces_free(s);
}

void own_traces_free(struct sessions *s) {
    if (s->own)
        free(s->own->paths);
    free(s->own);
    s->own = NULL;
}

static const char *name_of(const char *path) {
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

// By their names, which have the sessions' ids: the folder may have been moved.
bool own_traces_have(const struct sessions *s, const char *path) {
    bool found = !s->own;
    for (size_t i = 0; !found && i < s->own->count; i++)
        found = !strcmp(name_of(s->own->paths[i]), name_of(path));
    return found;
}
