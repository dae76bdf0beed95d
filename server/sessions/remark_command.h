// The command NOTE.
#pragma once

#include "sessions/parts.h"

// A marker must lie near a bone, and a text must have no control characters. The caller holds the
// slot's command lock. False: the reply says why not.
bool remark_command(struct sessions *sessions, int station, const char *author,
                    const arthron_Remark *remark, arthron_CommandReply *reply);
