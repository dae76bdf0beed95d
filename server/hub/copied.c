#include "hub/copied.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"

#include <dirent.h>
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define ID_DIGITS 32

// ---- which trace --------------------------------------------------------------------------------

bool copied_is_id(const char *text) {
    return strspn(text, "0123456789abcdef") == ID_DIGITS && !text[ID_DIGITS];
}

static bool is_of_session(const char *path, const char *id) {
    struct trace_reader *reader;
    char text[ID_DIGITS + 1];
    if (trace_reader_create(path, &reader, NULL) != RESULT_OK)
        return false;
    for (int i = 0; i < ID_DIGITS / 2; i++)
        snprintf(text + 2 * i, 3, "%02x", trace_reader_header(reader)->session_id[i]);
    trace_reader_destroy(&reader);
    return !strcmp(text, id);
}

// A trace's name ends with the first digits of its session's id.
static enum result find_session(const char *dir, const char *id, char out_path[HUB_PATH_MAX],
                                struct error *err) {
    char end[32];
    int length = snprintf(end, sizeof end, "-%.8s.trace", id);
    bool found = false;
    DIR *folder = opendir(dir);
    for (struct dirent *entry; folder && !found && (entry = readdir(folder));) {
        size_t name = strlen(entry->d_name);
        if (name < (size_t)length || strcmp(entry->d_name + name - length, end) != 0)
            continue;
        int used = snprintf(out_path, HUB_PATH_MAX, "%s/%s", dir, entry->d_name);
        found = used < HUB_PATH_MAX && is_of_session(out_path, id);
    }
    if (folder)
        closedir(folder);
    return found ? RESULT_OK : fail(err, RESULT_MISSING, "%s: no trace of a session %s", dir, id);
}

static enum result find_trace(const struct hub *hub, const char *from, char out_path[HUB_PATH_MAX],
                              struct error *err) {
    struct stat status;
    if (copied_is_id(from))
        return find_session(hub->config.traces_dir, from, out_path, err);
    if (stat(from, &status) != 0)
        return fail(err, RESULT_IO, "%s: %s", from, strerror(errno));
    if (!S_ISREG(status.st_mode))
        return fail(err, RESULT_IO, "%s: it is no file", from);
    snprintf(out_path, HUB_PATH_MAX, "%s", from);
    return RESULT_OK;
}

// ---- the new trace ------------------------------------------------------------------------------

static enum result copy_inputs(const struct hub *hub, const struct again *again, const char *from,
                               struct trace_writer *writer, struct error *err) {
    struct trace_reader *reader;
    struct trace_record record;
    enum result result = trace_reader_create(from, &reader, err);
    if (result != RESULT_OK)
        return result;
    while (result == RESULT_OK && trace_reader_offset(reader) < again->place.offset) {
        if (atomic_load(&hub->ending))
            result = fail(err, RESULT_TIMEOUT, "%s: the server ends", from);
        else
            result = trace_read(reader, &record, err);
        if (result != RESULT_OK || (record.type != TRACE_STEP && record.type != TRACE_PAST))
            continue;
        record.type = TRACE_PAST;
        result = trace_append_record(writer, &record, err);
    }
    trace_reader_destroy(&reader);
    return result;
}

// Its clock goes on from where the other's stood: what came before is before its start.
static void fill_header(struct hub *hub, int seat, struct copied *c) {
    pthread_mutex_lock(&hub->card_lock);
    struct card card = hub->seats[seat].card;
    pthread_mutex_unlock(&hub->card_lock);
    card.scene = c->again.scene;
    card.start_utc_ns = clock_utc_ns();
    desk_new_id(card.session_id);
    desk_header(hub, &hub->seats[seat], &card, &c->header);
    c->again.live->ahead_ns = c->again.place.time_ns - c->header.start_ns;
    c->header.start_ns = c->again.place.time_ns;
    c->header.settings = c->again.header.settings;
    memcpy(c->header.parent, c->again.place.hash, sizeof c->header.parent);
    memcpy(c->header.parent_id, c->again.header.session_id, sizeof c->header.parent_id);
}

static enum result write_trace(struct hub *hub, int seat, const char *from, struct copied *c,
                               struct error *err) {
    fill_header(hub, seat, c);
    enum result result = desk_trace_path(hub, &hub->seats[seat], &c->header, c->path, err);
    if (result != RESULT_OK)
        return result;
    if (snprintf(c->draft, sizeof c->draft, "%s.draft", c->path) >= (int)sizeof c->draft) {
        c->draft[0] = '\0';
        return fail(err, RESULT_LIMIT, "%s: the path is too long", c->path);
    }
    struct trace_writer **trace = &c->again.live->trace;
    result = trace_writer_create(c->draft, &c->header, &hub->vouches, trace, err);
    return result == RESULT_OK ? copy_inputs(hub, &c->again, from, *trace, err) : result;
}

// ---- making one ---------------------------------------------------------------------------------

struct making {
    struct hub *hub;
    int seat;
    const char *from;
    double at_s;
    struct copied *copied;
    enum result result;
    struct error *err;
};

static enum result make(struct making *m) {
    struct copied *c = m->copied;
    char path[HUB_PATH_MAX];
    enum result result = find_trace(m->hub, m->from, path, m->err);
    if (result == RESULT_OK)
        result = again_run(m->hub, path, &m->at_s, &c->again, m->err);
    return c->again.live ? write_trace(m->hub, m->seat, path, c, m->err) : result;
}

static void *run(void *argument) {
    struct making *m = argument;
    struct sched_param none = {0};
    sched_setscheduler(0, SCHED_IDLE, &none); // as a theatre: the workers go first
    m->result = make(m);
    return NULL;
}

enum result copied_create(struct hub *hub, int seat, const char *from, double at_s,
                          struct copied **out_copied, struct error *err) {
    struct copied *c = alloc(1, sizeof *c);
    struct making m = {hub, seat, from, at_s, c, RESULT_OK, err};
    pthread_t thread;
    CHECK(pthread_create(&thread, NULL, run, &m) == 0);
    pthread_join(thread, NULL);
    if (m.result != RESULT_OK)
        copied_destroy(&c);
    *out_copied = c;
    return m.result;
}

enum result copied_begin(struct copied *c, struct error *err) {
    if (rename(c->draft, c->path) != 0)
        return fail(err, RESULT_IO, "%s: %s", c->path, strerror(errno));
    c->draft[0] = '\0';
    return RESULT_OK;
}

void copied_destroy(struct copied **copied) {
    struct copied *c = *copied;
    *copied = NULL;
    if (!c)
        return;
    if (c->again.live)
        trace_writer_destroy(&c->again.live->trace);
    if (c->draft[0])
        unlink(c->draft);
    again_fini(&c->again);
    free(c);
}

void copied_clear(const char *traces_dir) {
    static const char draft[] = ".trace.draft";
    char path[HUB_PATH_MAX];
    DIR *folder = opendir(traces_dir);
    for (struct dirent *entry; folder && (entry = readdir(folder));) {
        size_t length = strlen(entry->d_name), end = strlen(draft);
        if (length < end || strcmp(entry->d_name + length - end, draft) != 0)
            continue;
        int used = snprintf(path, sizeof path, "%s/%s", traces_dir, entry->d_name);
        if (used < (int)sizeof path && !trace_is_written(path) && unlink(path) == 0)
            log_warning("hub", "%s: removed; the server ended before this copy was complete", path);
    }
    if (folder)
        closedir(folder);
}
