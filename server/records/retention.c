#include "records/retention.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "records/unrecorded.h"
#include "store/store.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <time.h>

#define RETENTION_NICE 15
#define LOOK_S 60
#define DAY_NS (86400 * NS_PER_S)
#define ASKED_S 3600
#define JUMP_NS (3600 * NS_PER_S)                     // of the time of day
#define FIRST_UTC_NS (INT64_C(1577836800) * NS_PER_S) // 2020: an end before this has no true time

struct retention {
    char *records, *traces_dir;
    int keep_days;
    uint64_t keep_bytes;
    bool (*may_remove)(void *user);
    void *user;
    int64_t begins_ns; // to remove
    int64_t day_ns;    // time of day, less the monotonic time
    bool was_allowed;  // at the last look
    pthread_t thread;
    pthread_mutex_t lock; // of stop
    pthread_cond_t stops;
    bool stop;
    bool failing, lacks_room; // the thread's
    atomic_uint_fast64_t removed, traces_bytes;
    atomic_int_fast64_t due;
};

struct candidate {
    char id[STORE_ID_MAX], trace[STORE_TEXT_MAX];
    int64_t end_utc_ns;
    uint64_t bytes;
};

struct candidates {
    struct candidate *all;
    size_t count, room;
    uint64_t bytes;        // of their traces
    int64_t newest_utc_ns; // the last end of any session
};

// ---- what is there ------------------------------------------------------------------------------

void retention_asked(const char *trace) {
    const struct timespec times[] = {{.tv_nsec = UTIME_NOW}, {.tv_nsec = UTIME_OMIT}};
    utimensat(AT_FDCWD, trace, times, 0);
}

static uint64_t size_of_files(const char *folder) {
    uint64_t sum = 0;
    struct stat status;
    DIR *dir = opendir(folder);
    for (struct dirent *entry; dir && (entry = readdir(dir));)
        if (!fstatat(dirfd(dir), entry->d_name, &status, AT_SYMLINK_NOFOLLOW) &&
            S_ISREG(status.st_mode))
            sum += (uint64_t)status.st_size;
    if (dir)
        closedir(dir);
    return sum;
}

static void take_row(void *user, const struct store_cell *cells, int count) {
    struct candidates *c = user;
    struct candidate one = {0};
    struct stat status;
    CHECK(count == 4);
    snprintf(one.id, sizeof one.id, "%s", cells[0].text);
    snprintf(one.trace, sizeof one.trace, "%s", cells[1].text);
    one.end_utc_ns = cells[2].integer;
    if (!stat(one.trace, &status))
        one.bytes = (uint64_t)status.st_size;
    c->bytes += one.bytes;
    c->newest_utc_ns = cells[3].integer;
    if (c->count == c->room) {
        c->room = 2 * c->room + 64;
        c->all = alloc_resize(c->all, c->room, sizeof *c->all);
    }
    c->all[c->count++] = one;
}

// ---- what goes ----------------------------------------------------------------------------------

struct bounds {
    int64_t before_utc_ns; // an end before this is too old
    uint64_t bytes;        // of all files
};

static struct bounds bounds_of(const struct retention *r) {
    int64_t now_utc_ns = clock_utc_ns();
    return (struct bounds){r->keep_days ? now_utc_ns - r->keep_days * DAY_NS : INT64_MIN,
                           r->keep_bytes ? r->keep_bytes : UINT64_MAX};
}

static void wait_a_day(struct retention *r, const char *why) {
    int64_t begins_ns = clock_now_ns() + DAY_NS;
    if (begins_ns - r->begins_ns > DAY_NS / 2)
        log_error("records", "no session is removed for a day: %s", why);
    r->begins_ns = begins_ns;
}

// A time of day that is wrong makes all sessions too old.
static void mistrust_clock(struct retention *r, const struct candidates *c,
                           const struct bounds *bounds) {
    int64_t day_ns = clock_utc_ns() - clock_now_ns();
    if (llabs(day_ns - r->day_ns) > JUMP_NS)
        wait_a_day(r, "the time of day jumped");
    r->day_ns = day_ns;
    if (c->count && c->newest_utc_ns < bounds->before_utc_ns)
        wait_a_day(r,
                   "even the last one is older than [server] keep_days; is the time of day right?");
}

// Where the traces of others alone are too many, no removal helps.
static void mistrust_room(struct retention *r, const struct candidates *c, uint64_t bytes,
                          struct bounds *bounds) {
    bool lacks = bytes > c->bytes && bytes - c->bytes > bounds->bytes;
    if (lacks && !r->lacks_room)
        log_error("records", "no session is removed for room: what is never removed has more than "
                             "[server] keep_gb alone");
    r->lacks_room = lacks;
    if (lacks)
        bounds->bytes = UINT64_MAX;
}

// What other servers judged meanwhile is here by the second look behind a pause.
static bool is_allowed(struct retention *r) {
    bool was = r->was_allowed;
    r->was_allowed = !r->may_remove || r->may_remove(r->user);
    return was && r->was_allowed && clock_now_ns() >= r->begins_ns;
}

static struct bounds soon(const struct retention *r, struct bounds now) {
    return (struct bounds){r->keep_days ? now.before_utc_ns + DAY_NS : INT64_MIN,
                           now.bytes == UINT64_MAX ? UINT64_MAX : now.bytes / 10 * 9};
}

static bool goes(const struct candidate *c, const struct bounds *bounds, uint64_t bytes) {
    bool is_old = c->end_utc_ns >= FIRST_UTC_NS && c->end_utc_ns < bounds->before_utc_ns;
    return is_old || (c->bytes && bytes > bounds->bytes);
}

static enum result remove_one(const struct retention *r, const char *id, struct error *err) {
    struct store *store;
    enum result result = store_open(r->records, STORE_THERE, RECORDER_ACTOR, &store, err);
    if (result == RESULT_OK)
        result = store_remove_dispensable(store, id, err);
    store_close(&store);
    return result;
}

static bool is_asked(const char *trace) {
    struct stat status;
    time_t since_s = stat(trace, &status) ? -1 : time(NULL) - status.st_atime;
    return since_s >= 0 && since_s < ASKED_S;
}

static bool should_retention_stop(struct retention *r) {
    pthread_mutex_lock(&r->lock);
    bool stop = r->stop;
    pthread_mutex_unlock(&r->lock);
    return stop;
}

// Returns how many bytes are left. What was removed is no candidate any more.
static uint64_t remove_those(struct retention *r, struct candidates *c, const struct bounds *bounds,
                             uint64_t bytes) {
    struct error err;
    for (size_t i = 0; i < c->count && !should_retention_stop(r); i++) {
        struct candidate *one = &c->all[i];
        if (!goes(one, bounds, bytes) || is_asked(one->trace))
            continue;
        if (remove_one(r, one->id, &err) != RESULT_OK) {
            log_warning("records", "session %s stays: %s", one->id, err.text);
            continue;
        }
        log_info("records", "session %s was removed, as it is kept no longer", one->id);
        atomic_fetch_add(&r->removed, 1);
        bytes -= one->bytes < bytes ? one->bytes : bytes;
        *one = (struct candidate){.end_utc_ns = INT64_MAX};
    }
    return bytes;
}

static int64_t count_due(const struct candidates *c, const struct bounds *bounds, uint64_t bytes) {
    int64_t due = 0;
    for (size_t i = 0; i < c->count; i++) {
        if (!goes(&c->all[i], bounds, bytes))
            continue;
        due++;
        bytes -= c->all[i].bytes < bytes ? c->all[i].bytes : bytes;
    }
    return due;
}

static void tell_due(struct retention *r, int64_t due) {
    if (atomic_exchange(&r->due, due) == due || !due)
        return;
    log_warning("records",
                "%" PRId64 " sessions go next, within a day or with the next tenth of [server] "
                "keep_gb: copy what you want to keep",
                due);
}

static enum result gather(const struct retention *r, struct candidates *out, struct error *err) {
    struct store *store;
    enum result result = store_open(r->records, STORE_THERE, RECORDER_ACTOR, &store, err);
    if (result == RESULT_OK)
        result = store_dispensable(store, take_row, out, err);
    store_close(&store);
    return result;
}

static void look(struct retention *r) {
    struct candidates candidates = {0};
    struct error err;
    uint64_t bytes = size_of_files(r->traces_dir);
    enum result result = gather(r, &candidates, &err);
    if (result != RESULT_OK && !r->failing)
        log_error("records", "nobody sees which sessions are too old: %s", err.text);
    r->failing = result != RESULT_OK;
    if (result == RESULT_OK) {
        struct bounds now = bounds_of(r);
        mistrust_clock(r, &candidates, &now);
        mistrust_room(r, &candidates, bytes, &now);
        struct bounds next = soon(r, now);
        if (is_allowed(r))
            bytes = remove_those(r, &candidates, &now, bytes);
        tell_due(r, count_due(&candidates, &next, bytes));
    }
    atomic_store(&r->traces_bytes, bytes);
    free(candidates.all);
}

// ---- the thread ---------------------------------------------------------------------------------

static void *run_retention(void *argument) {
    struct retention *r = argument;
    setpriority(PRIO_PROCESS, 0, RETENTION_NICE); // Linux: of this thread
    while (!should_retention_stop(r)) {
        look(r);
        int64_t until_ns = clock_now_ns() + LOOK_S * NS_PER_S;
        struct timespec until = {until_ns / NS_PER_S, until_ns % NS_PER_S};
        int code = 0;
        pthread_mutex_lock(&r->lock);
        while (!r->stop && code != ETIMEDOUT)
            code = pthread_cond_timedwait(&r->stops, &r->lock, &until);
        pthread_mutex_unlock(&r->lock);
    }
    return NULL;
}

struct retention *retention_start(const struct retention_config *config) {
    if (!config->records[0] || (!config->keep_days && !config->keep_bytes))
        return NULL;
    struct retention *r = alloc(1, sizeof *r);
    r->records = alloc_text(config->records);
    r->traces_dir = alloc_text(config->traces_dir);
    r->keep_days = config->keep_days;
    r->keep_bytes = config->keep_bytes;
    r->may_remove = config->may_remove;
    r->user = config->user;
    r->was_allowed = !config->may_remove;
    r->begins_ns = clock_now_ns() + config->notice_s * NS_PER_S;
    r->day_ns = clock_utc_ns() - clock_now_ns();
    pthread_mutex_init(&r->lock, NULL);
    pthread_condattr_t monotonic;
    pthread_condattr_init(&monotonic);
    pthread_condattr_setclock(&monotonic, CLOCK_MONOTONIC);
    pthread_cond_init(&r->stops, &monotonic);
    pthread_condattr_destroy(&monotonic);
    int failed = pthread_create(&r->thread, NULL, run_retention, r);
    NEED(!failed, "thread");
    return r;
}

void retention_stop(struct retention **retention) {
    struct retention *r = *retention;
    if (!r)
        return;
    pthread_mutex_lock(&r->lock);
    r->stop = true;
    pthread_cond_signal(&r->stops);
    pthread_mutex_unlock(&r->lock);
    pthread_join(r->thread, NULL);
    pthread_cond_destroy(&r->stops);
    pthread_mutex_destroy(&r->lock);
    free(r->records);
    free(r->traces_dir);
    free(r);
    *retention = NULL;
}

struct retention_figures retention_figures(const struct retention *r) {
    if (!r)
        return (struct retention_figures){0};
    return (struct retention_figures){atomic_load(&r->removed), atomic_load(&r->due),
                                      atomic_load(&r->traces_bytes)};
}
