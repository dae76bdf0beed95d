#include "cluster/posting.h"

#include <string.h>

#define IN_FLIGHT_MAX 64

void posting_own(struct posting *p, uint64_t token) {
    atomic_store(&p->token, token);
}

bool posting_has_lost(struct posting *p) {
    return atomic_exchange(&p->lost, false);
}

static bool is_first_of_base(const struct jet_message *message) {
    static const uint8_t zero[sizeof(uint32_t)];
    return !strcmp(message->kind, "base") &&
           !memcmp((const uint8_t *)message->data + sizeof zero, zero, sizeof zero);
}

bool posting_next(struct posting *p, struct journal_writer *writer, struct jet_message *out,
                  bool *out_begins_base) {
    if (atomic_load(&p->in_flight) >= IN_FLIGHT_MAX || !journal_next(writer, out))
        return false;
    *out_begins_base = is_first_of_base(out);
    atomic_fetch_add(&p->in_flight, 1);
    return true;
}

void posting_answered(struct posting *p, uint64_t token, bool begins_base, enum write_answer answer,
                      uint64_t sequence) {
    if (answer != WRITE_DONE) {
        atomic_store(&p->lost, true);
    } else if (begins_base && token >= atomic_load(&p->base_token)) {
        atomic_store(&p->base_begins, sequence);
        atomic_store(&p->base_token, token);
    }
    atomic_fetch_sub(&p->in_flight, 1);
}

bool posting_is_done(const struct posting *p) {
    return !atomic_load(&p->in_flight) && !atomic_load(&p->lost);
}

uint64_t posting_purges(struct posting *p, bool serves) {
    uint64_t token = atomic_load(&p->base_token), begins = atomic_load(&p->base_begins);
    bool is_own = token && token == atomic_load(&p->token);
    if (!serves || !is_own || begins == p->purged || !posting_is_done(p))
        return 0;
    p->purged = begins;
    return begins;
}
