// The task pool: each task once, those of one key in order and one at a time, and an end in which
// none is lost. Tasks wait for each other with semaphores and flags, never for a time.
#include "base/task_pool.h"

#include "base/check.h"
#include "base/clock.h"
#include "test.h"

#include <pthread.h>
#include <sched.h>
#include <semaphore.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <unistd.h>

#define KEYS 7
#define EACH 300

static struct task_pool *pool_of(int threads, int tasks_max) {
    return task_pool_create(&(struct task_pool_settings){
        .threads = threads, .tasks_max = tasks_max, .urgent_max = tasks_max});
}

// ---- what tasks write down ----------------------------------------------------------------------

struct log {
    pthread_mutex_t lock;
    int count, at[64];
};

#define LOG_INIT                                                                                   \
    { .lock = PTHREAD_MUTEX_INITIALIZER }

struct note {
    struct log *log;
    int number;
    sem_t *begun, *go; // or NULL
    int again;         // how often to ask to be run again
    int64_t again_ns;
    atomic_int runs, done, undone;
};

static void write_down(struct log *log, int number) {
    pthread_mutex_lock(&log->lock);
    log->at[log->count++] = number;
    pthread_mutex_unlock(&log->lock);
}

static int64_t run_note(void *data) {
    struct note *note = data;
    if (note->begun)
        sem_post(note->begun);
    if (note->go)
        sem_wait(note->go);
    write_down(note->log, note->number);
    return atomic_fetch_add(&note->runs, 1) < note->again ? note->again_ns : TASK_DONE;
}

static void finish_note(void *data, bool done) {
    struct note *note = data;
    atomic_fetch_add(done ? &note->done : &note->undone, 1);
}

static bool add(struct task_pool *pool, struct note *note, uint64_t key, bool urgent) {
    return task_pool_add(
        pool,
        &(struct pool_task){
            .key = key, .urgent = urgent, .run = run_note, .finish = finish_note, .data = note});
}

static void assert_log(const struct log *log, int count, const int *expected) {
    assert_int_equal(log->count, count);
    for (int i = 0; i < count; i++)
        assert_int_equal(log->at[i], expected[i]);
}

// A task that keeps a thread until `go`.
struct blocker {
    sem_t begun, go;
    struct note note;
};

static void block_with_key(struct task_pool *pool, struct blocker *b, struct log *log, int number,
                           uint64_t key) {
    sem_init(&b->begun, 0, 0);
    sem_init(&b->go, 0, 0);
    b->note = (struct note){.log = log, .number = number, .begun = &b->begun, .go = &b->go};
    assert_true(add(pool, &b->note, key, false));
    sem_wait(&b->begun);
}

static void block(struct task_pool *pool, struct blocker *b, struct log *log, int number) {
    block_with_key(pool, b, log, number, 0);
}

// ---- order --------------------------------------------------------------------------------------

static void an_urgent_task_goes_before_the_others_and_these_go_in_order(void **state) {
    (void)state;
    struct log log = LOG_INIT;
    struct task_pool *pool = pool_of(1, 8);
    struct blocker first;
    struct note notes[4];
    block(pool, &first, &log, 0);
    for (int i = 0; i < 4; i++) {
        notes[i] = (struct note){.log = &log, .number = i + 1};
        assert_true(add(pool, &notes[i], 0, i >= 2));
    }
    sem_post(&first.go);
    task_pool_drain(pool);
    assert_log(&log, 5, (int[]){0, 3, 4, 1, 2});
    task_pool_destroy(&pool);
    assert_null(pool);
}

static void an_urgent_task_waits_for_those_of_its_key(void **state) {
    (void)state;
    struct log log = LOG_INIT;
    struct task_pool *pool = pool_of(1, 8);
    struct blocker first;
    struct note notes[3];
    block(pool, &first, &log, 0);
    for (int i = 0; i < 3; i++)
        notes[i] = (struct note){.log = &log, .number = i + 1};
    assert_true(add(pool, &notes[0], 0, false));
    assert_true(add(pool, &notes[1], 5, false));
    assert_true(add(pool, &notes[2], 5, true));
    sem_post(&first.go);
    task_pool_drain(pool);
    assert_log(&log, 4, (int[]){0, 1, 2, 3});
    task_pool_destroy(&pool);
}

static void a_task_of_another_key_does_not_wait(void **state) {
    (void)state;
    struct log log = LOG_INIT;
    struct task_pool *pool = pool_of(2, 8);
    struct blocker first, other;
    struct note behind = {.log = &log, .number = 2};
    block_with_key(pool, &first, &log, 1, 11);
    assert_true(add(pool, &behind, 11, false));
    block_with_key(pool, &other, &log, 3, 12); // it runs, though an older one waits
    sem_post(&other.go);
    while (!atomic_load(&other.note.done))
        sched_yield();
    sem_post(&first.go);
    task_pool_drain(pool);
    assert_log(&log, 3, (int[]){3, 1, 2});
    task_pool_destroy(&pool);
}

struct lane {
    atomic_int inside, count; // tasks that run or finish; how many have run
    bool broken;
};

struct step {
    struct lane *lane;
    int number;
};

static int64_t run_step(void *data) {
    struct step *step = data;
    if (atomic_fetch_add(&step->lane->inside, 1) != 0 ||
        atomic_load(&step->lane->count) != step->number)
        step->lane->broken = true;
    sched_yield();
    return TASK_DONE;
}

static void finish_step(void *data, bool done) {
    struct step *step = data;
    atomic_fetch_add(&step->lane->count, done);
    atomic_fetch_sub(&step->lane->inside, 1);
    free(step);
}

struct giver {
    struct task_pool *pool;
    struct lane *lane;
    uint64_t key;
};

static void *give_steps(void *argument) {
    struct giver *giver = argument;
    for (int i = 0; i < EACH; i++) {
        struct step *step = alloc(1, sizeof *step);
        *step = (struct step){giver->lane, i};
        struct pool_task task = {.key = giver->key,
                            .urgent = i & 1,
                            .run = run_step,
                            .finish = finish_step,
                            .data = step};
        while (!task_pool_add(giver->pool, &task))
            sched_yield();
    }
    return NULL;
}

static void tasks_of_a_key_run_in_order_and_never_at_the_same_time(void **state) {
    (void)state;
    struct task_pool *pool = pool_of(4, 64);
    struct lane lanes[KEYS] = {0};
    struct giver givers[KEYS];
    pthread_t threads[KEYS];
    for (int i = 0; i < KEYS; i++) {
        givers[i] = (struct giver){pool, &lanes[i], (uint64_t)i + 1};
        assert_int_equal(pthread_create(&threads[i], NULL, give_steps, &givers[i]), 0);
    }
    for (int i = 0; i < KEYS; i++)
        pthread_join(threads[i], NULL);
    task_pool_drain(pool);
    for (int i = 0; i < KEYS; i++) {
        assert_false(lanes[i].broken);
        assert_int_equal(lanes[i].count, EACH);
    }
    task_pool_destroy(&pool);
}

// ---- bounds -------------------------------------------------------------------------------------

static void a_full_pool_refuses_and_takes_again_when_a_task_is_done(void **state) {
    (void)state;
    struct log log = LOG_INIT;
    struct task_pool *pool = pool_of(1, 2);
    struct blocker first;
    struct note notes[4];
    block(pool, &first, &log, 0);
    for (int i = 0; i < 4; i++)
        notes[i] = (struct note){.log = &log, .number = i + 1};
    assert_true(add(pool, &notes[0], 0, false));
    assert_false(add(pool, &notes[1], 0, false));
    assert_true(add(pool, &notes[2], 0, true)); // these have room of their own
    assert_true(add(pool, &notes[3], 0, true));
    assert_false(add(pool, &notes[1], 0, true));
    sem_post(&first.go);
    while (!atomic_load(&notes[0].done))
        sched_yield();
    while (!add(pool, &notes[1], 0, false))
        sched_yield();
    task_pool_drain(pool);
    assert_log(&log, 5, (int[]){0, 3, 4, 1, 2});
    assert_int_equal(notes[1].done, 1);
    assert_int_equal(notes[1].undone, 0);
    task_pool_destroy(&pool);
}

// ---- again --------------------------------------------------------------------------------------

static void a_task_that_asks_for_it_runs_again_before_those_of_its_key(void **state) {
    (void)state;
    struct log log = LOG_INIT;
    struct task_pool *pool = pool_of(2, 8);
    struct note first = {.log = &log, .number = 1, .again = 2, .again_ns = NS_PER_MS};
    struct note second = {.log = &log, .number = 2};
    assert_true(add(pool, &first, 9, false));
    assert_true(add(pool, &second, 9, false));
    while (!atomic_load(&second.done))
        sched_yield();
    task_pool_stop(pool);
    assert_log(&log, 4, (int[]){1, 1, 1, 2});
    assert_int_equal(first.done, 1);
    assert_int_equal(first.undone, 0);
    task_pool_destroy(&pool);
}

// The thread that asked for it may be kept by another task; the other one slept before.
static void a_task_runs_again_though_the_thread_that_ran_it_has_more_to_do(void **state) {
    (void)state;
    struct log log = LOG_INIT;
    for (int i = 0; i < 20; i++) {
        struct task_pool *pool = pool_of(2, 8);
        struct note again = {.log = &log, .again = 1, .again_ns = NS_PER_MS};
        struct blocker other;
        log.count = 0;
        assert_true(add(pool, &again, 0, false));
        block(pool, &other, &log, 1);
        while (atomic_load(&again.runs) < 2)
            sched_yield();
        sem_post(&other.go);
        task_pool_destroy(&pool);
        assert_int_equal(other.note.done + other.note.undone, 1);
    }
}

// ---- the end ------------------------------------------------------------------------------------

static void draining_runs_each_waiting_task_once_and_no_later(void **state) {
    (void)state;
    struct log log = LOG_INIT;
    struct task_pool *pool = pool_of(1, 8);
    struct note hourly = {.log = &log, .number = 1, .again = 100, .again_ns = 3600 * NS_PER_S};
    struct note behind = {.log = &log, .number = 2};
    assert_true(add(pool, &hourly, 3, false));
    assert_true(add(pool, &behind, 3, false));
    while (!atomic_load(&hourly.runs))
        sched_yield();
    task_pool_drain(pool);
    assert_in_range(hourly.runs, 1, 2); // 1 where it ran when draining began
    assert_int_equal(hourly.undone, 1);
    assert_int_equal(hourly.done, 0);
    assert_int_equal(behind.done, 1);
    assert_false(add(pool, &behind, 0, false));
    task_pool_destroy(&pool);
    assert_int_equal(behind.done + behind.undone, 1);
}

struct stopper {
    struct task_pool *pool;
    atomic_bool stopped;
};

static void *stop(void *argument) {
    struct stopper *stopper = argument;
    task_pool_stop(stopper->pool);
    atomic_store(&stopper->stopped, true);
    return NULL;
}

static void stopping_waits_for_what_runs_and_finishes_the_rest_undone(void **state) {
    (void)state;
    struct log log = LOG_INIT;
    struct task_pool *pool = pool_of(1, 100000); // more than are added below
    struct stopper stopper = {.pool = pool};
    struct blocker first;
    struct note notes[2], late;
    pthread_t thread;
    block(pool, &first, &log, 0);
    for (int i = 0; i < 2; i++) {
        notes[i] = (struct note){.log = &log, .number = i + 1};
        assert_true(add(pool, &notes[i], 0, i == 1));
    }
    assert_int_equal(pthread_create(&thread, NULL, stop, &stopper), 0);
    late = (struct note){.log = &log, .number = 9};
    int taken = 0;
    for (; add(pool, &late, 0, false); taken++) // until it takes no more
        usleep(100);
    assert_false(atomic_load(&stopper.stopped));
    sem_post(&first.go);
    pthread_join(thread, NULL);
    assert_log(&log, 1, (int[]){0});
    assert_int_equal(first.note.done, 1);
    for (int i = 0; i < 2; i++) {
        assert_int_equal(notes[i].done, 0);
        assert_int_equal(notes[i].undone, 1);
    }
    assert_int_equal(late.undone, taken);
    task_pool_destroy(&pool);
}

// ---- threads ------------------------------------------------------------------------------------

struct look {
    int nice;
    sigset_t blocked;
};

static int64_t look_around(void *data) {
    struct look *look = data;
    look->nice = getpriority(PRIO_PROCESS, (id_t)gettid());
    pthread_sigmask(SIG_SETMASK, NULL, &look->blocked);
    return TASK_DONE;
}

static void threads_have_their_priority_and_take_no_signals(void **state) {
    (void)state;
    struct look look;
    int before = getpriority(PRIO_PROCESS, (id_t)gettid());
    struct task_pool *pool =
        task_pool_create(&(struct task_pool_settings){.threads = 1, .tasks_max = 1, .nice = 19});
    assert_true(task_pool_add(pool, &(struct pool_task){.run = look_around, .data = &look}));
    task_pool_drain(pool);
    task_pool_destroy(&pool);
    assert_int_equal(look.nice, 19);
    assert_true(sigismember(&look.blocked, SIGTERM) == 1);
    assert_true(sigismember(&look.blocked, SIGXFSZ) == 1);
    assert_int_equal(getpriority(PRIO_PROCESS, (id_t)gettid()), before);
    sigset_t mine;
    pthread_sigmask(SIG_SETMASK, NULL, &mine);
    assert_true(sigismember(&mine, SIGTERM) == 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_urgent_task_goes_before_the_others_and_these_go_in_order),
        cmocka_unit_test(an_urgent_task_waits_for_those_of_its_key),
        cmocka_unit_test(a_task_of_another_key_does_not_wait),
        cmocka_unit_test(tasks_of_a_key_run_in_order_and_never_at_the_same_time),
        cmocka_unit_test(a_full_pool_refuses_and_takes_again_when_a_task_is_done),
        cmocka_unit_test(a_task_that_asks_for_it_runs_again_before_those_of_its_key),
        cmocka_unit_test(a_task_runs_again_though_the_thread_that_ran_it_has_more_to_do),
        cmocka_unit_test(draining_runs_each_waiting_task_once_and_no_later),
        cmocka_unit_test(stopping_waits_for_what_runs_and_finishes_the_rest_undone),
        cmocka_unit_test(threads_have_their_priority_and_take_no_signals),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
