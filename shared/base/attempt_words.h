// What an attempt at a task is called, in records, messages and files. server/task judges it.
#pragma once

enum attempt_purpose { ATTEMPT_PRACTICE, ATTEMPT_EXAM, ATTEMPT_PURPOSE_COUNT };
const char *attempt_purpose_name(enum attempt_purpose purpose); // "practice", "exam"

// The hand that holds the arthroscope.
enum attempt_hand { ATTEMPT_RIGHT, ATTEMPT_LEFT_HAND, ATTEMPT_HAND_COUNT };
const char *attempt_hand_name(enum attempt_hand hand); // "right", "left"

enum verdict { VERDICT_OPEN, VERDICT_PASSED, VERDICT_NOT_YET, VERDICT_COUNT };
const char *verdict_name(enum verdict verdict); // "open", "passed", "not yet"

enum attempt_end {
    ATTEMPT_RUNS,
    ATTEMPT_DONE,     // all goals are met
    ATTEMPT_TIME_OUT, // the limit's time is over
    ATTEMPT_SENTINEL, // an error ended it
    ATTEMPT_LEFT,     // its trainee ended it
    ATTEMPT_STOPPED,  // another one ended it, or the session was reset or closed
    ATTEMPT_END_COUNT
};
const char *attempt_end_name(enum attempt_end end); // "runs", "done", ...

// The index of a name; -1: none of them.
int attempt_purpose_from(const char *name);
int attempt_hand_from(const char *name);
