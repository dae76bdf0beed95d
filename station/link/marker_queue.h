// Markers on their way to the server. They wait here until the server has acknowledged them, over
// any number of connections. From any thread; the lock is held for copies only.
#pragma once

#include "base/marker.h"

#include <pthread.h>
#include <stddef.h>

#define MARKERS_QUEUED 1024
#define MARKERS_ON_WAY 32 // at most so many are sent and not acknowledged

struct marker_queue {
    pthread_mutex_t lock;
    uint64_t number;            // of the last marker
    uint64_t first, next, last; // positions: not acknowledged, to be sent next, behind the newest
    bool refused;               // the server takes none
    struct marker waiting[MARKERS_QUEUED]; // by position % MARKERS_QUEUED
};

void marker_queue_init(struct marker_queue *queue);
void marker_queue_fini(struct marker_queue *queue);

// Numbers it, and takes it if there is room. False: it is lost.
bool marker_queue_put(struct marker_queue *queue, const struct marker *marker);

// A session of a server begins to take them, from the oldest on.
void marker_queue_begin(struct marker_queue *queue);
// A server takes none: those that wait are lost, and so are all until marker_queue_begin. Returns
// how many waited.
size_t marker_queue_refuse(struct marker_queue *queue);

// The next one to send. False: there is none, or so many are on their way.
bool marker_queue_next(struct marker_queue *queue, struct marker *out_marker);

// The server has all up to this number.
void marker_queue_acknowledge(struct marker_queue *queue, uint64_t number);
