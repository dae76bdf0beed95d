// A theatre that always has something to cut still hears its stations.
#include "hub/seat.h"
#include "test.h"
#include "unit/case_knee.h"

#include <sys/eventfd.h>
#include <unistd.h>

#define ON_THEIR_WAY 200
#define JOBS_MAX 4000

static atomic_int figures_sent;

// ---- in place of the control connection ---------------------------------------------------------

bool control_send(struct control *control, struct control_peer peer,
                  const arthron_Control *message) {
    (void)control, (void)peer;
    if (message->which_message == arthron_Control_resection_tag)
        atomic_fetch_add(&figures_sent, 1);
    return true;
}

bool control_send_mesh(struct control *control, struct control_peer peer,
                       struct mesh_payload *payload) {
    (void)control, (void)peer, (void)payload;
    return true;
}

// ---- the test -----------------------------------------------------------------------------------

static struct hub hub;
static struct worker worker;

static void open_theatre(struct live *live) {
    struct knee_case *knee = box_knee();
    assert_int_equal(scene_create(&knee, &hub.scenes[0], NULL), RESULT_OK);
    pthread_mutex_init(&hub.card_lock, NULL);
    hub.seats[0].station = &hub.config.stations[0];
    worker = (struct worker){.hub = &hub, .wake_fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)};
    *live = (struct live){
        .serial = 1, .scene = hub.scenes[0], .operation = operation_create(hub.scenes[0])};
    theatre_start(&worker);
    theatre_open(worker.theatre, 0, live);
}

static void close_theatre(struct live *live) {
    struct retired retired;
    theatre_close(worker.theatre, 0, live, false);
    theatre_stop(&worker);
    assert_true(theatre_retired(worker.theatre, &retired));
    assert_ptr_equal(retired.live, live);
    theatre_release(&worker);
    operation_destroy(&live->operation);
    close(worker.wake_fd);
    scene_destroy(&hub.scenes[0]);
    pthread_mutex_destroy(&hub.card_lock);
}

static int take_done(void) {
    int seat, count = 0;
    uint64_t serial;
    struct job_result *result;
    for (; theatre_take(worker.theatre, &seat, &serial, &result); count++)
        job_result_destroy(&result);
    return count;
}

static void a_station_is_heard_while_there_is_always_something_to_cut(void **state) {
    (void)state;
    struct live live;
    arthron_Control ask = {.which_message = arthron_Control_mesh_ask_tag};
    uint64_t asked_for = 0, done = 0;
    open_theatre(&live);
    while (!atomic_load(&figures_sent) && done < JOBS_MAX) {
        for (; asked_for < done + ON_THEIR_WAY; asked_for++) {
            struct job job = {.id = asked_for + 1, .kind = JOB_RESTORE};
            theatre_run(worker.theatre, 0, &live, &job);
            if (asked_for == ON_THEIR_WAY / 2)
                theatre_tell(worker.theatre, 0, (struct control_peer){0}, &ask);
        }
        done += (uint64_t)take_done();
    }
    assert_int_equal(atomic_load(&figures_sent), 1);
    assert_true(done < JOBS_MAX);
    close_theatre(&live);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_station_is_heard_while_there_is_always_something_to_cut),
    };
    return cmocka_run_group_tests_name("theatre_words", tests, NULL, NULL);
}
