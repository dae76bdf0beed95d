// Which way frames travel: by datagram while answers to datagrams come back, else in the control
// connection, with a frame now and then also tried by datagram. Plain state: no sockets, no clock.
#pragma once

#include <stdbool.h>
#include <stdint.h>

#define PATH_WAY_MAX_NS 1000000000LL

struct path {
    bool datagrams;        // frames travel by datagram
    bool trial_open;       // a datagram on trial has no answer yet
    int trials_answered;   // in a row
    int64_t next_trial_ns; // while frames travel in the control connection
    int64_t unanswered_ns; // since when datagrams have had no answer; 0: the last one had
    int64_t way_ns;        // how long answers have lately taken, at most PATH_WAY_MAX_NS
};

struct frame_route {
    bool control, datagram;
};

// A zeroed struct path starts in the control connection and tries a datagram at once.

// The way of the frame that is sent now.
struct frame_route path_next(struct path *path, int64_t now_ns);

// An answer came by datagram, to a frame of sent_ns.
void path_answered(struct path *path, int64_t sent_ns, int64_t now_ns);

// The operating system refused a datagram.
void path_refused(struct path *path, int64_t now_ns);
