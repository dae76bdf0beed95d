// The recorder: a thread that writes what becomes of sessions into the records (store), so that
// neither a step nor the desk waits for a database.
//
// When a session has ended, its row is written at once, and then its trace is read: for its hash,
// and for its metrics. What the database does not take (it is locked, damaged, its disk is full)
// waits in order and is tried again, and the log says so. What is not written when the server ends,
// by a signal too, is taken from the traces when it starts the next time; audit entries, which no
// trace has, from a file that it leaves beside the records as it ends (audit_spool.h).
#pragma once

#include "records/session_row.h"

struct recorder;

// Texts are copied.
struct recorder_config {
    const char *records;    // the database; made where it is not there
    const char *traces_dir; // of all traces of this server
    const char *authority;  // a PEM file: whose signatures are believed
    scene_finder find;      // called from the recorder's thread
    void *user;
};

// Takes over the sessions whose traces lie in traces_dir and whose end is not in the records, and
// then waits for more; again where the file is another one (a backup was put back).
struct recorder *recorder_start(const struct recorder_config *config);

// From any thread: copies, and waits for no disk. The trace of a session that has ended must be
// closed. NULL: no records are kept.
void recorder_put(struct recorder *recorder, const struct store_session *session);

// The same for the audit log: now, by `actor` (empty: by the server itself). What is too long is
// cut.
void recorder_note(struct recorder *recorder, const char *actor, const char *action,
                   const char *subject);

// Tries once more to write what waits; large traces are left to the next start. NULL inside is
// fine.
void recorder_stop(struct recorder **recorder);
