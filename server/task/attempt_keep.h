// The attempts of a session as its state keeps them (base/kept.h): what steps that are not at hand
// made of the one that runs.
#pragma once

#include "base/kept.h"
#include "task/attempt.h"

struct kept_attempt {
    uint32_t begun;   // in the session so far
    uint32_t number;  // of the one that runs; 0: none
    int64_t begun_ns; // when it began, since the session's start
    struct attempt attempt;
};

// What is read is of a task with as many goals and errors as its own, or bad: kept_attempt_fits
// tells.
void kept_attempt_keep(struct kept_attempt *attempt, struct kept *kept);
bool kept_attempt_fits(const struct kept_attempt *attempt, const struct site *site);
