// A later part of a session's trace: where another server goes on with a session, its trace begins
// with a state of that session (trace/state.h) and with what came behind the state, but for the
// poses. From then on it is a trace like any other.
//
// The server before keeps a journal: the header, now and then the bytes of a state, and what its
// trace tells by a tap. The next one makes a trace of it:
//
//   1. trace_part_create: the header, with the next part's number, and the newest state.
//   2. trace_append_record for each record of the journal, in the order of the trace: remarks,
//      markers, begins and ends of attempts of the whole session; touches, taken jobs and commands
//      from the state's place on.
//   3. trace_writer_leave; then it is run as after a restart, and trace_writer_resume goes on.
//
// Until step 3 the file should have a name that no trace has: a start would resume it as it is.
#pragma once

#include "trace/state.h"

// Makes the file (it must not exist), writes the header and appends the state. header:
// that of the part before, but for build, libc and cpu, which are this program's
// (trace_header_set_machine), and for part, server and token. state_bytes: of a state file
// (trace_state_load).
//
// RESULT_CORRUPT: the bytes are no whole state. RESULT_VERSION: a program wrote them that keeps
// sessions in another format. RESULT_REFUSED: the state is of other rules than the header, or the
// header's part is none behind the first. RESULT_IO, RESULT_LIMIT as trace_writer_create.
enum result trace_part_create(const char *path, const struct trace_header *header,
                              const uint8_t *state_bytes, size_t size,
                              const struct trace_signer *signer, const struct trace_tap *tap,
                              struct trace_writer **out_writer, struct error *err);

// ---- the journal --------------------------------------------------------------------------------

// Makes of what a trace tells by its tap the records of a journal. Zero at the beginning of a
// session. Where a trace is gone on with, it begins with the job that its session waits for (of a
// restored one: sessions/restore.h).
struct trace_journal {
    struct job asked; // the last one that a step asked for; id 0: none
};

// True: *out_record is to be kept, with the offset and size of `tapped`: where the trace has it,
// beside the place of a state. A command becomes a TRACE_PAST, a landing the TRACE_TAKEN of its
// job; all others stay as they are. What the record points to stays valid as long as in `tapped`.
bool trace_journal_take(struct trace_journal *journal, const struct trace_record *tapped,
                        struct trace_record *out_record);

// Whether a record still counts where the trace begins with a later state: commands and jobs are in
// the state, remarks, markers and attempts are not.
bool trace_journal_outlasts_state(enum trace_record_type type);

// ---- the header and records as bytes, without the trace's hashes -------------------------------

#define TRACE_HEADER_PACKED_MAX 16384

// Returns the number of bytes in `out`, which holds TRACE_HEADER_PACKED_MAX.
size_t trace_header_pack(const struct trace_header *header, uint8_t *out);
// RESULT_FORMAT: the bytes are no header. RESULT_VERSION: one of a version that this program cannot
// read.
enum result trace_header_unpack(const uint8_t *bytes, size_t size, struct trace_header *out_header,
                                struct error *err);

#define TRACE_PACKED_MAX 10304 // bytes of one

// A record that trace_journal_take gave: a remark, a marker, an attempt's begin or end, a part of a
// touch, a past input, or a taken job. rules: of the session. Returns the number of bytes in `out`,
// which holds TRACE_PACKED_MAX.
size_t trace_record_pack(const struct trace_record *record, int rules, uint8_t *out);

// The next one from *in_out_at on, which then is behind it. The bytes may be anything, and the
// record is in its ranges; whether one follows from the other, the reader of the new part tells.
// The record points into the bytes. RESULT_CLOSED: there is none left. RESULT_FORMAT: it is none
// of the above, or damaged.
enum result trace_record_unpack(const uint8_t *bytes, size_t size, int rules, size_t *in_out_at,
                                struct trace_record *out_record, struct error *err);
