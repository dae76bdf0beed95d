// Threads in virtual time: each thread of the programs under test is a coroutine here, and one real
// thread runs them all. A thread runs until it waits; who runs next, and how late it wakes, follows
// from the seed. Time passes only while all wait. The functions of pthread, semaphores and clocks
// that the rooms call are wrapped at link time (wraps.cmake).
#pragma once

#include "random.h"

#include <stdbool.h>
#include <stdint.h>

struct sim_process {
    const char *name;
    int index;            // SIM_SERVER, or of the station
    int64_t ahead_ns;     // of its monotonic clock, beside the drift
    int64_t drift_ppm;    // of its clocks
    int64_t utc_ahead_ns; // of its time of day
    bool dead;            // killed: nothing that it still does is seen by anybody
    int64_t incarnation;  // counts its starts
};

#define SIM_SERVER (-1)
#define SIM_BEGIN_NS INT64_C(1000000000000) // true time at the start of a run

struct sim_thread;

void threads_begin(uint64_t seed);
void threads_end(void); // all have ended

int64_t sim_now_ns(void);        // true time
struct random *sim_random(void); // of the schedule

// The thread that runs; NULL outside of all.
struct sim_thread *sim_running(void);
struct sim_process *sim_process(void); // its process; NULL outside of all
bool sim_is_dead(void);                // it was killed

struct sim_thread *sim_start(struct sim_process *process, void *(*run)(void *), void *argument);
bool sim_is_done(const struct sim_thread *thread);
void sim_forget(struct sim_thread **thread); // that is done

// Waits for `on`; until_ns is true time, INT64_MAX: for ever. False where the time was over.
bool sim_wait(const void *on, int64_t until_ns);
void sim_wake(const void *on); // all that wait
void sim_wake_one(const void *on);
void sim_sleep(int64_t ns);

// An event of the world: no thread's.
void sim_at(int64_t at_ns, void (*run)(void *user), void *user);

// Runs all threads and events up to a time.
void sim_run_until(int64_t until_ns);
// Lets what is on its way arrive; no thread is left.
void sim_finish_events(void);
// Runs the threads of a dead process alone, until `thread` is done. Nobody else's time passes.
void sim_run_dead(struct sim_process *process, struct sim_thread *thread);

// What a process's monotonic clock shows at a true time, and back.
int64_t sim_local_ns(const struct sim_process *process, int64_t true_ns);
int64_t sim_true_ns(const struct sim_process *process, int64_t local_ns);

// A thread was not run for a while, as on a busy machine: how often, and the longest.
struct sim_stalls {
    bool on;
    uint64_t count;
    int64_t last_ns; // when
};
extern struct sim_stalls sim_stalls;
