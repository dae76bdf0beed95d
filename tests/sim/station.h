// The stations of a run: each a process that runs the station's real loop on devices of the
// simulation's own.
#pragma once

#include "link/link.h"
#include "sim/net.h"

#define STATION_RATE_HZ 50

void stations_begin(uint64_t seed, int count);
void station_start(int station);
void station_kill(int station); // at once
void station_stop(int station); // as a technician does; it takes its time
bool station_has_ended(int station);
struct link *station_link(int station); // NULL: it does not run
struct sim_process *station_process(int station);

void station_silence(int station, int device, bool silent);
#define STATION_DEVICES 2
