#include "sessions/attempt_rows.h"

#include "base/check.h"
#include "base/log.h"
#include "judging/judging.h"
#include "runtime/attempt_state.h"
#include "task/tell.h"
#include "trace/catalogue.h"

#include <openssl/evp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void hash_file(const struct task_file *file, char out[STORE_HASH_MAX]) {
    uint8_t hash[EVP_MAX_MD_SIZE];
    unsigned size = 0;
    int done = EVP_Digest(file->text, file->size, hash, &size, EVP_sha256(), NULL);
    NEED(done, "memory");
    for (unsigned i = 0; i < size; i++)
        snprintf(out + 2 * (size_t)i, 3, "%02x", hash[i]);
}

static void fill(const char *session, int64_t begun_utc_ns, const struct trace_attempt *begun,
                 const struct task_file *file, const struct trace_outcome *ended,
                 struct attempt_row *out) {
    *out = (struct attempt_row){
        .number = (int)begun->number,
        .task_version = file->task.version,
        .first_step = ended->first_step,
        .last_step = ended->last_step,
        .begun_utc_ns = begun_utc_ns,
        .time_s = 1e-9 * (double)ended->time_ns,
        .goals = file->task.goal_count,
        .goals_met = (int)ended->goals_met,
        .errors = (int)ended->errors,
        .sentinel = ended->end == ATTEMPT_SENTINEL,
        .pass_time_s = begun->pass_time_s,
        .pass_errors = (int)begun->pass_errors,
        .mark_version = (int)begun->mark_version,
    };
    memcpy(out->session, session, sizeof out->session);
    snprintf(out->task, sizeof out->task, "%s", file->task.name);
    snprintf(out->title, sizeof out->title, "%s", file->task.title);
    snprintf(out->purpose, sizeof out->purpose, "%s", attempt_purpose_name(begun->purpose));
    snprintf(out->hand, sizeof out->hand, "%s", attempt_hand_name(begun->hand));
    snprintf(out->verdict, sizeof out->verdict, "%s", verdict_name(ended->verdict));
    snprintf(out->end, sizeof out->end, "%s", attempt_end_name(ended->end));
    hash_file(file, out->file_hash);
}

static void fill_figures(const struct site *site, const struct attempt *attempt,
                         struct attempt_row *row) {
    if (attempt->errors > attempt->occurrence_count)
        log_warning("records", "session %s, attempt %d: the first %d of %d errors have their steps",
                    row->session, row->number, attempt->occurrence_count, attempt->errors);
    if (!tell_figures(site, attempt, row->figures, sizeof row->figures))
        log_error("records", "session %s, attempt %d: its figures are too long for the records",
                  row->session, row->number);
    if (!tell_occurrences(site, attempt, row->occurrences, sizeof row->occurrences))
        log_error("records", "session %s, attempt %d: its occurrences are too long for the records",
                  row->session, row->number);
}

void attempt_row_of(const struct session_attempt *a, const char session[STORE_ID_MAX],
                    int64_t start_utc_ns, struct attempt_row *out) {
    struct trace_attempt begun;
    struct trace_outcome ended;
    attempt_begun(a, &begun);
    attempt_outcome(a, &ended);
    fill(session, start_utc_ns + a->begun_ns, &begun, shared_site_file(a->site), &ended, out);
    fill_figures(shared_site_site(a->site), &a->attempt, out);
}

// ---- of a trace ---------------------------------------------------------------------------------

struct reading {
    const char *trace;
    char session[STORE_ID_MAX];
    int64_t utc_ns; // when the session's clock was 0
    attempt_row_taker take;
    void *user;
};

static void take_judged(void *user, const struct judged_attempt *judged) {
    const struct reading *r = user;
    struct attempt_row *row;
    if (!judged->ended)
        return;
    row = alloc(1, sizeof *row);
    fill(r->session, r->utc_ns + judged->begun_ns, judged->begun, judged->file, judged->ended, row);
    if (judged->site && judged->is_same)
        fill_figures(judged->site, &judged->attempt, row);
    if (!judged->is_same)
        log_warning("records", "%s: attempt %d is judged otherwise now: it has no figures",
                    r->trace, row->number);
    r->take(r->user, row);
    free(row);
}

void attempt_rows_read(const char *trace, const struct scene *scene, attempt_row_taker take,
                       void *user) {
    struct reading reading = {.trace = trace, .take = take, .user = user};
    struct attempt_taker taker = {.user = &reading, .take = take_judged};
    struct trace_reader *reader;
    struct error err;
    if (trace_reader_create(trace, &reader, &err) != RESULT_OK) {
        log_error("records", "its attempts are not recorded: %s", err.text);
        return;
    }
    const struct trace_header *header = trace_reader_header(reader);
    trace_id_text(header->session_id, reading.session);
    reading.utc_ns = header->start_utc_ns - header->start_ns;
    if (judge_trace(reader, scene, &taker, &err) == RESULT_REFUSED)
        log_error("records", "%s: not recorded: %s", trace, err.text);
    trace_reader_destroy(&reader);
}
