// What a running server says to a command about its sessions, and the same as JSON.
#pragma once

#include "net/console.h"

struct session_answer {
    arthron_CommandReply reply;    // the last one
    arthron_SessionInfo *sessions; // of all replies
    size_t session_count;
    arthron_Metrics metrics; // of SHOW
};

// On stdout, in one line.
void session_print_json(const struct session_answer *answer);
