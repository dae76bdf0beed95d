#include "link/marker_queue.h"

void marker_queue_init(struct marker_queue *q) {
    *q = (struct marker_queue){0};
    pthread_mutex_init(&q->lock, NULL);
}

void marker_queue_fini(struct marker_queue *q) {
    pthread_mutex_destroy(&q->lock);
}

bool marker_queue_put(struct marker_queue *q, const struct marker *marker) {
    pthread_mutex_lock(&q->lock);
    uint64_t number = ++q->number;
    bool room = q->last - q->first < MARKERS_QUEUED && !q->refused;
    if (room) {
        struct marker *kept = &q->waiting[q->last++ % MARKERS_QUEUED];
        *kept = *marker;
        kept->number = number;
    }
    pthread_mutex_unlock(&q->lock);
    return room;
}

void marker_queue_begin(struct marker_queue *q) {
    pthread_mutex_lock(&q->lock);
    q->next = q->first;
    q->refused = false;
    pthread_mutex_unlock(&q->lock);
}

size_t marker_queue_refuse(struct marker_queue *q) {
    pthread_mutex_lock(&q->lock);
    size_t waited = (size_t)(q->last - q->first);
    q->first = q->next = q->last;
    q->refused = true;
    pthread_mutex_unlock(&q->lock);
    return waited;
}

bool marker_queue_next(struct marker_queue *q, struct marker *out) {
    pthread_mutex_lock(&q->lock);
    bool goes = q->next < q->last && q->next - q->first < MARKERS_ON_WAY;
    if (goes)
        *out = q->waiting[q->next++ % MARKERS_QUEUED];
    pthread_mutex_unlock(&q->lock);
    return goes;
}

void marker_queue_acknowledge(struct marker_queue *q, uint64_t number) {
    pthread_mutex_lock(&q->lock);
    while (q->first < q->next && q->waiting[q->first % MARKERS_QUEUED].number <= number)
        q->first++;
    pthread_mutex_unlock(&q->lock);
}
