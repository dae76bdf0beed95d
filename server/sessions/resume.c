#include "sessions/resume.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/task_pool.h"
#include "sessions/opening.h"
#include "sessions/restore.h"

#include <dirent.h>
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

struct resumed {
    struct sessions *sessions;
    int station;
    char path[SESSIONS_PATH_MAX]; // empty: there is none
    struct restored restored;
};

// ---- which --------------------------------------------------------------------------------------

// STATION-20260102T030405Z-01234567.trace
static bool is_trace_of(const char *name, const char *station) {
    static const char rest[] = "-20260102T030405Z-01234567.trace";
    size_t length = strlen(station);
    return !strncmp(name, station, length) && strlen(name + length) == sizeof rest - 1 &&
           name[length] == '-' && !strcmp(name + length + sizeof rest - 7, ".trace");
}

static struct timespec written_at(DIR *folder, const char *name) {
    struct stat status = {0};
    fstatat(dirfd(folder), name, &status, 0);
    return status.st_mtim;
}

// The stamps in the names sort as times do; of those of one second, what was written to last.
static bool is_newer(DIR *folder, const char *name, const char *than, size_t stamp_end) {
    int order = *than ? strncmp(name, than, stamp_end) : 1;
    struct timespec a = written_at(folder, name), b = written_at(folder, than);
    if (order)
        return order > 0;
    return a.tv_sec != b.tv_sec ? a.tv_sec > b.tv_sec : a.tv_nsec > b.tv_nsec;
}

static void find_newest(const char *dir, const char *station, char out_name[NAME_MAX + 1]) {
    size_t stamp_end = strlen(station) + strlen("-20260102T030405Z");
    DIR *folder = opendir(dir);
    out_name[0] = '\0';
    for (struct dirent *entry; folder && (entry = readdir(folder));)
        if (is_trace_of(entry->d_name, station) &&
            is_newer(folder, entry->d_name, out_name, stamp_end))
            snprintf(out_name, NAME_MAX + 1, "%s", entry->d_name);
    if (folder)
        closedir(folder);
}

// Whether it was written to within the time that a session waits for its station.
static bool is_recent(const struct sessions *s, const char *path) {
    struct stat status;
    return stat(path, &status) == 0 && time(NULL) - status.st_mtime <= s->config.wait_s;
}

static bool find_trace(struct resumed *r) {
    const char *dir = r->sessions->config.traces_dir;
    char name[NAME_MAX + 1];
    find_newest(dir, station_name(r->sessions, r->station), name);
    int length = snprintf(r->path, sizeof r->path, "%s/%s", dir, name);
    return name[0] && length < (int)sizeof r->path && is_recent(r->sessions, r->path);
}

// ---- a trace whose replay ends the program ------------------------------------------------------

// While a trace is run again, a marker stands beside it. A marker of an earlier start means that
// the program did not survive this replay: the session is not tried again, so that one trace does
// not keep all stations out.
static bool marker_path(const struct resumed *r, char out_path[SESSIONS_PATH_MAX + 16]) {
    return snprintf(out_path, SESSIONS_PATH_MAX + 16, "%s.resuming", r->path) > 0;
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
    marker_path(r, path);
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

static void clear_marker(const struct resumed *r) {
    char path[SESSIONS_PATH_MAX + 16];
    marker_path(r, path);
    unlink(path);
}

// ---- running it again ---------------------------------------------------------------------------

static void go_on(struct resumed *r) {
    struct restored *restored = &r->restored;
    struct session_runtime *runtime = &restored->session->runtime;
    int64_t now_ns = clock_now_ns();
    metrics_interrupt(&restored->metrics); // the trace will say so where it goes on
    runtime->metrics = (struct live_metrics){.scene = runtime->scene, .metrics = restored->metrics};
    runtime->snapshots = restored->snapshots;
    runtime->ahead_ns = runtime->last_ns > now_ns ? runtime->last_ns - now_ns : 0;
}

static int64_t resume_one(void *data) {
    struct resumed *r = data;
    struct error err;
    int64_t begin_ns = clock_now_ns();
    const char *station = station_name(r->sessions, r->station);
    if (!set_marker(r))
        return TASK_DONE;
    enum result result = restore_run(r->sessions, r->path, NULL, &r->restored, &err);
    clear_marker(r);
    if (r->restored.session)
        go_on(r);
    if (result == RESULT_MISSING)
        log_warning("sessions",
                    "station %s: its session was open when the server ended; run again to "
                    "step %llu in %.1f s",
                    station, (unsigned long long)r->restored.place.step,
                    (double)(clock_now_ns() - begin_ns) / 1e9);
    else if (result != RESULT_CLOSED)
        log_error("sessions", "station %s: its session cannot go on: %s", station, err.text);
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

void resume_replay(struct sessions *s) {
    struct task_pool_settings settings = {.threads = sessions_worker_count(&s->config),
                                          .tasks_max = STATIONS_MAX};
    struct task_pool *pool = task_pool_create(&settings);
    s->resumed = alloc((size_t)s->config.station_count + 1, sizeof *s->resumed);
    for (int i = 0; i < s->config.station_count; i++) {
        struct resumed *r = &s->resumed[i];
        *r = (struct resumed){.sessions = s, .station = i};
        if (find_trace(r))
            task_pool_add(pool, &(struct task){.run = resume_one, .data = r});
        else
            r->path[0] = '\0';
    }
    task_pool_drain(pool);
    task_pool_destroy(&pool);
    for (int i = 0; i < s->config.station_count; i++)
        claim_slot(&s->resumed[i]);
}

// ---- going on -----------------------------------------------------------------------------------

// The slot has no session then, and the station gets a new one.
static void give_up(struct resumed *r, const struct error *err) {
    log_error("sessions", "station %s: its session cannot go on: %s",
              station_name(r->sessions, r->station), err->text);
    station_slot_failed(&r->sessions->slots[r->station], 0);
    restore_fini(&r->restored);
}

static void attach(struct resumed *r) {
    struct sessions *s = r->sessions;
    struct session_runtime *runtime = &r->restored.session->runtime;
    struct session_about about;
    opening_about(s, &r->restored.header, r->restored.scene, r->path, &about);
    runtime->serial = about.serial;
    runtime->snapshots.now.session = runtime->metrics.session = about.serial;
    session_row_begin(&r->restored.header, r->path, &r->restored.session->row);
    station_slot_attached(&s->slots[r->station], &about, runtime->state, &r->restored.remarks);
    recorder_put(s->recorder, &r->restored.session->row);
    runtime_attach(s->runtime, r->station, runtime);
    r->restored.session = NULL;
}

// True where the session goes on.
static bool open_trace(struct resumed *r) {
    struct session_runtime *runtime = &r->restored.session->runtime;
    struct error err;
    bool was_closed = r->restored.state == SESSION_CLOSED; // only its end was missing
    enum result result = trace_writer_resume(r->path, &r->restored.place, clock_utc_ns(),
                                             &r->sessions->trace_signer, &runtime->trace, &err);
    if (was_closed) {
        if (result == RESULT_OK)
            trace_writer_destroy(&runtime->trace);
        restore_fini(&r->restored);
    } else if (result != RESULT_OK) {
        give_up(r, &err);
    }
    return result == RESULT_OK && !was_closed;
}

// ---- those that do not go on --------------------------------------------------------------------

static bool is_open(const char *path, struct trace_place *out_place) {
    struct trace_reader *reader;
    struct trace_record record;
    enum result result;
    if (trace_reader_create(path, &reader, NULL) != RESULT_OK)
        return false;
    do
        result = trace_read(reader, &record, NULL);
    while (result == RESULT_OK);
    *out_place = trace_reader_place(reader);
    bool open = result == RESULT_MISSING && trace_reader_header(reader)->version == TRACE_VERSION;
    trace_reader_destroy(&reader);
    return open;
}

static void close_trace(const struct resumed *r, const char *path) {
    struct trace_place place;
    struct trace_writer *writer;
    struct error err;
    const char *station = station_name(r->sessions, r->station);
    if (!is_open(path, &place))
        return;
    if (trace_writer_resume(path, &place, clock_utc_ns(), &r->sessions->trace_signer, &writer,
                            &err) != RESULT_OK) {
        log_error("sessions", "station %s: a trace could not be closed: %s", station, err.text);
        return;
    }
    trace_writer_destroy(&writer);
    log_warning("sessions", "station %s: closed %s, whose end was missing", station, path);
}

static void close_others(const struct resumed *r) {
    const char *dir = r->sessions->config.traces_dir;
    char path[SESSIONS_PATH_MAX];
    DIR *folder = opendir(dir);
    for (struct dirent *entry; folder && (entry = readdir(folder));) {
        if (!is_trace_of(entry->d_name, station_name(r->sessions, r->station)))
            continue;
        int length = snprintf(path, sizeof path, "%s/%s", dir, entry->d_name);
        if (length < (int)sizeof path && strcmp(path, r->path) != 0 && is_recent(r->sessions, path))
            close_trace(r, path);
    }
    if (folder)
        closedir(folder);
}

void resume_open_traces(struct sessions *s) {
    for (int i = 0; i < s->config.station_count; i++) {
        if (s->resumed[i].restored.session)
            open_trace(&s->resumed[i]);
        close_others(&s->resumed[i]);
    }
}

void resume_attach(struct sessions *s) {
    for (int i = 0; i < s->config.station_count; i++)
        if (s->resumed[i].restored.session)
            attach(&s->resumed[i]);
    resume_release(s);
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
