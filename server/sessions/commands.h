// Runs the commands of instructors, from the server's socket and from its pages.
#pragma once

#include "sessions/parts.h"

// actor: the person who sent the command, for the audit log. From any thread; waits until the
// command is done or refused.
void commands_run(struct sessions *sessions, const char *actor, const arthron_Command *command,
                  arthron_CommandReply *out_reply);
