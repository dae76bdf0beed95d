// What sessions of a simulation learn: each moment names the one before, so whatever is read of a
// journal is known to be a beginning of what was played, or not. Moment 0 is none.
#pragma once

#include "cluster/journal.h"

enum moment_kind { MOMENT_ROOT, MOMENT_REMARK, MOMENT_COMMAND, MOMENT_CUT, MOMENT_KINDS };

struct moment {
    uint32_t before, root;
    uint32_t count, remarks; // with it, from the root on
    enum moment_kind kind;
    bool ended, ended_is_kept; // of a root
};

struct moments {
    struct moment *of;
    uint32_t count, room;
};

// before: of a root, any.
uint32_t moments_add(struct moments *m, uint32_t before, enum moment_kind kind);
struct moment *moments_root(const struct moments *m, uint32_t moment);
bool moments_follow(const struct moments *m, uint32_t early, uint32_t late); // or are the same
// The offset in the trace at which it is told.
uint64_t moments_offset(const struct moments *m, uint32_t moment);
// As a session's trace tells it.
void moments_tell(const struct moments *m, uint32_t moment, struct journal_writer *writer);
// All records of a journal behind a state at *in_out: the newest moment. False: they do not follow
// from one another.
bool moments_join(const struct moments *m, struct journal_reader *reader, uint32_t *in_out);
