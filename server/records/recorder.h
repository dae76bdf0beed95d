// The recorder: a thread that writes sessions, attempts and audit entries into the records (store),
// so that no step and no command waits for a database.
//
// When a session begins or has ended, the recorder writes its row at once. Another thread then
// reads the trace for its hash and metrics (scoring.h), and no row waits for it. If the database
// cannot be written (locked, damaged, full disk), the log says so, everything waits in order, and
// the recorder tries again. Sessions that still wait when the server ends come from their traces at
// the next start. Audit entries, which no trace contains, come from a file beside the records
// (audit_spool.h).
#pragma once

#include "records/session_row.h"
#include "store/attempts.h"

struct recorder;

typedef void (*attempt_row_taker)(void *user, const struct attempt_row *row);

// Texts are copied.
struct recorder_config {
    const char *records;    // the database; made if it does not exist
    const char *traces_dir; // of all traces of this server
    const char *authority;  // a PEM file: only traces signed under it give results
    scene_finder find;      // called from the scoring thread
    void *user;
    struct trace_signer signer; // of the audit log, each minute; sign NULL: it stays unsigned
    // Gives each attempt that a trace holds to `take`, from the scoring thread; scene: NULL where
    // `find` has none. NULL: traces have no attempts.
    void (*read_attempts)(const char *trace, const struct scene *scene, attempt_row_taker take,
                          void *taker);
    // After a row was written that the records had not, from the recorder's thread; NULL: nobody
    // wants to know.
    void (*attempt_written)(void *user, struct store *store, const char *session, int number);
    void *attempt_user;
};

// Adds the sessions in traces_dir that have no end in the records, with their attempts, then waits
// for more. Does the same again after the file of the records was replaced.
struct recorder *recorder_start(const struct recorder_config *config);

// From any thread; copies, and does not wait for a disk. The trace of a session that has ended must
// be closed. recorder NULL: the server keeps no records.
void recorder_put(struct recorder *recorder, const struct store_session *session);

// The same for the session of a trace that is no longer written, whose header is read at once.
// False if the trace is written, is a piece or cannot be read.
bool recorder_put_trace(struct recorder *recorder, const char *trace);

// The same for an attempt that has ended, of a session that was put before.
void recorder_attempt(struct recorder *recorder, const struct attempt_row *attempt);

// The same for an entry of the audit log with the current time. An empty actor is the server
// itself. Texts that are too long are cut.
void recorder_note(struct recorder *recorder, const char *actor, const char *action,
                   const char *subject);

// How much waits for the records. Any thread. recorder NULL: nothing.
int recorder_waiting(struct recorder *recorder);

// For need_before_end (base/check.h): leaves the audit entries that wait to the next start. One
// that is just being written may be there twice then.
void recorder_write_last(struct recorder *recorder);

// Tries once more to write everything that waits. Leaves large traces to the next start. NULL
// inside is fine.
void recorder_stop(struct recorder **recorder);
