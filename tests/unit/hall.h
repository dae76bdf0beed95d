// A hub with one station that is not there: its frames come from the test, and what is sent to it
// goes nowhere. Its knee is of boxes (unit/case_knee.h), its cases are boxes0 and boxes1.
#pragma once

#include "folder.h"
#include "hub/seat.h"

extern char hall_dir[FOLDER_MAX];

int hall_make(void **state); // keys and case, for a group of tests
int hall_remove(void **state);

struct hub *hall_open(void);
void hall_join(struct hub *hub); // returns when its session runs
void hall_leave(struct hub *hub);

// About the station; a CASE is boxes1. It must succeed.
const arthron_CommandReply *hall_command(struct hub *hub, arthron_Command_Kind kind);

// A frame with a running burr at `tip`.
void hall_frame(struct hub *hub, vec3 tip);

// Cuts the meniscus with a running burr, from one share of its length to another.
void hall_shave_part(struct hub *hub, double from, double to);
void hall_shave(struct hub *hub); // from end to end

struct card hall_card(struct hub *hub);
// When nothing has come for a while. Tells too early only that the mesh has another number.
struct card hall_last_card(struct hub *hub);

void hall_wait_ms(long ms);
