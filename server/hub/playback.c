#include "hub/playback.h"

#include "base/check.h"
#include "base/clock.h"
#include "hub/film.h"

#include <errno.h>
#include <sched.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PARCEL_SIZE 16384          // so that a batch always has room for the next one, chunks apart
#define WAITING_MAX (size_t)524288 // bytes that wait for the page
#define PARCELS_MAX 1024
#define PATIENCE_MS 30000

struct playback {
    atomic_int references;
    struct audience *audience;
    struct guest guest;
    arthron_Watch watch;
    atomic_bool left, ended, others_wait;
    struct ring *parcels; // of struct parcel *, to the thread of the pages
    struct parcel *next;  // that thread's: taken, and not put in a batch yet
    atomic_size_t waiting;
    sem_t taken; // posted where the page took something
    // The thread's own; before it starts, the usher's.
    pthread_t thread;
    sem_t *bell;
    arthron_Live item;
    arthron_MeshChunk chunk;
    uint8_t bytes[LIVE_ITEM_MAX];
    struct batch batch;
    bool last;
};

// ---- references ---------------------------------------------------------------------------------

struct playback *playback_create(struct audience *audience, const struct viewer *viewer) {
    struct playback *p = alloc(1, sizeof *p);
    atomic_init(&p->references, 1);
    p->audience = audience;
    p->guest = viewer->guest;
    p->watch = viewer->watch;
    p->parcels = ring_create(PARCELS_MAX, sizeof(struct parcel *));
    p->batch = (struct batch){p->bytes, sizeof p->bytes, 0, false};
    sem_init(&p->taken, 0, 0);
    return p;
}

struct playback *playback_hold(struct playback *p) {
    atomic_fetch_add(&p->references, 1);
    return p;
}

void playback_release(struct playback **playback) {
    struct playback *p = *playback;
    *playback = NULL;
    if (atomic_fetch_sub(&p->references, 1) > 1)
        return;
    struct parcel *parcel;
    while (ring_pop(p->parcels, &parcel))
        free(parcel);
    free(p->next);
    ring_destroy(&p->parcels);
    sem_destroy(&p->taken);
    free(p);
}

void playback_leave(struct playback **playback) {
    atomic_store(&(*playback)->left, true);
    sem_post(&(*playback)->taken);
    playback_release(playback);
}

bool playback_is_left(const struct playback *p) {
    return atomic_load(&p->left);
}

bool playback_has_ended(const struct playback *p) {
    return atomic_load(&p->ended);
}

void playback_others_wait(struct playback *p, bool wait) {
    atomic_store(&p->others_wait, wait);
}

// ---- to the page --------------------------------------------------------------------------------

void playback_batch(struct playback *p, struct batch *batch) {
    while (p->next || ring_pop(p->parcels, &p->next)) {
        if (!batch_put(batch, p->next->bytes, p->next->size))
            return;
        atomic_fetch_sub(&p->waiting, p->next->size);
        free(p->next);
        p->next = NULL;
        sem_post(&p->taken);
    }
}

// False where the page has gone, or keeps others waiting.
static bool wait_for_page(struct playback *p, size_t size) {
    int patience_ms = p->audience->config.patience_ms;
    int64_t begin_ns = clock_now_ns();
    int64_t patience_ns = (patience_ms ? patience_ms : PATIENCE_MS) * NS_PER_MS;
    size_t before = atomic_load(&p->waiting);
    while (!p->last && !atomic_load(&p->left) && atomic_load(&p->waiting) + size > WAITING_MAX) {
        struct timespec until;
        clock_gettime(CLOCK_REALTIME, &until);
        until.tv_sec++;
        sem_timedwait(&p->taken, &until);
        if (atomic_load(&p->waiting) != before)
            begin_ns = clock_now_ns();
        before = atomic_load(&p->waiting);
        if (atomic_load(&p->others_wait) && clock_now_ns() - begin_ns > patience_ns)
            return false;
    }
    return !atomic_load(&p->left);
}

static bool send(struct playback *p) {
    if (!p->batch.used)
        return true;
    if (!wait_for_page(p, p->batch.used))
        return false;
    struct parcel *parcel = alloc(1, sizeof *parcel + p->batch.used);
    parcel->size = p->batch.used;
    memcpy(parcel->bytes, p->bytes, p->batch.used);
    p->batch.used = 0;
    atomic_fetch_add(&p->waiting, parcel->size);
    while (!ring_push(p->parcels, &parcel)) {
        if (atomic_load(&p->left)) {
            free(parcel);
            return false;
        }
        sched_yield();
    }
    hub_ring(p->audience->hub);
    return true;
}

static bool say(void *user, const arthron_Live *item) {
    struct playback *p = user;
    if (!batch_say(&p->batch, item) && (!send(p) || !batch_say(&p->batch, item)))
        return false;
    bool is_progress = item->which_message == arthron_Live_progress_tag;
    if (is_progress || p->batch.used >= PARCEL_SIZE)
        return send(p);
    return !atomic_load(&p->left);
}

static bool say_mesh(void *user, const struct mesh_payload *payload) {
    struct playback *p = user;
    for (uint32_t i = 0; i < chunk_count(payload); i++) {
        if (!send(p) || !chunk_say(payload, i, &p->chunk, &p->batch))
            return false;
    }
    return send(p);
}

void playback_tell(struct playback *p, arthron_Trouble_Kind kind, const char *trouble) {
    p->item = (arthron_Live){.which_message = arthron_Live_trouble_tag};
    p->item.message.trouble.kind = kind;
    snprintf(p->item.message.trouble.text, sizeof p->item.message.trouble.text, "%.255s", trouble);
    if (say(p, &p->item))
        send(p);
}

void playback_fail(struct playback *p, arthron_Trouble_Kind kind, const char *why) {
    playback_tell(p, kind, why);
    p->item = (arthron_Live){.which_message = arthron_Live_progress_tag};
    p->item.message.progress.done = true;
    say(p, &p->item);
}

// ---- the thread ---------------------------------------------------------------------------------

static enum result play(struct playback *p, struct error *err) {
    const struct audience_config *config = &p->audience->config;
    if (!config->allowed || !config->allowed(config->user, &p->guest, p->watch.session))
        return fail(err, RESULT_REFUSED, "there is no session %s that you may see",
                    p->watch.session);
    struct film_screen screen = {p, say, say_mesh, &p->item};
    return film_show(p->audience->hub, &p->watch, &screen, err);
}

// The last word needs no room.
static void give_up(struct playback *p) {
    p->batch.used = 0;
    p->last = true;
    playback_fail(p, arthron_Trouble_Kind_FAILED,
                  "this page took nothing for long, and others wait: open it again");
}

static void *run(void *argument) {
    struct playback *p = argument;
    struct sched_param none = {0};
    struct error err;
    sched_setscheduler(0, SCHED_IDLE, &none);
    enum result result = play(p, &err);
    if (result == RESULT_REFUSED)
        playback_fail(p, arthron_Trouble_Kind_NOT_THERE, err.text);
    else if (result != RESULT_OK && result != RESULT_CLOSED)
        playback_fail(p, arthron_Trouble_Kind_FAILED, error_without_folder(err.text));
    else if (result == RESULT_OK)
        send(p);
    else
        give_up(p);
    atomic_store(&p->ended, true);
    sem_post(p->bell);
    return NULL;
}

void playback_start(struct playback *p, sem_t *bell) {
    p->bell = bell;
    CHECK(pthread_create(&p->thread, NULL, run, p) == 0);
}

void playback_join(struct playback *p) {
    pthread_join(p->thread, NULL);
}
