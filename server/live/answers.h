// The answers to a page's commands, wherever they come from, in the order of the commands. For the
// web server's thread.
#pragma once

#include "live/live.h"

#define ASKED_MAX 8    // unanswered commands of one page
#define REMOTES_MAX 31 // other servers that one page hears of
#define ANSWERERS (1 + REMOTES_MAX)
#define ANSWER_HERE 0 // a remote's number: 1 and its index

struct live_batch;
struct parcel;

struct answers {
    int first, count;
    struct asked {
        uint32_t waits; // for these, by bits
        struct parcel *from[ANSWERERS];
    } asked[ASKED_MAX];
};

void answers_expect(struct answers *answers, uint32_t from);
// Takes the parcel: the answer to the oldest command that waits for this one.
void answers_take(struct answers *answers, int from, struct parcel *parcel);
// No answer comes from there: `refusal` is copied for each command that waits for it alone.
void answers_lost(struct answers *answers, int from, const struct parcel *refusal);
bool answers_wait_for(const struct answers *answers, int from);
bool answers_are_next(const struct answers *answers);
// The next one, for the caller to release.
struct parcel *answers_next(struct answers *answers);
void answers_clear(struct answers *answers);
