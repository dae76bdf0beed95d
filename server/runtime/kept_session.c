#include "runtime/kept_session.h"

#include "base/check.h"
#include "trace/state_session.h"

#include <stdlib.h>
#include <string.h>

_Static_assert(sizeof(struct metrics) == 49760 && offsetof(struct attempt, hints) == 10272 &&
                   sizeof(struct snapshot_maker) == 2816,
               "what is copied as it lies: where it changes, raise KEPT_FORMAT (trace/state.h)");

static void write_attempt(const struct session_runtime *session, struct kept *k) {
    const struct session_attempt *runs = session->attempt;
    struct kept_attempt attempt = {.begun = session->attempts};
    size_t begin = state_section_begin(k);
    if (runs && runs->attempt.end == ATTEMPT_RUNS) {
        attempt.number = runs->number;
        attempt.begun_ns = runs->begun_ns;
        attempt.attempt = runs->attempt;
    }
    kept_attempt_keep(&attempt, k);
    state_section_end(k, begin);
}

void kept_session_write(const struct session_runtime *session, const struct job *asked,
                        struct kept *k) {
    struct job job = *asked;
    write_attempt(session, k);
    size_t begin = state_section_begin(k);
    metrics_keep((struct metrics *)(uintptr_t)&session->metrics.metrics, k);
    state_section_end(k, begin);
    begin = state_section_begin(k);
    session_keep(session->session, &job, NULL, k);
    state_section_end(k, begin);
    begin = state_section_begin(k);
    snapshot_keep((struct snapshot_maker *)(uintptr_t)&session->snapshots, k);
    state_section_end(k, begin);
}

void kept_session_join(const struct kept *session, const struct kept *operation,
                       struct trace_state *state) {
    state->size = session->used + sizeof(uint64_t) + operation->used;
    state->content = alloc(state->size, 1);
    struct kept all = kept_into(state->content, state->size);
    kept_bytes(&all, session->data, session->used);
    size_t begin = state_section_begin(&all);
    kept_bytes(&all, operation->data, operation->used);
    state_section_end(&all, begin);
    CHECK(!all.bad && all.used == all.size);
}

static bool is_read(const struct kept *k) {
    return !k->bad && !kept_left(k);
}

static bool read_rest(const struct trace_state *state, struct kept_session *out) {
    struct kept metrics = state_section(state, STATE_METRICS);
    struct kept snapshot = state_section(state, STATE_SNAPSHOT);
    metrics_keep(&out->metrics, &metrics);
    snapshot_keep(&out->snapshots, &snapshot);
    return is_read(&metrics) && is_read(&snapshot);
}

enum result kept_session_attempt(const struct trace_state *state, struct kept_attempt *out,
                                 struct error *err) {
    memset(out, 0, sizeof *out);
    if (state->format != KEPT_FORMAT)
        return fail(err, RESULT_VERSION, "the state is of format %u", state->format);
    struct kept k = state_section(state, STATE_ATTEMPT);
    kept_attempt_keep(out, &k);
    return is_read(&k) ? RESULT_OK : fail(err, RESULT_FORMAT, "its attempt is damaged");
}

enum result kept_session_read(const struct trace_state *state, const struct scene *scene,
                              const struct trace_header *header, struct kept_session *out,
                              struct error *err) {
    const struct session_settings *settings = &header->settings;
    memset(out, 0, sizeof *out);
    metrics_init(&out->metrics, &settings->instruments, header->optic);
    snapshot_begin(&out->snapshots, 0, header->start_ns);
    enum result result = kept_session_attempt(state, &out->attempt, err);
    if (result == RESULT_OK)
        result = state_session_read(state, scene, settings, &out->session, &out->operation,
                                    &out->asked, err);
    if (result != RESULT_OK || read_rest(state, out))
        return result;
    session_destroy(&out->session);
    operation_destroy(&out->operation);
    return fail(err, RESULT_FORMAT, "it is not the state of this session");
}
