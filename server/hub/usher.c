// The usher: does what pages ask for, one after the other, so that the thread of the pages waits
// for no desk; and has recorded sessions played, two at a time.
#include "base/check.h"
#include "base/clock.h"
#include "hub/playback.h"
#include "hub/viewer.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PLAYING_MAX 2
#define ERRANDS 1024 // more than all pages may have

struct errand {
    int viewer; // index
    uint32_t guest;
    char actor[64];
    const char *refusal;       // or NULL
    arthron_Command command;   // where playback is NULL
    struct playback *playback; // a reference
};

struct usher {
    struct audience *audience;
    pthread_t thread;
    atomic_bool stop;
    sem_t bell;
    struct ring *errands; // of struct errand, from the thread of the pages
    arthron_Live item;
    // In order; those before `playing` are.
    struct playback *playbacks[AUDIENCE_VIEWERS_MAX];
    int count, playing;
};

// ---- commands -----------------------------------------------------------------------------------

static struct parcel *answer(struct usher *u, const struct errand *errand) {
    u->item = (arthron_Live){.which_message = arthron_Live_command_reply_tag};
    arthron_CommandReply *reply = &u->item.message.command_reply;
    if (errand->refusal)
        snprintf(reply->text, sizeof reply->text, "%s", errand->refusal);
    else
        desk_command(u->audience->hub, errand->actor, &errand->command, reply);
    struct parcel *parcel = parcel_of(&u->item, errand->guest);
    if (parcel)
        return parcel;
    reply->sessions_count = 0;
    reply->resections_count = 0;
    return parcel_of(&u->item, errand->guest);
}

// The ring takes all that a page may have asked for; what it does not take is for a page that went.
static void command(struct usher *u, const struct errand *errand) {
    struct parcel *parcel = answer(u, errand);
    CHECK(parcel);
    if (!ring_push(u->audience->viewers[errand->viewer].answers, &parcel))
        free(parcel);
    hub_ring(u->audience->hub);
}

// ---- recorded sessions --------------------------------------------------------------------------

static void drop(struct usher *u, int index) {
    playback_release(&u->playbacks[index]);
    u->count--;
    memmove(u->playbacks + index, u->playbacks + index + 1,
            (size_t)(u->count - index) * sizeof *u->playbacks);
}

static void reap(struct usher *u) {
    for (int i = u->playing - 1; i >= 0; i--)
        if (playback_has_ended(u->playbacks[i])) {
            playback_join(u->playbacks[i]);
            drop(u, i);
            u->playing--;
        }
}

static void start_waiting(struct usher *u) {
    for (int i = u->count - 1; i >= u->playing; i--)
        if (playback_is_left(u->playbacks[i]))
            drop(u, i);
    for (; u->playing < u->count && u->playing < PLAYING_MAX; u->playing++)
        playback_start(u->playbacks[u->playing], &u->bell);
    for (int i = 0; i < u->playing; i++)
        playback_others_wait(u->playbacks[i], u->count > u->playing);
}

static void queue(struct usher *u, struct playback *playback) {
    if (u->count == AUDIENCE_VIEWERS_MAX) {
        playback_tell(playback, "too many recorded sessions are asked for");
        playback_release(&playback);
        return;
    }
    if (u->count >= PLAYING_MAX)
        playback_tell(playback, "other recorded sessions are being played: this one waits");
    u->playbacks[u->count++] = playback;
}

// ---- the thread ---------------------------------------------------------------------------------

static void take_errands(struct usher *u) {
    struct errand errand;
    while (ring_pop(u->errands, &errand)) {
        if (errand.playback)
            queue(u, errand.playback);
        else if (!atomic_load(&u->stop))
            command(u, &errand);
    }
}

static void *ush(void *argument) {
    struct usher *u = argument;
    while (!atomic_load(&u->stop)) {
        while (sem_wait(&u->bell) && errno == EINTR)
            ;
        take_errands(u);
        reap(u);
        start_waiting(u);
    }
    return NULL;
}

struct usher *usher_start(struct audience *audience) {
    struct usher *u = alloc(1, sizeof *u);
    u->audience = audience;
    sem_init(&u->bell, 0, 0);
    u->errands = ring_create(ERRANDS, sizeof(struct errand));
    CHECK(pthread_create(&u->thread, NULL, ush, u) == 0);
    return u;
}

// All viewers have left, so what is played ends by itself.
void usher_stop(struct usher **usher) {
    struct usher *u = *usher;
    atomic_store(&u->stop, true);
    sem_post(&u->bell);
    pthread_join(u->thread, NULL);
    take_errands(u);
    for (int i = 0; i < u->playing; i++)
        playback_join(u->playbacks[i]);
    while (u->count)
        drop(u, u->count - 1);
    ring_destroy(&u->errands);
    sem_destroy(&u->bell);
    free(u);
    *usher = NULL;
}

// ---- the thread of the pages --------------------------------------------------------------------

static bool send(struct usher *u, const struct errand *errand) {
    bool pushed = ring_push(u->errands, errand);
    sem_post(&u->bell);
    return pushed;
}

bool usher_command(struct usher *u, const struct viewer *viewer, const arthron_Command *asked,
                   const char *refusal) {
    struct errand errand = {.viewer = (int)(viewer - u->audience->viewers),
                            .guest = viewer->number,
                            .refusal = refusal,
                            .command = *asked};
    snprintf(errand.actor, sizeof errand.actor, "%s", viewer->guest.name);
    return send(u, &errand);
}

bool usher_play(struct usher *u, struct playback *playback) {
    struct errand errand = {.playback = playback_hold(playback)};
    if (send(u, &errand))
        return true;
    playback_release(&errand.playback);
    return false;
}
