// Which open traces are this server's: only they are gone on with, or signed. Without records all
// are, because no result comes from them.
#pragma once

#include "sessions/parts.h"

// Reads the open sessions of the records as an earlier server left them: before the recorder
// starts. If the records cannot be read, all traces count as own.
void own_traces_read(struct sessions *sessions);
void own_traces_free(struct sessions *sessions);
bool own_traces_have(const struct sessions *sessions, const char *path);
