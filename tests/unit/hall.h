// Sessions with one station that is not there: what it says comes from the test, and what is sent
// to it goes nowhere. Its knee is of boxes (unit/case_knee.h), its cases are boxes0 and boxes1.
#pragma once

#include "folder.h"
#include "sessions/sessions.h"

extern char hall_dir[FOLDER_MAX];

int hall_make(void **state); // keys and case, for a group of tests
int hall_remove(void **state);

struct sessions *hall_open(void);
// The station connects with this Hello.connection; returns what it is told.
arthron_Welcome hall_connect(struct sessions *sessions, uint64_t connection);
void hall_join(struct sessions *sessions); // the same; returns when its session runs
void hall_leave(struct sessions *sessions);

// About the station; a CASE is boxes1. hall_command must succeed.
const arthron_CommandReply *hall_try(struct sessions *sessions, arthron_Command_Kind kind);
const arthron_CommandReply *hall_command(struct sessions *sessions, arthron_Command_Kind kind);

// Before its session begins: the server has a lease, until hall_serve_until_ns.
extern atomic_int_fast64_t hall_serve_until_ns;
void hall_lease(struct sessions *sessions);

// A frame with a running burr at `tip`, closed now or before.
void hall_frame(struct sessions *sessions, vec3 tip);
void hall_frame_of(struct sessions *sessions, vec3 tip, int64_t time_ns);

// A marker of the station, by its clock, which is ours.
void hall_mark(struct sessions *sessions, uint64_t number, int64_t time_ns);
void hall_press(struct sessions *sessions, uint64_t number, const char *name, bool down); // now

// Cuts the meniscus with a running burr, from one share of its length to another.
void hall_shave_part(struct sessions *sessions, double from, double to);
void hall_shave(struct sessions *sessions); // from end to end

struct station_status hall_status(struct sessions *sessions);
struct tissue_report hall_tissues(struct sessions *sessions);
// When nothing has come for a while. Tells too early only that the mesh has another number.
struct tissue_report hall_last_tissues(struct sessions *sessions);

struct station_counts *hall_counts(struct sessions *sessions);

// Between these two, no cut is done: one that is asked for is on its way.
void hall_hold_cuts(struct sessions *sessions);
void hall_let_cuts_go(struct sessions *sessions);
bool hall_is_cutting(struct sessions *sessions);

// Between these two, commands to the station wait.
void hall_hold_commands(struct sessions *sessions);
void hall_let_commands_go(struct sessions *sessions);

void hall_wait_ms(long ms);
