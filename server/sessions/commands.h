// What instructors ask for: at the server's socket, and on its pages.
#pragma once

#include "sessions/parts.h"

// actor: who asks, as the records call them. From any thread; waits until it is done or refused.
void commands_run(struct sessions *sessions, const char *actor, const arthron_Command *command,
                  arthron_CommandReply *out_reply);
