// Threads that run tasks from a bounded queue, so that the thread that adds a task never waits for
// it.
//
// Order. A free thread takes the oldest urgent task, or else the oldest task. Tasks of one key
// never run at the same time, and run in the order in which they were added: an urgent one too
// waits for those of its key. Tasks without a key run as soon as a thread is free.
//
// Ownership. The pool copies a struct pool_task and never looks at its `data`. Each task that was taken
// ends with exactly one call of `finish`, before the next task of its key runs: release `data`
// there.
//
// Threads. Any thread may add, a task of the pool too. One thread, and no task of the pool, stops,
// drains and destroys. Only task_pool_create allocates. The pool's threads block all signals.
#pragma once

#include <stdbool.h>
#include <stdint.h>

#define TASK_DONE 0

struct pool_task {
    uint64_t key; // 0: none
    bool urgent;
    // On a thread of the pool: does the work. Returns TASK_DONE, or after how many nanoseconds
    // (more than 0) to run it again; tasks of its key wait until then too.
    int64_t (*run)(void *data);
    // On a thread of the pool, or on the thread that stops it. `done`: whether `run` returned
    // TASK_DONE; false where the pool stopped before. NULL: nothing to do.
    void (*finish)(void *data, bool done);
    void *data;
};

struct task_pool_settings {
    int threads;    // at least 1
    int tasks_max;  // tasks at a time, from being added until finished; without urgent ones
    int urgent_max; // the same for urgent ones
    int nice;       // of the threads, as in setpriority: 0 as the process, 19 the lowest priority
};

struct task_pool;

struct task_pool *task_pool_create(const struct task_pool_settings *settings);

// False where the pool is full, stopped or draining: the task remains the caller's, and `finish` is
// not called.
bool task_pool_add(struct task_pool *pool, const struct pool_task *task);

// Waits for the tasks that run, and finishes all others undone, in the order in which they were
// added. Does nothing where the pool was stopped or drained before.
void task_pool_stop(struct task_pool *pool);

// Takes no more tasks, waits for those that run, runs each that waits once without a delay, and
// stops: a task that asks to be run again is finished undone.
void task_pool_drain(struct task_pool *pool);

// Stops the pool unless it was. NULL inside is fine; *pool becomes NULL.
void task_pool_destroy(struct task_pool **pool);
