// The usher has recorded sessions played, two at a time. Its runners bring the commands of pages to
// the desk, so that the thread of the pages waits for nothing: those of one page one after the
// other, by the same runner as long as one is not done; else by the one with the least to do, since
// an undo or a copy may take its time.
#include "base/check.h"
#include "base/clock.h"
#include "hub/playback.h"
#include "hub/viewer.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PLAYING_MAX 2
#define RUNNERS 4
#define ERRANDS 1024 // more than all pages may have
#define WISHES 1024

struct errand {
    int viewer; // index
    uint32_t guest;
    char actor[64];
    const char *refusal; // or NULL
    arthron_Command command;
};

struct runner {
    struct usher *usher;
    struct audience *audience;
    pthread_t thread;
    atomic_bool stop;
    sem_t bell;
    struct ring *errands; // of struct errand, from the thread of the pages
    arthron_Live item;
};

struct usher {
    struct audience *audience;
    pthread_t thread;
    atomic_bool stop;
    sem_t bell;
    struct ring *wishes; // of struct playback *, references, from the thread of the pages
    struct runner runners[RUNNERS];
    // Of each viewer's place: who runs its errands, and how many are not done.
    struct {
        int runner;
        atomic_int left;
    } places[AUDIENCE_VIEWERS_MAX];
    // In order; those before `playing` are.
    struct playback *playbacks[AUDIENCE_VIEWERS_MAX];
    int count, playing;
};

// ---- commands -----------------------------------------------------------------------------------

static struct parcel *answer(struct runner *r, const struct errand *errand) {
    r->item = (arthron_Live){.which_message = arthron_Live_command_reply_tag};
    arthron_CommandReply *reply = &r->item.message.command_reply;
    if (errand->refusal)
        snprintf(reply->text, sizeof reply->text, "%s", errand->refusal);
    else
        desk_command(r->audience->hub, errand->actor, &errand->command, reply);
    struct parcel *parcel = parcel_of(&r->item, errand->guest);
    if (parcel)
        return parcel;
    reply->sessions_count = 0;
    reply->resections_count = 0;
    return parcel_of(&r->item, errand->guest);
}

// The ring takes all that a page may have asked for; what it does not take is for a page that went.
static void run_errand(struct runner *r, const struct errand *errand) {
    struct parcel *parcel = answer(r, errand);
    CHECK(parcel);
    if (!ring_push(r->audience->viewers[errand->viewer].answers, &parcel))
        free(parcel);
    atomic_fetch_sub(&r->usher->places[errand->viewer].left, 1);
    hub_ring(r->audience->hub);
}

static void *run_errands(void *argument) {
    struct runner *r = argument;
    struct errand errand;
    while (!atomic_load(&r->stop)) {
        while (sem_wait(&r->bell) && errno == EINTR)
            ;
        while (!atomic_load(&r->stop) && ring_pop(r->errands, &errand))
            run_errand(r, &errand);
    }
    return NULL;
}

static void start_runner(struct runner *r, struct usher *usher) {
    r->usher = usher;
    r->audience = usher->audience;
    sem_init(&r->bell, 0, 0);
    r->errands = ring_create(ERRANDS, sizeof(struct errand));
    CHECK(pthread_create(&r->thread, NULL, run_errands, r) == 0);
}

static void stop_runner(struct runner *r) {
    atomic_store(&r->stop, true);
    sem_post(&r->bell);
    pthread_join(r->thread, NULL);
    ring_destroy(&r->errands);
    sem_destroy(&r->bell);
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

static void drop_left(struct usher *u) {
    for (int i = u->count - 1; i >= u->playing; i--)
        if (playback_is_left(u->playbacks[i]))
            drop(u, i);
}

static void start_waiting(struct usher *u) {
    drop_left(u);
    for (; u->playing < u->count && u->playing < PLAYING_MAX; u->playing++)
        playback_start(u->playbacks[u->playing], &u->bell);
    for (int i = 0; i < u->playing; i++)
        playback_others_wait(u->playbacks[i], u->count > u->playing);
}

static void queue(struct usher *u, struct playback *playback) {
    drop_left(u);
    if (u->count == AUDIENCE_VIEWERS_MAX) {
        playback_fail(playback, arthron_Trouble_Kind_FAILED,
                      "too many recorded sessions are asked for");
        playback_release(&playback);
        return;
    }
    if (u->count >= PLAYING_MAX)
        playback_tell(playback, arthron_Trouble_Kind_NOTE,
                      "other recorded sessions are being played: this one waits");
    u->playbacks[u->count++] = playback;
}

// ---- the thread ---------------------------------------------------------------------------------

static void take_wishes(struct usher *u) {
    struct playback *playback;
    while (ring_pop(u->wishes, &playback))
        queue(u, playback);
}

static void *ush(void *argument) {
    struct usher *u = argument;
    while (!atomic_load(&u->stop)) {
        while (sem_wait(&u->bell) && errno == EINTR)
            ;
        take_wishes(u);
        reap(u);
        start_waiting(u);
    }
    return NULL;
}

struct usher *usher_start(struct audience *audience) {
    struct usher *u = alloc(1, sizeof *u);
    u->audience = audience;
    sem_init(&u->bell, 0, 0);
    u->wishes = ring_create(WISHES, sizeof(struct playback *));
    for (int i = 0; i < RUNNERS; i++)
        start_runner(&u->runners[i], u);
    CHECK(pthread_create(&u->thread, NULL, ush, u) == 0);
    return u;
}

// All viewers have left, so what is played ends by itself.
void usher_stop(struct usher **usher) {
    struct usher *u = *usher;
    atomic_store(&u->stop, true);
    sem_post(&u->bell);
    pthread_join(u->thread, NULL);
    take_wishes(u);
    for (int i = 0; i < u->playing; i++)
        playback_join(u->playbacks[i]);
    while (u->count)
        drop(u, u->count - 1);
    for (int i = 0; i < RUNNERS; i++)
        stop_runner(&u->runners[i]);
    ring_destroy(&u->wishes);
    sem_destroy(&u->bell);
    free(u);
    *usher = NULL;
}

// ---- the thread of the pages --------------------------------------------------------------------

static int idlest_runner(const struct usher *u) {
    int left[RUNNERS] = {0}, best = 0;
    for (int i = 0; i < AUDIENCE_VIEWERS_MAX; i++)
        left[u->places[i].runner] += atomic_load(&u->places[i].left);
    for (int i = 1; i < RUNNERS; i++)
        if (left[i] < left[best])
            best = i;
    return best;
}

bool usher_command(struct usher *u, const struct viewer *viewer, const arthron_Command *asked,
                   const char *refusal) {
    int place = (int)(viewer - u->audience->viewers);
    if (!atomic_load(&u->places[place].left))
        u->places[place].runner = idlest_runner(u);
    struct runner *runner = &u->runners[u->places[place].runner];
    struct errand errand = {
        .viewer = place, .guest = viewer->number, .refusal = refusal, .command = *asked};
    snprintf(errand.actor, sizeof errand.actor, "%s", viewer->guest.name);
    atomic_fetch_add(&u->places[place].left, 1);
    if (!ring_push(runner->errands, &errand)) {
        atomic_fetch_sub(&u->places[place].left, 1);
        return false;
    }
    sem_post(&runner->bell);
    return true;
}

bool usher_play(struct usher *u, struct playback *playback) {
    struct playback *wish = playback_hold(playback);
    if (!ring_push(u->wishes, &wish)) {
        playback_release(&wish);
        return false;
    }
    sem_post(&u->bell);
    return true;
}
