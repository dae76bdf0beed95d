#include "live/playback.h"

#include "base/check.h"
#include "base/clock.h"
#include "live/replay_stream.h"
#include "runtime/reply.h"

#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PARCEL_SIZE 16384          // so that a batch always has room for the next one, chunks apart
#define WAITING_MAX (size_t)524288 // bytes that wait for the page
#define PARCELS_MAX 1024
#define LAST_PARCELS 8 // places for the last words
#define PATIENCE_MS 10000
#define LEAST_TAKEN 65536 // bytes in that time

struct playback {
    atomic_int references;
    struct live_server *live;
    struct playback_turn turn; // of the server's list
    arthron_Watch watch;
    atomic_bool left, is_missing;
    struct ring *parcels; // of struct parcel *, to the thread of the pages
    struct parcel *next;  // that thread's: taken, and not put in a batch yet
    atomic_size_t waiting, parcels_waiting;
    char server[SERVER_NAME_SIZE]; // once it is missing: who has it, if that is known
    sem_t taken;                   // posted where the page took something
    // The thread's own; before it starts, the pages'.
    arthron_Live item;
    arthron_MeshChunk chunk;
    uint8_t bytes[LIVE_ITEM_MAX];
    struct live_batch batch;
    bool last;
    size_t sent; // bytes
    int64_t
        since_ns; // it has waited for the page since then, but for what this took; 0: it has not
    size_t taken_then; // bytes
};

// ---- references ---------------------------------------------------------------------------------

struct playback *playback_create(struct live_server *live, const struct viewer *viewer) {
    struct playback *p = alloc(1, sizeof *p);
    atomic_init(&p->references, 1);
    p->live = live;
    p->turn.account = viewer->account;
    p->watch = viewer->watch;
    p->parcels = ring_create(PARCELS_MAX, sizeof(struct parcel *));
    p->batch = (struct live_batch){p->bytes, sizeof p->bytes, 0, false};
    sem_init(&p->taken, 0, 0);
    return p;
}

static struct playback *hold(struct playback *p) {
    atomic_fetch_add(&p->references, 1);
    return p;
}

static void release(struct playback **playback) {
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
    struct playback *p = *playback, *waited = p;
    atomic_store(&p->left, true);
    sem_post(&p->taken);
    if (turns_leave(&p->live->turns, &p->turn))
        release(&waited);
    release(playback);
}

bool playback_is_missing(const struct playback *p, const char **out_server) {
    *out_server = p->server;
    return atomic_load(&p->is_missing);
}

// ---- to the page --------------------------------------------------------------------------------

void playback_batch(struct playback *p, struct live_batch *batch) {
    while (p->next || ring_pop(p->parcels, &p->next)) {
        if (!batch_put(batch, p->next->bytes, p->next->size))
            return;
        atomic_fetch_sub(&p->waiting, p->next->size);
        atomic_fetch_sub(&p->parcels_waiting, 1);
        free(p->next);
        p->next = NULL;
        sem_post(&p->taken);
    }
}

static bool has_room(const struct playback *p, size_t size) {
    return p->last || (atomic_load(&p->waiting) + size <= WAITING_MAX &&
                       atomic_load(&p->parcels_waiting) < PARCELS_MAX - LAST_PARCELS);
}

// Whether the page takes its share of a thread that others wait for. What a page takes is counted
// over the time in which there was always something for it.
static bool takes_enough(struct playback *p) {
    int patience_ms = p->live->config.patience_ms;
    int64_t patience_ns = (patience_ms ? patience_ms : PATIENCE_MS) * NS_PER_MS;
    int64_t now_ns = clock_now_ns();
    size_t taken = p->sent - atomic_load(&p->waiting);
    if (p->since_ns && now_ns - p->since_ns < patience_ns)
        return true;
    if (p->since_ns && taken - p->taken_then < LEAST_TAKEN)
        return !turns_want(&p->live->turns, &p->turn);
    p->since_ns = now_ns;
    p->taken_then = taken;
    return true;
}

// False where the page has gone, or keeps others waiting.
static bool wait_for_page(struct playback *p, size_t size) {
    if (atomic_load(&p->waiting) < WAITING_MAX / 2 && has_room(p, size))
        p->since_ns = 0;
    while (!atomic_load(&p->left) && !has_room(p, size)) {
        if (!takes_enough(p))
            return false;
        int64_t until_ns = clock_now_ns() + NS_PER_S;
        struct timespec until = {until_ns / NS_PER_S, until_ns % NS_PER_S};
        sem_clockwait(&p->taken, CLOCK_MONOTONIC, &until);
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
    p->sent += parcel->size;
    atomic_fetch_add(&p->waiting, parcel->size);
    atomic_fetch_add(&p->parcels_waiting, 1);
    bool pushed = ring_push(p->parcels, &parcel);
    CHECK(pushed);
    live_news(p->live);
    return true;
}

static bool say_item(void *user, const arthron_Live *item) {
    struct playback *p = user;
    if (!batch_say(&p->batch, item) && (!send(p) || !batch_say(&p->batch, item)))
        return false;
    bool is_progress = item->which_message == arthron_Live_progress_tag;
    if (is_progress || p->batch.used >= PARCEL_SIZE)
        return send(p);
    return !atomic_load(&p->left);
}

static bool say_payload(void *user, const struct mesh_payload *payload) {
    struct playback *p = user;
    for (uint32_t i = 0; i < chunk_count(payload); i++) {
        if (!send(p) || !chunk_say(payload, i, &p->chunk, &p->batch))
            return false;
    }
    return send(p);
}

static void tell(struct playback *p, arthron_Trouble_Kind kind, arthron_Why_Code code,
                 const char *trouble) {
    p->item = (arthron_Live){.which_message = arthron_Live_trouble_tag};
    p->item.message.trouble.kind = kind;
    p->item.message.trouble.has_why = true;
    reply_why(code, NULL, &p->item.message.trouble.why);
    snprintf(p->item.message.trouble.text, sizeof p->item.message.trouble.text, "%.255s", trouble);
    if (say_item(p, &p->item))
        send(p);
}

static void fail_with(struct playback *p, arthron_Trouble_Kind kind, arthron_Why_Code code,
                      const char *why) {
    tell(p, kind, code, why);
    p->item = (arthron_Live){.which_message = arthron_Live_progress_tag};
    p->item.message.progress.done = true;
    say_item(p, &p->item);
}

// ---- the thread ---------------------------------------------------------------------------------

static bool is_here(struct playback *p) {
    return replay_stream_is_here(p->live->sessions, &p->watch, p->server);
}

// Then the thread of the pages goes on where the trace is missing.
static bool asks_others(const struct playback *p) {
    return p->live->config.relays && !p->watch.own;
}

static enum result play(struct playback *p, struct error *err) {
    const struct live_config *config = &p->live->config;
    if (!config->allowed || !config->allowed(config->user, &p->turn.account, p->watch.session))
        return fail(err, RESULT_REFUSED, "there is no session %s that you may see",
                    p->watch.session);
    if (asks_others(p) && !is_here(p)) {
        atomic_store(&p->is_missing, true);
        live_news(p->live);
        return RESULT_OK;
    }
    bool blind =
        config->is_blind && config->is_blind(config->user, &p->turn.account, p->watch.session);
    struct replay_sink sink = {p, say_item, say_payload, &p->item, blind};
    return replay_stream_run(p->live->sessions, &p->watch, &sink, err);
}

// The last word needs no room.
static void give_up(struct playback *p) {
    p->batch.used = 0;
    p->last = true;
    fail_with(p, arthron_Trouble_Kind_FAILED, arthron_Why_Code_TOO_SLOW,
              "this page took too little for long, and others wait: open it again");
}

static void run_one(struct playback *p) {
    struct error err;
    if (atomic_load(&p->left))
        return;
    enum result result = play(p, &err);
    if (result == RESULT_MISSING && !is_here(p))
        fail_with(p, arthron_Trouble_Kind_FAILED, arthron_Why_Code_NOT_HERE, err.text);
    else if (result == RESULT_REFUSED)
        fail_with(p, arthron_Trouble_Kind_NOT_THERE, arthron_Why_Code_NOT_YOURS, err.text);
    else if (result != RESULT_OK && result != RESULT_CLOSED)
        fail_with(p, arthron_Trouble_Kind_FAILED, arthron_Why_Code_UNSAID,
                  error_without_folder(err.text));
    else if (result == RESULT_OK)
        send(p);
    else
        give_up(p);
}

static struct playback *take_turn(struct live_server *live) {
    struct playback_turn *turn = turns_take(&live->turns);
    return turn ? (struct playback *)((char *)turn - offsetof(struct playback, turn)) : NULL;
}

static int64_t run_playback(void *data) {
    struct live_server *live = data;
    atomic_fetch_sub(&live->playbacks_called, 1);
    for (struct playback *p; (p = take_turn(live)); release(&p)) {
        run_one(p);
        turns_end(&live->turns, &p->turn);
    }
    return TASK_DONE;
}

void playback_start(struct playback *p) {
    struct live_server *live = p->live;
    if (turns_are_busy(&live->turns, &p->turn.account))
        tell(p, arthron_Trouble_Kind_NOTE, arthron_Why_Code_WAITS,
             "other recorded sessions are being played: this one waits");
    turns_add(&live->turns, &hold(p)->turn);
    if (atomic_load(&live->playbacks_called) == PLAYBACK_THREADS)
        return;
    atomic_fetch_add(&live->playbacks_called, 1);
    bool taken =
        task_pool_add(live->playbacks, &(struct pool_task){.run = run_playback, .data = live});
    CHECK(taken);
}
