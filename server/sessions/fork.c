#include "sessions/fork.h"

#include "base/chance.h"
#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "runtime/reply.h"
#include "sessions/course.h"
#include "sessions/resources.h"
#include "sessions/restore.h"
#include "trace/catalogue.h"
#include "trace/player.h"

#include <dirent.h>
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#define FORK_NICE 10 // behind workers; somebody waits for it

struct fork {
    struct sessions *sessions;
    int station;
    struct restored restored;      // its session has the new trace, and goes to the runtime
    struct trace_header header;    // of the new trace
    char path[SESSIONS_PATH_MAX];  // of it, once it has its name
    char draft[SESSIONS_PATH_MAX]; // until then, so that nobody takes it for a session's; or empty
};

// ---- which trace --------------------------------------------------------------------------------

static enum result find_source_trace(const struct sessions *s, const char *from,
                                     char out_path[SESSIONS_PATH_MAX], struct error *err) {
    struct stat status;
    if (trace_is_id(from))
        return catalogue_find(s->config.traces_dir, from, out_path, SESSIONS_PATH_MAX, err);
    if (stat(from, &status) != 0)
        return fail(err, RESULT_IO, "%s: %s", from, strerror(errno));
    if (!S_ISREG(status.st_mode))
        return fail(err, RESULT_IO, "%s: it is no file", from);
    snprintf(out_path, SESSIONS_PATH_MAX, "%s", from);
    return RESULT_OK;
}

// ---- the new trace ------------------------------------------------------------------------------

struct trace_copy {
    const struct sessions *sessions;
    const char *from;
    uint64_t end; // of what is copied, in the file
    struct trace_writer *writer;
    enum result result;
    struct error *err;
};

static bool copy_input(void *user, const struct trace_record *record) {
    struct trace_copy *c = user;
    struct trace_record input = *record;
    input.type = TRACE_PAST;
    if (record->offset >= c->end)
        return false;
    if (sessions_are_ending(c->sessions))
        c->result = fail(c->err, RESULT_TIMEOUT, "%s: the server ends", c->from);
    else
        c->result = trace_append_record(c->writer, &input, c->err);
    return c->result == RESULT_OK;
}

// In the copy, too, it is at its own time: before the copy's start.
static bool copy_marker(void *user, const struct trace_record *record) {
    struct trace_copy *c = user;
    if (record->type != TRACE_MARKER || record->offset >= c->end)
        return true;
    c->result = trace_append_record(c->writer, record, c->err);
    return c->result == RESULT_OK;
}

static enum result copy_inputs(const struct sessions *s, const struct restored *restored,
                               const char *from, struct trace_writer *writer, struct error *err) {
    struct trace_reader *reader;
    struct trace_copy copying = {s, from, restored->place.offset, writer, RESULT_OK, err};
    struct trace_player player = {
        .user = &copying, .record = copy_marker, .step = copy_input, .past = copy_input};
    enum result result = trace_reader_create(from, &reader, err);
    if (result != RESULT_OK)
        return result;
    struct error why; // the end and the damage of a recorded session are no fault of its copy
    if (trace_play(reader, &player, &why) == RESULT_IO && copying.result == RESULT_OK)
        copying.result = fail(err, RESULT_IO, "%s", why.text);
    trace_reader_destroy(&reader);
    return copying.result;
}

// Its clock goes on from where the other's stood: what came before is before its start.
static void fill_header(struct fork *f) {
    struct sessions *s = f->sessions;
    struct station_status status;
    uint8_t id[16];
    chance_fill(id, sizeof id);
    station_slot_status(&s->slots[f->station], &status);
    opening_header(s, f->station, id, f->restored.scene, status.strength, status.trainee,
                   &f->header);
    f->restored.session->runtime.ahead_ns = f->restored.place.time_ns - f->header.start_ns;
    f->header.start_ns = f->restored.place.time_ns;
    f->header.settings = f->restored.header.settings;
    memcpy(f->header.parent, f->restored.place.hash, sizeof f->header.parent);
    memcpy(f->header.parent_id, f->restored.header.session_id, sizeof f->header.parent_id);
}

// The station's channels would be other instruments in the copy.
static enum result check_instruments(struct fork *f, const char *from, struct error *err) {
    struct station_status status;
    station_slot_status(&f->sessions->slots[f->station], &status);
    if (instruments_equal(&status.instruments, &f->restored.header.settings.instruments))
        return RESULT_OK;
    return fail(err, RESULT_REFUSED, "%s: its session had other instruments than station %s", from,
                station_name(f->sessions, f->station));
}

static enum result write_trace(struct fork *f, const char *from, struct error *err) {
    struct sessions *s = f->sessions;
    if (check_instruments(f, from, err) != RESULT_OK)
        return RESULT_REFUSED;
    fill_header(f);
    enum result result = opening_trace_path(s, &f->header, f->path, err);
    if (result != RESULT_OK)
        return result;
    if (snprintf(f->draft, sizeof f->draft, "%s.draft", f->path) >= (int)sizeof f->draft) {
        f->draft[0] = '\0';
        return fail(err, RESULT_LIMIT, "%s: the path is too long", f->path);
    }
    struct trace_writer **trace = &f->restored.session->runtime.trace;
    result = trace_writer_create(f->draft, &f->header, &s->trace_signer, NULL, trace, err);
    return result == RESULT_OK ? copy_inputs(s, &f->restored, from, *trace, err) : result;
}

// ---- making one ---------------------------------------------------------------------------------

static enum result make(struct fork *f, const char *from, double at_s, struct error *err) {
    char path[SESSIONS_PATH_MAX];
    enum result result = find_source_trace(f->sessions, from, path, err);
    if (result == RESULT_OK)
        result = restore_run(f->sessions, path, &at_s, &f->restored, err);
    return f->restored.session ? write_trace(f, path, err) : result;
}

struct making {
    struct fork *fork;
    const char *from;
    double at_s;
    enum result result;
    struct error *err;
};

static void *run_fork(void *argument) {
    struct making *m = argument;
    setpriority(PRIO_PROCESS, 0, FORK_NICE); // Linux: of this thread; workers and cuts go first
    m->result = make(m->fork, m->from, m->at_s, m->err);
    return NULL;
}

enum result fork_create(struct sessions *s, int station, const char *from, double at_s,
                        struct fork **out_fork, struct error *err) {
    struct fork *f = alloc(1, sizeof *f);
    f->sessions = s;
    f->station = station;
    struct making m = {f, from, at_s, RESULT_OK, err};
    pthread_t thread;
    m.result = resources_allow_session(err);
    if (m.result == RESULT_OK && pthread_create(&thread, NULL, run_fork, &m) == 0)
        pthread_join(thread, NULL);
    else if (m.result == RESULT_OK)
        m.result = fail(err, RESULT_LIMIT, "the system gives no thread to make the copy");
    if (m.result != RESULT_OK)
        fork_destroy(&f);
    *out_fork = f;
    return m.result;
}

// ---- it begins ----------------------------------------------------------------------------------

static bool take_name(struct fork *f, arthron_CommandReply *reply) {
    if (rename(f->draft, f->path) != 0)
        return reply_refuse(reply, "%s: %s", f->path, strerror(errno));
    f->draft[0] = '\0';
    return true;
}

static bool take_slot(struct fork *f, arthron_CommandReply *reply) {
    struct station_slot *slot = &f->sessions->slots[f->station];
    if (!course_stop(f->sessions, f->station, reply))
        return false;
    return station_slot_claim(slot, f->header.session_id) ||
           reply_refuse_as(reply, arthron_Why_Code_BEING_OPENED,
                           station_name(f->sessions, f->station),
                           "station %s: another session is being opened",
                           station_name(f->sessions, f->station));
}

// The name comes first: where it cannot be had, the station's session goes on.
bool fork_begin(struct fork *f, arthron_CommandReply *reply) {
    struct open_session *session = f->restored.session;
    if (!take_name(f, reply))
        return false;
    if (!take_slot(f, reply)) {
        snprintf(f->draft, sizeof f->draft, "%s", f->path);
        return false;
    }
    f->restored.session = NULL;
    opening_attach(f->sessions, f->station, session, &f->header, f->restored.scene, f->path);
    return reply->ok = true;
}

void fork_destroy(struct fork **fork) {
    struct fork *f = *fork;
    *fork = NULL;
    if (!f)
        return;
    if (f->restored.session)
        trace_writer_destroy(&f->restored.session->runtime.trace);
    if (f->draft[0])
        unlink(f->draft);
    restore_fini(&f->restored);
    free(f);
}

void fork_clear(const char *traces_dir) {
    static const char draft[] = ".trace.draft";
    char path[SESSIONS_PATH_MAX];
    DIR *folder = opendir(traces_dir);
    for (struct dirent *entry; folder && (entry = readdir(folder));) {
        size_t length = strlen(entry->d_name), end = strlen(draft);
        if (length < end || strcmp(entry->d_name + length - end, draft) != 0)
            continue;
        int used = snprintf(path, sizeof path, "%s/%s", traces_dir, entry->d_name);
        if (used < (int)sizeof path && !trace_is_written(path) && unlink(path) == 0)
            log_warning("sessions", "%s: removed; the server ended before this copy was complete",
                        path);
    }
    if (folder)
        closedir(folder);
}
