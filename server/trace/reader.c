#include "base/check.h"
#include "trace/buffer.h"
#include "trace/reader_parts.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum result reader_unreadable(const struct trace_reader *r, struct error *err) {
    return fail(err, RESULT_IO, "%s: %s", r->path, strerror(errno));
}

#define READ_AT_ONCE ((size_t)1 << 17) // of the file

// Reads exactly `size` bytes; RESULT_MISSING where the file has no more.
static enum result read_exactly(struct trace_reader *r, void *out, size_t size, struct error *err) {
    size_t got = fread(out, 1, size, r->file);
    if (got == size)
        return RESULT_OK;
    if (ferror(r->file))
        return fail(err, RESULT_IO, "%s", strerror(errno));
    return fail(err, RESULT_MISSING, "it ends too early");
}

static enum result read_header(struct trace_reader *r, struct error *err) {
    uint8_t data[HEADER_MAX];
    size_t rest = 0;
    unsigned version = 0;
    enum result result = read_exactly(r, data, HEADER_PREFIX, err);
    if (result == RESULT_OK)
        result = header_decode_prefix(data, &version, &rest, err);
    if (result == RESULT_OK)
        result = read_exactly(r, data + HEADER_PREFIX, rest, err);
    if (result == RESULT_OK)
        result = header_decode(data, HEADER_PREFIX + rest, version, &r->chain, &r->header, err);
    r->place.offset = HEADER_PREFIX + rest;
    r->place.version = r->header.version;
    r->place.rules = r->header.settings.rules;
    if (result != RESULT_OK)
        return fail_in(err, result, "%s, header: ", r->path);
    return RESULT_OK;
}

enum result trace_reader_create(const char *path, struct trace_reader **out_reader,
                                struct error *err) {
    FILE *file = fopen(path, "rbe");
    if (!file)
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    struct trace_reader *r = alloc(1, sizeof *r);
    r->file = file;
    setvbuf(file, NULL, _IOFBF, READ_AT_ONCE);
    r->path = alloc_text(path);
    chain_init(&r->chain);
    struct stat status = {0};
    enum result result =
        fstat(fileno(file), &status) == 0 ? read_header(r, err) : reader_unreadable(r, err);
    r->size = (uint64_t)status.st_size;
    if (result != RESULT_OK) {
        trace_reader_destroy(&r);
        return result;
    }
    *out_reader = r;
    return RESULT_OK;
}

static void forget_touch(struct trace_reader *r) {
    free(r->gathering.bytes);
    touch_change_fini(&r->gathering.touch);
    r->gathering = (struct gathering){0};
    r->landed = false;
}

static void forget_state(struct trace_reader *r) {
    free(r->beginning.bytes);
    r->beginning.bytes = NULL;
    r->beginning.is_told = false;
}

void trace_reader_destroy(struct trace_reader **reader) {
    if (!*reader)
        return;
    forget_touch(*reader);
    forget_state(*reader);
    fclose((*reader)->file);
    chain_fini(&(*reader)->chain);
    free((*reader)->path);
    free(*reader);
    *reader = NULL;
}

const struct trace_header *trace_reader_header(const struct trace_reader *r) {
    return &r->header;
}

// A touch belongs to the step at which it lands: without that step it is not yet read.
struct trace_place trace_reader_place(const struct trace_reader *r) {
    struct trace_place place = r->place;
    if (r->gathering.job && !r->landed)
        return r->gathering.place;
    memcpy(place.hash, r->chain.value, sizeof place.hash);
    return place;
}

uint64_t trace_reader_offset(const struct trace_reader *r) {
    return r->place.offset;
}

uint64_t trace_reader_size(const struct trace_reader *r) {
    return r->size;
}

void trace_reader_bind(struct trace_reader *r, const struct scene *scene) {
    const struct knee_case *knee = scene_case(scene);
    r->bound = true;
    r->tissues = scene_tissue_count(scene);
    r->groups = knee->group_count;
    r->torn = knee->torn_count;
    for (int i = 0; i < r->tissues; i++)
        r->tissue_vertices[i] = knee->groups[scene_tissue_group(scene, i)].mesh.vertex_count;
    if (r->state == RESULT_OK && r->header.version >= TRACE_FIRST_WITH_ATTEMPTS &&
        r->header.loose_count != knee->loose_count)
        r->state =
            fail(&r->why, RESULT_FORMAT, "%s: it is of a case with %d loose bodies, and %s has %d",
                 r->path, r->header.loose_count, knee->name, knee->loose_count);
}

static enum result check_indexes(const struct trace_reader *r, const struct session_output *o,
                                 struct error *err) {
    bool good = (!o->job.id || o->job.kind == JOB_UNDO || o->job.tissue < r->tissues) &&
                (!o->landed.job || o->landed.tissue < r->tissues) && o->torn_count <= r->torn;
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        good = good && o->instruments[i].warp.nearest < r->groups;
    return good ? RESULT_OK
                : fail(err, RESULT_FORMAT, "step %llu names a part that its case does not have",
                       (unsigned long long)o->step);
}

static enum result check_job(const struct trace_reader *r, const struct session_output *o,
                             struct error *err) {
    bool good = o->job.tissue < r->tissues && (!o->landed.job || o->landed.tissue < r->tissues);
    return good ? RESULT_OK
                : fail(err, RESULT_FORMAT, "job %llu is of a tissue that its case does not have",
                       (unsigned long long)o->job.id);
}

// ---- the state of a later part ------------------------------------------------------------------

static bool is_later_part(const struct trace_reader *r) {
    return r->header.part > 1;
}

// Where a reader has skipped damage, it may have skipped the state.
static enum result check_beginning(const struct trace_reader *r, const struct trace_record *record,
                                   struct error *err) {
    const struct beginning *b = &r->beginning;
    bool is_past = record->type == TRACE_PAST, is_taken = record->type == TRACE_TAKEN;
    if (r->damaged)
        return RESULT_OK;
    if (record->type == TRACE_STATE)
        return is_later_part(r) && !b->is_read
                   ? RESULT_OK
                   : fail(err, RESULT_FORMAT, "a state stands where none can be");
    if (is_later_part(r) && !b->is_read)
        return fail(err, RESULT_FORMAT, "part %u of a session does not begin with a whole state",
                    r->header.part);
    if (is_taken && !b->goes_on)
        return fail(err, RESULT_FORMAT, "job %llu is taken over where none can be",
                    (unsigned long long)record->output.job.id);
    if (is_past && is_later_part(r) && (!b->goes_on || !input_is_command(record->input.kind)))
        return fail(err, RESULT_FORMAT, "an input behind the state is no command");
    if (is_taken && record->output.job.id <= b->taken)
        return fail(err, RESULT_FORMAT, "job %llu is taken over after job %llu",
                    (unsigned long long)record->output.job.id, (unsigned long long)b->taken);
    return RESULT_OK;
}

static enum result end_state(struct trace_reader *r, struct error *err) {
    struct beginning *b = &r->beginning;
    if (trace_state_parse(b->bytes, b->size, &b->state, err) != RESULT_OK)
        return fail_in(err, RESULT_FORMAT, "its state: ");
    if (b->state.place.rules != r->header.settings.rules)
        return fail(err, RESULT_FORMAT, "its state is of a session by other rules");
    b->is_read = b->is_told = b->goes_on = true;
    r->place.step = r->place.past = b->state.place.step;
    r->place.time_ns = b->state.place.time_ns;
    return RESULT_OK;
}

static enum result follow_state(struct trace_reader *r, struct trace_record *record,
                                struct error *err) {
    struct beginning *b = &r->beginning;
    const struct trace_state_part *part = &record->state_part;
    if (r->damaged)
        return RESULT_OK;
    if (part->offset != b->size || (b->size && part->whole != b->whole))
        return fail(err, RESULT_FORMAT, "a part of its state is missing");
    b->whole = part->whole;
    b->bytes = alloc_resize(b->bytes, b->size + part->size, 1);
    memcpy(b->bytes + b->size, part->bytes, part->size);
    b->size += part->size;
    enum result result = b->size == b->whole ? end_state(r, err) : RESULT_OK;
    record->state = b->is_told ? &b->state : NULL;
    return result;
}

// ---- touches ------------------------------------------------------------------------------------

static enum result end_touch(struct trace_reader *r, struct error *err) {
    const struct gathering *g = &r->gathering;
    unsigned long long job = g->job;
    if (!touch_decode(g->bytes, g->whole, &r->gathering.touch))
        return fail(err, RESULT_FORMAT, "the touched surface of job %llu is malformed", job);
    bool there = !r->bound || (g->tissue < r->tissues && g->touch.vertices[g->touch.count - 1] <
                                                             r->tissue_vertices[g->tissue]);
    return there ? RESULT_OK
                 : fail(err, RESULT_FORMAT,
                        "the touched surface of job %llu has vertices that its case does not have",
                        job);
}

// Behind damage a touch may lack its first parts: none of it counts.
static enum result follow_touch(struct trace_reader *r, const struct trace_touch_part *part,
                                struct error *err) {
    struct gathering *g = &r->gathering;
    if (!g->job && part->offset == 0) {
        struct trace_place place = trace_reader_place(r);
        memcpy(place.hash, r->before, sizeof place.hash);
        *g = (struct gathering){part->job, part->tissue, part->whole, .place = place};
    }
    if (r->damaged && !g->job)
        return RESULT_OK;
    if (part->job != g->job || part->tissue != g->tissue || part->whole != g->whole ||
        part->offset != g->size)
        return fail(err, RESULT_FORMAT, "a part of the touched surface of job %llu is missing",
                    (unsigned long long)part->job);
    g->bytes = alloc_resize(g->bytes, g->size + part->size, 1);
    memcpy(g->bytes + g->size, part->bytes, part->size);
    g->size += part->size;
    return g->size == g->whole ? end_touch(r, err) : RESULT_OK;
}

static enum result check_hash(const struct trace_reader *r, const struct landed *landed,
                              struct error *err) {
    const struct gathering *g = &r->gathering;
    if (!landed->job || (r->damaged && !g->job))
        return RESULT_OK;
    if (touch_hash(&g->touch) != landed->touch_hash || (g->job && g->tissue != landed->tissue))
        return fail(err, RESULT_FORMAT, "the touched surface of job %llu does not have its hash",
                    (unsigned long long)landed->job);
    return RESULT_OK;
}

static enum result land_touch(struct trace_reader *r, struct trace_record *record,
                              struct error *err) {
    struct gathering *g = &r->gathering;
    bool lands = record->input.kind == INPUT_JOB && record->job_done &&
                 record->input.job == g->job && g->size == g->whole;
    if (g->job && !lands && r->damaged)
        forget_touch(r);
    else if (g->job && !lands)
        return fail(err, RESULT_FORMAT, "the touched surface of job %llu does not land",
                    (unsigned long long)g->job);
    if (record->type != TRACE_PAST && check_hash(r, &record->output.landed, err) != RESULT_OK)
        return RESULT_FORMAT;
    r->landed = g->job;
    record->touch = g->job ? &g->touch : NULL;
    record->touch_tissue = g->tissue;
    return RESULT_OK;
}

// ---- records ------------------------------------------------------------------------------------

// What is right in itself must also follow from what came before.
static enum result follow_step(struct trace_reader *r, const struct trace_record *record,
                               struct error *err) {
    struct trace_place *place = &r->place;
    uint64_t step = record->type == TRACE_STEP ? record->output.step : place->step + 1;
    if (r->damaged ? step <= place->step : step != place->step + 1)
        return fail(err, RESULT_FORMAT, "step %llu comes after step %llu", (unsigned long long)step,
                    (unsigned long long)place->step);
    if (record->input.time_ns < place->time_ns)
        return fail(err, RESULT_FORMAT, "time falls at step %llu", (unsigned long long)step);
    place->step = step;
    place->time_ns = record->input.time_ns;
    if (record->type == TRACE_STEP)
        place->records++;
    else
        place->past++;
    if (record->type == TRACE_TAKEN)
        r->beginning.taken = record->output.job.id;
    if (record->type == TRACE_STEP)
        r->beginning.goes_on = false;
    return RESULT_OK;
}

// Behind damage begin or end may be missing.
static enum result follow_attempt(struct trace_reader *r, const struct trace_record *record,
                                  struct error *err) {
    bool begins = record->type == TRACE_BEGUN;
    uint32_t number = begins ? record->begun.number : record->ended.number;
    bool good =
        begins ? !r->attempted && number > r->attempts : r->attempted && number == r->attempts;
    if (!good && !r->damaged)
        return fail(err, RESULT_FORMAT, "attempt %u %s, but the one before is number %u, which %s",
                    number, begins ? "begins" : "ends", r->attempts,
                    r->attempted ? "runs" : "has ended");
    r->attempts = number;
    r->attempted = begins;
    return RESULT_OK;
}

static enum result follow(struct trace_reader *r, struct trace_record *record, struct error *err) {
    struct trace_place *place = &r->place;
    switch (record->type) {
    case TRACE_STATE:
        return follow_state(r, record, err);
    case TRACE_STEP:
    case TRACE_PAST:
    case TRACE_TAKEN:
        if (land_touch(r, record, err) != RESULT_OK)
            return RESULT_FORMAT;
        return follow_step(r, record, err);
    case TRACE_TOUCH:
        return follow_touch(r, &record->touch_part, err);
    case TRACE_GAP:
        place->step += record->missing;
        place->missing += record->missing;
        r->beginning.goes_on = false;
        return RESULT_OK;
    case TRACE_RESUME:
    case TRACE_REMARK:
    case TRACE_FAULT:
    case TRACE_MARKER:
        return RESULT_OK;
    case TRACE_BEGUN:
    case TRACE_ENDED:
        return follow_attempt(r, record, err);
    default:
        if (!r->damaged && (record->records != place->records || record->missing != place->missing))
            return fail(err, RESULT_FORMAT, "the end record counts other steps than there are");
        r->ended = true;
        return RESULT_OK;
    }
}

static enum result decode(struct trace_reader *r, const uint8_t *data, size_t size,
                          struct trace_record *out, struct error *err) {
    memcpy(r->before, r->chain.value, sizeof r->before);
    struct trace_layout layout = layout_of(&r->header, r->header.version);
    enum result result = record_decode(data, size, layout, &r->chain, out, &r->end, err);
    if (result == RESULT_OK && r->bound && out->type == TRACE_STEP)
        result = check_indexes(r, &out->output, err);
    if (result == RESULT_OK && r->bound && out->type == TRACE_TAKEN)
        result = check_job(r, &out->output, err);
    if (result == RESULT_OK)
        result = check_beginning(r, out, err);
    if (result == RESULT_OK)
        result = follow(r, out, err);
    if (result == RESULT_OK && out->type == TRACE_END)
        seal_message(r->before, out->records, out->missing, r->seal);
    return result;
}

static enum result read_behind(struct trace_reader *r, struct error *err) {
    if (fgetc(r->file) != EOF)
        return fail(err, RESULT_FORMAT, "there is more after its end");
    return ferror(r->file) ? fail(err, RESULT_IO, "%s", strerror(errno))
                           : fail(err, RESULT_CLOSED, "all is read");
}

static enum result read_record(struct trace_reader *r, struct trace_record *out,
                               struct error *err) {
    uint8_t *data = r->data;
    if (r->landed)
        forget_touch(r);
    if (r->beginning.is_told)
        forget_state(r);
    if (r->ended)
        return read_behind(r, err);
    size_t rest;
    enum result result = reader_hop(r, err);
    if (result != RESULT_OK)
        return result;
    result = read_exactly(r, data, RECORD_PREFIX, err);
    if (result == RESULT_OK)
        result = record_decode_prefix(data, r->header.version, &rest, err);
    r->foreign = result == RESULT_FORMAT;
    if (result == RESULT_OK)
        result = read_exactly(r, data + RECORD_PREFIX, rest, err);
    if (result == RESULT_OK)
        result = decode(r, data, RECORD_PREFIX + rest, out, err);
    r->foreign |= result == RESULT_CORRUPT;
    if (result != RESULT_OK)
        return result;
    out->offset = r->place.offset;
    out->size = RECORD_PREFIX + rest;
    r->place.offset += out->size;
    return RESULT_OK;
}

enum result trace_read(struct trace_reader *r, struct trace_record *out, struct error *err) {
    if (r->state == RESULT_OK) {
        r->state = read_record(r, out, &r->why);
        if (r->state != RESULT_OK)
            fail_in(&r->why, r->state, "%s, byte %llu: ", r->path,
                    (unsigned long long)r->place.offset);
    }
    if (r->state != RESULT_OK)
        return fail(err, r->state, "%s", r->why.text);
    return RESULT_OK;
}

// ---- behind what is damaged

// Whether a record begins at `at`, by the hash before it. Of version 3: an older one has no chain.
static bool record_begins(struct trace_reader *r, const uint8_t *data, size_t size, size_t at) {
    size_t rest;
    struct error none;
    if (size - at < RECORD_PREFIX ||
        record_decode_prefix(data + at, r->header.version, &rest, &none) != RESULT_OK ||
        size - at - RECORD_PREFIX < rest)
        return false;
    memcpy(r->chain.value, data + at - TRACE_HASH_SIZE, TRACE_HASH_SIZE);
    return checksum_matches(data + at, RECORD_PREFIX + rest, r->header.version, &r->chain);
}

// Up to `size` bytes from the record on that cannot be read. False: the file cannot be read.
static bool read_from_damage(struct trace_reader *r, uint8_t *out_data, size_t size,
                             size_t *out_got) {
    *out_got = 0;
    if (fseeko(r->file, (off_t)r->place.offset, SEEK_SET))
        return false;
    *out_got = fread(out_data, 1, size, r->file);
    return !ferror(r->file);
}

enum result trace_skip_damage(struct trace_reader *r, uint64_t *out_bytes, struct error *err) {
    size_t rest = r->size > r->place.offset ? (size_t)(r->size - r->place.offset) : 0;
    size_t size, at = RECORD_PREFIX + TRACE_HASH_SIZE;
    uint8_t *data = alloc(rest + 1, 1);
    bool readable = read_from_damage(r, data, rest, &size);
    bool looks = readable && r->header.version >= 3 && !r->ended;
    while (looks && at < size && !record_begins(r, data, size, at))
        at++;
    bool found = looks && at < size;
    if (found)
        memcpy(r->chain.value, data + at - TRACE_HASH_SIZE, TRACE_HASH_SIZE);
    free(data);
    if (!readable)
        return reader_unreadable(r, err);
    if (!found)
        return fail(err, RESULT_MISSING, "%s: no whole record after byte %llu", r->path,
                    (unsigned long long)r->place.offset);
    *out_bytes = at;
    r->place.offset += at;
    if (fseeko(r->file, (off_t)r->place.offset, SEEK_SET))
        return reader_unreadable(r, err);
    r->state = RESULT_OK;
    r->damaged = true;
    r->foreign = false;
    forget_touch(r);
    forget_state(r);
    return RESULT_OK;
}

#define TAIL_SIZE ((uint64_t)1 << 16) // some records, the longest too

// Goes on shortly before the end.
static enum result skip_to_tail(struct trace_reader *r, struct error *err) {
    uint64_t skipped;
    if (r->size <= r->place.offset + TAIL_SIZE)
        return RESULT_OK;
    r->place.offset = r->size - TAIL_SIZE;
    return trace_skip_damage(r, &skipped, err);
}

enum result trace_last_time(const char *path, int64_t *out_time_ns, struct error *err) {
    struct trace_reader *r;
    static _Thread_local struct trace_record record;
    enum result result = trace_reader_create(path, &r, err);
    if (result != RESULT_OK)
        return result;
    bool found = false;
    result = skip_to_tail(r, err);
    while (result == RESULT_OK && (result = trace_read(r, &record, err)) == RESULT_OK)
        if (record_is_input(&record)) {
            *out_time_ns = record.input.time_ns;
            found = true;
        }
    trace_reader_destroy(&r);
    if (result == RESULT_IO)
        return result;
    if (!found)
        return fail(err, RESULT_MISSING, "%s: it has no step near its end", path);
    return RESULT_OK;
}

bool trace_is_open(const char *path) {
    struct trace_reader *r;
    static _Thread_local struct trace_record record;
    enum result result = trace_reader_create(path, &r, NULL);
    if (result != RESULT_OK)
        return result == RESULT_IO && (access(path, F_OK) == 0 || errno != ENOENT);
    bool open = r->header.version >= TRACE_OLDEST_RESUMED;
    uint64_t skipped;
    result = open ? skip_to_tail(r, NULL) : RESULT_CLOSED;
    while (result == RESULT_OK || (r->foreign && trace_skip_damage(r, &skipped, NULL) == RESULT_OK))
        result = trace_read(r, &record, NULL);
    trace_reader_destroy(&r);
    return open && result != RESULT_CLOSED;
}

#define PAGE 4096 // of a disk; a file's pages are on disk or lost as a whole
#define LOST_MIN                                                                                   \
    ((size_t)256) // of a page whose beginning was on disk before: no record is so empty

static bool is_zero(const uint8_t *data, size_t size) {
    for (size_t i = 0; i < size; i++)
        if (data[i])
            return false;
    return true;
}

// Whether the record that cannot be read, or what ought to be one, has a lost page in it.
static bool has_lost_page(struct trace_reader *r) {
    uint8_t data[RECORD_MAX + 2 * PAGE];
    size_t size, page = PAGE - r->place.offset % PAGE;
    if (!read_from_damage(r, data, sizeof data, &size))
        return false;
    if (is_zero(data, page < size ? page : size))
        return true;
    for (; page < RECORD_MAX + PAGE && page < size; page += PAGE) {
        size_t rest = size - page < PAGE ? size - page : PAGE;
        if (is_zero(data + page, rest) ||
            (page >= LOST_MIN && is_zero(data + page - LOST_MIN, LOST_MIN)))
            return true;
    }
    return false;
}

bool trace_ends_torn(struct trace_reader *r) {
    bool has_begun = !is_later_part(r) || r->beginning.is_read;
    return r->foreign && !r->damaged && has_begun && r->size - r->place.offset <= BUFFER_SIZE &&
           has_lost_page(r) && trace_is_open(r->path);
}

// ---- the seal

bool trace_reader_seal(const struct trace_reader *r, struct trace_seal *out) {
    if (!r->ended || !r->end.signature_size)
        return false;
    memcpy(out->message, r->seal, sizeof out->message);
    out->certificate = r->end.certificate;
    out->certificate_size = r->end.certificate_size;
    out->signature = r->end.signature;
    out->signature_size = r->end.signature_size;
    return true;
}
