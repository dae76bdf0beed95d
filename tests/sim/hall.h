// The server of a run: its process, its commands, its end.
#pragma once

#include "sessions/sessions.h"
#include "sim/net.h"

enum hall_death { DEATH_ENDED, DEATH_HANDED_OVER, DEATH_KILLED, DEATH_POWER };

struct hall_counts {
    uint64_t starts, failed_starts, commands, done;
};

void hall_begin(uint64_t seed, const char *dir, int stations);
void hall_start(void);
// ENDED and HANDED_OVER take their time; the others are at once.
void hall_end(enum hall_death death);
// Another server is started on the same folders; it must be refused.
void hall_try_second(void);
bool hall_is_up(void);
bool hall_has_ended(void);            // and may be started
struct sessions *hall_sessions(void); // NULL: not up
struct hall_counts hall_counts(void);

// Commands at random times; false: only those that bring sessions back.
void hall_command_freely(bool freely);

// The one case of all runs, once a server has loaded it.
const struct scene *sim_scene(void);
