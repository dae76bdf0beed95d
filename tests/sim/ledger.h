// What was recorded of each session, as its trace must have it: steps with their hashes and times,
// remarks that were confirmed.
#pragma once

#include "sim/watch.h"
#include "trace/trace.h"

struct ledger;

void ledgers_begin(void);
void ledgers_end(void);
void ledgers_count(struct watch_counts *counts);

struct ledger *ledger_of(const struct trace_writer *writer);
int ledger_station(const struct ledger *ledger);
uint64_t ledger_serial(const struct ledger *ledger); // no two have the same
// Another session of the station steps; until this one is gone on with by another server.
void ledger_leave(struct ledger *ledger);
bool ledger_is_left(const struct ledger *ledger);
void ledger_step(struct ledger *ledger, const struct session_output *output, bool put);
void ledger_note(struct ledger *ledger, const char *text);
void ledger_some_id(int station, char out_id[256]);
