// Sessions that were open when the server was killed. The trace is the truth: a session's state is
// what its inputs lead to, so it is run again from them, many times faster than it was, and goes on
// in the same trace.
#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "hub/seat.h"
#include "trace/rerun.h"

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
    struct trace_header header;
    struct trace_place place; // where it goes on
    enum session_state state;
    int scene;
    struct metrics metrics;
    struct moments moments;
    struct remarks remarks;
    struct live *live; // without its trace; NULL: not resumed
};

// ---- which --------------------------------------------------------------------------------------

// STATION-20260102T030405Z-01234567.trace
static bool is_trace_of(const char *name, const char *station) {
    static const char rest[] = "-20260102T030405Z-01234567.trace";
    size_t length = strlen(station);
    return !strncmp(name, station, length) && strlen(name + length) == sizeof rest - 1 &&
           name[length] == '-' && !strcmp(name + length + sizeof rest - 7, ".trace");
}

// The stamps in the names sort as times do.
static void find_newest(const char *dir, const char *station, char out_name[NAME_MAX + 1]) {
    DIR *folder = opendir(dir);
    out_name[0] = '\0';
    for (struct dirent *entry; folder && (entry = readdir(folder));)
        if (is_trace_of(entry->d_name, station) && strcmp(entry->d_name, out_name) > 0)
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

static int scene_of(const struct hub *hub, uint64_t case_hash) {
    for (int i = 0; i < hub->config.case_count; i++)
        if (scene_case(hub->scenes[i])->hash == case_hash && !hub->unfit[i].text[0])
            return i;
    return -1;
}

// ---- running it again ---------------------------------------------------------------------------

// RESULT_MISSING at the end of a trace that was not closed: as it should be.
static enum result run_again(struct resumed *r, struct trace_reader *reader, struct rerun *rerun,
                             struct error *err) {
    struct trace_record record;
    struct session_output output;
    enum result result;
    while ((result = trace_read(reader, &record, err)) == RESULT_OK) {
        if (record.type == TRACE_GAP)
            return fail(err, RESULT_REFUSED, "%s: steps are missing in it", r->path);
        if (record.type == TRACE_RESUME)
            metrics_interrupt(&r->metrics);
        if (record.type == TRACE_REMARK)
            remarks_put(&r->remarks, &record.remark);
        if (record.type != TRACE_STEP && record.type != TRACE_PAST)
            continue;
        rerun_step(rerun, &record, &output);
        if (record.type == TRACE_STEP && record.output.hash != output.hash)
            return fail(err, RESULT_REFUSED, "%s: step %llu comes out otherwise than it was",
                        r->path, (unsigned long long)output.step);
        if (record.type == TRACE_STEP)
            metrics_step(&r->metrics, &record.input, &output);
        moments_step(&r->moments, &output);
        r->state = output.state;
    }
    metrics_interrupt(&r->metrics); // where it goes on there will be a record of that
    r->place = trace_reader_place(reader);
    return result;
}

static void make_live(struct resumed *r, struct rerun **rerun) {
    struct live *live = alloc(1, sizeof *live);
    int64_t now_ns = clock_now_ns();
    live->scene = r->hub->scenes[r->scene];
    live->state = r->state;
    tally_begin(&r->header, live->scene, &live->tally);
    live->tally.metrics = r->metrics;
    live->moments = r->moments;
    live->last_ns = r->place.time_ns;
    live->ahead_ns = live->last_ns > now_ns ? live->last_ns - now_ns : 0;
    rerun_release(rerun, &live->session, &live->operation, &live->pending);
    r->live = live;
}

static enum result read_to_end(struct trace_reader *reader, struct error *err) {
    struct trace_record record;
    enum result result;
    while ((result = trace_read(reader, &record, err)) == RESULT_OK)
        ;
    return result;
}

// A session that was closed needs no case here: it does not go on.
static enum result refuse(const struct resumed *r, struct trace_reader *reader, struct error *err) {
    if (read_to_end(reader, err) == RESULT_CLOSED)
        return RESULT_CLOSED;
    if (r->header.version != TRACE_VERSION)
        return fail(err, RESULT_REFUSED, "%s: it is of version %d", r->path, r->header.version);
    return fail(err, RESULT_REFUSED, "%s: this server has not its case", r->path);
}

static enum result replay(struct resumed *r, struct error *err) {
    struct trace_reader *reader;
    enum result result = trace_reader_create(r->path, &reader, err);
    if (result != RESULT_OK)
        return result;
    r->header = *trace_reader_header(reader);
    r->scene = scene_of(r->hub, r->header.case_hash);
    if (r->scene < 0 || r->header.version != TRACE_VERSION) {
        result = refuse(r, reader, err);
        trace_reader_destroy(&reader);
        return result;
    }
    metrics_init(&r->metrics, r->header.optic);
    moments_begin(&r->moments, 0, r->header.start_ns);
    struct rerun *rerun = rerun_create(r->hub->scenes[r->scene], &r->header.settings);
    result = run_again(r, reader, rerun, err);
    if (result == RESULT_MISSING)
        make_live(r, &rerun);
    rerun_destroy(&rerun);
    trace_reader_destroy(&reader);
    return result;
}

static void *resume_one(void *argument) {
    struct resumed *r = argument;
    struct error err;
    int64_t begin_ns = clock_now_ns();
    enum result result = replay(r, &err);
    const char *station = r->hub->seats[r->seat].station->name;
    if (result == RESULT_MISSING)
        log_warning("hub",
                    "station %s: its session was open when the server ended; run again to "
                    "step %llu in %.1f s",
                    station, (unsigned long long)r->place.step,
                    (double)(clock_now_ns() - begin_ns) / 1e9);
    else if (result != RESULT_CLOSED)
        log_error("hub", "station %s: its session cannot go on: %s", station, err.text);
    return NULL;
}

// A station that comes meets its session, before the worker has it too.
static void take_seat(struct resumed *r) {
    struct seat *seat = &r->hub->seats[r->seat];
    if (!r->live || r->state == SESSION_CLOSED)
        return;
    memcpy(seat->card.session_id, r->header.session_id, sizeof seat->card.session_id);
    snprintf(seat->card.trace, sizeof seat->card.trace, "%s", r->path);
    seat->card.start_utc_ns = r->header.start_utc_ns;
    seat->card.scene = r->scene;
    atomic_store(&seat->counts.state, (int)r->state);
    atomic_store(&seat->counts.steps, r->place.step);
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

static void release(struct resumed *r) {
    if (!r->live)
        return;
    session_destroy(&r->live->session);
    operation_destroy(&r->live->operation);
    job_result_destroy(&r->live->pending);
    free(r->live);
    r->live = NULL;
}

// The seat has no session then, and gets a new one.
static void give_up(struct resumed *r, const struct error *err) {
    struct seat *seat = &r->hub->seats[r->seat];
    log_error("hub", "station %s: its session cannot go on: %s", seat->station->name, err->text);
    atomic_store(&seat->counts.state, SESSION_CLOSED);
    release(r);
}

static void attach(struct resumed *r) {
    struct hub *hub = r->hub;
    struct live *live = r->live;
    struct error err;
    if (trace_writer_resume(r->path, &r->place, clock_utc_ns(), &hub->vouches, &live->trace,
                            &err) != RESULT_OK) {
        give_up(r, &err);
        return;
    }
    if (r->state == SESSION_CLOSED) { // only its end was missing
        trace_writer_destroy(&live->trace);
        release(r);
        return;
    }
    live->serial = live->moments.now.session = ++hub->sessions_made;
    seat_introduce(hub, r->seat, live, &r->header, &r->remarks);
    session_row_begin(&r->header, r->path, &live->row);
    struct note note = {.kind = NOTE_ATTACH, .seat = r->seat, .live = live};
    struct worker *worker = seat_worker(hub, r->seat);
    bool told = worker_tell(worker, worker->from_desk, &note);
    CHECK(told);
}

void resume_attach(struct hub *hub) {
    for (int i = 0; i < hub->config.station_count; i++)
        if (hub->resumed[i].live)
            attach(&hub->resumed[i]);
}

void resume_record(struct hub *hub) {
    for (int i = 0; i < hub->config.station_count; i++) {
        if (hub->resumed[i].live)
            recorder_put(hub->recorder, &hub->resumed[i].live->row);
        remarks_fini(&hub->resumed[i].remarks);
    }
    free(hub->resumed);
    hub->resumed = NULL;
}

void resume_release(struct hub *hub) {
    for (int i = 0; hub->resumed && i < hub->config.station_count; i++)
        release(&hub->resumed[i]);
    for (int i = 0; hub->resumed && i < hub->config.station_count; i++)
        remarks_fini(&hub->resumed[i].remarks);
    free(hub->resumed);
}
