#include "records/session_row.h"

#include "base/check.h"
#include "base/log.h"
#include "metrics/subject.h"
#include "trace/catalogue.h"
#include "trace/player.h"
#include "trace/state_session.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <xxhash.h>

_Static_assert(sizeof((struct store_session *)0)->trace_hash == 2 * TRACE_HASH_SIZE + 1,
               "all of it");

#define HASH_TURN ((size_t)1 << 18)

void session_row_begin(const struct trace_header *header, const char *trace,
                       struct store_session *out) {
    *out = (struct store_session){
        .case_hash = header->case_hash,
        .start_utc_ns = header->start_utc_ns,
        .state = STATE_OPEN,
        .part = header->part ? header->part : 1,
    };
    trace_id_text(header->session_id, out->id);
    snprintf(out->station, sizeof out->station, "%s", header->station);
    snprintf(out->trainee, sizeof out->trainee, "%s", header->trainee);
    snprintf(out->case_name, sizeof out->case_name, "%s", header->case_name);
    snprintf(out->trace, sizeof out->trace, "%s", trace);
}

// ---- hash ---------------------------------------------------------------------------------------

static enum result hash_trace(struct store_session *session, struct error *err) {
    int fd = open(session->trace, O_RDONLY | O_CLOEXEC);
    if (fd < 0)
        return fail(err, RESULT_IO, "%s: %s", session->trace, strerror(errno));
    XXH3_state_t *state = XXH3_createState();
    uint8_t *turn = alloc(1, HASH_TURN);
    CHECK(state);
    XXH3_64bits_reset(state);
    ssize_t got;
    while ((got = read(fd, turn, HASH_TURN)) > 0)
        XXH3_64bits_update(state, turn, (size_t)got);
    session->trace_xxh3 = XXH3_64bits_digest(state);
    session->trace_is_read = got == 0;
    XXH3_freeState(state);
    free(turn);
    close(fd);
    return got ? fail(err, RESULT_IO, "%s: %s", session->trace, strerror(errno)) : RESULT_OK;
}

// ---- results ------------------------------------------------------------------------------------

_Static_assert(STORE_NAME_MAX >= SUBJECT_MAX, "what a figure is about fits");

struct score_builder {
    struct session_score *score;
    const struct knee_case *knee; // or NULL
};

static void take_value(void *user, const struct metric_value *v) {
    const struct score_builder *builder = user;
    struct session_score *score = builder->score;
    const struct metric_kind *kind = &metric_kinds[v->metric];
    if (score->count == score->room) {
        score->room = 2 * score->room + 64;
        score->results =
            alloc_resize(score->results, (unsigned long)score->room, sizeof *score->results);
    }
    struct store_result *r = &score->results[score->count++];
    *r = (struct store_result){.version = kind->version, .value = v->value};
    snprintf(r->metric, sizeof r->metric, "%s", kind->name);
    snprintf(r->unit, sizeof r->unit, "%s", kind->unit);
    subject_text(builder->knee, v, r->subject);
    if (v->below_floor)
        snprintf(r->details, sizeof r->details, "{\"below_floor\":true}");
}

// ---- the trace ----------------------------------------------------------------------------------

struct row_reader {
    struct metrics *metrics;
    struct store_session *session;
    int64_t last_ns;
    int64_t begin_ns, begin_utc_ns; // from here on the session's clock and the time of day went
                                    // together
    int64_t resumed_utc_ns;         // without a step since; else 0
    int attempts;
    bool is_unknown; // what another server measured before
};

static bool on_step(void *user, const struct trace_record *record) {
    struct row_reader *r = user;
    metrics_step(r->metrics, &record->input, &record->output);
    if (r->resumed_utc_ns) {
        r->begin_ns = r->last_ns;
        r->begin_utc_ns = r->resumed_utc_ns;
        r->resumed_utc_ns = 0;
    }
    r->last_ns = record->input.time_ns;
    r->session->steps++;
    return true;
}

static bool on_elsewhere(void *user, const struct trace_record *record) {
    struct row_reader *r = user;
    metrics_pass(r->metrics, record->input.kind, &record->output.landed,
                 record->output.job.kind == JOB_UNDO);
    return true;
}

static bool on_state(void *user, const struct trace_state *state) {
    struct row_reader *r = user;
    struct kept kept = state_section(state, STATE_METRICS);
    r->is_unknown = !metrics_take_over(r->metrics, &kept);
    return !r->is_unknown;
}

static bool on_resume(void *user, int64_t utc_ns) {
    struct row_reader *r = user;
    metrics_interrupt(r->metrics);
    r->resumed_utc_ns = utc_ns;
    return true;
}

static bool on_gap(void *user, uint64_t missing) {
    struct row_reader *r = user;
    r->session->missing += missing;
    return true;
}

static bool on_ended(void *user, const struct trace_outcome *ended) {
    struct row_reader *r = user;
    (void)ended;
    r->attempts++;
    return true;
}

static bool on_end(void *user, uint64_t records, uint64_t missing) {
    struct row_reader *r = user;
    (void)records;
    r->session->state = STATE_CLOSED;
    r->session->missing = missing;
    return true;
}

// *out_closed: when the trace was closed, long after its last step if a killed server left it open.
// What is damaged counts as far as it is whole. RESULT_IO: the file cannot be read.
static enum result read_steps(struct trace_reader *reader, struct metrics *metrics,
                              struct session_score *score, int64_t *out_closed_utc_ns,
                              struct error *err) {
    struct store_session *s = &score->session;
    int64_t start_ns = trace_reader_header(reader)->start_ns;
    struct row_reader r = {metrics, s, start_ns, start_ns, s->start_utc_ns, 0, 0, false};
    struct trace_player player = {.user = &r,
                                  .step = on_step,
                                  .past = on_elsewhere,
                                  .taken = on_elsewhere,
                                  .state = on_state,
                                  .resume = on_resume,
                                  .gap = on_gap,
                                  .ended = on_ended,
                                  .end = on_end};
    s->state = STATE_INTERRUPTED;
    if (trace_play(reader, &player, err) == RESULT_IO)
        return RESULT_IO;
    if (r.is_unknown)
        return fail(err, RESULT_VERSION,
                    "%s: another version of this program kept what the server before had measured",
                    s->trace);
    score->attempts = r.attempts;
    s->end_utc_ns = r.begin_utc_ns + (r.last_ns > r.begin_ns ? r.last_ns - r.begin_ns : 0);
    struct trace_place place = trace_reader_place(reader);
    for (int i = 0; i < TRACE_HASH_SIZE; i++)
        snprintf(s->trace_hash + 2 * i, 3, "%02x", place.hash[i]);
    *out_closed_utc_ns = r.resumed_utc_ns > s->end_utc_ns ? r.resumed_utc_ns : s->end_utc_ns;
    return RESULT_OK;
}

// Whether the trace, read to its end, has a signature of the authority.
static bool is_signed(const struct trace_reader *reader, const char *authority,
                      int64_t closed_utc_ns, const struct store_session *s) {
    char signed_by[TRACE_SIGNED_BY_MAX];
    struct trace_seal seal;
    struct error err = {"it ends without a signature"};
    if (trace_reader_seal(reader, &seal) &&
        trace_seal_check(&seal, authority, closed_utc_ns, signed_by, &err) == RESULT_OK)
        return true;
    log_warning("records", "%s: %s; the session is recorded without results", s->trace, err.text);
    return false;
}

enum result session_score_trace(const char *trace, const char *authority, scene_finder find,
                                void *user, struct session_score *out, struct error *err) {
    struct trace_reader *reader;
    *out = (struct session_score){0};
    enum result result = trace_reader_create(trace, &reader, err);
    if (result != RESULT_OK)
        return result;
    const struct trace_header *header = trace_reader_header(reader);
    const struct scene *scene = find(user, header->case_hash);
    if (scene)
        trace_reader_bind(reader, scene);
    struct score_builder builder = {out, scene ? scene_case(scene) : NULL};
    struct metrics *metrics = alloc(1, sizeof *metrics);
    metrics_init(metrics, &header->settings.instruments, header->optic);
    session_row_begin(header, trace, &out->session);
    int64_t closed_utc_ns = 0;
    result = read_steps(reader, metrics, out, &closed_utc_ns, err);
    if (result == RESULT_OK && is_signed(reader, authority, closed_utc_ns, &out->session))
        metrics_each(metrics, builder.knee, take_value, &builder);
    else
        out->attempts = 0;
    free(metrics);
    trace_reader_destroy(&reader);
    if (result == RESULT_OK)
        result = hash_trace(&out->session, err);
    if (result != RESULT_OK)
        session_score_fini(out);
    return result;
}

void session_score_fini(struct session_score *score) {
    free(score->results);
    score->results = NULL;
    score->count = score->room = 0;
}
