#include "export/contents.h"

#include "base/clock.h"
#include "trace/player.h"

#include <string.h>

static double seconds_of(const struct trace_header *header, const struct session_output *output) {
    return (double)(output->time_ns - header->start_ns) / (double)NS_PER_S;
}

static bool is_wanted(const struct export_request *request, double seconds) {
    return seconds >= request->from_s && seconds <= request->to_s;
}

struct counting {
    const struct export_request *request;
    struct contents *contents;
};

static bool count_step(void *user, const struct trace_record *record) {
    const struct counting *counting = user;
    struct contents *contents = counting->contents;
    const struct session_output *output = &record->output;
    if (!is_wanted(counting->request, seconds_of(&contents->header, output)))
        return true;
    contents->steps++;
    if (record->input.kind == INPUT_FRAME)
        for (int i = 0; i < record->input.frame.count; i++) {
            const struct sample *s = &record->input.frame.samples[i];
            contents->sampled[s->channel][s->kind] = true;
        }
    contents->jobs += output->job.id != 0;
    if (output->job.move_count > contents->moves)
        contents->moves = output->job.move_count;
    contents->landed += output->landed.job != 0;
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        contents->present[i] |= output->instruments[i].present;
    return true;
}

// What a record says is held against its own case alone.
static enum result open_trace(const struct export_request *request,
                              struct trace_reader **out_reader, struct error *err) {
    enum result result = trace_reader_create(request->trace, out_reader, err);
    if (result == RESULT_OK && request->scene &&
        scene_case(request->scene)->hash == trace_reader_header(*out_reader)->case_hash)
        trace_reader_bind(*out_reader, request->scene);
    return result;
}

enum result contents_read(const struct export_request *request, struct contents *contents,
                          struct error *err) {
    struct trace_reader *reader;
    struct counting counting = {request, contents};
    struct trace_player player = {.user = &counting, .step = count_step};
    memset(contents, 0, sizeof *contents);
    enum result result = open_trace(request, &reader, err);
    if (result != RESULT_OK)
        return result;
    contents->header = *trace_reader_header(reader);
    contents->end = trace_play(reader, &player, &contents->why);
    memcpy(contents->hash, trace_reader_place(reader).hash, sizeof contents->hash);
    trace_reader_destroy(&reader);
    if (!contents->steps && (contents->end == RESULT_FORMAT || contents->end == RESULT_IO))
        return contents_end(contents, err);
    if (!contents->steps)
        return fail(err, RESULT_MISSING, "%s has no step in that time", request->trace);
    return RESULT_OK;
}

enum result contents_end(const struct contents *contents, struct error *err) {
    if (contents->end == RESULT_CLOSED)
        return RESULT_OK;
    return fail(err, contents->end, "%s", contents->why.text);
}

void bytes_text(const uint8_t *bytes, size_t count, char *out_text) {
    for (size_t i = 0; i < count; i++)
        snprintf(out_text + 2 * i, 3, "%02x", bytes[i]);
}

static bool ever_there(const struct step_field *field, const struct contents *contents) {
    if (field->owner <= OWNER_LOOSE)
        return OWNER_LOOSE - field->owner < contents->header.loose_count;
    if (field->owner <= OWNER_MOVE)
        return OWNER_MOVE - field->owner < contents->moves;
    switch (step_field_part(field)) {
    case OWNER_STEP:
        return true;
    case OWNER_JOB:
    case OWNER_LANDED:
        return contents->jobs > 0;
    default:
        return contents->present[field->owner];
    }
}

int contents_fields(const struct contents *contents,
                    struct step_field out_fields[STEP_FIELDS_MAX]) {
    struct step_field all[STEP_FIELDS_MAX];
    int count = 0, all_count = step_fields(all);
    for (int i = 0; i < all_count; i++)
        if (ever_there(&all[i], contents))
            out_fields[count++] = all[i];
    return count;
}

struct walking {
    struct walk *walk;
    uint64_t left; // steps
    walk_step step;
    void *user;
    bool begun;
};

static void tell_progress(const struct walk *walk) {
    uint64_t size = trace_reader_size(walk->reader);
    if (walk->request->progress)
        walk->request->progress((uint64_t)walk->pass * size + trace_reader_offset(walk->reader),
                                (uint64_t)walk->passes * size);
}

static bool on_contents_step(void *user, const struct trace_record *record) {
    struct walking *w = user;
    double seconds = seconds_of(trace_reader_header(w->walk->reader), &record->output);
    bool reads_on = w->walk->marker != NULL;
    if (!is_wanted(w->walk->request, seconds) || !w->left)
        return w->left || reads_on;
    tell_progress(w->walk);
    w->begun = true;
    w->left--;
    return w->step(w->user, record, seconds) && (w->left || reads_on);
}

static bool on_contents_remark(void *user, const struct remark *remark) {
    const struct walking *w = user;
    if (w->begun && w->walk->remark)
        w->walk->remark(w->user, remark);
    return true;
}

// One that came late is behind the steps of its time, and may be behind all that are exported.
static bool on_contents_marker(void *user, const struct marker *marker) {
    const struct walking *w = user;
    int64_t start_ns = trace_reader_header(w->walk->reader)->start_ns;
    double seconds = (double)(marker->time_ns - start_ns) / (double)NS_PER_S;
    if (w->walk->marker && is_wanted(w->walk->request, seconds))
        w->walk->marker(w->user, marker);
    return true;
}

static bool on_begun(void *user, const struct trace_attempt *begun) {
    const struct walking *w = user;
    if (w->begun && w->walk->begun)
        w->walk->begun(w->user, begun);
    return true;
}

static bool on_ended(void *user, const struct trace_outcome *ended) {
    const struct walking *w = user;
    if (w->begun && w->walk->ended)
        w->walk->ended(w->user, ended);
    return true;
}

enum result walk_run(struct walk *walk, const struct contents *contents, walk_step step, void *user,
                     struct error *err) {
    struct walking walking = {walk, contents->steps, step, user, false};
    struct trace_player player = {.user = &walking,
                                  .step = on_contents_step,
                                  .remark = on_contents_remark,
                                  .marker = on_contents_marker,
                                  .begun = on_begun,
                                  .ended = on_ended};
    enum result result = open_trace(walk->request, &walk->reader, err);
    if (result != RESULT_OK)
        return result;
    struct error why; // of damage and of an early end the first pass has told
    if (trace_play(walk->reader, &player, &why) == RESULT_IO)
        result = fail(err, RESULT_IO, "%s", why.text);
    walk->pass++;
    trace_reader_destroy(&walk->reader);
    return result;
}
