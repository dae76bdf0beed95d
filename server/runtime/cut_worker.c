#include "runtime/cut_worker.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "runtime/mesh_sender.h"

#include <errno.h>
#include <poll.h>
#include <sched.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/resource.h>
#include <unistd.h>

#define ROUND_MS 200
#define TASKS_MAX 1024
#define NICE 10

enum task_kind { TASK_OPEN, TASK_RUN, TASK_RELEASE, TASK_CLOSE };

// From the worker. A session has one job on its way at most, so the ring never overflows.
struct cut_task {
    enum task_kind kind;
    int station;
    struct session_runtime *session; // TASK_OPEN, TASK_CLOSE
    uint64_t serial;                 // TASK_RUN: of the session
    enum session_end end;            // TASK_CLOSE
    struct job job;                  // TASK_RUN
    struct job_result *result;       // TASK_RELEASE
};

struct job_done {
    int station;
    uint64_t session;
    struct job_result *result;
};

struct cut_worker {
    struct worker *worker;
    pthread_t thread;
    atomic_bool stop;
    int wake_fd;
    struct progress progress;
    struct ring *tasks;         // of struct cut_task
    struct ring *mesh_requests; // of struct mesh_request
    struct ring *done;          // of struct job_done, to the worker
    struct ring *notices;       // of struct runtime_notice, to the owner of the sessions
    struct session_runtime *sessions[STATIONS_MAX];
    struct mesh_sender senders[STATIONS_MAX];
    struct mesh_inbox inboxes[STATIONS_MAX]; // from the control thread
    struct mesh_words words[STATIONS_MAX];   // of this round
};

static struct station_runtime *station_of(const struct cut_worker *c, int station) {
    return &c->worker->runtime->stations[station];
}

// ---- tasks of the worker ------------------------------------------------------------------------

static void publish_tissues(struct cut_worker *c, int index) {
    struct station_runtime *station = station_of(c, index);
    const struct session_runtime *session = c->sessions[index];
    struct tissue_report report = {.session = session->serial};
    for (int i = 0; i < scene_tissue_count(session->scene); i++) {
        report.figures[i] = *operation_figures(session->operation, i);
        report.mesh_hashes[i] = mesh_sender_hash(&c->senders[index], i);
    }
    pthread_mutex_lock(&station->tissues_lock);
    station->tissues = report;
    pthread_mutex_unlock(&station->tissues_lock);
}

static void notify(struct cut_worker *c, const struct runtime_notice *notice) {
    bool pushed = ring_push(c->notices, notice);
    CHECK(pushed);
    c->worker->runtime->config.notify(c->worker->runtime->config.user);
}

static void open_session(struct cut_worker *c, const struct cut_task *task) {
    c->sessions[task->station] = task->session;
    mesh_sender_open(&c->senders[task->station], *c->worker->runtime->config.control,
                     task->session);
    publish_tissues(c, task->station);
    notify(c, &(struct runtime_notice){.kind = NOTICE_OPENED,
                                       .station = task->station,
                                       .session = task->session->serial});
}

// A burr asks on and on, so only the first, second, fourth, ... refusal is logged.
static void log_refusal(const struct cut_worker *c, int station, const struct job_result *result) {
    uint32_t refused = result->figures.refused;
    if (result->outcome == JOB_REFUSED && (refused & (refused - 1)) == 0)
        log_warning("cuts", "station %s: a cut was refused: %s",
                    station_of(c, station)->config->name, result->why.text);
}

// The worker only reads the result, and gives it back.
static void hand_over_result(struct cut_worker *c, const struct cut_task *task,
                             struct job_result *result) {
    struct job_done done = {task->station, task->serial, result};
    bool pushed = ring_push(c->done, &done);
    CHECK(pushed);
    wake_fd(c->worker->wake_fd);
}

static void show_result(struct cut_worker *c, int station, const struct job_result *result) {
    log_refusal(c, station, result);
    if (result->outcome == JOB_NOTHING)
        return;
    mesh_sender_push(&c->senders[station], result);
    publish_tissues(c, station);
}

// A cut lands at once. Who asked for an undo is answered as it lands, and then sees the tissue that
// it left: so that is shown first.
static void run(struct cut_worker *c, const struct cut_task *task) {
    struct session_runtime *session = c->sessions[task->station];
    CHECK(session && session->serial == task->serial);
    struct job_result *result = operation_run(session->operation, &task->job);
    bool is_undo = result->kind == JOB_UNDO;
    if (!is_undo)
        hand_over_result(c, task, result);
    show_result(c, task->station, result);
    if (is_undo)
        hand_over_result(c, task, result);
}

static void close_session(struct cut_worker *c, const struct cut_task *task) {
    mesh_sender_close(&c->senders[task->station]);
    c->sessions[task->station] = NULL;
    notify(c, &(struct runtime_notice){.kind = NOTICE_ENDED,
                                       .station = task->station,
                                       .session = task->session->serial,
                                       .ended = task->session,
                                       .end = task->end});
}

static const char *const doing[] = {[TASK_OPEN] = "show a session's meshes",
                                    [TASK_RUN] = "run a cut, an undo or a restore",
                                    [TASK_RELEASE] = "release a result",
                                    [TASK_CLOSE] = "end a session"};

static void take_task(struct cut_worker *c, struct cut_task *task) {
    progress_note(&c->progress, doing[task->kind], task->station);
    switch (task->kind) {
    case TASK_OPEN:
        open_session(c, task);
        break;
    case TASK_RUN:
        run(c, task);
        break;
    case TASK_RELEASE:
        job_result_destroy(&task->result);
        break;
    case TASK_CLOSE:
        close_session(c, task);
        break;
    }
}

// ---- the thread ---------------------------------------------------------------------------------

// Takes what is there now and leaves the rest to the next round, since tasks may come for ever. A
// station asks for meshes when it hears of its session, whose task was given before: so words are
// taken first and answered last. The same holds for pages.
static void take_round(struct cut_worker *c) {
    bool said[STATIONS_MAX];
    for (int i = 0; i < STATIONS_MAX; i++)
        said[i] = mesh_inbox_take(&c->inboxes[i], clock_now_ns(), &c->words[i]);
    size_t requests = ring_count(c->mesh_requests), tasks = ring_count(c->tasks);
    struct cut_task task;
    struct mesh_request request;
    for (; tasks && ring_pop(c->tasks, &task); tasks--)
        take_task(c, &task);
    for (int i = 0; i < STATIONS_MAX; i++)
        if (said[i]) {
            progress_note(&c->progress, "send meshes", i);
            mesh_sender_take(&c->senders[i], &c->words[i]);
        }
    for (; requests && ring_pop(c->mesh_requests, &request); requests--) {
        mesh_sender_request(&c->senders[request.station], &request);
        mailbox_release(&request.mailbox);
    }
}

// The worker goes first. A real priority, not SCHED_IDLE: an idle thread would wait for any backup
// on the machine, with locks that workers take.
static void lower_priority(void) {
    struct sched_param none = {0};
    sched_setscheduler(0, SCHED_BATCH, &none);
    setpriority(PRIO_PROCESS, 0, NICE); // Linux: of this thread
}

static void *work(void *argument) {
    struct cut_worker *c = argument;
    struct pollfd fd = {.fd = c->wake_fd, .events = POLLIN};
    lower_priority();
    progress_begin(&c->progress, "cut worker", c->worker->index);
    bool stop = false;
    while (!stop) {
        progress_note(&c->progress, "wait for cuts", -1);
        poll(&fd, 1, ROUND_MS);
        uint64_t wakes;
        if (fd.revents && read(c->wake_fd, &wakes, sizeof wakes) < 0)
            CHECK(errno == EAGAIN);
        stop = atomic_load(&c->stop);
        take_round(c);
    }
    progress_end(&c->progress);
    return NULL;
}

struct progress *cut_worker_progress(struct cut_worker *c) {
    return &c->progress;
}

struct cut_worker *cut_worker_create(struct worker *worker) {
    struct cut_worker *c = alloc(1, sizeof *c);
    c->worker = worker;
    c->wake_fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    NEED(c->wake_fd >= 0, "descriptor");
    c->tasks = ring_create(TASKS_MAX, sizeof(struct cut_task));
    c->mesh_requests = ring_create(TASKS_MAX, sizeof(struct mesh_request));
    c->done = ring_create(TASKS_MAX, sizeof(struct job_done));
    c->notices = ring_create(TASKS_MAX, sizeof(struct runtime_notice));
    for (int i = 0; i < STATIONS_MAX; i++)
        mesh_inbox_init(&c->inboxes[i]);
    int failed = pthread_create(&c->thread, NULL, work, c);
    NEED(!failed, "thread");
    return c;
}

void cut_worker_stop(struct cut_worker *c) {
    atomic_store(&c->stop, true);
    wake_fd(c->wake_fd);
    pthread_join(c->thread, NULL);
}

void cut_worker_destroy(struct cut_worker **cut_worker) {
    struct cut_worker *c = *cut_worker;
    struct job_done done;
    struct mesh_request request;
    if (!c)
        return;
    while (ring_pop(c->done, &done))
        job_result_destroy(&done.result);
    while (ring_pop(c->mesh_requests, &request))
        mailbox_release(&request.mailbox);
    for (int i = 0; i < STATIONS_MAX; i++) {
        mesh_sender_fini(&c->senders[i]);
        mesh_inbox_fini(&c->inboxes[i]);
    }
    ring_destroy(&c->tasks);
    ring_destroy(&c->mesh_requests);
    ring_destroy(&c->done);
    ring_destroy(&c->notices);
    close(c->wake_fd);
    free(c);
    *cut_worker = NULL;
}

// ---- what the other threads call ----------------------------------------------------------------

static void give(struct cut_worker *c, const struct cut_task *task) {
    bool pushed = ring_push(c->tasks, task);
    CHECK(pushed);
    wake_fd(c->wake_fd);
}

void cut_worker_open(struct cut_worker *c, int station, struct session_runtime *session) {
    give(c, &(struct cut_task){.kind = TASK_OPEN, .station = station, .session = session});
}

void cut_worker_run(struct cut_worker *c, int station, uint64_t session, const struct job *job) {
    give(c,
         &(struct cut_task){.kind = TASK_RUN, .station = station, .serial = session, .job = *job});
}

void cut_worker_close(struct cut_worker *c, int station, struct session_runtime *session,
                      enum session_end end) {
    give(c, &(struct cut_task){
                .kind = TASK_CLOSE, .station = station, .session = session, .end = end});
}

bool cut_worker_take(struct cut_worker *c, int *out_station, uint64_t *out_session,
                     struct job_result **out_result) {
    struct job_done done;
    if (!ring_pop(c->done, &done))
        return false;
    *out_station = done.station;
    *out_session = done.session;
    *out_result = done.result;
    return true;
}

// Releasing it is not urgent: the next task or round does it.
void cut_worker_release_result(struct cut_worker *c, struct job_result *result) {
    struct cut_task task = {.kind = TASK_RELEASE, .result = result};
    bool pushed = ring_push(c->tasks, &task);
    CHECK(pushed);
}

void cut_worker_message(struct cut_worker *c, int station, struct control_peer peer,
                        const arthron_Control *message) {
    mesh_inbox_put(&c->inboxes[station], peer, message);
    wake_fd(c->wake_fd);
}

void cut_worker_leave(struct cut_worker *c, int station) {
    mesh_inbox_leave(&c->inboxes[station]);
    wake_fd(c->wake_fd);
}

bool cut_worker_mesh_request(struct cut_worker *c, const struct mesh_request *request) {
    if (!ring_push(c->mesh_requests, request))
        return false;
    wake_fd(c->wake_fd);
    return true;
}

bool cut_worker_next_notice(struct cut_worker *c, struct runtime_notice *out_notice) {
    return ring_pop(c->notices, out_notice);
}
