// The remarks of a session: instructors' notes, and points to touch. The station's slot keeps them
// for the pages. The trace keeps them for good.
#pragma once

#include "trace/remark.h"
#include "wire/wire.h"

// Use only under the slot's lock.
struct remarks {
    uint64_t session;  // its serial
    uint64_t revision; // counts up with each change
    int count;
    struct kept_remark {
        uint64_t revision; // of its last change
        struct remark remark;
    } * all; // by number - 1
};

// A session begins. said: NULL, or its remarks from before the server was killed, which are moved
// here; *said is empty afterwards.
void remarks_begin(struct remarks *remarks, uint64_t session, struct remarks *said);
void remarks_fini(struct remarks *remarks);

// Adds a remark, or replaces the one with its number. Smaller numbers that are missing count as
// withdrawn.
void remarks_put(struct remarks *remarks, const struct remark *remark);

// start_ns: the session's, on its clock.
void remark_to_wire(const struct remark *remark, int64_t start_ns, arthron_Remark *out_message);
