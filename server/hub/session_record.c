#include "hub/session_record.h"

#include "base/check.h"
#include "session/scene.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <xxhash.h>

#define FIGURES_VERSION 1
#define HASH_TURN ((size_t)1 << 18)

void session_record_begin(const struct trace_header *header, const char *trace,
                          struct session_record *out) {
    memset(out, 0, sizeof *out);
    struct store_session *s = &out->session;
    for (int i = 0; i < 16; i++)
        snprintf(s->id + 2 * i, 3, "%02x", header->session_id[i]);
    snprintf(s->station, sizeof s->station, "%s", header->station);
    snprintf(s->trainee, sizeof s->trainee, "%s", header->trainee);
    snprintf(s->case_name, sizeof s->case_name, "%s", header->case_name);
    snprintf(s->trace, sizeof s->trace, "%s", trace);
    s->case_hash = header->case_hash;
    s->start_utc_ns = header->start_utc_ns;
    s->state = STATE_OPEN;
}

// ---- figures ------------------------------------------------------------------------------------

static struct store_result *add(struct session_record *record, const char *group,
                                const char *metric, const char *unit, double value) {
    CHECK(record->result_count < SESSION_RESULTS_MAX);
    struct store_result *r = &record->results[record->result_count++];
    *r = (struct store_result){.version = FIGURES_VERSION, .value = value};
    snprintf(r->metric, sizeof r->metric, "resection.%s", metric);
    snprintf(r->subject, sizeof r->subject, "%s", group);
    snprintf(r->unit, sizeof r->unit, "%s", unit);
    return r;
}

// Row by row along the rim, in each from the rim inwards.
static void tell_zones(const struct zone_volumes *zones, struct store_result *result) {
    char *at = result->details, *end = at + sizeof result->details;
    at += snprintf(at, (size_t)(end - at), "{\"zones_mm3\":[");
    for (int i = 0; i < ZONE_ALONG_COUNT * ZONE_ACROSS_COUNT; i++)
        at += snprintf(at, (size_t)(end - at), "%s%.6g", i ? "," : "",
                       zones->mm3[i / ZONE_ACROSS_COUNT][i % ZONE_ACROSS_COUNT]);
    snprintf(at, (size_t)(end - at), "]}");
}

void session_record_figures(struct session_record *record, const char *group,
                            const struct tissue_figures *f) {
    const struct quality_report *q = &f->quality;
    add(record, group, "cuts", "", f->cuts);
    add(record, group, "cuts_refused", "", f->refused);
    add(record, group, "pieces", "", f->pieces);
    add(record, group, "left", "mm3", f->volume_mm3);
    tell_zones(&q->removed, add(record, group, "removed", "mm3", f->removed_mm3));
    add(record, group, "removed_in_pieces", "mm3", f->pieces_mm3);
    add(record, group, "rim", "mm", q->rim_mm);
    add(record, group, "contour_step", "mm", q->step_mm);
    if (q->planned_mm3 <= 0)
        return;
    add(record, group, "planned", "mm3", q->planned_mm3);
    add(record, group, "over", "mm3", q->over_mm3);
    add(record, group, "under", "mm3", q->under_mm3);
    add(record, group, "damage_left", "mm3", q->damage_mm3);
}

// ---- hash ---------------------------------------------------------------------------------------

bool session_record_hash(struct store_session *session) {
    int fd = open(session->trace, O_RDONLY | O_CLOEXEC);
    if (fd < 0)
        return false;
    XXH3_state_t *state = XXH3_createState();
    uint8_t *turn = alloc(1, HASH_TURN);
    CHECK(state);
    XXH3_64bits_reset(state);
    ssize_t got;
    while ((got = read(fd, turn, HASH_TURN)) > 0)
        XXH3_64bits_update(state, turn, (size_t)got);
    session->trace_hash = XXH3_64bits_digest(state);
    session->trace_is_hashed = got == 0;
    XXH3_freeState(state);
    free(turn);
    close(fd);
    return session->trace_is_hashed;
}

// ---- from the trace -----------------------------------------------------------------------------

struct story {
    struct session_record *record;
    int64_t begin_ns, last_ns;
    bool known[TISSUES_MAX]; // has figures
    struct tissue_figures figures[TISSUES_MAX];
};

static void take_step(struct story *story, const struct trace_record *record) {
    const struct landed *landed = &record->output.landed;
    story->record->session.steps++;
    story->last_ns = record->input.time_ns;
    if (!record->job_done || (unsigned)landed->tissue >= TISSUES_MAX)
        return;
    story->known[landed->tissue] = true;
    story->figures[landed->tissue] = landed->figures;
}

static enum result read_steps(struct trace_reader *reader, struct story *story, struct error *err) {
    struct store_session *s = &story->record->session;
    struct trace_record *record = alloc(1, sizeof *record);
    enum result result;
    s->state = STATE_INTERRUPTED;
    while ((result = trace_read(reader, record, err)) == RESULT_OK) {
        if (record->type == TRACE_STEP) {
            take_step(story, record);
        } else if (record->type == TRACE_GAP) {
            s->missing += record->missing;
        } else {
            s->state = STATE_CLOSED;
            s->missing = record->missing;
        }
    }
    free(record);
    return result == RESULT_CLOSED ? RESULT_OK : result;
}

static void name_figures(struct story *story, const struct scene *scene) {
    for (int i = 0; i < TISSUES_MAX; i++) {
        char name[STORE_NAME_MAX];
        snprintf(name, sizeof name, "tissue %d", i + 1);
        if (scene && i < scene_tissue_count(scene))
            snprintf(name, sizeof name, "%s",
                     scene_case(scene)->groups[scene_tissue_group(scene, i)].name);
        if (story->known[i])
            session_record_figures(story->record, name, &story->figures[i]);
    }
}

enum result session_record_from_trace(const char *trace, scene_finder find, void *user,
                                      struct session_record *out, struct error *err) {
    struct trace_reader *reader;
    enum result result = trace_reader_create(trace, &reader, err);
    if (result != RESULT_OK)
        return result;
    const struct trace_header *header = trace_reader_header(reader);
    struct story story = {.record = out, .begin_ns = header->start_ns, .last_ns = header->start_ns};
    session_record_begin(header, trace, out);
    result = read_steps(reader, &story, err);
    if (result == RESULT_MISSING || result == RESULT_CORRUPT || result == RESULT_FORMAT)
        result = RESULT_OK; // what is before that counts
    if (story.last_ns > story.begin_ns)
        out->session.end_utc_ns = header->start_utc_ns + (story.last_ns - story.begin_ns);
    name_figures(&story, find(user, header->case_hash));
    trace_reader_destroy(&reader);
    return result;
}
