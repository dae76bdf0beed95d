#include "sessions/takeover.h"

#include "base/clock.h"
#include "base/log.h"
#include "sessions/opening.h"
#include "sessions/resume.h"
#include "sessions/sharing.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

// Its part of the journal's session, open.
static bool is_local(const struct sessions *s, int station, const struct journal_session *session,
                     char out_path[SESSIONS_PATH_MAX]) {
    struct trace_reader *reader;
    struct error err;
    if (resume_newest(s, station_name(s, station), out_path, &err) != RESULT_OK || !out_path[0] ||
        trace_reader_create(out_path, &reader, &err) != RESULT_OK)
        return false;
    const struct trace_header *header = trace_reader_header(reader);
    bool is_it =
        !memcmp(header->session_id, session->header.session_id, sizeof header->session_id) &&
        header->part >= session->header.part;
    trace_reader_destroy(&reader);
    return is_it && trace_is_open(out_path);
}

// The case's folder is this server's.
static enum result next_header(const struct sessions *s, int station, uint64_t token,
                               const struct journal_session *session, struct trace_header *out,
                               struct error *err) {
    *out = session->header;
    for (int i = 0; i < s->config.case_count; i++) {
        if (scene_case(s->scenes[i])->hash != out->case_hash)
            continue;
        out->version = TRACE_VERSION;
        out->part++;
        trace_header_set_machine(out);
        sharing_header(s, station, out);
        out->token = token;
        snprintf(out->case_dir, sizeof out->case_dir, "%s", s->config.cases[i].dir);
        return RESULT_OK;
    }
    return fail(err, RESULT_MISSING, "this server has not the case %s as it is there",
                out->case_name);
}

static enum result append_records(struct trace_writer *writer, struct journal_reader *reader,
                                  struct error *err) {
    struct trace_record record;
    enum result result;
    while ((result = journal_next_record(reader, &record, err)) == RESULT_OK) {
        result = trace_append_record(writer, &record, err);
        if (result != RESULT_OK)
            return result;
    }
    return result == RESULT_CLOSED ? RESULT_OK : result;
}

static enum result write_part(struct sessions *s, const char *draft,
                              const struct trace_header *header,
                              const struct journal_session *session, struct journal_reader *reader,
                              struct error *err) {
    struct trace_writer *writer;
    unlink(draft);
    enum result result = trace_part_create(draft, header, session->state, session->state_size,
                                           &s->trace_signer, NULL, &writer, err);
    if (result != RESULT_OK)
        return result;
    result = append_records(writer, reader, err);
    trace_writer_leave(&writer);
    return result;
}

// The part has no trace's name until it is whole (trace/part.h).
static enum result make_part(struct sessions *s, int station, uint64_t token,
                             const struct journal_session *session, struct journal_reader *reader,
                             char out_path[SESSIONS_PATH_MAX], struct error *err) {
    struct trace_header header;
    char draft[SESSIONS_PATH_MAX + 8];
    enum result result = next_header(s, station, token, session, &header, err);
    if (result == RESULT_OK)
        result = opening_trace_path(s, &header, out_path, err);
    if (result != RESULT_OK)
        return result;
    snprintf(draft, sizeof draft, "%s.draft", out_path);
    result = write_part(s, draft, &header, session, reader, err);
    if (result == RESULT_OK && link(draft, out_path) != 0)
        result = fail(err, RESULT_IO, "%s: it is there already, or cannot be made", out_path);
    unlink(draft);
    return result;
}

enum result takeover_run(struct sessions *s, int station, uint64_t token,
                         const struct journal_session *session, struct journal_reader *reader,
                         struct error *err) {
    char path[SESSIONS_PATH_MAX];
    int64_t begin_ns = clock_now_ns();
    enum result result = RESULT_OK;
    if (!is_local(s, station, session, path))
        result = make_part(s, station, token, session, reader, path, err);
    if (result == RESULT_OK)
        result = resume_here(s, station, path, err);
    if (result == RESULT_OK)
        log_info("sessions",
                 "station %s: its session of server %s goes on here after %.0f ms, in %s",
                 station_name(s, station), session->header.server,
                 (double)(clock_now_ns() - begin_ns) / NS_PER_MS, path);
    return result;
}
