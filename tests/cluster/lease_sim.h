// Servers, their lease and their journals, simulated: keys that compare revisions, streams, a
// network that delays and loses, servers that are killed, paused and cut off, and stations that ask
// from server to server and train there. What happens follows from the seed alone.
#pragma once

#include <stdint.h>

struct lease_sim {
    uint64_t seed;
    int servers, stations;
    double fault_s;   // faults come so often, on average; 0: never
    double trouble_s; // for so long
    double quiet_s;   // then all is well for so long
    double drift;     // clocks run faster or slower by up to this share
};

struct lease_figures {
    uint64_t double_owners;  // times at which two servers could serve a station
    uint64_t sinking_tokens; // owners whose token was not above that of the owner before
    uint64_t takes, deposals, lives_lost, writes;
    uint64_t restored; // sessions that went on at another server
    // Of these: they lacked what the server before could rely on; they had ended, and were known to
    // have; what was read of them was no session.
    uint64_t lost, risen, torn;
    int unserved;         // stations without an owner at the end
    double longest_gap_s; // in which a station asked and nobody served it, while nothing was wrong
};

struct lease_figures lease_sim_run(const struct lease_sim *sim);
