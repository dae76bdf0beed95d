#include "live/answers.h"

#include "base/check.h"
#include "live/passing.h"
#include "live/viewer.h"

#include <stdlib.h>
#include <string.h>

static struct asked *asked_at(struct answers *answers, int index) {
    return &answers->asked[(answers->first + index) % ASKED_MAX];
}

void answers_expect(struct answers *answers, uint32_t from) {
    CHECK(answers->count < ASKED_MAX && from);
    *asked_at(answers, answers->count++) = (struct asked){.waits = from};
}

void answers_take(struct answers *answers, int from, struct parcel *parcel) {
    for (int i = 0; i < answers->count; i++) {
        struct asked *asked = asked_at(answers, i);
        if (!(asked->waits & 1u << from))
            continue;
        asked->waits &= ~(1u << from);
        asked->from[from] = parcel;
        return;
    }
    free(parcel); // nobody asked
}

static struct parcel *copy_of(const struct parcel *parcel) {
    struct parcel *copy = alloc(1, sizeof *copy + parcel->size);
    memcpy(copy, parcel, sizeof *copy + parcel->size);
    return copy;
}

static bool has_answer(const struct asked *asked) {
    for (int i = 0; i < ANSWERERS; i++)
        if (asked->from[i])
            return true;
    return false;
}

void answers_lost(struct answers *answers, int from, const struct parcel *refusal) {
    for (int i = 0; i < answers->count; i++) {
        struct asked *asked = asked_at(answers, i);
        if (!(asked->waits & 1u << from))
            continue;
        asked->waits &= ~(1u << from);
        if (!asked->waits && !has_answer(asked))
            asked->from[from] = copy_of(refusal);
    }
}

bool answers_wait_for(const struct answers *answers, int from) {
    for (int i = 0; i < ASKED_MAX; i++)
        if (answers->asked[i].waits & 1u << from)
            return true;
    return false;
}

// A list, with what the others told of their stations.
static void merge(struct parcel **list, struct parcel *other) {
    struct parcel *merged = alloc(1, sizeof *merged + LIVE_BATCH_MAX);
    merged->size = passing_merge((*list)->bytes, (*list)->size, other->bytes, other->size,
                                 merged->bytes, LIVE_BATCH_MAX);
    struct parcel *needless = merged->size ? *list : merged;
    if (merged->size)
        *list = merged;
    free(needless);
    free(other);
}

bool answers_are_next(const struct answers *answers) {
    return answers->count && !answers->asked[answers->first].waits;
}

struct parcel *answers_next(struct answers *answers) {
    struct asked *asked = asked_at(answers, 0);
    struct parcel *parcel = NULL;
    CHECK(answers_are_next(answers));
    for (int i = 0; i < ANSWERERS; i++) {
        if (parcel && asked->from[i])
            merge(&parcel, asked->from[i]);
        else if (asked->from[i])
            parcel = asked->from[i];
    }
    CHECK(parcel);
    memset(asked, 0, sizeof *asked);
    answers->first = (answers->first + 1) % ASKED_MAX;
    answers->count--;
    return parcel;
}

void answers_clear(struct answers *answers) {
    for (int i = 0; i < ASKED_MAX; i++)
        for (int j = 0; j < ANSWERERS; j++)
            free(answers->asked[i].from[j]);
    memset(answers, 0, sizeof *answers);
}
