// The members of struct trace_reader. For reader.c and reader_skim.c only.
#pragma once

#include "trace/record.h"
#include "trace/state.h"

#include <stdio.h>

// The touch of the next job to land, put together from its parts.
struct gathering {
    uint64_t job; // 0: none
    int tissue;
    uint32_t whole, size;
    uint8_t *bytes;
    struct touch_change touch; // once it is whole
    struct trace_place place;  // before its first part
};

// The state from which a later part begins, put together too.
struct beginning {
    uint32_t whole, size;
    uint8_t *bytes; // until the record behind it is read
    struct trace_state state;
    bool is_read, is_told; // all of it; with the last record
    bool goes_on;          // what is recorded comes from behind the state, and is no step yet
    uint64_t taken;        // the last job
};

struct trace_reader {
    FILE *file;
    char *path;
    uint64_t size;
    struct trace_header header;
    struct trace_place place; // time 0 before the first step: where a session's clock begins
    struct chain chain;
    uint8_t before[TRACE_HASH_SIZE]; // the last record
    bool bound;                      // to a scene with so many
    int tissues, groups, torn;
    uint32_t tissue_vertices[TISSUES_MAX];
    uint8_t data[RECORD_MAX]; // of the last record
    struct trace_place skim_to;
    bool skims; // up to there
    struct beginning beginning;
    struct gathering gathering;
    bool landed;       // the gathered touch, with the last record
    uint32_t attempts; // the number of the last one that began
    bool attempted;    // it has not ended
    bool ended;        // the end record was read
    bool damaged;      // records were left out: what is read need not follow from what came before
    bool foreign;      // no writer wrote what stands where reading has ended
    struct trace_end end;
    uint8_t seal[TRACE_SEAL_SIZE];
    enum result state; // anything but OK: reading has ended so
    struct error why;
};

enum result reader_unreadable(const struct trace_reader *reader, struct error *err);

// ---- reader_skim.c ----

// Where a reader skims: passes over records, up to one that is to be read or to the end of that.
// RESULT_CORRUPT: they do not end where they should.
enum result reader_hop(struct trace_reader *reader, struct error *err);
