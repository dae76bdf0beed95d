// A station's journal on its way into the stream: what is under way, what answers mean, and what
// may be purged. No socket, no clock, no thread; answers may come on any thread, the caller locks
// the rest.
#pragma once

#include "cluster/journal.h"

#include <stdatomic.h>

struct posting {
    atomic_uint_fast64_t token; // by which this server has the station; 0: it has not
    atomic_int in_flight;
    atomic_bool lost; // an answer that was none
    // Of the newest base: the token of its messages, and the sequence of the first one.
    atomic_uint_fast64_t base_token, base_begins;
    uint64_t purged; // before it
};

// The server has the station by this token; 0: it has not.
void posting_own(struct posting *posting, uint64_t token);

// Whether a message was lost since the last call: the journal is to be broken.
bool posting_has_lost(struct posting *posting);
// The next message that may be sent now; each is answered. False: none.
bool posting_next(struct posting *posting, struct journal_writer *writer,
                  struct jet_message *out_message, bool *out_begins_base);
// token: of the message. On one thread, where it is WRITE_DONE.
void posting_answered(struct posting *posting, uint64_t token, bool begins_base,
                      enum write_answer answer, uint64_t sequence);
// Whether nothing is under way, and all that was is in the stream.
bool posting_is_done(const struct posting *posting);
// The sequence before which nothing is needed any more, once for each; 0: there is none. serves:
// whether this server may serve now. Else another one may have the station, and what that one wrote
// may be before this one's base.
uint64_t posting_purges(struct posting *posting, bool serves);
