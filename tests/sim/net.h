// The network between the stations and the server: datagrams, and the streams under the control
// connections. Also the descriptors that live in memory alone: sockets and wakes.
#pragma once

#include "sim/threads.h"

#include <stddef.h>

#define SIM_STATIONS_MAX 8
#define SIM_FD 4096 // descriptors from here on are the simulation's

enum direction { TO_SERVER, TO_STATION, DIRECTIONS };

// Of one station's way to the server.
struct weather {
    double lost, doubled, corrupted; // shares of datagrams
    int64_t delay_ns, jitter_ns;     // one way
    bool cut[DIRECTIONS];            // nothing arrives; streams go on afterwards
};

struct net_counts {
    uint64_t sent, lost, doubled, corrupted, late;
};

void net_begin(uint64_t seed);
void net_end(void);
struct weather *net_weather(int station);
struct weather net_fair(int station); // without faults
struct net_counts net_counts(void);

// How long a message takes now.
int64_t net_delay_ns(int station);

// A process was killed: its sockets are gone.
void net_drop(struct sim_process *process);

// Nobody has closed what he opened; for the end of a run.
int net_open_descriptors(void);
