#include "live/blindness.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/task_pool.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define RENEW_NS (2 * NS_PER_S)

struct reading {
    int count;
    bool too_many;
    struct blind_pair pairs[BLIND_PAIRS_MAX];
};

static void take_pair(void *user, const char *account, const char *trainee) {
    struct reading *r = user;
    r->too_many = r->count == BLIND_PAIRS_MAX;
    if (r->too_many)
        return;
    struct blind_pair *pair = &r->pairs[r->count++];
    snprintf(pair->account, sizeof pair->account, "%s", account);
    snprintf(pair->trainee, sizeof pair->trainee, "%s", trainee);
}

static void read_pairs(struct blindness *b) {
    struct reading *r = alloc(1, sizeof *r);
    bool known = b->each(b->user, take_pair, r) && !r->too_many;
    if (r->too_many)
        log_error("live", "more than %d raters of exams that go on: pages may name their trainees",
                  BLIND_PAIRS_MAX);
    pthread_mutex_lock(&b->mutex);
    if (known) {
        b->known = true;
        b->count = r->count;
        memcpy(b->pairs, r->pairs, (size_t)r->count * sizeof *r->pairs);
    }
    b->read_ns = clock_now_ns();
    b->reading = false;
    pthread_mutex_unlock(&b->mutex);
    free(r);
}

static int64_t run_blindness(void *blindness) {
    read_pairs(blindness);
    return TASK_DONE;
}

void blindness_init(struct blindness *b, each_blind *each, void *user) {
    b->each = each;
    b->user = user;
    pthread_mutex_init(&b->mutex, NULL);
    if (each)
        read_pairs(b);
}

void blindness_fini(struct blindness *b) {
    pthread_mutex_destroy(&b->mutex);
}

void blindness_renew(struct blindness *b, struct task_pool *pool, int64_t now_ns) {
    if (!b->each)
        return;
    pthread_mutex_lock(&b->mutex);
    bool due = !b->reading && now_ns - b->read_ns > RENEW_NS;
    b->reading = b->reading || due;
    pthread_mutex_unlock(&b->mutex);
    if (!due || task_pool_add(pool, &(struct pool_task){.run = run_blindness, .data = b}))
        return;
    pthread_mutex_lock(&b->mutex);
    b->reading = false;
    pthread_mutex_unlock(&b->mutex);
}

bool is_blind_to(struct blindness *b, const char *account, const char *trainee) {
    if (!b->each || !trainee[0])
        return false;
    pthread_mutex_lock(&b->mutex);
    bool blind = !b->known;
    for (int i = 0; i < b->count && !blind; i++)
        blind = !strcmp(b->pairs[i].account, account) && !strcmp(b->pairs[i].trainee, trainee);
    pthread_mutex_unlock(&b->mutex);
    return blind;
}
