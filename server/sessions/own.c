#include "sessions/own.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/draft.h"
#include "base/log.h"
#include "store/store.h"
#include "trace/catalogue.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#define LIST_TRIES 3 // to read the list

struct own_traces {
    size_t count;
    char (*names)[TRACE_NAME_MAX]; // they have the sessions' ids: the folder may have been moved
};

static const char *name_of(const char *path) {
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

static void add(struct own_traces *own, const char *path) {
    const char *name = name_of(path);
    if (strlen(name) >= TRACE_NAME_MAX)
        return;
    own->names = alloc_resize(own->names, own->count + 1, sizeof *own->names);
    strcpy(own->names[own->count++], name);
}

// ---- the list beside the records ----------------------------------------------------------------

static bool list_path(const struct sessions *s, char out[PATH_MAX]) {
    return s->config.records[0] &&
           snprintf(out, PATH_MAX, "%s.begun", s->config.records) < PATH_MAX;
}

// An empty line ends what a full disk may have left of another.
static int append_line(const char *path, const char *name) {
    char line[TRACE_NAME_MAX + 2];
    int fd = open(path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
    if (fd < 0)
        return errno;
    int size = snprintf(line, sizeof line, "\n%s\n", name);
    errno = ENOSPC; // of a part that is written
    int fault = write(fd, line, (size_t)size) == size && fdatasync(fd) == 0 ? 0 : errno;
    close(fd);
    return fault;
}

void own_traces_note(const struct sessions *s, const char *trace) {
    char path[PATH_MAX];
    if (!list_path(s, path))
        return;
    int fault = append_line(path, name_of(trace));
    if (fault)
        log_warning("sessions", "%s: %s; should the server be killed at once, %s does not go on",
                    path, strerror(fault), trace);
}

static void take_line(const struct sessions *s, struct own_traces *own, char *line) {
    char path[PATH_MAX];
    line[strcspn(line, "\n")] = '\0';
    if (!line[0] || strchr(line, '/') ||
        snprintf(path, sizeof path, "%s/%s", s->config.traces_dir, line) >= SESSIONS_PATH_MAX)
        return;
    if (!own_traces_have(s, path) && trace_is_open(path))
        add(own, path);
}

// Those that have ended since are left out.
static void write_list(const char *path, const struct own_traces *own) {
    struct draft draft;
    struct error err;
    enum result result = draft_open(path, &draft, &err);
    if (result == RESULT_OK) {
        for (size_t i = 0; i < own->count && draft_is_good(&draft); i++)
            fprintf(draft.file, "%s\n", own->names[i]);
        result = draft_keep(&draft, &err);
    }
    if (result != RESULT_OK)
        log_warning("sessions", "%s", err.text);
}

// errno, or 0.
static int read_lines(const struct sessions *s, struct own_traces *own, const char *path) {
    char line[TRACE_NAME_MAX + 1];
    FILE *file = fopen(path, "re");
    if (!file)
        return errno == ENOENT ? 0 : errno;
    while (fgets(line, sizeof line, file))
        take_line(s, own, line);
    int fault = ferror(file) ? errno : 0;
    fclose(file);
    return fault;
}

// Where it cannot be read, it stays as it is, for the next start.
static void read_list(const struct sessions *s, struct own_traces *own) {
    static const struct timespec try_again = {.tv_nsec = 50 * NS_PER_MS};
    char path[PATH_MAX];
    if (!list_path(s, path))
        return;
    int fault = read_lines(s, own, path);
    for (int i = 1; fault && i < LIST_TRIES; i++) {
        nanosleep(&try_again, NULL);
        fault = read_lines(s, own, path);
    }
    if (fault)
        log_error("sessions",
                  "%s: %s; open sessions that only this list names wait for the next start", path,
                  strerror(fault));
    else
        write_list(path, own);
}

// ---- those of the records -----------------------------------------------------------------------

static void take_own(void *user, const struct store_cell *cells, int count) {
    if (count == 1 && cells[0].kind == STORE_TEXT)
        add(user, cells[0].text);
}

void own_traces_read(struct sessions *s) {
    struct store *store;
    struct error err;
    if (!s->config.records[0])
        return;
    struct own_traces *own = alloc(1, sizeof *own);
    s->own = own;
    read_list(s, own);
    enum result result = store_open(s->config.records, STORE_THERE, "server", &store, &err);
    if (result == RESULT_OK)
        result = store_open_traces(store, take_own, own, &err);
    store_close(&store);
    if (result == RESULT_OK || result == RESULT_MISSING)
        return;
    log_warning("sessions", "%s: so only sessions that %s.begun names go on", err.text,
                s->config.records);
}

void own_traces_free(struct sessions *s) {
    if (s->own)
        free(s->own->names);
    free(s->own);
    s->own = NULL;
}

bool own_traces_have(const struct sessions *s, const char *path) {
    bool found = !s->own;
    for (size_t i = 0; !found && i < s->own->count; i++)
        found = !strcmp(s->own->names[i], name_of(path));
    return found;
}
