// The journals in the simulation of the lease: sessions whose records, states and ends go into
// streams by the server's own writer, and are read by its own reader where another server goes on.
#pragma once

#include "lease_world.h"

void journals_create(struct world *w);
void journals_destroy(struct world *w);

// ---- what the lease tells a server's process
void journal_owned(struct node *node, int station, uint64_t token);
void journal_lost(struct node *node, int station);
void journal_killed(struct node *node);
void journal_tick(struct node *node);

// ---- what a station does there
// Whether its session can be there: all that was played elsewhere is known. Else it is soon.
bool journal_serves(struct node *node, int station);
void journal_play(struct node *node, int station);
// The session goes away, and the station's key with it. False: it does already.
bool journal_move(struct node *node, int station);

// STORED to MOVED; those of a process that runs.
void journal_happens(struct world *w, struct happening *event);
