#include "runtime/cut_worker.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "runtime/keeper.h"
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
#define TASKS_LEAST 1024
#define TASKS_EACH 16
#define MESH_REQUESTS_MAX 1024
#define CUT_NICE 10

enum task_kind { TASK_OPEN, TASK_RUN, TASK_KEEP, TASK_RELEASE, TASK_CLOSE };

// From the worker. A session has one job on its way at most, so the ring never overflows.
struct cut_task {
    enum task_kind kind;
    int station;
    struct session_runtime *session; // TASK_OPEN, TASK_CLOSE
    uint64_t serial;                 // TASK_RUN, TASK_KEEP: of the session
    enum session_end end;            // TASK_CLOSE
    const struct job *job;           // TASK_RUN: the station's
    struct job_result *result;       // TASK_RELEASE
    struct session_image *image;     // TASK_KEEP
};

struct job_done {
    int station;
    uint64_t session;
    struct job_result *result;
};

// One of the worker's stations.
struct cut_station {
    struct session_runtime *session; // NULL: none
    struct mesh_sender sender;
    struct mesh_inbox inbox; // from the control thread
    bool listed;             // under said_lock
    struct mesh_words words; // of this round
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
    struct mesh_starts starts;
    int count;
    struct cut_station *stations; // by their place
    pthread_mutex_t said_lock;    // held for a copy
    int *said, said_count;        // places whose inbox has something
    int *round, round_count;      // the same of this round
};

static struct cut_station *cut_station(const struct cut_worker *c, int station) {
    return &c->stations[worker_place(c->worker->runtime, station)];
}

static struct station_runtime *station_of(const struct cut_worker *c, int station) {
    return &c->worker->runtime->stations[station];
}

// ---- tasks of the worker ------------------------------------------------------------------------

static void publish_tissues(struct cut_worker *c, int index) {
    struct station_runtime *station = station_of(c, index);
    const struct cut_station *own = cut_station(c, index);
    const struct session_runtime *session = own->session;
    struct tissue_report report = {.session = session->serial};
    for (int i = 0; i < scene_tissue_count(session->scene); i++) {
        report.figures[i] = *operation_figures(session->operation, i);
        report.mesh_hashes[i] = mesh_sender_hash(&own->sender, i);
    }
    pthread_mutex_lock(&station->tissues_lock);
    station->tissues = report;
    pthread_mutex_unlock(&station->tissues_lock);
}

static void notify_runtime(struct cut_worker *c, const struct runtime_notice *notice) {
    bool pushed = ring_push(c->notices, notice);
    CHECK(pushed);
    c->worker->runtime->config.notify(c->worker->runtime->config.user);
}

static void open_session(struct cut_worker *c, const struct cut_task *task) {
    struct cut_station *own = cut_station(c, task->station);
    own->session = task->session;
    mesh_sender_open(&own->sender, *c->worker->runtime->config.control, task->session, &c->starts);
    publish_tissues(c, task->station);
    notify_runtime(c, &(struct runtime_notice){.kind = NOTICE_OPENED,
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
    mesh_sender_push(&cut_station(c, station)->sender, result);
    publish_tissues(c, station);
}

// A cut lands at once. Who asked for an undo is answered as it lands, and then sees the tissue that
// it left: so that is shown first.
static void run(struct cut_worker *c, const struct cut_task *task) {
    struct session_runtime *session = cut_station(c, task->station)->session;
    CHECK(session && session->serial == task->serial);
    int64_t begun_ns = clock_now_ns();
    struct job_result *result = operation_run(session->operation, task->job);
    if (result->kind == JOB_CUT)
        latency_add(&c->worker->cuts, clock_now_ns() - begun_ns);
    session_make_room(session->session, result);
    bool is_undo = result->kind == JOB_UNDO;
    if (!is_undo)
        hand_over_result(c, task, result);
    show_result(c, task->station, result);
    if (is_undo)
        hand_over_result(c, task, result);
}

static void keep(struct cut_worker *c, const struct cut_task *task) {
    struct session_runtime *session = cut_station(c, task->station)->session;
    struct session_image *image = task->image;
    CHECK(session && session->serial == task->serial);
    image->operation = kept_growing();
    operation_keep(session->operation, &image->operation);
    atomic_store(&station_of(c, task->station)->kept_bytes, image->operation.used);
    keeper_write(c->worker->runtime->keeper, image);
}

static void close_session(struct cut_worker *c, const struct cut_task *task) {
    struct cut_station *own = cut_station(c, task->station);
    mesh_sender_close(&own->sender);
    own->session = NULL;
    if (task->end != END_HANDED_OVER && task->session->trace_file[0])
        keeper_remove(c->worker->runtime->keeper, task->session->trace_file);
    notify_runtime(c, &(struct runtime_notice){.kind = NOTICE_ENDED,
                                       .station = task->station,
                                       .session = task->session->serial,
                                       .ended = task->session,
                                       .end = task->end});
}

static const char *const doing[] = {[TASK_OPEN] = "show a session's meshes",
                                    [TASK_RUN] = "run a cut, an undo or a restore",
                                    [TASK_KEEP] = "keep a session's state",
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
    case TASK_KEEP:
        keep(c, task);
        break;
    case TASK_RELEASE:
        job_result_destroy(&task->result);
        break;
    case TASK_CLOSE:
        close_session(c, task);
        break;
    }
}

// ---- what stations say --------------------------------------------------------------------------

static void list(struct cut_worker *c, int place) {
    pthread_mutex_lock(&c->said_lock);
    if (!c->stations[place].listed)
        c->said[c->said_count++] = place;
    c->stations[place].listed = true;
    pthread_mutex_unlock(&c->said_lock);
}

static void take_list(struct cut_worker *c) {
    pthread_mutex_lock(&c->said_lock);
    int *empty = c->round;
    c->round = c->said;
    c->round_count = c->said_count;
    c->said = empty;
    c->said_count = 0;
    for (int i = 0; i < c->round_count; i++)
        c->stations[c->round[i]].listed = false;
    pthread_mutex_unlock(&c->said_lock);
}

// Leaves those that have words in the round. One that asks too soon waits for a later one.
static void take_words(struct cut_worker *c) {
    int count = 0;
    take_list(c);
    for (int i = 0; i < c->round_count; i++) {
        struct cut_station *own = &c->stations[c->round[i]];
        if (mesh_inbox_take(&own->inbox, clock_now_ns(), &own->words))
            c->round[count++] = c->round[i];
        else
            list(c, c->round[i]);
    }
    c->round_count = count;
}

static void answer_words(struct cut_worker *c) {
    for (int i = 0; i < c->round_count; i++) {
        struct cut_station *own = &c->stations[c->round[i]];
        progress_note(&c->progress, "send meshes", worker_station(c->worker, c->round[i]));
        mesh_sender_take(&own->sender, &own->words);
    }
}

// ---- the thread ---------------------------------------------------------------------------------

// Takes what is there now and leaves the rest to the next round, since tasks may come for ever. A
// station asks for meshes when it hears of its session, whose task was given before: so words are
// taken first and answered last. The same holds for pages.
static void take_round(struct cut_worker *c) {
    take_words(c);
    size_t requests = ring_count(c->mesh_requests), tasks = ring_count(c->tasks);
    struct cut_task task;
    struct mesh_request request;
    for (; tasks && ring_pop(c->tasks, &task); tasks--)
        take_task(c, &task);
    answer_words(c);
    for (; requests && ring_pop(c->mesh_requests, &request); requests--) {
        mesh_sender_request(&cut_station(c, request.station)->sender, &request);
        mailbox_release(&request.mailbox);
    }
}

// The worker goes first. A real priority, not SCHED_IDLE: an idle thread would wait for any backup
// on the machine, with locks that workers take.
static void lower_priority(void) {
    struct sched_param none = {0};
    sched_setscheduler(0, SCHED_BATCH, &none);
    setpriority(PRIO_PROCESS, 0, CUT_NICE); // Linux: of this thread
}

static void *run_cut_worker(void *argument) {
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

void cut_worker_waiting(const struct cut_worker *c, size_t *jobs, size_t *mesh_requests) {
    *jobs += ring_count(c->tasks);
    *mesh_requests += ring_count(c->mesh_requests);
}

struct cut_worker *cut_worker_create(struct worker *worker) {
    struct cut_worker *c = alloc(1, sizeof *c);
    c->worker = worker;
    c->wake_fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    NEED(c->wake_fd >= 0, "descriptor");
    size_t tasks = worker_room(worker->runtime, worker->index, TASKS_EACH, TASKS_LEAST);
    c->tasks = ring_create(tasks, sizeof(struct cut_task));
    c->mesh_requests = ring_create(MESH_REQUESTS_MAX, sizeof(struct mesh_request));
    c->done = ring_create(tasks, sizeof(struct job_done));
    c->notices = ring_create(tasks, sizeof(struct runtime_notice));
    c->count = worker_stations(worker->runtime, worker->index);
    c->stations = alloc((size_t)c->count, sizeof *c->stations);
    c->said = alloc((size_t)c->count, sizeof *c->said);
    c->round = alloc((size_t)c->count, sizeof *c->round);
    pthread_mutex_init(&c->said_lock, NULL);
    for (int i = 0; i < c->count; i++)
        mesh_inbox_init(&c->stations[i].inbox);
    int failed = pthread_create(&c->thread, NULL, run_cut_worker, c);
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
    for (int i = 0; i < c->count; i++) {
        mesh_sender_fini(&c->stations[i].sender);
        mesh_inbox_fini(&c->stations[i].inbox);
    }
    mesh_starts_fini(&c->starts);
    pthread_mutex_destroy(&c->said_lock);
    free(c->stations);
    free(c->said);
    free(c->round);
    ring_destroy(&c->tasks);
    ring_destroy(&c->mesh_requests);
    ring_destroy(&c->done);
    ring_destroy(&c->notices);
    close(c->wake_fd);
    free(c);
    *cut_worker = NULL;
}

// ---- what the other threads call ----------------------------------------------------------------

static void give_task(struct cut_worker *c, const struct cut_task *task) {
    bool pushed = ring_push(c->tasks, task);
    CHECK(pushed);
    wake_fd(c->wake_fd);
}

void cut_worker_open(struct cut_worker *c, int station, struct session_runtime *session) {
    give_task(c, &(struct cut_task){.kind = TASK_OPEN, .station = station, .session = session});
}

void cut_worker_run(struct cut_worker *c, int station, uint64_t session, const struct job *job) {
    give_task(
        c, &(struct cut_task){.kind = TASK_RUN, .station = station, .serial = session, .job = job});
}

void cut_worker_keep(struct cut_worker *c, int station, uint64_t session,
                     struct session_image *image) {
    give_task(c, &(struct cut_task){
                     .kind = TASK_KEEP, .station = station, .serial = session, .image = image});
}

void cut_worker_close(struct cut_worker *c, int station, struct session_runtime *session,
                      enum session_end end) {
    give_task(c, &(struct cut_task){
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
    mesh_inbox_put(&cut_station(c, station)->inbox, peer, message);
    list(c, worker_place(c->worker->runtime, station));
    wake_fd(c->wake_fd);
}

void cut_worker_leave(struct cut_worker *c, int station) {
    mesh_inbox_leave(&cut_station(c, station)->inbox);
    list(c, worker_place(c->worker->runtime, station));
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
