#include "link/pings.h"

#include "base/clock.h"

#define FAST_PINGS 10
#define FAST_PING_NS (20 * NS_PER_MS)
#define PING_NS NS_PER_S
#define REST_PING_MOST_NS (8 * NS_PER_S)
#define UNANSWERED_NS (4 * NS_PER_S)
#define UNANSWERED_BESIDE_OTHER_NS (1900 * NS_PER_MS) // looked at each second, before the ping
#define SILENCE_BESIDE_DATAGRAMS_NS (60 * NS_PER_S)

void pings_begin(struct pings *p, int64_t now_ns) {
    *p = (struct pings){.answered_ns = now_ns, .frames = p->frames};
}

// A station that sends no frames rests. After a rest the clock is asked for as at the beginning.
static bool is_due(struct pings *p, uint64_t frames, int64_t now_ns) {
    bool rested = p->rests;
    p->rests = p->count >= FAST_PINGS && frames == p->frames;
    p->frames = frames;
    if (rested && !p->rests)
        p->count = 0;
    return p->count < FAST_PINGS || !rested || now_ns - p->sent_ns > REST_PING_MOST_NS - PING_NS;
}

bool pings_due(struct pings *p, uint64_t frames, int64_t now_ns) {
    if (!is_due(p, frames, now_ns))
        return false;
    p->sent_ns = now_ns;
    if (!p->unanswered_ns)
        p->unanswered_ns = now_ns;
    p->count++;
    return true;
}

int64_t pings_next_ns(const struct pings *p) {
    return p->count < FAST_PINGS ? FAST_PING_NS : PING_NS;
}

void pings_answered(struct pings *p, int64_t now_ns) {
    p->answered_ns = now_ns;
    p->unanswered_ns = 0;
}

bool pings_are_missed(const struct pings *p, bool has_datagrams, bool has_other, int64_t now_ns) {
    int64_t patience_ns = has_other ? UNANSWERED_BESIDE_OTHER_NS : UNANSWERED_NS;
    return p->unanswered_ns && now_ns - p->unanswered_ns > patience_ns &&
           (!has_datagrams || now_ns - p->answered_ns > SILENCE_BESIDE_DATAGRAMS_NS);
}
