// Who plays a recorded session next, so that nobody keeps the others from theirs. Staff go before
// trainees, and trainees together leave a thread to staff. A trainee has two, of which one runs.
// Staff have as many as they like; the second goes behind everybody's first.
#pragma once

#include "live/account.h"

#include <pthread.h>

#define PLAYBACK_THREADS 3
#define PLAYBACKS_OF_TRAINEES 2 // that run, of all trainees together
#define PLAYBACKS_OF_TRAINEE 2  // that run or wait, of one

// Of one playback, while it waits or runs.
struct playback_turn {
    struct playback_turn *next;
    struct live_account account;
    bool runs, left; // its page has left, so it soon ends
};

struct playback_turns {
    pthread_mutex_t lock; // held for looks at the list only
    struct playback_turn *first;
};

void turns_init(struct playback_turns *turns);
void turns_fini(struct playback_turns *turns);

// False: the person has as many as they may.
bool turns_have_place(struct playback_turns *turns, const struct live_account *account);
// Whether one that is added now would wait.
bool turns_are_busy(struct playback_turns *turns, const struct live_account *account);
void turns_add(struct playback_turns *turns, struct playback_turn *turn);

// The next one, which runs from now on; NULL: none may. Ask again where one has ended.
struct playback_turn *turns_take(struct playback_turns *turns);
void turns_end(struct playback_turns *turns, struct playback_turn *turn);
// Its page has left. True if it waited: then nobody takes it.
bool turns_leave(struct playback_turns *turns, struct playback_turn *turn);

// Whether another one could run if this one ended.
bool turns_want(struct playback_turns *turns, const struct playback_turn *turn);
