#include "runtime/looks.h"

#include "base/check.h"

#include <stdlib.h>

#define TURNS 2048 // of the wheel: a list of places for each
#define NOWHERE (-1)

struct look {
    int64_t turn;      // NOWHERE: none is asked for
    int before, after; // in the list of its turn; NOWHERE: the end
};

struct looks {
    int64_t turn; // all before are over
    int first[TURNS];
    struct look of[];
};

struct looks *looks_create(int places) {
    struct looks *l = alloc(1, sizeof *l + (size_t)places * sizeof *l->of);
    for (int i = 0; i < TURNS; i++)
        l->first[i] = NOWHERE;
    for (int i = 0; i < places; i++)
        l->of[i].turn = NOWHERE;
    return l;
}

void looks_destroy(struct looks **looks) {
    free(*looks);
    *looks = NULL;
}

static int *link_to(struct looks *l, const struct look *look) {
    return look->before == NOWHERE ? &l->first[look->turn % TURNS] : &l->of[look->before].after;
}

static void take_out(struct looks *l, int place) {
    struct look *look = &l->of[place];
    *link_to(l, look) = look->after;
    if (look->after != NOWHERE)
        l->of[look->after].before = look->before;
    look->turn = NOWHERE;
}

static void put_in(struct looks *l, int place, int64_t turn) {
    int *first = &l->first[turn % TURNS];
    l->of[place] = (struct look){turn, NOWHERE, *first};
    if (*first != NOWHERE)
        l->of[*first].before = place;
    *first = place;
}

void looks_by(struct looks *l, int place, int64_t when_ns) {
    int64_t turn = when_ns / LOOKS_TURN_NS;
    if (turn < l->turn)
        turn = l->turn;
    if (turn - l->turn >= TURNS)
        turn = l->turn + TURNS - 1;
    if (l->of[place].turn != NOWHERE && l->of[place].turn <= turn)
        return;
    if (l->of[place].turn != NOWHERE)
        take_out(l, place);
    put_in(l, place, turn);
}

int64_t looks_next_ns(const struct looks *l, int64_t until_ns) {
    int64_t turn = l->turn;
    while (turn < l->turn + TURNS && (turn + 1) * LOOKS_TURN_NS < until_ns &&
           l->first[turn % TURNS] == NOWHERE)
        turn++;
    int64_t next_ns = (turn + 1) * LOOKS_TURN_NS;
    return next_ns < until_ns ? next_ns : until_ns;
}

// Where nobody asked for a whole round of the wheel, no place is left behind.
int looks_take(struct looks *l, int64_t now_ns) {
    int64_t now = now_ns / LOOKS_TURN_NS;
    if (now - l->turn > TURNS)
        l->turn = now - TURNS;
    for (; l->turn < now; l->turn++) {
        int place = l->first[l->turn % TURNS];
        if (place == NOWHERE)
            continue;
        take_out(l, place);
        return place;
    }
    return NOWHERE;
}
