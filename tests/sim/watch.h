// The invariants of a run. The programs' own functions are wrapped where a step is recorded, a
// reply leaves, a trace is opened; the stations tell what they send and show.
#pragma once

#include "link/link.h"
#include "sim/net.h"
#include "trace/trace.h"
#include "wire/wire.h"

struct sessions;
struct sessions_config;

struct watch_counts {
    uint64_t steps, frames, views, resumes, traces, replayed, lost_steps, remarks;
    double error_mm; // the largest of a shown tip while the network was fair
};

void watch_begin(int stations);
void watch_end(void);
struct watch_counts watch_counts(void);

// ---- stations
void watch_sent(int station, int64_t incarnation, uint64_t connection, uint64_t number);
void watch_shown(int station, int64_t incarnation, const arthron_View *view);
void watch_began(int station); // a program of the station

// ---- the instructor
uint64_t watch_session(int station); // tells sessions apart; 0: there was none
void watch_noted(int station, uint64_t session, const char *text);
// The id of one that the station has had; empty: none.
void watch_some_session(int station, char out_id[256]);

// ---- the server's death, and what is on its disk then
void watch_killed(bool power);
void watch_look_at_traces(void);
void watch_up(int64_t wait_ns); // another one serves
void watch_renamed(const char *from, const char *to);

// ---- once all faults are over
// All stations are served and every count adds up. Call it twice, a few seconds apart.
struct watch_settled {
    uint64_t sent, accepted, refused;
    int64_t time_ns; // of the last step, on the session's clock
};
struct watch_settled watch_settled(int station, struct link *link, struct sessions *sessions);
// The server has ended: each trace is whole, and replays to the same hashes.
void watch_replay_all(const struct scene *scene);
