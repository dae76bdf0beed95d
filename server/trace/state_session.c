#include "trace/state_session.h"

#include <string.h>

size_t state_section_begin(struct kept *k) {
    uint64_t size = 0;
    kept_u64(k, &size);
    return k->used;
}

void state_section_end(struct kept *k, size_t begin) {
    uint64_t size = k->used - begin;
    if (!k->bad)
        memcpy(k->data + begin - sizeof size, &size, sizeof size);
}

struct kept state_section(const struct trace_state *state, enum state_section section) {
    struct kept all = kept_from(state->content, state->size);
    all.bad = state->format != KEPT_FORMAT;
    for (int i = 0; !all.bad; i++) {
        uint64_t size;
        kept_u64(&all, &size);
        kept_holds(&all, size <= kept_left(&all));
        if (all.bad)
            break;
        if (i == (int)section)
            return kept_from(all.data + all.used, (size_t)size);
        all.used += (size_t)size;
    }
    return (struct kept){.reads = true, .bad = true};
}

// The operation first: it has the touch that the session eases to.
static bool read_both(const struct trace_state *state, struct session *session,
                      struct operation *operation, struct job *asked) {
    struct kept from = state_section(state, STATE_OPERATION);
    operation_keep(operation, &from);
    if (from.bad || kept_left(&from))
        return false;
    from = state_section(state, STATE_SESSION);
    session_keep(session, asked, operation, &from);
    return !from.bad && !kept_left(&from) && session_hash(session) == state->output_hash;
}

enum result state_session_read(const struct trace_state *state, const struct scene *scene,
                               const struct session_settings *settings,
                               struct session **out_session, struct operation **out_operation,
                               struct job *out_asked, struct error *err) {
    memset(out_asked, 0, sizeof *out_asked);
    if (state->format != KEPT_FORMAT)
        return fail(err, RESULT_VERSION,
                    "the state is of format %u, and this program knows format %d", state->format,
                    KEPT_FORMAT);
    if (settings->rules != RULES_NEWEST)
        return fail(err, RESULT_FORMAT, "a session by older rules is not kept");
    *out_session = session_create(scene, settings);
    *out_operation = operation_create(scene, settings->rules, &settings->instruments);
    if (read_both(state, *out_session, *out_operation, out_asked))
        return RESULT_OK;
    session_destroy(out_session);
    operation_destroy(out_operation);
    return fail(err, RESULT_FORMAT, "it is not the state of this session");
}
