// An attempt on outputs that are made here, so that each condition can be met or missed alone.
#pragma once

#include "generate/generate.h"
#include "random.h"
#include "task/attempt.h"
#include "test.h"

#define STEP_NS (10 * NS_PER_MS)
#define PROBE (CHANNEL_PROBE - CHANNEL_FIRST_INSTRUMENT)
#define SHAVER (CHANNEL_SHAVER - CHANNEL_FIRST_INSTRUMENT)
#define SCOPE (CHANNEL_SCOPE - CHANNEL_FIRST_INSTRUMENT)

extern struct scene *scene;
extern struct task task;
extern struct site *site;
extern struct attempt attempt;
extern struct session_output output;
extern struct error err;
extern struct random noise;

int make_case(void **state); // the healthy knee, for all tests of a group
int drop_case(void **state);

extern const vec3 forward; // in front of the patella nothing hides it

// A session that runs, all bones at rest, no instrument.
void begin(const char *text);
struct attempt_news steps(int count);
void place(int tool, pose T);
// Looks from `from` at `to`, y up.
pose looking(vec3 from, vec3 to);
vec3 landmark(const char *name);
int group(const char *name);
// The tip of a tool on a group at a point.
void touch(int tool, const char *name, vec3 at, double off_mm, double deep_mm);
void see_patella(double away_mm);
void land(double under, double over, double rim, double step);
void bend(double flexion_deg, double valgus_deg, double drawer_mm);
vec3 trembling(vec3 p);

void loose(int i, enum loose_state state);

#define FAR_GOAL "[goal never]\nsee = notch\nhold_s = 60\n"
