// The scores of sessions that have ended: a thread of its own at a low priority reads their traces
// one after the other, so that no row and no audit entry waits for a trace to be read.
#pragma once

#include "records/session_row.h"

struct scoring;

struct scoring_config {
    const char *authority; // as of session_score_trace, as are find and user
    scene_finder find;
    void *user;
    // On the thread: takes the score over.
    void (*scored)(void *owner, const struct session_score *score);
    void *owner;
};

// Texts must outlive it.
struct scoring *scoring_start(const struct scoring_config *config);

// Copies, and does not wait. A trace that cannot be read is told in the log and has no score.
void scoring_put(struct scoring *scoring, const struct store_session *session);

// Large traces are left alone from now on.
void scoring_hurry(struct scoring *scoring);

// Reads what waits, and ends. NULL inside is fine.
void scoring_stop(struct scoring **scoring);
