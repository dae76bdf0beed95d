// Writes the states of sessions beside their traces: a thread of its own, at a low priority. Who
// gives it something does not wait for the disk.
#pragma once

#include "runtime/kept_session.h"

// A session at one step. One a worker: from the capture by the worker until it is on disk.
struct session_image {
    atomic_bool busy;
    char trace[TRACE_FILE_MAX];
    struct trace_state state;
    struct kept session;   // in memory that was made before
    struct kept operation; // from the cut worker; empty between
};

struct keeper;

struct keeper *keeper_create(const struct runtime_config *config); // must outlive it
// Writes what it was given; joins the thread. NULL inside is fine.
void keeper_destroy(struct keeper **keeper);

struct session_image *session_image_create(void);
void session_image_destroy(struct session_image **image);

// Both parts are there. Then it is not busy any more.
void keeper_write(struct keeper *keeper, struct session_image *image);
// The session has ended: after what was given before, its state is removed.
void keeper_remove(struct keeper *keeper, const char *trace);
