#include "check/parallel.h"

#include <pthread.h>
#include <stdatomic.h>
#include <unistd.h>

#define THREADS_MAX 64

struct share {
    atomic_int next;
    int count;
    parallel_work *work;
    void *context;
    const struct progress *progress;
    pthread_mutex_t lock; // of `done`
    int done;
};

static void tell_done(struct share *share) {
    if (!share->progress)
        return;
    pthread_mutex_lock(&share->lock);
    share->progress->tell(share->progress->context, (double)++share->done / share->count);
    pthread_mutex_unlock(&share->lock);
}

static void *take_share(void *argument) {
    struct share *share = argument;
    for (int i; (i = atomic_fetch_add(&share->next, 1)) < share->count;) {
        share->work(share->context, i);
        tell_done(share);
    }
    return NULL;
}

void parallel_for(int count, parallel_work *work, void *context, const struct progress *progress) {
    struct share share = {.count = count,
                          .work = work,
                          .context = context,
                          .progress = progress,
                          .lock = PTHREAD_MUTEX_INITIALIZER};
    long cores = sysconf(_SC_NPROCESSORS_ONLN);
    pthread_t threads[THREADS_MAX];
    int started = 0;
    // A thread that cannot be had leaves its share to the others.
    while (started < THREADS_MAX && started + 1 < cores && started + 1 < count &&
           pthread_create(&threads[started], NULL, take_share, &share) == 0)
        started++;
    take_share(&share);
    for (int i = 0; i < started; i++)
        pthread_join(threads[i], NULL);
}
