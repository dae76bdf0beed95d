// How long things took, counted in buckets whose bounds double. Any threads add without waiting.
#pragma once

#include <stdatomic.h>
#include <stdint.h>

#define LATENCY_BOUNDS 23                    // 1 µs to 4.2 s
#define LATENCY_BUCKETS (LATENCY_BOUNDS + 1) // the last one has no bound

struct latency {
    atomic_uint_fast64_t counts[LATENCY_BUCKETS];
    atomic_uint_fast64_t sum_ns;
};

// As it was at some moment, perhaps of several.
struct latency_figures {
    uint64_t counts[LATENCY_BUCKETS], sum_ns;
};

static inline int64_t latency_bound_ns(int bucket) {
    return INT64_C(1000) << bucket;
}

static inline int latency_bucket(int64_t ns) {
    uint64_t us = ns > 0 ? (uint64_t)(ns - 1) / 1000 : 0;
    int bucket = us ? 64 - __builtin_clzll(us) : 0;
    return bucket < LATENCY_BOUNDS ? bucket : LATENCY_BOUNDS;
}

static inline void latency_add(struct latency *latency, int64_t ns) {
    atomic_fetch_add_explicit(&latency->counts[latency_bucket(ns)], 1, memory_order_relaxed);
    atomic_fetch_add_explicit(&latency->sum_ns, ns > 0 ? (uint64_t)ns : 0, memory_order_relaxed);
}

static inline void latency_gather(const struct latency *latency, struct latency_figures *sum) {
    for (int i = 0; i < LATENCY_BUCKETS; i++)
        sum->counts[i] += atomic_load_explicit(&latency->counts[i], memory_order_relaxed);
    sum->sum_ns += atomic_load_explicit(&latency->sum_ns, memory_order_relaxed);
}
