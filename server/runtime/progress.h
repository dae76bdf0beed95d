// What a thread does, and that it goes on: written by the thread, read by the watchdog. Never
// waits.
#pragma once

#include <stdatomic.h>
#include <stddef.h>
#include <sys/types.h>

struct progress {
    atomic_int thread; // its id for the kernel; 0: it is not watched
    atomic_uint_fast64_t beats;
    _Atomic(const char *) doing; // a literal
    atomic_int station;          // index; -1: no station's
};

static inline void progress_note(struct progress *progress, const char *doing, int station) {
    atomic_store_explicit(&progress->doing, doing, memory_order_relaxed);
    atomic_store_explicit(&progress->station, station, memory_order_relaxed);
    atomic_fetch_add_explicit(&progress->beats, 1, memory_order_relaxed);
}

// By the thread: it has this name (at most 15 bytes) from now on, and is watched.
void progress_begin(struct progress *progress, const char *name, int index);
void progress_end(struct progress *progress);
