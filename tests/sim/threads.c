#include "sim/threads.h"

#include "base/check.h"
#include "base/clock.h"
#include "sim/report.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <ucontext.h>

#define STACK_SIZE ((size_t)1 << 20)
#define STACKS_KEPT 64
#define TURNS_MAX 2000000 // without time passing: nobody gets on
#define STALL_NS (12 * NS_PER_MS)

enum thread_state { THREAD_READY, THREAD_WAITS, THREAD_DONE };

struct sim_thread {
    struct sim_thread *next;
    struct sim_process *process;
    ucontext_t context;
    void *stack;
    void *(*run)(void *);
    void *argument;
    enum thread_state state;
    int64_t when_ns; // ready: not before; waits: until
    const void *on;
    bool woken;
};

struct event {
    int64_t at_ns;
    uint64_t order;
    void (*run)(void *user);
    void *user;
};

static struct {
    int64_t now_ns;
    struct random random;
    struct sim_thread *threads, *running;
    struct sim_process *alone; // only this one's threads run
    ucontext_t scheduler;
    struct event *events; // a heap
    size_t event_count, event_room;
    uint64_t event_order, turns;
    int64_t turned_ns;
    void *stacks[STACKS_KEPT];
    int stack_count;
} sim;

struct sim_stalls sim_stalls;

// ---- time ---------------------------------------------------------------------------------------

int64_t sim_now_ns(void) {
    return sim.now_ns;
}

struct random *sim_random(void) {
    return &sim.random;
}

int64_t sim_local_ns(const struct sim_process *p, int64_t true_ns) {
    return true_ns + (int64_t)((__int128)true_ns * p->drift_ppm / 1000000) + p->ahead_ns;
}

int64_t sim_true_ns(const struct sim_process *p, int64_t local_ns) {
    return (int64_t)((__int128)(local_ns - p->ahead_ns) * 1000000 / (1000000 + p->drift_ppm)) + 1;
}

// How late a thread runs after it could.
static int64_t latency_ns(void) {
    uint64_t bits = random_bits(&sim.random);
    if (sim_stalls.on && !sim.alone && bits % 4096 == 0) {
        sim_stalls.count++;
        sim_stalls.last_ns = sim.now_ns;
        return (int64_t)(bits >> 16) % STALL_NS;
    }
    return 2000 + (int64_t)(bits >> 16) % 40000;
}

// ---- events -------------------------------------------------------------------------------------

static bool is_before(const struct event *a, const struct event *b) {
    return a->at_ns != b->at_ns ? a->at_ns < b->at_ns : a->order < b->order;
}

static void swap_events(size_t a, size_t b) {
    struct event kept = sim.events[a];
    sim.events[a] = sim.events[b];
    sim.events[b] = kept;
}

void sim_at(int64_t at_ns, void (*run)(void *user), void *user) {
    if (sim.event_count == sim.event_room) {
        sim.event_room = sim.event_room ? 2 * sim.event_room : 256;
        sim.events = alloc_resize(sim.events, sim.event_room, sizeof *sim.events);
    }
    size_t i = sim.event_count++;
    sim.events[i] = (struct event){at_ns, sim.event_order++, run, user};
    for (; i && is_before(&sim.events[i], &sim.events[(i - 1) / 2]); i = (i - 1) / 2)
        swap_events(i, (i - 1) / 2);
}

static struct event take_event(void) {
    struct event first = sim.events[0];
    sim.events[0] = sim.events[--sim.event_count];
    for (size_t i = 0, child; (child = 2 * i + 1) < sim.event_count; i = child) {
        if (child + 1 < sim.event_count && is_before(&sim.events[child + 1], &sim.events[child]))
            child++;
        if (!is_before(&sim.events[child], &sim.events[i]))
            break;
        swap_events(i, child);
    }
    return first;
}

// ---- threads ------------------------------------------------------------------------------------

struct sim_thread *sim_running(void) {
    return sim.running;
}

struct sim_process *sim_process(void) {
    return sim.running ? sim.running->process : NULL;
}

bool sim_is_dead(void) {
    return sim.running && sim.running->process->dead;
}

static void back_to_scheduler(void) {
    struct sim_thread *thread = sim.running;
    int kept = errno; // of this thread
    swapcontext(&thread->context, &sim.scheduler);
    errno = kept;
}

static void begin_thread(void) {
    struct sim_thread *thread = sim.running;
    thread->run(thread->argument);
    thread->state = THREAD_DONE;
    sim_wake(thread);
    back_to_scheduler();
}

static void *take_stack(void) {
    if (sim.stack_count)
        return sim.stacks[--sim.stack_count];
    void *stack = mmap(NULL, STACK_SIZE, PROT_READ | PROT_WRITE,
                       MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE | MAP_STACK, -1, 0);
    CHECK(stack != MAP_FAILED);
    mprotect(stack, 4096, PROT_NONE);
    return stack;
}

static void give_stack(void *stack) {
    if (sim.stack_count < STACKS_KEPT)
        sim.stacks[sim.stack_count++] = stack;
    else
        munmap(stack, STACK_SIZE);
}

struct sim_thread *sim_start(struct sim_process *process, void *(*run)(void *), void *argument) {
    struct sim_thread *thread = alloc(1, sizeof *thread);
    thread->process = process;
    thread->run = run;
    thread->argument = argument;
    thread->stack = take_stack();
    thread->state = THREAD_READY;
    thread->when_ns = sim.now_ns + latency_ns();
    getcontext(&thread->context);
    thread->context.uc_stack.ss_sp = thread->stack;
    thread->context.uc_stack.ss_size = STACK_SIZE;
    makecontext(&thread->context, begin_thread, 0);
    struct sim_thread **end = &sim.threads;
    while (*end)
        end = &(*end)->next;
    *end = thread;
    return thread;
}

bool sim_is_done(const struct sim_thread *thread) {
    return thread->state == THREAD_DONE;
}

void sim_forget(struct sim_thread **thread) {
    struct sim_thread **at = &sim.threads;
    CHECK(sim_is_done(*thread));
    while (*at != *thread)
        at = &(*at)->next;
    *at = (*thread)->next;
    give_stack((*thread)->stack);
    free(*thread);
    *thread = NULL;
}

bool sim_wait(const void *on, int64_t until_ns) {
    struct sim_thread *thread = sim.running;
    CHECK(thread);
    thread->on = on;
    thread->when_ns = until_ns;
    thread->woken = false;
    thread->state = THREAD_WAITS;
    back_to_scheduler();
    return thread->woken;
}

void sim_sleep(int64_t ns) {
    if (sim.running && ns > 0)
        sim_wait(&sim, sim.now_ns + ns);
}

static void make_ready(struct sim_thread *thread, bool woken) {
    thread->state = THREAD_READY;
    thread->woken = woken;
    thread->when_ns = sim.now_ns + latency_ns();
}

void sim_wake(const void *on) {
    for (struct sim_thread *t = sim.threads; t; t = t->next)
        if (t->state == THREAD_WAITS && t->on == on)
            make_ready(t, true);
}

void sim_wake_one(const void *on) {
    struct sim_thread *one = NULL;
    uint64_t count = 0;
    for (struct sim_thread *t = sim.threads; t; t = t->next)
        if (t->state == THREAD_WAITS && t->on == on && random_bits(&sim.random) % ++count == 0)
            one = t;
    if (one)
        make_ready(one, true);
}

// ---- the schedule -------------------------------------------------------------------------------

static bool may_run(const struct sim_thread *thread) {
    return sim.alone ? thread->process == sim.alone : true;
}

// One that can run now; else NULL and the time at which one can.
static struct sim_thread *next_thread(int64_t *out_next_ns) {
    struct sim_thread *one = NULL;
    uint64_t count = 0;
    *out_next_ns = INT64_MAX;
    for (struct sim_thread *t = sim.threads; t; t = t->next) {
        if (t->state == THREAD_DONE || !may_run(t))
            continue;
        if (t->state == THREAD_WAITS && t->when_ns <= sim.now_ns)
            make_ready(t, false);
        if (t->state == THREAD_READY && t->when_ns <= sim.now_ns) {
            if (count++ == 0 || random_bits(&sim.random) % count == 0)
                one = t;
        } else if (t->when_ns < *out_next_ns) {
            *out_next_ns = t->when_ns;
        }
    }
    return one;
}

static void run_thread(struct sim_thread *thread) {
    sim.running = thread;
    swapcontext(&sim.scheduler, &thread->context);
    sim.running = NULL;
    if (sim.turned_ns != sim.now_ns)
        sim.turns = 0;
    sim.turned_ns = sim.now_ns;
    if (++sim.turns > TURNS_MAX)
        broken("time goes on", "process %s works without end and without time passing",
               thread->process->name);
}

void sim_run_until(int64_t until_ns) {
    for (;;) {
        int64_t next_ns;
        struct sim_thread *thread = next_thread(&next_ns);
        if (thread) {
            run_thread(thread);
            continue;
        }
        bool has_event = sim.event_count && sim.events[0].at_ns <= next_ns;
        int64_t at_ns = has_event ? sim.events[0].at_ns : next_ns;
        if (at_ns > until_ns) {
            sim.now_ns = until_ns;
            return;
        }
        if (at_ns > sim.now_ns)
            sim.now_ns = at_ns;
        if (has_event) {
            struct event event = take_event();
            event.run(event.user);
        }
    }
}

void sim_finish_events(void) {
    while (sim.event_count) {
        struct event event = take_event();
        if (event.at_ns > sim.now_ns)
            sim.now_ns = event.at_ns;
        event.run(event.user);
    }
}

void sim_run_dead(struct sim_process *process, struct sim_thread *main_thread) {
    int64_t now_ns = sim.now_ns;
    sim.alone = process;
    while (!sim_is_done(main_thread)) {
        int64_t next_ns;
        struct sim_thread *thread = next_thread(&next_ns);
        if (thread)
            run_thread(thread);
        else if (next_ns == INT64_MAX)
            broken("a process ends when it is asked to", "%s does not: all its threads wait",
                   process->name);
        else
            sim.now_ns = next_ns;
    }
    sim.alone = NULL;
    sim.now_ns = now_ns;
}

void threads_begin(uint64_t seed) {
    sim.now_ns = SIM_BEGIN_NS;
    sim.random = (struct random){seed};
    sim.event_count = 0;
    sim.event_order = 0;
    sim_stalls = (struct sim_stalls){0};
}

void threads_end(void) {
    for (const struct sim_thread *t = sim.threads; t; t = t->next)
        broken("a process ends with its threads", "%s leaves one behind", t->process->name);
}
