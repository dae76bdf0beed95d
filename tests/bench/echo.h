// The least that a server of poses could do, as a child process on one processor: it gives each
// datagram back, opened and sealed again or as it came, in batches as the server does.
#pragma once

#include "load.h"

#include <sys/types.h>

struct echo {
    pid_t pid;
    int count;
    struct caller *callers; // connected to it
};

enum result echo_start(int callers, bool sealed, int cpu, struct echo *out_echo, struct error *err);
void echo_end(struct echo *echo);
int64_t echo_ns(const struct echo *echo); // its processor time so far
