#include "sessions/resume.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/task_pool.h"
#include "sessions/attempts.h"
#include "sessions/closing.h"
#include "sessions/opening.h"
#include "sessions/own.h"
#include "sessions/restore.h"
#include "sessions/sharing.h"
#include "trace/catalogue.h"
#include "trace/state.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#define RESUME_TRIES 3 // of what the system refused
static const struct timespec try_again = {.tv_nsec = 50 * NS_PER_MS};

struct resumed {
    struct sessions *sessions;
    int station;
    char path[SESSIONS_PATH_MAX]; // empty: there is none
    struct restored restored;
    struct error refused; // why it does not go on; empty: it does, or may at another start
};

// ---- which --------------------------------------------------------------------------------------

struct newest_trace {
    const char *station;
    struct trace_entry newest; // its path is not kept
    char path[SESSIONS_PATH_MAX];
};

// Of those of one second, what was written to last.
static bool is_newer(const struct trace_entry *entry, const struct newest_trace *search) {
    int order = search->path[0] ? strcmp(entry->stamp, search->newest.stamp) : 1;
    bool is_same = !order && !strcmp(entry->id_start, search->newest.id_start);
    if (is_same) // the session's last part
        return entry->part > search->newest.part;
    return order ? order > 0 : entry->written_utc_ns > search->newest.written_utc_ns;
}

static bool take_newest(void *user, const struct trace_entry *entry) {
    struct newest_trace *search = user;
    if (strcmp(entry->station, search->station) != 0 || !is_newer(entry, search) ||
        strlen(entry->path) >= sizeof search->path)
        return true;
    search->newest = *entry;
    snprintf(search->path, sizeof search->path, "%s", entry->path);
    return true;
}

enum result resume_newest(const struct sessions *s, const char *station,
                          char out_path[SESSIONS_PATH_MAX], struct error *err) {
    struct newest_trace search = {.station = station};
    enum result result = catalogue_each(s->config.traces_dir, take_newest, &search, err);
    snprintf(out_path, SESSIONS_PATH_MAX, "%s", search.path);
    return result;
}

bool resume_is_recent(const struct sessions *s, const char *path) {
    struct stat status;
    if (stat(path, &status) != 0)
        return errno != ENOENT;
    return time(NULL) - status.st_mtime <= s->config.wait_s;
}

// Of several servers none knows at its start whether its sessions go on elsewhere (sharing.h).
static enum result find_trace(struct resumed *r, struct error *err) {
    if (r->sessions->sharing)
        return RESULT_OK;
    enum result result =
        resume_newest(r->sessions, station_name(r->sessions, r->station), r->path, err);
    if (!r->path[0] || !resume_is_recent(r->sessions, r->path) ||
        !own_traces_have(r->sessions, r->path))
        r->path[0] = '\0';
    return result;
}

// ---- a trace whose replay ends the program ------------------------------------------------------

// While a trace is run again, a marker stands beside it. A marker of an earlier start means that
// the program did not survive this replay: the session is not tried again, so that one trace does
// not keep all stations out.
void resume_marker(const char *trace, char out_path[SESSIONS_PATH_MAX + 16]) {
    snprintf(out_path, SESSIONS_PATH_MAX + 16, "%.*s.resuming", SESSIONS_PATH_MAX - 1, trace);
}

static void sync_folder(const char *dir) {
    int fd = open(dir, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd >= 0) {
        fsync(fd);
        close(fd);
    }
}

static bool set_marker(const struct resumed *r) {
    char path[SESSIONS_PATH_MAX + 16];
    resume_marker(r->path, path);
    int fd = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    if (fd < 0 && errno == EEXIST) {
        log_error("sessions",
                  "station %s: %s is not resumed: an earlier start ended while it ran this trace "
                  "again; remove %s to try once more",
                  station_name(r->sessions, r->station), r->path, path);
        return false;
    }
    if (fd >= 0)
        close(fd);
    sync_folder(r->sessions->config.traces_dir);
    return true;
}

static void clear_resumed_marker(const struct resumed *r) {
    char path[SESSIONS_PATH_MAX + 16];
    resume_marker(r->path, path);
    int fault = 1;
    for (int i = 0; fault && i < RESUME_TRIES; i++)
        fault = unlink(path) && errno != ENOENT ? errno : 0;
    if (fault)
        log_error("sessions", "%s: %s; remove this file, else the next start does not resume it",
                  path, strerror(fault));
}

// ---- running it again ---------------------------------------------------------------------------

static void go_on(struct resumed *r) {
    struct restored *restored = &r->restored;
    struct session_runtime *runtime = &restored->session->runtime;
    int64_t now_ns = clock_now_ns();
    metrics_interrupt(&restored->metrics); // the trace will say so where it goes on
    runtime->metrics = (struct live_metrics){.scene = runtime->scene, .metrics = restored->metrics};
    runtime->snapshots = restored->snapshots;
    // The clock of a session that another server began tells nothing of this server's.
    bool is_own = restored->header.part == 1;
    runtime->ahead_ns = !is_own || runtime->last_ns > now_ns ? runtime->last_ns - now_ns : 0;
}

// The next start finds it in the list again.
static void set_aside(const struct resumed *r, const struct error *err) {
    log_error("sessions",
              "station %s: its session is set aside, and the next start tries again, unless the "
              "station has begun another one: %s",
              station_name(r->sessions, r->station), err->text);
    own_traces_note(r->sessions, r->path);
}

static int64_t resume_one(void *data) {
    struct resumed *r = data;
    struct error err;
    int64_t begin_ns = clock_now_ns();
    const char *station = station_name(r->sessions, r->station);
    if (!set_marker(r))
        return TASK_DONE;
    enum result result = restore_run(r->sessions, r->path, NULL, &r->restored, &err);
    for (int i = 1; result == RESULT_IO && i < RESUME_TRIES; i++) {
        nanosleep(&try_again, NULL);
        restore_fini(&r->restored);
        result = restore_run(r->sessions, r->path, NULL, &r->restored, &err);
    }
    clear_resumed_marker(r);
    if (r->restored.session)
        go_on(r);
    if (result == RESULT_MISSING)
        log_warning("sessions",
                    "station %s: its session was open when the server ended; run again from step "
                    "%llu to step %llu in %.1f s",
                    station, (unsigned long long)r->restored.kept_step + 1,
                    (unsigned long long)r->restored.place.step,
                    (double)(clock_now_ns() - begin_ns) / 1e9);
    else if (result == RESULT_IO)
        set_aside(r, &err);
    else if (result != RESULT_CLOSED)
        log_error("sessions", "station %s: its session cannot go on: %s", station, err.text);
    if (result == RESULT_REFUSED || result == RESULT_VERSION)
        r->refused = err;
    return TASK_DONE;
}

// A station that connects meets its session, before the worker has it too.
static void claim_slot(struct resumed *r) {
    struct station_slot *slot = &r->sessions->slots[r->station];
    if (!r->restored.session || r->restored.state == SESSION_CLOSED)
        return;
    station_slot_set_case(slot, r->restored.scene, NAN);
    bool claimed = station_slot_claim(slot, r->restored.header.session_id);
    CHECK(claimed);
}

enum result resume_replay(struct sessions *s, struct error *err) {
    enum result result = RESULT_OK;
    struct task_pool_settings settings = {.threads = sessions_worker_count(&s->config),
                                          .tasks_max = s->config.station_count + 1};
    struct task_pool *pool = task_pool_create(&settings);
    s->resumed = alloc((size_t)s->config.station_count + 1, sizeof *s->resumed);
    for (int i = 0; i < s->config.station_count; i++) {
        struct resumed *r = &s->resumed[i];
        *r = (struct resumed){.sessions = s, .station = i};
        if (result == RESULT_OK)
            result = find_trace(r, err);
        if (result == RESULT_OK && r->path[0])
            task_pool_add(pool, &(struct pool_task){.run = resume_one, .data = r});
    }
    task_pool_drain(pool);
    task_pool_destroy(&pool);
    for (int i = 0; i < s->config.station_count; i++)
        claim_slot(&s->resumed[i]);
    return result;
}

// ---- going on -----------------------------------------------------------------------------------

// The slot has no session then, and the station gets a new one.
static void give_up(struct resumed *r, const struct error *err) {
    set_aside(r, err);
    station_slot_failed(&r->sessions->slots[r->station], 0);
    restore_fini(&r->restored);
}

// The server was killed, perhaps before the records had them.
static void put_attempts(struct resumed *r) {
    while (r->restored.ended) {
        struct session_attempt *attempt = r->restored.ended;
        r->restored.ended = attempt->next;
        attempts_release(r->sessions, r->station, attempt);
    }
}

static void attach(struct resumed *r) {
    struct sessions *s = r->sessions;
    struct session_runtime *runtime = &r->restored.session->runtime;
    struct session_about about;
    opening_about(s, &r->restored.header, r->restored.scene, r->path, &about);
    runtime->serial = about.serial;
    memcpy(runtime->trace_file, about.trace, sizeof runtime->trace_file);
    runtime->snapshots.now.session = runtime->metrics.session = about.serial;
    if (runtime->attempt)
        runtime->attempt->session = about.serial;
    session_row_begin(&r->restored.header, r->path, &r->restored.session->row);
    recorder_put(s->recorder, &r->restored.session->row);
    put_attempts(r);
    sharing_begun(s, r->station, &r->restored.header, r->path, &r->restored.asked,
                  &r->restored.lasting);
    r->restored.session = NULL;
    opening_hand_over(s, r->station, &about, runtime, &r->restored.remarks, &r->restored.markers);
}

// True where the session goes on.
static bool open_trace(struct resumed *r) {
    struct session_runtime *runtime = &r->restored.session->runtime;
    struct error err;
    bool was_closed = r->restored.state == SESSION_CLOSED; // only its end was missing
    enum result result =
        trace_writer_resume(r->path, &r->restored.place, clock_utc_ns(), &r->sessions->trace_signer,
                            sharing_tap(r->sessions, r->station), &runtime->trace, &err);
    if (was_closed) {
        if (result == RESULT_OK)
            trace_writer_destroy(&runtime->trace);
        trace_state_remove(r->path);
        restore_fini(&r->restored);
    } else if (result != RESULT_OK) {
        give_up(r, &err);
    }
    return result == RESULT_OK && !was_closed;
}

void resume_open_traces(struct sessions *s) {
    for (int i = 0; i < s->config.station_count; i++) {
        if (s->resumed[i].restored.session)
            open_trace(&s->resumed[i]);
        else if (s->resumed[i].refused.text[0])
            closing_close(s, s->resumed[i].path, s->resumed[i].refused.text);
    }
}

void resume_attach(struct sessions *s) {
    for (int i = 0; i < s->config.station_count; i++)
        if (s->resumed[i].restored.session)
            attach(&s->resumed[i]);
    resume_release(s);
}

enum result resume_here(struct sessions *s, int station, const char *path, struct error *err) {
    struct resumed r = {.sessions = s, .station = station};
    snprintf(r.path, sizeof r.path, "%s", path);
    resume_one(&r);
    if (!r.restored.session || r.restored.state == SESSION_CLOSED) {
        enum result result = fail(err, RESULT_REFUSED, "%s: it does not go on", path);
        restore_fini(&r.restored);
        return result;
    }
    claim_slot(&r);
    if (!open_trace(&r))
        return fail(err, RESULT_REFUSED, "%s: it cannot be written", path);
    own_traces_note(s, path);
    attach(&r);
    restore_fini(&r.restored);
    return RESULT_OK;
}

void resume_release(struct sessions *s) {
    for (int i = 0; s->resumed && i < s->config.station_count; i++) {
        struct open_session *session = s->resumed[i].restored.session;
        if (session)
            trace_writer_destroy(&session->runtime.trace);
        restore_fini(&s->resumed[i].restored);
    }
    free(s->resumed);
    s->resumed = NULL;
}
