// Which open traces are this server's: only they are gone on with, or signed. Without records all
// are, because no result comes from them.
#pragma once

#include "sessions/parts.h"

// A session begins: its trace is noted in RECORDS.begun, because its row reaches the records only
// later, and a server that is killed before must find it. Waits for the disk.
void own_traces_note(const struct sessions *sessions, const char *trace);

// Reads that list and the open sessions of the records as an earlier server left them: before the
// recorder starts. If the records cannot be read, that list alone counts.
void own_traces_read(struct sessions *sessions);
void own_traces_free(struct sessions *sessions);
bool own_traces_have(const struct sessions *sessions, const char *path);
