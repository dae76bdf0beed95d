#include "sessions/manager.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/task_pool.h"
#include "runtime/drift.h"
#include "runtime/fair_share.h"
#include "sessions/attempts.h"
#include "sessions/opening.h"
#include "sessions/sharing.h"

#include <errno.h>
#include <inttypes.h>
#include <semaphore.h>
#include <stdlib.h>
#include <time.h>

#define ROUND_NS NS_PER_S
#define MANAGER_RETRY_NS NS_PER_S
#define EXCESS_WARNING 100 // frames a second: a burst after a pause is none
#define POOL_THREADS 4
#define POOL_TASKS_EACH 4 // of a station

// Of one station.
struct looked_after {
    atomic_bool calls; // it may need a session, or another one
    bool drift_warned, trace_warned;
    uint64_t clock_steps;           // that were told
    uint64_t markers_refused;       // too
    uint64_t ended_for_instruments; // serial of the session
    uint64_t excess;                // frames, as of the last look
    int64_t excess_told_ns;
};

struct manager {
    struct sessions *sessions;
    pthread_t thread;
    atomic_bool opens; // between manager_start and manager_stop
    sem_t wake;
    struct task_pool *pool;
    struct looked_after *stations;
};

void manager_call(struct sessions *s, int station) {
    atomic_store(&s->manager->stations[station].calls, true);
    manager_notify(s);
}

void manager_notify(void *user) {
    struct sessions *s = user;
    sem_post(&s->manager->wake);
}

// ---- opening and releasing ----------------------------------------------------------------------

enum task_kind { TASK_OPEN, TASK_RELEASE, TASK_ATTEMPT, TASK_WORK };

struct station_task {
    struct sessions *sessions;
    int station;
    enum task_kind kind;
    struct session_runtime *ended; // TASK_RELEASE
    enum session_end end;
    struct session_attempt *attempt;                      // TASK_ATTEMPT
    void (*work)(struct sessions *sessions, int station); // TASK_WORK
};

static int64_t run_task(void *data) {
    struct station_task *task = data;
    struct error err;
    switch (task->kind) {
    case TASK_OPEN:
        opening_run(task->sessions, task->station, &err);
        break;
    case TASK_RELEASE:
        opening_release(task->sessions, task->station, task->ended, task->end);
        break;
    case TASK_ATTEMPT:
        attempts_release(task->sessions, task->station, task->attempt);
        break;
    case TASK_WORK:
        task->work(task->sessions, task->station);
        break;
    }
    return TASK_DONE;
}

static void finish_task(void *data, bool done) {
    struct station_task *task = data;
    if (!done && (task->kind == TASK_RELEASE || task->kind == TASK_ATTEMPT))
        run_task(data);
    else if (!done && task->kind == TASK_OPEN) // the server ends, or has too much to do
        station_slot_failed(&task->sessions->slots[task->station],
                            clock_now_ns() + MANAGER_RETRY_NS);
    free(data);
}

// Tasks of one station run in order. The pool is full only where it is stopped: each station has at
// most one opening and a few releases on their way.
static void give_task(struct sessions *s, struct station_task what) {
    struct station_task *data = alloc(1, sizeof *data);
    *data = what;
    struct pool_task task = {
        .key = (uint64_t)what.station + 1, .run = run_task, .finish = finish_task, .data = data};
    if (!task_pool_add(s->manager->pool, &task))
        finish_task(data, false);
}

bool manager_opens(const struct sessions *s) {
    return atomic_load(&s->manager->opens);
}

void manager_open(struct sessions *s, int station) {
    if (manager_opens(s) && sharing_serves(s, station) &&
        station_slot_claim_needed(&s->slots[station], clock_now_ns()))
        give_task(s, (struct station_task){.sessions = s, .station = station});
}

void manager_run(struct sessions *s, int station,
                 void (*work)(struct sessions *sessions, int station)) {
    give_task(s, (struct station_task){
                     .sessions = s, .station = station, .kind = TASK_WORK, .work = work});
}

// A station that comes back with other instruments gets a new session: in the old one its channels
// would be others. Once for each session; if the worker has no room, the next round tries again.
static void end_of_other_instruments(struct sessions *s, int station) {
    struct station_status status;
    uint64_t *ended = &s->manager->stations[station].ended_for_instruments;
    station_slot_status(&s->slots[station], &status);
    if (!status.connected || status.phase != SLOT_ATTACHED || *ended == status.about.serial ||
        instruments_equal(&status.instruments, &status.about.instruments))
        return;
    if (!runtime_input(s->runtime, station, INPUT_STOP, 0))
        return;
    *ended = status.about.serial;
    log_info("sessions", "station %s has other instruments now: its session ends, another begins",
             station_name(s, station));
}

// ---- notices ------------------------------------------------------------------------------------

static void take_undone(struct station_slot *slot, const struct runtime_notice *notice) {
    struct undo_answer undone = {notice->undone.outcome, notice->undone.cuts,
                                 notice->undone.volume_mm3};
    station_slot_add_undone(slot, notice->ticket, &undone, notice->undone.more);
}

static void take_notice(struct sessions *s, const struct runtime_notice *notice) {
    struct station_slot *slot = &s->slots[notice->station];
    atomic_store(&s->manager->stations[notice->station].calls, true);
    switch (notice->kind) {
    case NOTICE_STATE:
        station_slot_set_state(slot, notice->session, notice->state);
        break;
    case NOTICE_TAKEN:
        station_slot_set_taken(slot, notice->ticket, notice->done);
        break;
    case NOTICE_UNDONE:
        take_undone(slot, notice);
        break;
    case NOTICE_OPENED:
        station_slot_set_tissues(slot, notice->session);
        break;
    case NOTICE_ATTEMPT:
        give_task(s, (struct station_task){.sessions = s,
                                           .station = notice->station,
                                           .kind = TASK_ATTEMPT,
                                           .attempt = notice->attempt});
        break;
    case NOTICE_ENDED:
        station_slot_set_ended(slot, notice->session);
        give_task(s, (struct station_task){.sessions = s,
                                           .station = notice->station,
                                           .kind = TASK_RELEASE,
                                           .ended = notice->ended,
                                           .end = notice->end});
        break;
    }
}

static void take_markers(struct sessions *s) {
    struct session_marker next;
    for (int i = 0; i < s->config.station_count; i++)
        while (runtime_next_marker(s->runtime, i, &next))
            station_slot_put_marker(&s->slots[i], next.session, &next.marker);
}

static void take_notices(struct sessions *s) {
    struct runtime_notice notice;
    while (runtime_next_notice(s->runtime, &notice))
        take_notice(s, &notice);
    take_markers(s);
}

// ---- warnings, once for each session ------------------------------------------------------------

static void warn_of_drift(struct sessions *s, int station) {
    const struct station_counts *counts = runtime_counts(s->runtime, station);
    bool known = atomic_load(&counts->touches) >= DRIFT_TOUCHES;
    double drift_mm = (double)atomic_load(&counts->drift_nm) / 1e6;
    bool *warned = &s->manager->stations[station].drift_warned;
    bool is_far = known && drift_mm > s->config.calibration_mm;
    if (is_far && !*warned)
        log_warning("sessions", "station %s: tip is %.2f mm off the surface; recalibrate",
                    station_name(s, station), drift_mm);
    *warned = is_far;
}

static void warn_of_trace(struct sessions *s, int station) {
    const struct station_counts *counts = runtime_counts(s->runtime, station);
    bool *warned = &s->manager->stations[station].trace_warned;
    bool is_incomplete = atomic_load(&counts->trace_missing) > 0;
    if (is_incomplete && !*warned)
        log_error("sessions", "station %s: its trace is incomplete: the disk is too slow or full",
                  station_name(s, station));
    *warned = is_incomplete;
}

static void warn_of_clock(struct sessions *s, int station) {
    const struct station_counts *counts = runtime_counts(s->runtime, station);
    uint64_t steps = atomic_load(&counts->clock_steps);
    uint64_t *told = &s->manager->stations[station].clock_steps;
    if (steps > *told)
        log_warning("sessions", "station %s: its clock was stepped by %.3f s; its frames go on",
                    station_name(s, station), (double)atomic_load(&counts->clock_step_ns) / 1e9);
    *told = steps;
}

static void warn_of_markers(struct sessions *s, int station) {
    uint64_t refused = atomic_load(&runtime_counts(s->runtime, station)->markers_refused);
    uint64_t *told = &s->manager->stations[station].markers_refused;
    if (refused > *told)
        log_warning("sessions",
                    "station %s: %" PRIu64 " markers are not recorded: they are not of the time of "
                    "the session, or its trace is of an older version",
                    station_name(s, station), refused - *told);
    *told = refused;
}

static void warn_of_share(struct sessions *s, int station) {
    uint64_t excess = atomic_load(&runtime_counts(s->runtime, station)->frames_excess);
    struct looked_after *one = &s->manager->stations[station];
    uint64_t *before = &one->excess;
    int64_t now_ns = clock_now_ns(), *told_ns = &one->excess_told_ns;
    uint64_t more = excess < *before ? excess : excess - *before;
    *before = excess;
    if (more <= EXCESS_WARNING || (*told_ns && now_ns - *told_ns < FAIR_TELL_NS))
        return;
    *told_ns = now_ns;
    log_warning("sessions",
                "station %s sends more than its share: %" PRIu64 " frames of the last second were "
                "left out",
                station_name(s, station), more);
}

// ---- the thread ---------------------------------------------------------------------------------

static void look_after(struct sessions *s) {
    grades_refresh(s->grades);
    for (int i = 0; i < s->config.station_count; i++) {
        warn_of_drift(s, i);
        warn_of_trace(s, i);
        warn_of_clock(s, i);
        warn_of_share(s, i);
        warn_of_markers(s, i);
    }
}

static void wait_for_work(struct manager *m, int64_t until_ns) {
    struct timespec until = {until_ns / NS_PER_S, until_ns % NS_PER_S};
    if (sem_clockwait(&m->wake, CLOCK_MONOTONIC, &until) != 0)
        return;
    while (sem_trywait(&m->wake) == 0) // what comes next serves all that was posted
        ;
}

// Those that call, and once a round all.
static void open_needed(struct sessions *s, bool all) {
    for (int i = 0; i < s->config.station_count; i++) {
        if (!atomic_exchange(&s->manager->stations[i].calls, false) && !all)
            continue;
        end_of_other_instruments(s, i);
        manager_open(s, i);
    }
}

static void *manage(void *argument) {
    struct sessions *s = argument;
    int64_t round_ns = clock_now_ns();
    while (atomic_load(&s->manager->opens)) {
        bool all = clock_now_ns() >= round_ns;
        take_notices(s);
        open_needed(s, all);
        if (all) {
            look_after(s);
            round_ns = clock_now_ns() + ROUND_NS;
        }
        wait_for_work(s->manager, round_ns);
    }
    return NULL;
}

void manager_create(struct sessions *s) {
    int count = s->config.station_count;
    struct task_pool_settings settings = {.threads = POOL_THREADS,
                                          .tasks_max = POOL_TASKS_EACH * (count + 1)};
    struct manager *m = alloc(1, sizeof *m);
    m->stations = alloc((size_t)count, sizeof *m->stations);
    m->sessions = s;
    sem_init(&m->wake, 0, 0);
    m->pool = task_pool_create(&settings);
    s->manager = m;
}

void manager_start(struct sessions *s) {
    atomic_store(&s->manager->opens, true);
    int failed = pthread_create(&s->manager->thread, NULL, manage, s);
    NEED(!failed, "thread");
}

void manager_stop(struct sessions *s) {
    struct manager *m = s->manager;
    if (!m || !atomic_exchange(&m->opens, false))
        return;
    sem_post(&m->wake);
    pthread_join(m->thread, NULL);
    task_pool_drain(m->pool);
}

void manager_destroy(struct sessions *s) {
    struct manager *m = s->manager;
    if (!m)
        return;
    if (s->runtime)
        take_notices(s);
    task_pool_destroy(&m->pool);
    sem_destroy(&m->wake);
    free(m->stations);
    free(m);
    s->manager = NULL;
}
