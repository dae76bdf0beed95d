// An attempt at a task as STRING messages: what happens, each once, and its figures as JSON. A
// station and a recorded session tell it with the same words. Of an exam they tell no goals,
// errors, end and verdict, whatever is known. No memory of its own, no clock.
#pragma once

#include "base/attempt_words.h"
#include "igtl/content.h"

#include <stdbool.h>
#include <stdint.h>

// "begun telescoping", "goal near", "error bump 2", "ended passed (done)"
#define IGTL_ATTEMPT "attempt"
// {"number":1,"task":"telescoping",...}
#define IGTL_PROGRESS "progress"
#define IGTL_PROGRESS_NS 1000000000LL // between two figures in which nothing happened

#define IGTL_GOALS_MAX 24
#define IGTL_ERRORS_MAX 12
#define IGTL_TASK_NAME_SIZE 32

struct igtl_attempt {
    uint32_t number; // in its session; 0: none
    char task[IGTL_TASK_NAME_SIZE];
    enum attempt_purpose purpose;
    enum attempt_hand hand;
    double time_s; // NAN: not known
    double limit_s;
    int goal_count, error_count; // no goals: goals and errors are not known
    struct {
        char name[IGTL_TASK_NAME_SIZE];
        bool met;
    } goals[IGTL_GOALS_MAX];
    struct {
        char name[IGTL_TASK_NAME_SIZE];
        uint32_t count;
    } errors[IGTL_ERRORS_MAX];
    bool ended;
    enum attempt_end end;
    enum verdict verdict;
};

// What was told. A zeroed one: nothing. With `last` set: what happened before needs no telling.
struct igtl_attempt_told {
    struct igtl_attempt last;
    bool figures;   // were told
    int64_t utc_ns; // when
};

struct igtl_attempt_word {
    const char *device;
    char text[IGTL_TEXT_SIZE];
};

// The next that has to be told of `now`; false: all is told. Call it until then.
bool igtl_attempt_next(struct igtl_attempt_told *told, const struct igtl_attempt *now,
                       int64_t utc_ns, struct igtl_attempt_word *out_word);
