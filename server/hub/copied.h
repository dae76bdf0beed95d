// A session that begins where a recorded one was at some time: a trace of its own, in which the
// other's inputs until then come first, and the state that they led to.
#pragma once

#include "hub/again.h"

struct copied {
    struct again again;         // its live has its trace, and is the worker's once it is attached
    struct trace_header header; // of the new trace
    char path[HUB_PATH_MAX];    // of it, once it is begun
    char draft[HUB_PATH_MAX];   // and until then, so that nobody takes it for a session's
};

// Whether a text is a session's id: 32 hexadecimal digits, as all that is shown of it: lower case.
bool copied_is_id(const char *text);

// from: the path of a trace, or a session's id whose trace lies with this server's. at_s: since its
// start; what is later, and its stop, is left out. Runs the session again in a thread that gives
// way to all others, and waits for it and for the disk: without the desk's lock. RESULT_MISSING,
// RESULT_IO, RESULT_FORMAT, or as again_run.
enum result copied_create(struct hub *hub, int seat, const char *from, double at_s,
                          struct copied **out_copied, struct error *err);

// The trace gets its name.
enum result copied_begin(struct copied *copied, struct error *err);

// What was not begun leaves nothing behind. NULL inside is fine.
void copied_destroy(struct copied **copied);

// Removes what a server that was killed left of sessions that had not begun.
void copied_clear(const char *traces_dir);
