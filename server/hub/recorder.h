// The recorder: a thread that writes what becomes of sessions into the records (store), so that
// neither a step nor the desk waits for a database.
//
// What the database does not take (it is locked, damaged, its disk is full) waits in order and is
// tried again, and the log says so. What is not written when the server ends, by a signal too, is
// taken from the traces when it starts the next time.
#pragma once

#include "hub/session_record.h"

struct recorder;

// Takes over the sessions whose traces lie in traces_dir and whose end is not in the records, and
// then waits for more. find: from the recorder's thread.
struct recorder *recorder_start(const char *records, const char *traces_dir, scene_finder find,
                                void *user);

// From any thread: copies, and waits for no disk. A session that has ended gets its trace's hash on
// the way, so its trace must be closed. NULL: no records are kept.
void recorder_put(struct recorder *recorder, const struct session_record *record);

// Tries once more to write what waits. NULL inside is fine.
void recorder_stop(struct recorder **recorder);
