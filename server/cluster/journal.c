#include "cluster/journal.h"

#include "base/bytes.h"
#include "base/check.h"
#include "base/clock.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define JOBS_APART 12 // a new base: what a takeover runs again takes less than a second
#define BASES_APART_NS (120 * NS_PER_S)
#define MORE_MAX (JET_PART_MAX - TRACE_PACKED_MAX)
#define SINCE_MAX ((size_t)64 << 20) // of a session whose state cannot be kept

// ---- bytes --------------------------------------------------------------------------------------

struct buffer {
    uint8_t *data;
    size_t size, room;
};

static uint8_t *make_room(struct buffer *b, size_t more) {
    if (b->size + more > b->room) {
        b->room = 2 * (b->size + more);
        b->data = alloc_resize(b->data, b->room, 1);
    }
    return b->data + b->size;
}

static void append(struct buffer *b, const void *bytes, size_t size) {
    if (size)
        memcpy(make_room(b, size), bytes, size);
    b->size += size;
}

static void append_number(struct buffer *b, uint32_t number) {
    struct writer w = {make_room(b, sizeof number), sizeof number, 0, false};
    write_u32(&w, number);
    b->size += sizeof number;
}

static void append_part(struct buffer *b, const void *bytes, size_t size) {
    append_number(b, (uint32_t)size);
    append(b, bytes, size);
}

static void cut_front(struct buffer *b, size_t size) {
    b->size -= size;
    if (b->size)
        memmove(b->data, b->data + size, b->size);
}

// ---- writing ------------------------------------------------------------------------------------

// Where a record ends in the bytes of those since the state.
struct placed {
    uint64_t offset; // in the trace
    size_t end;
};

struct journal_writer {
    uint64_t token, number;
    bool owns, owned; // since journal_own; `owned` is to be given out
    bool waits;       // for journal_go_on

    bool runs, ends; // a session; `ended` is to be given out
    bool has_ended;  // the last session, of which `ended` was perhaps lost
    char trace[JOURNAL_PATH_MAX];
    struct trace_header header;
    struct trace_journal tap;
    struct buffer standing, since; // since: behind the newest state that is known
    struct placed *places;
    size_t place_count, place_room;

    bool kept, is_newer; // a state is on disk; one that the base has not
    bool refreshes;      // since journal_refresh
    bool has_base;       // a base was made, and nothing behind it lost
    int64_t base_ns;
    int jobs; // behind the base
    struct buffer base, more;
    size_t given; // of the base
    struct buffer message;
};

struct journal_writer *journal_writer_create(void) {
    return alloc(1, sizeof(struct journal_writer));
}

static void clear_session(struct journal_writer *w) {
    w->standing.size = w->since.size = w->base.size = w->more.size = 0;
    w->place_count = w->given = 0;
    w->kept = w->is_newer = w->refreshes = w->has_base = false;
    w->runs = w->ends = w->has_ended = false;
    w->jobs = 0;
}

void journal_writer_destroy(struct journal_writer **writer) {
    struct journal_writer *w = *writer;
    if (!w)
        return;
    free(w->standing.data);
    free(w->since.data);
    free(w->places);
    free(w->base.data);
    free(w->more.data);
    free(w->message.data);
    free(w);
    *writer = NULL;
}

void journal_own(struct journal_writer *w, uint64_t token) {
    w->token = token;
    w->number = 0;
    w->owns = w->waits = true;
    w->has_ended = false;
    journal_break(w);
}

void journal_go_on(struct journal_writer *w, uint64_t token) {
    if (token == w->token)
        w->waits = false;
}

void journal_begin(struct journal_writer *w, const struct trace_header *header, const char *trace,
                   const struct job *asked) {
    clear_session(w);
    w->runs = true;
    w->header = *header;
    w->tap.asked = *asked;
    snprintf(w->trace, sizeof w->trace, "%s", trace);
}

void journal_end(struct journal_writer *w) {
    bool ends = w->runs || w->has_ended;
    clear_session(w);
    w->ends = w->has_ended = ends;
}

void journal_leave(struct journal_writer *w) {
    clear_session(w);
    w->owns = w->owned = false;
}

static void place(struct journal_writer *w, uint64_t offset) {
    if (w->place_count == w->place_room) {
        w->place_room = 2 * w->place_room + 64;
        w->places = alloc_resize(w->places, w->place_room, sizeof *w->places);
    }
    w->places[w->place_count++] = (struct placed){offset, w->since.size};
}

void journal_record(struct journal_writer *w, const struct trace_record *tapped) {
    struct trace_record record;
    uint8_t packed[TRACE_PACKED_MAX];
    if (!w->runs || !trace_journal_take(&w->tap, tapped, &record))
        return;
    size_t size = trace_record_pack(&record, w->header.settings.rules, packed);
    if (trace_journal_outlasts_state(record.type)) {
        append(&w->standing, packed, size);
    } else {
        append(&w->since, packed, size);
        place(w, record.offset);
    }
    w->jobs += record.type == TRACE_TAKEN;
    if (w->has_base)
        append(&w->more, packed, size);
    if (w->since.size > SINCE_MAX)
        clear_session(w);
}

void journal_kept(struct journal_writer *w) {
    w->kept = w->is_newer = w->runs;
}

void journal_refresh(struct journal_writer *w) {
    w->refreshes = w->runs && (w->jobs || !w->has_base);
    w->is_newer = false;
}

void journal_break(struct journal_writer *w) {
    w->owned = w->owns;
    w->ends = w->has_ended;
    w->has_base = false;
    w->base.size = w->more.size = w->given = 0;
}

const char *journal_newer_state(const struct journal_writer *w) {
    return w->is_newer ? w->trace : NULL;
}

const char *journal_wants_state(const struct journal_writer *w, int64_t now_ns) {
    if (!w->kept || w->waits || w->given < w->base.size)
        return NULL;
    bool is_old =
        w->refreshes || w->jobs >= JOBS_APART || (w->jobs && now_ns - w->base_ns >= BASES_APART_NS);
    return !w->has_base || (w->is_newer && is_old) ? w->trace : NULL;
}

// What is in the state.
static void drop_before(struct journal_writer *w, uint64_t offset) {
    size_t count = 0;
    while (count < w->place_count && w->places[count].offset < offset)
        count++;
    if (!count)
        return;
    size_t gone = w->places[count - 1].end;
    cut_front(&w->since, gone);
    w->place_count -= count;
    for (size_t i = 0; i < w->place_count; i++)
        w->places[i] =
            (struct placed){w->places[i + count].offset, w->places[i + count].end - gone};
}

bool journal_put_state(struct journal_writer *w, const uint8_t *bytes, size_t size,
                       int64_t now_ns) {
    struct trace_state state;
    uint8_t header[TRACE_HEADER_PACKED_MAX];
    w->is_newer = w->kept = w->runs && trace_state_parse(bytes, size, &state, NULL) == RESULT_OK;
    if (!w->kept)
        return false;
    drop_before(w, state.place.offset);
    w->base.size = w->more.size = w->given = 0;
    append_part(&w->base, header, trace_header_pack(&w->header, header));
    append_part(&w->base, w->standing.data, w->standing.size);
    append_part(&w->base, w->since.data, w->since.size);
    append_part(&w->base, bytes, size);
    w->is_newer = w->refreshes = false;
    w->has_base = true;
    w->jobs = 0;
    w->base_ns = now_ns;
    return true;
}

static void begin_message(struct journal_writer *w, const char *kind, struct jet_message *out) {
    w->message.size = 0;
    *out = (struct jet_message){.token = w->token, .number = ++w->number, .kind = kind};
}

static void end_message(struct journal_writer *w, struct jet_message *out) {
    out->data = w->message.data;
    out->size = w->message.size;
}

static void give_base(struct journal_writer *w, struct jet_message *out) {
    size_t left = w->base.size - w->given, most = JET_PART_MAX - 2 * sizeof(uint32_t);
    size_t size = left < most ? left : most;
    begin_message(w, "base", out);
    append_number(&w->message, (uint32_t)w->base.size);
    append_number(&w->message, (uint32_t)w->given);
    append(&w->message, w->base.data + w->given, size);
    w->given += size;
    end_message(w, out);
}

// Whole records, for a reader may have the messages before alone.
static size_t records_within(const struct buffer *b, int rules, size_t most) {
    struct trace_record record;
    size_t at = 0, end = 0;
    while (end < most &&
           trace_record_unpack(b->data, b->size, rules, &at, &record, NULL) == RESULT_OK)
        end = at;
    return end;
}

static void give_more(struct journal_writer *w, struct jet_message *out) {
    size_t size = w->more.size;
    if (size > MORE_MAX)
        size = records_within(&w->more, w->header.settings.rules, MORE_MAX);
    begin_message(w, "more", out);
    append(&w->message, w->more.data, size);
    cut_front(&w->more, size);
    end_message(w, out);
}

bool journal_next(struct journal_writer *w, struct jet_message *out) {
    if (!w->token)
        return false;
    if (w->owned) {
        begin_message(w, "owned", out);
        w->owned = false;
    } else if (w->waits) {
        return false;
    } else if (w->ends) {
        begin_message(w, "ended", out);
        w->ends = false;
    } else if (w->given < w->base.size) {
        give_base(w, out);
    } else if (w->more.size) {
        give_more(w, out);
    } else {
        return false;
    }
    return true;
}

bool journal_owns(const struct journal_writer *w) {
    return w->token && !w->owned;
}

bool journal_is_empty(const struct journal_writer *w) {
    return !w->kept && !w->has_base;
}

bool journal_is_whole(const struct journal_writer *w) {
    return w->has_base && w->given == w->base.size && !w->more.size;
}

bool journal_is_fresh(const struct journal_writer *w) {
    return !w->refreshes;
}

// ---- reading ------------------------------------------------------------------------------------

enum kind { KIND_OWNED, KIND_BASE, KIND_MORE, KIND_ENDED, KIND_UNKNOWN };

struct kept_message {
    uint64_t token, number;
    enum kind kind;
    size_t at, size; // in `bytes`
};

struct journal_reader {
    uint64_t newest_token;
    struct kept_message *all;
    size_t count, room;
    struct buffer bytes, base, more; // more: all records, one behind the other
    size_t at;
    int rules;
};

struct journal_reader *journal_reader_create(void) {
    return alloc(1, sizeof(struct journal_reader));
}

void journal_reader_destroy(struct journal_reader **reader) {
    struct journal_reader *r = *reader;
    if (!r)
        return;
    free(r->all);
    free(r->bytes.data);
    free(r->base.data);
    free(r->more.data);
    free(r);
    *reader = NULL;
}

static enum kind kind_of_word(const char *word) {
    static const char *const words[] = {"owned", "base", "more", "ended"};
    enum kind kind = KIND_OWNED;
    while (kind < KIND_UNKNOWN && strcmp(word, words[kind]) != 0)
        kind++;
    return kind;
}

void journal_take(struct journal_reader *r, const struct jet_message *message) {
    if (message->token < r->newest_token)
        return;
    r->newest_token = message->token;
    if (r->count == r->room) {
        r->room = 2 * r->room + 64;
        r->all = alloc_resize(r->all, r->room, sizeof *r->all);
    }
    r->all[r->count++] = (struct kept_message){
        message->token, message->number, kind_of_word(message->kind), r->bytes.size, message->size};
    append(&r->bytes, message->data, message->size);
}

static int by_number(const void *a, const void *b) {
    const struct kept_message *one = a, *other = b;
    if (one->token != other->token)
        return one->token < other->token ? -1 : 1;
    return one->number < other->number ? -1 : one->number > other->number;
}

static void sort(struct journal_reader *r) {
    size_t count = 0;
    if (r->count)
        qsort(r->all, r->count, sizeof *r->all, by_number);
    for (size_t i = 0; i < r->count; i++)
        if (!count || by_number(&r->all[count - 1], &r->all[i]) != 0)
            r->all[count++] = r->all[i];
    r->count = count;
}

static struct reader bytes_of(const struct journal_reader *r, const struct kept_message *m) {
    return (struct reader){r->bytes.data + m->at, m->size, 0, false};
}

static bool follows(const struct journal_reader *r, size_t i) {
    return i < r->count && r->all[i].token == r->all[i - 1].token &&
           r->all[i].number == r->all[i - 1].number + 1;
}

// The base that begins with this message, whole. *in_out_next: the message behind its last part.
static bool join_base(struct journal_reader *r, size_t first, size_t *out_next) {
    size_t i = first;
    uint32_t whole = 0;
    r->base.size = 0;
    do {
        struct reader bytes = bytes_of(r, &r->all[i]);
        whole = read_u32(&bytes);
        uint32_t offset = read_u32(&bytes);
        if (r->all[i].kind != KIND_BASE || bytes.underflow || offset != r->base.size)
            return false;
        append(&r->base, bytes.data + bytes.used, bytes.size - bytes.used);
        i++;
    } while (r->base.size < whole && follows(r, i));
    *out_next = i;
    return r->base.size == whole;
}

static bool begins_base(const struct journal_reader *r, size_t i) {
    struct reader bytes = bytes_of(r, &r->all[i]);
    read_u32(&bytes);
    return r->all[i].kind == KIND_BASE && !read_u32(&bytes) && !bytes.underflow;
}

static bool find_base(struct journal_reader *r, size_t *out_next) {
    for (size_t i = r->count; i-- > 0;)
        if (begins_base(r, i) && join_base(r, i, out_next))
            return true;
    return false;
}

static bool read_part(struct reader *base, struct reader *out) {
    size_t size = read_u32(base);
    const uint8_t *bytes = read_bytes(base, size);
    *out = (struct reader){bytes, size, 0, false};
    return !base->underflow;
}

// True where the session has ended in them.
static bool take_more(struct journal_reader *r, size_t next) {
    bool ended = false;
    for (size_t i = next; !ended && follows(r, i) && r->all[i].kind != KIND_BASE; i++) {
        ended = r->all[i].kind == KIND_ENDED;
        if (r->all[i].kind == KIND_MORE)
            append(&r->more, r->bytes.data + r->all[i].at, r->all[i].size);
    }
    return ended;
}

// A session that ended and had no base, behind the one of the last base.
static bool ended_later(const struct journal_reader *r, size_t next) {
    for (size_t i = next; i < r->count; i++)
        if (r->all[i].kind == KIND_ENDED)
            return true;
    return false;
}

enum result journal_read(struct journal_reader *r, struct journal_session *out, struct error *err) {
    size_t next;
    sort(r);
    *out = (struct journal_session){.newest_token = r->newest_token};
    if (!find_base(r, &next))
        return fail(err, RESULT_MISSING, "the journal has no whole base");
    struct reader base = {r->base.data, r->base.size, 0, false}, header, standing, since, state;
    if (!read_part(&base, &header) || !read_part(&base, &standing) || !read_part(&base, &since) ||
        !read_part(&base, &state))
        return fail(err, RESULT_FORMAT, "the journal's base is damaged");
    enum result result = trace_header_unpack(header.data, header.size, &out->header, err);
    if (result != RESULT_OK)
        return fail_in(err, result, "the journal's base: ");
    r->rules = out->header.settings.rules;
    r->more.size = r->at = 0;
    append(&r->more, standing.data, standing.size);
    append(&r->more, since.data, since.size);
    out->token = r->all[next - 1].token;
    out->has_ended = take_more(r, next) || ended_later(r, next);
    out->state = state.data;
    out->state_size = state.size;
    return RESULT_OK;
}

enum result journal_next_record(struct journal_reader *r, struct trace_record *out,
                                struct error *err) {
    return trace_record_unpack(r->more.data, r->more.size, r->rules, &r->at, out, err);
}
