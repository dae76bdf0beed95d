// What instructors say to a session: notes, and points to touch. The session's slot keeps them for
// the pages, and its trace keeps them for good.
#pragma once

#include "trace/remark.h"
#include "wire/wire.h"

// All under the lock of the slot.
struct remarks {
    uint64_t session;  // its serial
    uint64_t revision; // counts up with each change
    int count;
    struct kept_remark {
        uint64_t revision; // of its last change
        struct remark remark;
    } * all; // by number - 1
};

// A session begins. What was said in it before its server was killed is taken over: *said is empty
// afterwards; or NULL.
void remarks_begin(struct remarks *remarks, uint64_t session, struct remarks *said);
void remarks_fini(struct remarks *remarks);

// The last state of a remark; numbers below it that never came are withdrawn ones.
void remarks_put(struct remarks *remarks, const struct remark *remark);

// start_ns: the session's, on its clock.
void remark_to_wire(const struct remark *remark, int64_t start_ns, arthron_Remark *out_message);
