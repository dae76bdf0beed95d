#include "api/rehearsals.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "store/store.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define KEPT 16

// Of what the server computes for one person.
static const struct throttle_rule of_actor = {8, 10, 120};

struct entry {
    bool used; // it is known, there or not
    struct rehearsal_wish wish;
    uint8_t *batch; // NULL: there is none
    size_t size;
};

struct rehearsals {
    const struct api_config *config;
    struct throttle *throttle;
    pthread_mutex_t lock; // of what follows; not held while one is computed
    bool computing;
    int next; // the entry to be replaced
    struct entry entries[KEPT];
};

struct rehearsals *rehearsals_create(const struct api_config *config, struct throttle *throttle) {
    struct rehearsals *r = alloc(1, sizeof *r);
    r->config = config;
    r->throttle = throttle;
    pthread_mutex_init(&r->lock, NULL);
    return r;
}

void rehearsals_destroy(struct rehearsals **rehearsals) {
    struct rehearsals *r = *rehearsals;
    if (!r)
        return;
    for (int i = 0; i < KEPT; i++)
        free(r->entries[i].batch);
    pthread_mutex_destroy(&r->lock);
    free(r);
    *rehearsals = NULL;
}

// With the lock. NULL: not known yet.
static const struct entry *find_rehearsal(const struct rehearsals *r,
                                          const struct rehearsal_wish *wish) {
    for (int i = 0; i < KEPT; i++) {
        const struct rehearsal_wish *w = &r->entries[i].wish;
        if (r->entries[i].used && w->task == wish->task && w->knee_case == wish->knee_case &&
            w->case_hash == wish->case_hash)
            return &r->entries[i];
    }
    return NULL;
}

static struct entry compute(const struct rehearsals *r, const struct rehearsal_wish *wish) {
    const struct api_config *config = r->config;
    struct entry made = {.wish = *wish};
    struct error err = {""};
    enum result result =
        config->rehearse(config->user, wish->task, wish->knee_case, &made.batch, &made.size, &err);
    made.used = result == RESULT_OK || result == RESULT_MISSING; // what else failed may pass
    if (result != RESULT_OK) {
        made.batch = NULL;
        log_info("api", "no expert's hands at the task %s on the case %s: %s",
                 config->tasks[wish->task].name, config->cases[wish->knee_case].name, err.text);
    }
    return made;
}

// With the lock, which is left meanwhile. NULL: it failed, and may work another time.
static const struct entry *make(struct rehearsals *r, const struct rehearsal_wish *wish) {
    r->computing = true;
    pthread_mutex_unlock(&r->lock);
    struct entry made = compute(r, wish);
    pthread_mutex_lock(&r->lock);
    r->computing = false;
    if (!made.used)
        return NULL;
    struct entry *place = &r->entries[r->next++ % KEPT];
    free(place->batch);
    *place = made;
    return place;
}

static bool may_make(struct rehearsals *r, const char *actor, int *out_wait_s) {
    char who[STORE_NAME_MAX + 16];
    snprintf(who, sizeof who, "rehearse %s", actor);
    return throttle_try(r->throttle, who, &of_actor, clock_now_ns(), out_wait_s);
}

enum result rehearsals_take(struct rehearsals *r, const struct rehearsal_wish *wish,
                            const char *actor, uint8_t **out_batch, size_t *out_size,
                            int *out_wait_s) {
    enum result result = RESULT_MISSING;
    pthread_mutex_lock(&r->lock);
    const struct entry *entry = find_rehearsal(r, wish);
    if (!entry && r->computing)
        result = RESULT_TIMEOUT;
    else if (!entry && !may_make(r, actor, out_wait_s))
        result = RESULT_LIMIT;
    else if (!entry)
        entry = make(r, wish);
    if (entry && entry->batch) {
        *out_batch = alloc(1, entry->size);
        memcpy(*out_batch, entry->batch, entry->size);
        *out_size = entry->size;
        result = RESULT_OK;
    }
    pthread_mutex_unlock(&r->lock);
    return result;
}
