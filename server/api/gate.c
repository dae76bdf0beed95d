#include "api/gate.h"

#include <string.h>

static bool is_on_a_case_of(const struct curriculum_task *task, const char *case_name) {
    for (int i = 0; i < task->case_count; i++)
        if (!strcmp(task->cases[i], case_name))
            return true;
    return !task->case_count;
}

void gate_add(struct gate *gate, const struct curriculum_task *task, const char *case_name,
              const char *hand, bool passed, bool locked, double time_s) {
    int at = task->each_hand && !strcmp(hand, "left") ? GATE_LEFT : GATE_RIGHT;
    if (!is_on_a_case_of(task, case_name))
        return;
    gate->attempts++;
    if (passed && (gate->best_s == 0 || time_s < gate->best_s))
        gate->best_s = time_s;
    if (!locked && gate->in_row[at] < task->passes)
        gate->in_row[at] = passed ? gate->in_row[at] + 1 : 0;
}

bool gate_hand_is_passed(const struct gate *gate, const struct curriculum_task *task, int hand) {
    return gate->in_row[hand] >= task->passes;
}

bool gate_is_passed(const struct gate *gate, const struct curriculum_task *task) {
    return gate_hand_is_passed(gate, task, GATE_RIGHT) &&
           (!task->each_hand || gate_hand_is_passed(gate, task, GATE_LEFT));
}

int gate_next_hand(const struct gate *gate, const struct curriculum_task *task) {
    return task->each_hand && gate_hand_is_passed(gate, task, GATE_RIGHT) ? GATE_LEFT : GATE_RIGHT;
}

static bool is_passed(const struct gate *gates, const struct curriculum *c, const char *task) {
    for (int i = 0; i < c->count; i++)
        if (!strcmp(c->tasks[i].task, task))
            return gate_is_passed(&gates[i], &c->tasks[i]);
    return true;
}

bool gate_is_locked(const struct gate *gates, const struct curriculum *c, int at) {
    const struct curriculum_task *task = &c->tasks[at];
    for (int i = 0; i < task->after_count; i++)
        if (!is_passed(gates, c, task->after[i]))
            return true;
    return false;
}
