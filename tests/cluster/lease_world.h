// What the parts of the simulation (lease_sim.h) share: what happens when, servers and their
// processes, the network.
#pragma once

#include "../random.h"
#include "cluster/ownership.h"
#include "lease_sim.h"

#include <stddef.h>

enum what {
    TICK,
    REQUEST, // a write of a key arrives
    ANSWER,
    WATCH, // a server begins to watch the keys
    SEEN,  // and sees the next one
    ASK,   // a station asks for its session
    FAULT,
    HEAL,
    STORED, // a message of a journal arrives
    POSTED, // and is answered
    PURGED,
    TAKEN, // a server reads the journal of a station that is its own now
    BEGUN, // and goes on with the session
    LEFT,  // it ends the session of a station that is not
    MOVED  // it gives a station away
};

struct happening {
    int64_t at_ns;
    uint64_t number; // of two at one time the first that was put
    enum what what;
    int server, station; // station: also the kind of fault
    uint64_t process;    // that it concerns
    enum write_answer answer;
    uint64_t revision; // or a sequence
    uint64_t id;       // of a write, or a watch
    struct request *request;
    struct post *post;
    bool begins_base;
};

// A write of a key, which each server sees once it was done.
struct request {
    bool of_server;
    int index; // of the server or station
    uint64_t id, replaces;
    struct server_value server;
    struct station_value station;
    int64_t done_ns;
    uint64_t revision;
};

struct node {
    struct world *world;
    int index;
    char name[SERVER_NAME_SIZE];
    struct ownership *ownership; // NULL: the process does not run
    uint64_t process;            // counts up with each
    uint64_t life_before;
    bool cut_off;
    int64_t cut_ns;
    int64_t paused_until_ns;
    double rate;      // of its clock
    uint64_t watch;   // of the keys, counts up
    size_t seen;      // changes of keys, in order
    int64_t shown_ns; // when it will have seen what was there as the watch began
    bool looks;       // the next one is on its way
    struct part **of; // by station: its journal here; NULL: it never had one
    int *parts, part_count;
};

struct asking {
    int server;
    int64_t since_ns;  // unserved
    uint64_t token;    // of the newest owner
    uint64_t welcomed; // the highest token that served it
};

// Servers that hold a station for theirs.
struct owners {
    int *of, count, room;
};

struct world {
    const struct lease_sim *sim;
    struct random random;
    int64_t now_ns, trouble_ns, calm_ns; // until when there are faults, and what they lead to
    struct happening *heap;
    size_t count, room;
    uint64_t numbers;
    struct request **changes; // of keys, in order
    size_t change_count, change_room;
    const struct request **server_keys, **station_keys; // their newest changes; NULL: none
    struct node *nodes;
    struct asking *stations;
    struct owners *owners; // by station
    struct journals *journals;
    struct lease_figures figures;
};

void put(struct world *w, struct happening event);
struct happening take_first(struct world *w);

static inline int64_t seconds(double s) {
    return (int64_t)(s * (double)NS_PER_S);
}

static inline int64_t clock_of(const struct node *node) {
    return (int64_t)((double)node->world->now_ns * node->rate) + (int64_t)node->index * NS_PER_S;
}

static inline bool happens(struct world *w, double probability) {
    return random_between(&w->random, 0, 1) < probability;
}

// Mostly some milliseconds; now and then, while something is wrong, seconds.
int64_t delay(struct world *w);
bool is_lost(struct world *w);
