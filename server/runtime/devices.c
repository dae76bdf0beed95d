#include "runtime/devices.h"

#include <string.h>

void devices_begin(struct device_watch *watch, struct device_counts counts[WIRE_DEVICES_MAX]) {
    memset(watch, 0, sizeof *watch);
    for (int i = 0; i < WIRE_DEVICES_MAX; i++) {
        atomic_store_explicit(&counts[i].samples, 0, memory_order_relaxed);
        atomic_store_explicit(&counts[i].dropouts, 0, memory_order_relaxed);
        atomic_store_explicit(&counts[i].lost, false, memory_order_relaxed);
    }
}

static void raise(atomic_uint_fast64_t *counter) {
    atomic_fetch_add_explicit(counter, 1, memory_order_relaxed);
}

void devices_step(struct device_watch *watch, const struct frame *frame,
                  struct device_counts counts[WIRE_DEVICES_MAX]) {
    bool fresh[WIRE_DEVICES_MAX] = {0}, there[WIRE_DEVICES_MAX] = {0},
         alive[WIRE_DEVICES_MAX] = {0};
    for (int i = 0; i < frame->count; i++) {
        const struct sample *s = &frame->samples[i];
        enum validity *before = &watch->validity[s->channel][s->kind];
        there[s->device] = true;
        alive[s->device] |= s->validity != VALIDITY_LOST;
        if (*before == VALIDITY_OK && s->validity == VALIDITY_HELD)
            raise(&counts[s->device].dropouts);
        *before = s->validity;
        if (s->validity == VALIDITY_OK && s->time_ns > watch->newest_ns[s->device]) {
            watch->newest_ns[s->device] = s->time_ns;
            fresh[s->device] = true;
        }
    }
    for (int i = 0; i < WIRE_DEVICES_MAX; i++) {
        if (fresh[i])
            raise(&counts[i].samples);
        if (there[i])
            atomic_store_explicit(&counts[i].lost, !alive[i], memory_order_relaxed);
    }
}
