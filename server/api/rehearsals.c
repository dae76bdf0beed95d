#include "api/rehearsals.h"

#include "base/check.h"
#include "base/log.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#define KEPT 16

struct entry {
    bool used; // it is known, there or not
    int task, knee_case;
    uint8_t *batch; // NULL: there is none
    size_t size;
};

struct rehearsals {
    const struct api_config *config;
    pthread_mutex_t lock; // of what follows; not held while one is computed
    bool computing;
    int next; // the entry to be replaced
    struct entry entries[KEPT];
};

struct rehearsals *rehearsals_create(const struct api_config *config) {
    struct rehearsals *r = alloc(1, sizeof *r);
    r->config = config;
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
static const struct entry *find(const struct rehearsals *r, int task, int knee_case) {
    for (int i = 0; i < KEPT; i++)
        if (r->entries[i].used && r->entries[i].task == task &&
            r->entries[i].knee_case == knee_case)
            return &r->entries[i];
    return NULL;
}

static struct entry compute(const struct rehearsals *r, int task, int knee_case) {
    const struct api_config *config = r->config;
    struct entry made = {.task = task, .knee_case = knee_case};
    struct error err = {""};
    enum result result =
        config->rehearse(config->user, task, knee_case, &made.batch, &made.size, &err);
    made.used = result == RESULT_OK || result == RESULT_MISSING; // what else failed may pass
    if (result != RESULT_OK) {
        made.batch = NULL;
        log_info("api", "no expert's hands at the task %s on the case %s: %s",
                 config->tasks[task].name, config->cases[knee_case].name, err.text);
    }
    return made;
}

// With the lock, which is left meanwhile.
static const struct entry *make(struct rehearsals *r, int task, int knee_case) {
    r->computing = true;
    pthread_mutex_unlock(&r->lock);
    struct entry made = compute(r, task, knee_case);
    pthread_mutex_lock(&r->lock);
    r->computing = false;
    struct entry *place = &r->entries[r->next++ % KEPT];
    free(place->batch);
    *place = made;
    return place;
}

enum result rehearsals_take(struct rehearsals *r, int task, int knee_case, uint8_t **out_batch,
                            size_t *out_size) {
    enum result result = RESULT_MISSING;
    pthread_mutex_lock(&r->lock);
    const struct entry *entry = find(r, task, knee_case);
    if (!entry && r->computing)
        result = RESULT_TIMEOUT;
    else if (!entry)
        entry = make(r, task, knee_case);
    if (entry && entry->batch) {
        *out_batch = alloc(1, entry->size);
        memcpy(*out_batch, entry->batch, entry->size);
        *out_size = entry->size;
        result = RESULT_OK;
    }
    pthread_mutex_unlock(&r->lock);
    return result;
}
