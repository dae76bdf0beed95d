#include "live/playback_turns.h"

#include <limits.h>

void turns_init(struct playback_turns *turns) {
    pthread_mutex_init(&turns->lock, NULL);
    turns->first = NULL;
}

void turns_fini(struct playback_turns *turns) {
    pthread_mutex_destroy(&turns->lock);
}

// ---- with the lock ------------------------------------------------------------------------------

struct counts {
    int all, own, trainees;
};

// Of those that run, or that wait; `own` are the account's.
static struct counts count(const struct playback_turns *turns, bool runs,
                           const struct live_account *account,
                           const struct playback_turn *without) {
    struct counts c = {0};
    for (const struct playback_turn *t = turns->first; t; t = t->next) {
        if (t == without || t->runs != runs)
            continue;
        c.all++;
        c.own += is_same_person(&t->account, account);
        c.trainees += is_trainee(&t->account);
    }
    return c;
}

// The least one goes first; INT_MAX: it may not run now.
static int rank(const struct playback_turns *turns, const struct live_account *account,
                const struct playback_turn *without) {
    struct counts c = count(turns, true, account, without);
    if (c.all == PLAYBACK_THREADS)
        return INT_MAX;
    if (is_trainee(account))
        return c.own || c.trainees == PLAYBACKS_OF_TRAINEES ? INT_MAX : 1;
    return c.own ? 2 : 0;
}

// As if `without` were not there.
static struct playback_turn *next(const struct playback_turns *turns,
                                  const struct playback_turn *without) {
    struct playback_turn *best = NULL;
    int least = INT_MAX;
    for (struct playback_turn *t = turns->first; t; t = t->next) {
        int of_this = t->runs || t == without ? INT_MAX : rank(turns, &t->account, without);
        if (of_this < least) {
            least = of_this;
            best = t;
        }
    }
    return best;
}

static void drop(struct playback_turns *turns, const struct playback_turn *turn) {
    struct playback_turn **at = &turns->first;
    while (*at && *at != turn)
        at = &(*at)->next;
    if (*at)
        *at = turn->next;
}

// ---- for everybody ------------------------------------------------------------------------------

bool turns_have_place(struct playback_turns *turns, const struct live_account *account) {
    pthread_mutex_lock(&turns->lock);
    int own = 0;
    for (const struct playback_turn *t = turns->first; t; t = t->next)
        own += !t->left && is_same_person(&t->account, account);
    pthread_mutex_unlock(&turns->lock);
    return !is_trainee(account) || own < PLAYBACKS_OF_TRAINEE;
}

bool turns_are_busy(struct playback_turns *turns, const struct live_account *account) {
    pthread_mutex_lock(&turns->lock);
    struct counts run = count(turns, true, account, NULL);
    struct counts wait = count(turns, false, account, NULL);
    pthread_mutex_unlock(&turns->lock);
    return run.all + wait.all >= PLAYBACK_THREADS ||
           (is_trainee(account) &&
            (run.own || wait.own || run.trainees + wait.trainees >= PLAYBACKS_OF_TRAINEES));
}

void turns_add(struct playback_turns *turns, struct playback_turn *turn) {
    pthread_mutex_lock(&turns->lock);
    struct playback_turn **end = &turns->first;
    while (*end)
        end = &(*end)->next;
    *end = turn;
    turn->next = NULL;
    turn->runs = turn->left = false;
    pthread_mutex_unlock(&turns->lock);
}

struct playback_turn *turns_take(struct playback_turns *turns) {
    pthread_mutex_lock(&turns->lock);
    struct playback_turn *turn = next(turns, NULL);
    if (turn)
        turn->runs = true;
    pthread_mutex_unlock(&turns->lock);
    return turn;
}

void turns_end(struct playback_turns *turns, struct playback_turn *turn) {
    pthread_mutex_lock(&turns->lock);
    drop(turns, turn);
    pthread_mutex_unlock(&turns->lock);
}

bool turns_leave(struct playback_turns *turns, struct playback_turn *turn) {
    pthread_mutex_lock(&turns->lock);
    bool waited = false;
    turn->left = true;
    for (const struct playback_turn *t = turns->first; t; t = t->next)
        waited |= t == turn && !t->runs;
    if (waited)
        drop(turns, turn);
    pthread_mutex_unlock(&turns->lock);
    return waited;
}

bool turns_want(struct playback_turns *turns, const struct playback_turn *turn) {
    pthread_mutex_lock(&turns->lock);
    bool wanted = next(turns, turn);
    pthread_mutex_unlock(&turns->lock);
    return wanted;
}
