// How far a trainee is with a task of a curriculum: passed once so many attempts in a row passed,
// with each hand where the curriculum asks for it. What was passed stays passed.
#pragma once

#include "store/courses.h"

enum { GATE_RIGHT, GATE_LEFT, GATE_HANDS }; // either hand counts as right where one is enough

struct gate {
    int attempts;
    int in_row[GATE_HANDS]; // passes up to now; at most as many as are asked for
    double best_s;          // of those that passed; 0: none
};

// The next attempt, oldest first. One on another case than the task's does not count; a pass of a
// task that was locked then opens nothing.
void gate_add(struct gate *gate, const struct curriculum_task *task, const char *case_name,
              const char *hand, bool passed, bool locked, double time_s);

bool gate_hand_is_passed(const struct gate *gate, const struct curriculum_task *task, int hand);
bool gate_is_passed(const struct gate *gate, const struct curriculum_task *task);
int gate_next_hand(const struct gate *gate, const struct curriculum_task *task);

// Whether a task that has to be passed before `at` is not. gates: of all tasks.
bool gate_is_locked(const struct gate *gates, const struct curriculum *curriculum, int at);
