// What waits for the records, in order: rows of sessions, entries of the audit log, attempts and
// scores.
#pragma once

#include "records/session_row.h"
#include "store/attempts.h"

enum waiting_kind { WAITING_ROW, WAITING_ENTRY, WAITING_ATTEMPT, WAITING_SCORE };

struct waiting {
    struct waiting *next;
    enum waiting_kind kind;
    union {
        struct store_session row;
        struct store_audit_entry entry;
        struct attempt_row *attempt; // owned, as is what a score holds
        struct session_score score;
    };
};

struct waiting_list {
    struct waiting *first, *last;
};

// Copies `from`; what it owns is the list's from then on.
void waiting_append(struct waiting_list *list, const struct waiting *from);

// Puts all of `head` before all of `list`, and leaves `head` empty.
void waiting_put_before(struct waiting_list *list, struct waiting_list *head);

// Takes the first one out, which then is the caller's to free with waiting_free.
struct waiting *waiting_take(struct waiting_list *list);

void waiting_free(struct waiting *waiting); // NULL is fine
void waiting_clear(struct waiting_list *list);
