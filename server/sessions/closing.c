#include "sessions/closing.h"

#include "base/clock.h"
#include "base/log.h"
#include "base/task_pool.h"
#include "sessions/own.h"
#include "sessions/resume.h"
#include "trace/catalogue.h"
#include "trace/player.h"
#include "trace/state.h"

#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define CLOSING_NICE 10             // behind workers
#define AT_THE_END_BYTES (64 << 20) // of a trace that is still closed while the server ends

// ---- how far it goes ----------------------------------------------------------------------------

struct open_trace {
    const struct sessions *sessions;
    bool is_large;
    struct trace_reader *reader;
    struct trace_place place; // behind the last whole record
    uint32_t remarks;         // the last number
    enum session_state state; // after the last step
};

static bool on_closing_record(void *user, const struct trace_record *record) {
    struct open_trace *t = user;
    if (record->type == TRACE_REMARK && record->remark.number > t->remarks)
        t->remarks = record->remark.number;
    if (record->type == TRACE_STEP)
        t->state = record->output.state;
    t->place = trace_reader_place(t->reader);
    return !(t->is_large && sessions_are_ending(t->sessions));
}

static bool is_large(const char *path) {
    struct stat status;
    return stat(path, &status) == 0 && status.st_size >= AT_THE_END_BYTES;
}

// False if it has an end, or cannot get one.
static bool read_open(const struct sessions *s, const char *path, struct open_trace *out) {
    struct trace_reader *reader;
    struct trace_player player = {.user = out, .record = on_closing_record};
    *out = (struct open_trace){.sessions = s, .is_large = is_large(path)};
    if (trace_reader_create(path, &reader, NULL) != RESULT_OK)
        return false;
    out->reader = reader;
    out->place = trace_reader_place(reader);
    bool open = !trace_header_is_piece(trace_reader_header(reader)) &&
                (trace_play(reader, &player, NULL) == RESULT_MISSING || trace_ends_torn(reader));
    trace_reader_destroy(&reader);
    return open && out->place.version >= TRACE_OLDEST_RESUMED;
}

// ---- closing one --------------------------------------------------------------------------------

static void say_why(struct trace_writer *writer, const struct open_trace *t, const char *why) {
    struct remark remark = {
        .number = t->remarks + 1, .time_ns = t->place.time_ns, .author = "arthron-server"};
    snprintf(remark.text, sizeof remark.text, "The session could not go on: %.200s",
             error_without_folder(why));
    if (t->remarks < REMARKS_MAX)
        trace_append_remark(writer, &remark);
}

// What kept a start from resuming it is over.
static void clear_marker(const char *path) {
    char marker[SESSIONS_PATH_MAX + 16];
    resume_marker(path, marker);
    unlink(marker);
}

void closing_close(struct sessions *s, const char *path, const char *why) {
    struct open_trace trace;
    struct trace_writer *writer;
    struct error err;
    if (!read_open(s, path, &trace))
        return;
    if (trace_writer_resume(path, &trace.place, clock_utc_ns(), &s->trace_signer, NULL, &writer,
                            &err) != RESULT_OK) {
        log_error("sessions", "a trace could not be closed: %s", err.text);
        return;
    }
    bool had_ended = trace.state == SESSION_CLOSED; // and only the end record was missing
    if (!had_ended)
        say_why(writer, &trace, why);
    trace_writer_destroy(&writer);
    clear_marker(path);
    trace_state_remove(path);
    log_warning("sessions", "%s: closed, its end was missing%s%s", path, had_ended ? "" : ": ",
                had_ended ? "" : why);
    recorder_put_trace(s->recorder, path);
}

// ---- all of the folder --------------------------------------------------------------------------

// False if a later start may still resume it.
static bool is_given_up(const struct sessions *s, const struct trace_entry *entry,
                        struct error *why) {
    char newest[SESSIONS_PATH_MAX];
    if (resume_newest(s, entry->station, newest, why) != RESULT_OK)
        return false;
    if (sessions_find_station(&s->config, entry->station) < 0)
        fail(why, RESULT_MISSING, "the server's config has no station %s", entry->station);
    else if (!resume_is_recent(s, entry->path))
        fail(why, RESULT_MISSING, "no server resumed it within %d s", s->config.wait_s);
    else if (strcmp(newest, entry->path) != 0)
        fail(why, RESULT_MISSING, "its station has a newer session");
    else
        return false;
    return true;
}

static void close_if_own(struct sessions *s, const char *path, const char *why) {
    if (own_traces_have(s, path))
        closing_close(s, path, why);
    else
        log_warning(
            "sessions",
            "%s: it stays open and unsigned, because the records know no open session of it", path);
}

static bool look_at(void *user, const struct trace_entry *entry) {
    struct sessions *s = user;
    struct error why;
    if (sessions_are_ending(s) && is_large(entry->path))
        return true;
    if (strlen(entry->path) >= SESSIONS_PATH_MAX || trace_is_written(entry->path))
        return true;
    if (!trace_is_open(entry->path))
        trace_state_remove(entry->path); // of a server that was killed just then
    else if (is_given_up(s, entry, &why))
        close_if_own(s, entry->path, why.text);
    return true;
}

static int64_t close_all(void *sessions) {
    struct sessions *s = sessions;
    struct error err;
    if (catalogue_each(s->config.traces_dir, look_at, s, &err) != RESULT_OK)
        log_error("sessions", "%s", err.text);
    return TASK_DONE;
}

void closing_start(struct sessions *s) {
    struct task_pool_settings settings = {.threads = 1, .tasks_max = 1, .nice = CLOSING_NICE};
    s->closing = task_pool_create(&settings);
    task_pool_add(s->closing, &(struct pool_task){.run = close_all, .data = s});
}

void closing_stop(struct sessions *s) {
    if (s->closing)
        task_pool_drain(s->closing);
    task_pool_destroy(&s->closing);
}
