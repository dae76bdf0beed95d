// Sessions that were open when the server was killed. The trace is the truth: a session's state is
// what its inputs lead to, so it is run again from them, many times faster than it was, and goes on
// in the same trace. Of a station that is the newest one; an older one had ended, whatever of that
// came to its trace, which gets its end.
#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "hub/again.h"

#include <dirent.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>

struct resumed {
    struct hub *hub;
    int seat;
    pthread_t thread;
    char path[HUB_PATH_MAX]; // empty: there is none
    struct again again;
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

// What was written to within the time that a session waits for its station.
static bool is_recent(const struct hub *hub, const char *path) {
    struct stat status;
    return stat(path, &status) == 0 && time(NULL) - status.st_mtime <= hub->config.wait_s;
}

static bool find_trace(struct resumed *r) {
    const char *dir = r->hub->config.traces_dir;
    char name[NAME_MAX + 1];
    find_newest(dir, r->hub->seats[r->seat].station->name, name);
    int length = snprintf(r->path, sizeof r->path, "%s/%s", dir, name);
    return name[0] && length < (int)sizeof r->path && is_recent(r->hub, r->path);
}

// ---- running it again ---------------------------------------------------------------------------

static void go_on(struct resumed *r) {
    struct again *again = &r->again;
    struct live *live = again->live;
    int64_t now_ns = clock_now_ns();
    metrics_interrupt(&again->metrics); // where it goes on there will be a record of that
    tally_begin(&again->header, live->scene, &live->tally);
    live->tally.metrics = again->metrics;
    live->moments = again->moments;
    live->ahead_ns = live->last_ns > now_ns ? live->last_ns - now_ns : 0;
}

static void *resume_one(void *argument) {
    struct resumed *r = argument;
    struct error err;
    int64_t begin_ns = clock_now_ns();
    enum result result = again_run(r->hub, r->path, NULL, &r->again, &err);
    if (r->again.live)
        go_on(r);
    const char *station = r->hub->seats[r->seat].station->name;
    if (result == RESULT_MISSING)
        log_warning("hub",
                    "station %s: its session was open when the server ended; run again to "
                    "step %llu in %.1f s",
                    station, (unsigned long long)r->again.place.step,
                    (double)(clock_now_ns() - begin_ns) / 1e9);
    else if (result != RESULT_CLOSED)
        log_error("hub", "station %s: its session cannot go on: %s", station, err.text);
    return NULL;
}

// A station that comes meets its session, before the worker has it too.
static void take_seat(struct resumed *r) {
    struct seat *seat = &r->hub->seats[r->seat];
    if (!r->again.live || r->again.state == SESSION_CLOSED)
        return;
    memcpy(seat->card.session_id, r->again.header.session_id, sizeof seat->card.session_id);
    snprintf(seat->card.trace, sizeof seat->card.trace, "%s", r->path);
    seat->card.start_utc_ns = r->again.header.start_utc_ns;
    seat->card.scene = r->again.scene;
    atomic_store(&seat->counts.state, (int)r->again.state);
    atomic_store(&seat->counts.steps, r->again.place.step);
}

void resume_replay(struct hub *hub) {
    hub->resumed = alloc((size_t)hub->config.station_count + 1, sizeof *hub->resumed);
    for (int i = 0; i < hub->config.station_count; i++) {
        struct resumed *r = &hub->resumed[i];
        *r = (struct resumed){.hub = hub, .seat = i};
        if (!find_trace(r))
            r->path[0] = '\0';
        else
            CHECK(pthread_create(&r->thread, NULL, resume_one, r) == 0);
    }
    for (int i = 0; i < hub->config.station_count; i++) {
        if (!hub->resumed[i].path[0])
            continue;
        pthread_join(hub->resumed[i].thread, NULL);
        take_seat(&hub->resumed[i]);
    }
}

// ---- going on -----------------------------------------------------------------------------------

// The seat has no session then, and gets a new one.
static void give_up(struct resumed *r, const struct error *err) {
    struct seat *seat = &r->hub->seats[r->seat];
    log_error("hub", "station %s: its session cannot go on: %s", seat->station->name, err->text);
    atomic_store(&seat->counts.state, SESSION_CLOSED);
    again_fini(&r->again);
}

static void attach(struct resumed *r) {
    struct hub *hub = r->hub;
    struct live *live = r->again.live;
    struct error err;
    if (trace_writer_resume(r->path, &r->again.place, clock_utc_ns(), &hub->vouches, &live->trace,
                            &err) != RESULT_OK) {
        give_up(r, &err);
        return;
    }
    if (r->again.state == SESSION_CLOSED) { // only its end was missing
        trace_writer_destroy(&live->trace);
        again_fini(&r->again);
        return;
    }
    live->serial = live->moments.now.session = ++hub->sessions_made;
    seat_introduce(hub, r->seat, live, &r->again.header, &r->again.remarks);
    session_row_begin(&r->again.header, r->path, &live->row);
    struct note note = {.kind = NOTE_ATTACH, .seat = r->seat, .live = live};
    struct worker *worker = seat_worker(hub, r->seat);
    bool told = worker_tell(worker, worker->from_desk, &note);
    CHECK(told);
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
    const char *station = r->hub->seats[r->seat].station->name;
    if (!is_open(path, &place))
        return;
    if (trace_writer_resume(path, &place, clock_utc_ns(), &r->hub->vouches, &writer, &err) !=
        RESULT_OK) {
        log_error("hub", "station %s: a trace could not be closed: %s", station, err.text);
        return;
    }
    trace_writer_destroy(&writer);
    log_warning("hub", "station %s: closed %s, whose end was missing", station, path);
}

static void close_others(const struct resumed *r) {
    const char *dir = r->hub->config.traces_dir;
    char path[HUB_PATH_MAX];
    DIR *folder = opendir(dir);
    for (struct dirent *entry; folder && (entry = readdir(folder));) {
        if (!is_trace_of(entry->d_name, r->hub->seats[r->seat].station->name))
            continue;
        int length = snprintf(path, sizeof path, "%s/%s", dir, entry->d_name);
        if (length < (int)sizeof path && strcmp(path, r->path) != 0 && is_recent(r->hub, path))
            close_trace(r, path);
    }
    if (folder)
        closedir(folder);
}

void resume_attach(struct hub *hub) {
    for (int i = 0; i < hub->config.station_count; i++) {
        if (hub->resumed[i].again.live)
            attach(&hub->resumed[i]);
        close_others(&hub->resumed[i]);
    }
}

void resume_record(struct hub *hub) {
    for (int i = 0; i < hub->config.station_count; i++) {
        struct again *again = &hub->resumed[i].again;
        if (again->live)
            recorder_put(hub->recorder, &again->live->row);
        again->live = NULL; // the worker's
        again_fini(again);
    }
    free(hub->resumed);
    hub->resumed = NULL;
}

void resume_release(struct hub *hub) {
    for (int i = 0; hub->resumed && i < hub->config.station_count; i++)
        again_fini(&hub->resumed[i].again);
    free(hub->resumed);
}
