// What another server needs to go on with a station's session, as messages of a stream: one writer
// here for each station, and the reader of what others have written. No socket, no clock, no
// thread; the caller locks.
//
// A message has the token of the server that wrote it, and a number that rises by one from message
// to message of that token:
//
//     owned  the server has the station from now on: what a lower token writes behind it is void
//     base   a part of a base: all that a new part of the session's trace begins with
//            (trace/part.h)
//     more   records behind the base
//     ended  the session has ended
//
// A base is u32 size and bytes of: the header, the records of the whole session that outlast a
// state, the records behind the state, the state. A lost message makes all behind it void, until
// the next base.
#pragma once

#include "cluster/jet.h"
#include "trace/part.h"

#define JOURNAL_PATH_MAX 256 // of a trace

struct journal_writer;

struct journal_writer *journal_writer_create(void);
void journal_writer_destroy(struct journal_writer **writer);

// The server has the station by this token: messages are numbered anew, the first is `owned`.
// Nothing else is given out until journal_go_on: the session here, if there is one, may be older
// than what others have written.
void journal_own(struct journal_writer *writer, uint64_t token);
// What others have written by lower tokens is known here.
void journal_go_on(struct journal_writer *writer, uint64_t token);

// A session begins here, or goes on. trace: its path. What came before it is told by
// journal_record at once.
void journal_begin(struct journal_writer *writer, const struct trace_header *header,
                   const char *trace, const struct job *asked);
void journal_end(struct journal_writer *writer); // it has ended
// It goes on elsewhere: nothing more is written.
void journal_leave(struct journal_writer *writer);
// As its trace tells by a tap. A session whose states cannot be kept is given up at last.
void journal_record(struct journal_writer *writer, const struct trace_record *tapped);
// A state of it is on disk.
void journal_kept(struct journal_writer *writer);
// A message was lost, or may be: `owned` is given out again, and a new base is needed.
void journal_break(struct journal_writer *writer);

// The session is about to go on elsewhere: the next state that is kept makes a base, if there is
// anything to run again behind the last one.
void journal_refresh(struct journal_writer *writer);
// Path of the trace whose state the next base needs; NULL: none is needed. now_ns: monotonic.
const char *journal_wants_state(const struct journal_writer *writer, int64_t now_ns);
// The same of one that is newer than the last base; NULL: there is none.
const char *journal_newer_state(const struct journal_writer *writer);
// Makes the base. bytes: of the state file; its place tells which records it has already. None
// (NULL): it could not be read. False: no base came of it.
bool journal_put_state(struct journal_writer *writer, const uint8_t *bytes, size_t size,
                       int64_t now_ns);

// The next message; its data are valid until the next call. False: there is none now.
bool journal_next(struct journal_writer *writer, struct jet_message *out_message);

// Whether `owned` was given out.
bool journal_owns(const struct journal_writer *writer);
// Whether no state of a session is there yet: nothing can be lost.
bool journal_is_empty(const struct journal_writer *writer);
// Whether a base and all that came behind it was given out.
bool journal_is_whole(const struct journal_writer *writer);
// Whether no journal_refresh waits for its state.
bool journal_is_fresh(const struct journal_writer *writer);

// ---- reading

struct journal_reader;

struct journal_reader *journal_reader_create(void);
void journal_reader_destroy(struct journal_reader **reader);
// Of the messages in the stream's order; twice is fine.
void journal_take(struct journal_reader *reader, const struct jet_message *message);

struct journal_session {
    struct trace_header header;
    uint64_t token;        // of the server that wrote the base
    uint64_t newest_token; // of all that had the station
    bool has_ended;
    const uint8_t *state;
    size_t state_size;
};

// RESULT_MISSING: there is no whole base. RESULT_FORMAT: it is damaged.
enum result journal_read(struct journal_reader *reader, struct journal_session *out_session,
                         struct error *err);
// Its records in order, behind journal_read. RESULT_CLOSED: no more are left. RESULT_FORMAT.
enum result journal_next_record(struct journal_reader *reader, struct trace_record *out_record,
                                struct error *err);
