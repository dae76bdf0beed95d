// Goes on with a session of another server, or with this server's own one after its restart.
#pragma once

#include "cluster/journal.h"
#include "sessions/parts.h"

// The journal's session of a station that is this server's by this token, and has none here. What
// the journal tells becomes the next part of the session's trace, which is run as after a restart.
// Where the journal's own part lies in the folder here, that one goes on. RESULT_MISSING: this
// server has not its case. Other results as trace_part_create, journal_next_record and restore_run.
enum result takeover_run(struct sessions *sessions, int station, uint64_t token,
                         const struct journal_session *session, struct journal_reader *reader,
                         struct error *err);
