#include "runtime/kept_session.h"

#include "base/check.h"

#include <stdlib.h>
#include <string.h>

void kept_session_write(const struct session_runtime *session, const struct job *asked,
                        struct kept *k) {
    struct job job = *asked;
    session_keep(session->session, &job, NULL, k);
    metrics_keep((struct metrics *)(uintptr_t)&session->metrics.metrics, k);
    snapshot_keep((struct snapshot_maker *)(uintptr_t)&session->snapshots, k);
}

void kept_session_join(const struct kept *session, const struct kept *operation,
                       struct trace_state *state) {
    uint64_t size = session->used;
    state->size = sizeof size + session->used + operation->used;
    state->content = alloc(state->size, 1);
    struct kept all = kept_into(state->content, state->size);
    kept_u64(&all, &size);
    kept_bytes(&all, session->data, session->used);
    kept_bytes(&all, operation->data, operation->used);
    CHECK(!all.bad && all.used == all.size);
}

// The operation first: it has the touch that the session eases to.
static bool read_parts(const struct trace_state *state, struct kept_session *out) {
    uint64_t size;
    struct kept all = kept_from(state->content, state->size);
    kept_u64(&all, &size);
    if (all.bad || size > kept_left(&all))
        return false;
    const uint8_t *data = all.data + all.used;
    struct kept session = kept_from(data, (size_t)size);
    struct kept operation = kept_from(data + size, kept_left(&all) - (size_t)size);
    operation_keep(out->operation, &operation);
    if (operation.bad || kept_left(&operation))
        return false;
    session_keep(out->session, &out->asked, out->operation, &session);
    metrics_keep(&out->metrics, &session);
    snapshot_keep(&out->snapshots, &session);
    return !session.bad && !kept_left(&session);
}

enum result kept_session_read(const struct trace_state *state, const struct scene *scene,
                              const struct trace_header *header, struct kept_session *out,
                              struct error *err) {
    const struct session_settings *settings = &header->settings;
    memset(out, 0, sizeof *out);
    metrics_init(&out->metrics, &settings->instruments, header->optic);
    snapshot_begin(&out->snapshots, 0, header->start_ns);
    if (settings->rules != RULES_NEWEST)
        return fail(err, RESULT_FORMAT, "a session by older rules is not kept");
    out->session = session_create(scene, settings);
    out->operation = operation_create(scene, settings->rules, &settings->instruments);
    if (read_parts(state, out) && session_hash(out->session) == state->output_hash)
        return RESULT_OK;
    session_destroy(&out->session);
    operation_destroy(&out->operation);
    return fail(err, RESULT_FORMAT, "it is not the state of this session");
}
