// A cut worker that always has something to cut still hears its stations.
#include "base/clock.h"
#include "runtime/cut_worker.h"
#include "test.h"
#include "unit/case_knee.h"

#include <sys/eventfd.h>
#include <time.h>
#include <unistd.h>

#define ON_THEIR_WAY 200
#define JOBS_MAX 4000

static atomic_int figures_sent, meshes_sent;

// ---- in place of the control connection ---------------------------------------------------------

bool __wrap_control_send(struct control *control, struct control_peer peer,
                         const arthron_Control *message);
bool __wrap_control_send(struct control *control, struct control_peer peer,
                         const arthron_Control *message) {
    (void)control, (void)peer;
    if (message->which_message == arthron_Control_resection_tag)
        atomic_fetch_add(&figures_sent, 1);
    return true;
}

bool __wrap_control_send_mesh(struct control *control, struct control_peer peer,
                              struct mesh_payload *payload);
bool __wrap_control_send_mesh(struct control *control, struct control_peer peer,
                              struct mesh_payload *payload) {
    (void)control, (void)peer, (void)payload;
    atomic_fetch_add(&meshes_sent, 1);
    return true;
}

// ---- the test -----------------------------------------------------------------------------------

static const struct runtime_station room = {.name = "room-1"};
static struct station_runtime stations[2];
static struct runtime runtime;
static struct control *no_control;

static void ignore(void *user) {
    (void)user;
}

static void open_worker(struct worker *worker, struct session_runtime *session) {
    struct knee_case *knee = box_knee();
    struct scene *scene;
    struct session_settings settings = session_settings_default();
    assert_int_equal(scene_create(&knee, &scene, NULL), RESULT_OK);
    runtime.config.notify = ignore;
    runtime.config.control = &no_control;
    runtime.config.station_count = 2;
    runtime.worker_count = 1;
    runtime.stations = stations;
    stations[0].config = &room;
    pthread_mutex_init(&stations[0].tissues_lock, NULL);
    *worker =
        (struct worker){.runtime = &runtime, .wake_fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)};
    *session = (struct session_runtime){
        .serial = 1,
        .scene = scene,
        .session = session_create(scene, &settings),
        .operation = operation_create(scene, RULES_NEWEST, instruments_usual())};
    worker->cut_worker = cut_worker_create(worker);
    cut_worker_open(worker->cut_worker, 0, session);
}

static void close_worker(struct worker *worker, struct session_runtime *session) {
    struct runtime_notice notice;
    cut_worker_close(worker->cut_worker, 0, session, END_CLOSED);
    cut_worker_stop(worker->cut_worker);
    assert_true(cut_worker_next_notice(worker->cut_worker, &notice));
    assert_int_equal(notice.kind, NOTICE_OPENED);
    assert_true(cut_worker_next_notice(worker->cut_worker, &notice));
    assert_int_equal(notice.kind, NOTICE_ENDED);
    assert_ptr_equal(notice.ended, session);
    cut_worker_destroy(&worker->cut_worker);
    session_destroy(&session->session);
    operation_destroy(&session->operation);
    close(worker->wake_fd);
    struct scene *scene = (struct scene *)session->scene;
    scene_destroy(&scene);
}

static int take_done(struct cut_worker *cut_worker) {
    int index, count = 0;
    uint64_t serial;
    struct job_result *result;
    for (; cut_worker_take(cut_worker, &index, &serial, &result); count++)
        cut_worker_release_result(cut_worker, result);
    return count;
}

// At most ON_THEIR_WAY of them are.
static const struct job *a_restore(uint64_t id) {
    static struct job jobs[ON_THEIR_WAY];
    struct job *job = &jobs[id % ON_THEIR_WAY];
    *job = (struct job){.id = id, .kind = JOB_RESTORE};
    return job;
}

static void a_station_is_heard_while_there_is_always_something_to_cut(void **state) {
    (void)state;
    struct worker worker;
    struct session_runtime session;
    arthron_Control ask = {.which_message = arthron_Control_mesh_ask_tag};
    uint64_t asked_for = 0, done = 0;
    open_worker(&worker, &session);
    while (!atomic_load(&figures_sent) && done < JOBS_MAX) {
        for (; asked_for < done + ON_THEIR_WAY; asked_for++) {
            cut_worker_run(worker.cut_worker, 0, session.serial, a_restore(asked_for + 1));
            if (asked_for == ON_THEIR_WAY / 2)
                cut_worker_message(worker.cut_worker, 0, (struct control_peer){0}, &ask);
        }
        done += (uint64_t)take_done(worker.cut_worker);
    }
    assert_true(atomic_load(&figures_sent) > 0);
    assert_true(done < JOBS_MAX);
    close_worker(&worker, &session);
}

static void wait_for(const atomic_int *count, int least) {
    while (atomic_load(count) < least)
        nanosleep(&(struct timespec){.tv_nsec = NS_PER_MS}, NULL);
}

static void keep_busy(struct worker *worker, uint64_t session, uint64_t *jobs) {
    for (int i = 0; i < ON_THEIR_WAY; i++)
        cut_worker_run(worker->cut_worker, 0, session, a_restore(++*jobs));
}

// A station that says more than the cut worker takes meanwhile, and one that is gone behind it.
static void a_station_that_comes_again_gets_its_meshes_whatever_was_said_before(void **state) {
    (void)state;
    struct worker worker;
    struct session_runtime session;
    struct control_peer first = {0, 1}, again = {0, 2};
    arthron_Control ask = {.which_message = arthron_Control_mesh_ask_tag};
    uint64_t jobs = 0;
    open_worker(&worker, &session);
    atomic_store(&meshes_sent, 0);
    cut_worker_message(worker.cut_worker, 0, first, &ask);
    wait_for(&meshes_sent, 1);
    keep_busy(&worker, session.serial, &jobs);
    for (int i = 0; i < 5000; i++)
        cut_worker_message(worker.cut_worker, 1, first, &ask);
    cut_worker_leave(worker.cut_worker, 0);
    cut_worker_message(worker.cut_worker, 0, again, &ask);
    wait_for(&meshes_sent, 2);
    cut_worker_leave(worker.cut_worker, 0);
    close_worker(&worker, &session);
}

// ---- pages --------------------------------------------------------------------------------------

static atomic_int notices;
static atomic_bool notified;

static void notice_slowly(void *user) {
    (void)user;
    atomic_fetch_add(&notices, 1);
    nanosleep(&(struct timespec){.tv_nsec = 50 * NS_PER_MS}, NULL);
    atomic_store(&notified, true);
}

static void *put(void *user) {
    struct mesh_payload *payload = mesh_payload_create("meniscus", 0, 1, 0);
    mailbox_put(user, 0, 1, payload);
    mesh_payload_release(&payload);
    return NULL;
}

static void nobody_is_notified_of_a_mailbox_that_was_left(void **state) {
    (void)state;
    pthread_t thread;
    struct mailbox *mailbox = mailbox_create(notice_slowly, NULL);
    assert_int_equal(pthread_create(&thread, NULL, put, mailbox), 0);
    while (!atomic_load(&notices))
        ;
    mailbox_leave(mailbox);
    assert_true(atomic_load(&notified));
    pthread_join(thread, NULL);
    put(mailbox);
    assert_int_equal(atomic_load(&notices), 1);
    mailbox_release(&mailbox);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_station_is_heard_while_there_is_always_something_to_cut),
        cmocka_unit_test(a_station_that_comes_again_gets_its_meshes_whatever_was_said_before),
        cmocka_unit_test(nobody_is_notified_of_a_mailbox_that_was_left),
    };
    return cmocka_run_group_tests_name("cut_worker_messages", tests, NULL, NULL);
}
