// The keys of goals and errors, each with scenes on either side of its bound.
#pragma once

#include "attempt_body.h"

#define LAST (task.goal_count - 1) // the goal that a row is about

// A key, a task whose last goal or only error has it, and a scene that is inside its bound by
// `inside`, outside where that is negative. Every step sets it anew.
struct kind {
    const char *key, *text;
    void (*set)(double inside);
    double just;  // inside by this: met; outside: missed
    double clear; // beyond this the noise plays no part
};

extern const struct kind goal_kinds[], error_kinds[]; // ended by a NULL key

extern bool trembles;   // hands and sensors, as a tracker of 0.1 mm has it
extern double femur_mm; // 0: where the femur hides the plateau is found anew

// Before the last goal's patella, straight at it.
void stand_before(double away_mm);
#define AWAY_MM 30.0
