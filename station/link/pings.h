// When a station pings its server, and whether that still answers. Plain state of one thread, no
// clock. The connection ends with it: pings_begin at each new one.
#pragma once

#include <stdbool.h>
#include <stdint.h>

struct pings {
    int count;
    int64_t sent_ns, answered_ns; // the last ones
    int64_t unanswered_ns;        // the first that was not answered; 0: there is none
    uint64_t frames;              // that were sent by the last look
    bool rests;                   // none since then
};

void pings_begin(struct pings *pings, int64_t now_ns);

// frames: sent in the life of the link. True: send one now, and tell whether the station rests. Ask
// again after pings_next_ns.
bool pings_due(struct pings *pings, uint64_t frames, int64_t now_ns);
int64_t pings_next_ns(const struct pings *pings);

void pings_answered(struct pings *pings, int64_t now_ns);

// has_datagrams: frames are answered by datagram, so the session lives without this connection for
// a while. has_other: there is another server, so a silent one is given up within 3 s.
bool pings_are_missed(const struct pings *pings, bool has_datagrams, bool has_other,
                      int64_t now_ns);
