#include "trace/part_chain.h"

#include "base/check.h"
#include "trace/player.h"
#include "trace/state.h"

#include <stdlib.h>
#include <string.h>

struct part {
    const char *path;
    struct trace_header header;
    struct trace_place place; // of the state with which it begins
    uint64_t output_hash;
    bool has_state;
};

// ---- the headers --------------------------------------------------------------------------------

static bool on_part_state(void *user, const struct trace_state *state) {
    struct part *part = user;
    part->place = state->place;
    part->output_hash = state->output_hash;
    part->has_state = true;
    return false;
}

static bool stop(void *user, const struct trace_record *record) {
    (void)user;
    return record->type == TRACE_STATE;
}

static enum result look_at_part(struct part *part, struct error *err) {
    struct trace_reader *reader;
    struct trace_player player = {.user = part, .record = stop, .state = on_part_state};
    enum result result = trace_reader_create(part->path, &reader, err);
    if (result != RESULT_OK)
        return result;
    part->header = *trace_reader_header(reader);
    if (part->header.part > 1)
        result = trace_play(reader, &player, err);
    trace_reader_destroy(&reader);
    if (part->header.part > 1 && !part->has_state)
        return result == RESULT_OK ? fail(err, RESULT_REFUSED, "%s: it has no state", part->path)
                                   : fail_in(err, RESULT_REFUSED, "its state: ");
    return RESULT_OK;
}

static int by_part(const void *a, const void *b) {
    return ((const struct part *)a)->header.part - ((const struct part *)b)->header.part;
}

static bool is_of_session(const struct trace_header *a, const struct trace_header *b) {
    return !memcmp(a->session_id, b->session_id, sizeof a->session_id) &&
           a->case_hash == b->case_hash && a->start_ns == b->start_ns &&
           a->start_utc_ns == b->start_utc_ns && a->settings.rules == b->settings.rules;
}

static enum result check_headers(const struct part *parts, int count, struct error *err) {
    for (int i = 0; i < count; i++) {
        const struct trace_header *h = &parts[i].header;
        if (!is_of_session(h, &parts[0].header))
            return fail(err, RESULT_REFUSED, "%s is of another session than %s", parts[i].path,
                        parts[0].path);
        if (i > 0 && h->part == parts[i - 1].header.part)
            return fail(err, RESULT_REFUSED, "%s and %s both are part %u", parts[i - 1].path,
                        parts[i].path, h->part);
        if (h->part != i + 1)
            return fail(err, RESULT_REFUSED, "part %d of the session is missing", i + 1);
        if (i > 0 && h->token <= parts[i - 1].header.token)
            return fail(err, RESULT_REFUSED,
                        "part %u has the token %llu, and part %u before it has %llu", h->part,
                        (unsigned long long)h->token, h->part - 1,
                        (unsigned long long)parts[i - 1].header.token);
    }
    return RESULT_OK;
}

// ---- the state of each, in the part before ------------------------------------------------------

struct landing {
    uint64_t job, hash;
};

// What the parts before hold of the state of one, and of the jobs behind it.
struct search {
    const struct part *of;
    struct trace_reader *reader;
    bool found, wrong; // the step; it is another one than the state's
    struct landing *landings;
    size_t count, room;
};

static void note_landing(struct search *s, const struct landed *landed) {
    if (s->count == s->room) {
        s->room = 2 * s->room + 64;
        s->landings = alloc_resize(s->landings, s->room, sizeof *s->landings);
    }
    s->landings[s->count++] = (struct landing){landed->job, landed->hash};
}

static bool on_part_step(void *user, const struct trace_record *record) {
    struct search *s = user;
    const struct trace_place *place = &s->of->place;
    if (record->output.step == place->step && !s->found) {
        struct trace_place here = trace_reader_place(s->reader);
        s->found = true;
        s->wrong = here.offset != place->offset || record->output.hash != s->of->output_hash ||
                   memcmp(here.hash, place->hash, sizeof here.hash) != 0;
    }
    if (record->output.step > place->step && record->output.landed.job)
        note_landing(s, &record->output.landed);
    return !s->wrong;
}

static bool check_taken(void *user, const struct trace_record *record) {
    struct search *s = user;
    const struct landed *landed = &record->output.landed;
    for (size_t i = 0; landed->job && i < s->count; i++)
        s->wrong |= s->landings[i].job == landed->job && s->landings[i].hash != landed->hash;
    return !s->wrong && record->type != TRACE_STEP;
}

// As far as it can be read.
static enum result walk(struct search *s, const char *path,
                        bool (*each)(void *user, const struct trace_record *record),
                        enum trace_record_type type, struct error *err) {
    struct error why;
    struct trace_player player = {.user = s};
    if (type == TRACE_STEP)
        player.step = each;
    else
        player.taken = each;
    enum result result = trace_reader_create(path, &s->reader, err);
    if (result != RESULT_OK)
        return result;
    result = trace_play(s->reader, &player, &why);
    trace_reader_destroy(&s->reader);
    return result == RESULT_IO ? fail(err, RESULT_IO, "%s", why.text) : RESULT_OK;
}

static bool is_same_state(const struct part *a, const struct part *b) {
    return a->has_state && b->has_state && a->place.offset == b->place.offset &&
           a->place.step == b->place.step && a->output_hash == b->output_hash &&
           !memcmp(a->place.hash, b->place.hash, sizeof a->place.hash);
}

static enum result check_part(const struct part *parts, int index, struct search *s,
                              struct error *err) {
    int from = index - 1;
    unsigned long long step = parts[index].place.step;
    while (from > 0 && is_same_state(&parts[from], &parts[index]))
        from--;
    enum result result = RESULT_OK;
    for (int i = from; i < index && result == RESULT_OK && !s->wrong; i++) {
        result = walk(s, parts[i].path, on_part_step, TRACE_STEP, err);
        if (result == RESULT_OK && !s->found)
            return fail(err, RESULT_REFUSED,
                        "part %d begins behind step %llu, which part %d does not have", index + 1,
                        step, i + 1);
    }
    if (result == RESULT_OK && s->wrong)
        return fail(err, RESULT_REFUSED,
                    "part %d begins behind step %llu, and part %d has another step %llu", index + 1,
                    step, from + 1, step);
    if (result == RESULT_OK)
        result = walk(s, parts[index].path, check_taken, TRACE_TAKEN, err);
    if (result == RESULT_OK && s->wrong)
        return fail(err, RESULT_REFUSED,
                    "a job that part %d takes over landed otherwise in the part before", index + 1);
    return result;
}

enum result trace_parts_check(const char *const *paths, int count, struct error *err) {
    struct part *parts = alloc((size_t)count, sizeof *parts);
    enum result result = RESULT_OK;
    for (int i = 0; i < count && result == RESULT_OK; i++) {
        parts[i].path = paths[i];
        result = look_at_part(&parts[i], err);
    }
    if (result == RESULT_OK) {
        qsort(parts, (size_t)count, sizeof *parts, by_part);
        result = check_headers(parts, count, err);
    }
    for (int i = 1; i < count && result == RESULT_OK; i++) {
        struct search search = {.of = &parts[i]};
        result = check_part(parts, i, &search, err);
        free(search.landings);
    }
    free(parts);
    return result;
}
