#include "base/bytes.h"
#include "base/check.h"
#include "trace/record.h"

#include <string.h>
#include <xxhash.h>

_Static_assert(sizeof(struct session_settings) == 4896, "the settings");
_Static_assert(sizeof(struct trace_header) < HEADER_FIELDS_MAX, "a header fits");

static void write_body(struct writer *w, const struct instrument_body *body) {
    write_u8(w, (uint8_t)body->point_count);
    for (int i = 0; i < body->point_count; i++) {
        write_vec3(w, body->points[i].at);
        write_f64(w, body->points[i].radius_mm);
    }
}

// Of too many points none is read: body_is_valid refuses them.
static void read_body(struct reader *r, struct instrument_body *out) {
    memset(out, 0, sizeof *out);
    out->point_count = read_u8(r);
    for (int i = 0; out->point_count <= AVATAR_POINTS_MAX && i < out->point_count; i++) {
        out->points[i].at = read_vec3(r);
        out->points[i].radius_mm = read_f64(r);
    }
}

static void write_settings(struct writer *w, const struct session_settings *s) {
    write_u8(w, (uint8_t)s->rules);
    write_u8(w, (uint8_t)s->field.kind);
    write_f64(w, s->field.unit_mm);
    write_f64(w, s->field.radius_mm);
    write_f64(w, s->field.background_per_mm);
    write_f64(w, s->field.skin_mm);
    write_f64(w, s->field.strength);
    write_u8(w, (uint8_t)s->adaptive);
    write_u8(w, (uint8_t)s->avatar);
    for (int i = 0; i < INSTRUMENTS_USUAL; i++)
        write_body(w, &s->bodies[i]);
    write_i64(w, s->hold_ns);
    write_f64(w, s->ease_share);
    write_f64(w, s->ease_mm_s);
}

// Before version 5 all followed the first rules. Version 2 had instruments that follow by their
// tips, and no torn ligaments.
static void read_settings(struct reader *r, unsigned version, struct session_settings *out) {
    *out = session_settings_default();
    out->rules = version >= 5 ? read_u8(r) : 1;
    out->field.kind = read_u8(r);
    out->field.unit_mm = read_f64(r);
    out->field.radius_mm = read_f64(r);
    out->field.background_per_mm = read_f64(r);
    out->field.skin_mm = read_f64(r);
    out->field.strength = read_f64(r);
    if (version >= 3) {
        out->adaptive = read_u8(r);
        out->avatar = read_u8(r);
        for (int i = 0; i < INSTRUMENTS_USUAL; i++)
            read_body(r, &out->bodies[i]);
    }
    out->hold_ns = read_i64(r);
    out->ease_share = read_f64(r);
    out->ease_mm_s = read_f64(r);
}

// Instruments beyond the usual ones.
static void write_described(struct writer *w, const struct session_settings *s) {
    write_u8(w, (uint8_t)(s->instruments.count - INSTRUMENTS_USUAL));
    for (int i = INSTRUMENTS_USUAL; i < s->instruments.count; i++) {
        const struct instrument *one = &s->instruments.of[i];
        write_text(w, one->name);
        write_u8(w, (uint8_t)one->kind);
        write_u8(w, one->cuts);
        write_u8(w, (uint8_t)(one->button + 1));
        write_f64(w, one->length_mm);
        write_f64(w, one->width_mm);
        write_f64(w, one->thickness_mm);
        write_f64(w, one->opening_deg);
        write_u32(w, one->colour);
        write_body(w, &s->bodies[i]);
    }
}

static enum result read_described(struct reader *r, struct session_settings *out,
                                  struct error *err) {
    int count = read_u8(r);
    for (int i = 0; i < count && !r->underflow; i++) {
        struct instrument one = {0};
        read_text(r, one.name, sizeof one.name);
        one.kind = read_u8(r);
        one.cuts = read_u8(r);
        one.button = (int)read_u8(r) - 1;
        one.length_mm = read_f64(r);
        one.width_mm = read_f64(r);
        one.thickness_mm = read_f64(r);
        one.opening_deg = read_f64(r);
        one.colour = read_u32(r);
        if (r->underflow || instruments_add(&out->instruments, &one, err) != RESULT_OK)
            break;
        read_body(r, &out->bodies[out->instruments.count - 1]);
    }
    return r->underflow || out->instruments.count == INSTRUMENTS_USUAL + count ? RESULT_OK
                                                                               : RESULT_FORMAT;
}

static bool settings_are_valid(const struct session_settings *s) {
    for (int i = 0; i < INSTRUMENT_COUNT; i++)
        if (!instrument_body_is_valid(&s->bodies[i]))
            return false;
    return (unsigned)s->adaptive < ADAPTIVE_COUNT && (unsigned)s->avatar < AVATAR_MODE_COUNT &&
           (unsigned)s->field.kind < FIELD_COUNT && s->field.unit_mm > 0 &&
           isfinite(s->field.unit_mm) && s->field.radius_mm > 0 && isfinite(s->field.radius_mm) &&
           s->field.background_per_mm >= 0 && isfinite(s->field.background_per_mm) &&
           s->field.skin_mm >= 0 && isfinite(s->field.skin_mm) && s->field.strength >= 0 &&
           s->field.strength <= 1 && s->hold_ns >= 0 && s->hold_ns <= TIME_MAX_NS &&
           s->ease_share >= 0 && isfinite(s->ease_share) && s->ease_mm_s >= 0 &&
           isfinite(s->ease_mm_s);
}

static void read_array(struct reader *r, uint8_t *out, size_t size) {
    const uint8_t *bytes = read_bytes(r, size);
    if (bytes)
        memcpy(out, bytes, size);
}

static bool has_parent(const struct trace_header *h) {
    static const uint8_t none[TRACE_HASH_SIZE];
    return memcmp(h->parent, none, sizeof none) != 0;
}

bool trace_header_is_piece(const struct trace_header *h) {
    return has_parent(h) && !memcmp(h->parent_id, h->session_id, sizeof h->parent_id);
}

bool trace_header_is_copied(const struct trace_header *h) {
    return has_parent(h) && !trace_header_is_piece(h);
}

size_t header_encode(const struct trace_header *h, struct chain *chain, uint8_t *out) {
    struct writer w = {out, HEADER_MAX, HEADER_PREFIX, false};
    write_bytes(&w, h->session_id, sizeof h->session_id);
    write_bytes(&w, h->parent, sizeof h->parent);
    write_bytes(&w, h->parent_id, sizeof h->parent_id);
    write_text(&w, h->station);
    write_text(&w, h->trainee);
    write_text(&w, h->case_name);
    write_text(&w, h->case_dir);
    write_u64(&w, h->case_hash);
    write_i64(&w, h->start_utc_ns);
    write_i64(&w, h->start_ns);
    write_settings(&w, &h->settings);
    write_f64(&w, h->optic.tilt_deg);
    write_f64(&w, h->optic.field_deg);
    write_text(&w, h->build);
    write_text(&w, h->libc);
    write_text(&w, h->cpu);
    write_described(&w, &h->settings);
    write_u8(&w, (uint8_t)h->loose_count);
    write_u16(&w, h->part ? h->part : 1);
    write_text(&w, h->server);
    write_u64(&w, h->token);
    struct writer prefix = {out, HEADER_PREFIX, 0, false};
    write_bytes(&prefix, HEADER_MAGIC, 8);
    write_u16(&prefix, TRACE_VERSION);
    write_u32(&prefix, (uint32_t)(w.used - HEADER_PREFIX));
    static const uint8_t none[TRACE_HASH_SIZE];
    if (chain)
        chain_add(chain, out, w.used);
    write_bytes(&w, chain ? chain->value : none, sizeof none);
    CHECK(!w.overflow && !prefix.overflow);
    return w.used;
}

enum result header_decode_prefix(const uint8_t *prefix, unsigned *out_version, size_t *out_rest,
                                 struct error *err) {
    struct reader r = {prefix, HEADER_PREFIX, 0, false};
    *out_version = 0;
    *out_rest = 0;
    if (memcmp(read_bytes(&r, 8), HEADER_MAGIC, 8) != 0)
        return fail(err, RESULT_FORMAT, "it does not begin as a trace does");
    *out_version = read_u16(&r);
    if (*out_version < TRACE_OLDEST_VERSION || *out_version > TRACE_VERSION)
        return fail(err, RESULT_VERSION, "it has version %u, and this program reads %d to %d",
                    *out_version, TRACE_OLDEST_VERSION, TRACE_VERSION);
    uint32_t size = read_u32(&r);
    if (size > HEADER_FIELDS_MAX)
        return fail(err, RESULT_LIMIT, "its header claims %u bytes, more than %d", size,
                    HEADER_FIELDS_MAX);
    *out_rest = size + checksum_size(*out_version);
    return RESULT_OK;
}

size_t checksum_size(unsigned version) {
    return version >= 3 ? TRACE_HASH_SIZE : sizeof(uint64_t);
}

bool checksum_matches(const uint8_t *data, size_t size, unsigned version, struct chain *chain) {
    size_t checked = size - checksum_size(version);
    if (version < 3) {
        struct reader r = {data + checked, sizeof(uint64_t), 0, false};
        return read_u64(&r) == XXH3_64bits(data, checked);
    }
    chain_add(chain, data, checked);
    bool matches = !memcmp(chain->value, data + checked, sizeof chain->value);
    memcpy(chain->value, data + checked, sizeof chain->value);
    return matches;
}

static enum result check_settings(const struct trace_header *h, struct error *err) {
    if (h->settings.rules > RULES_NEWEST)
        return fail(err, RESULT_VERSION,
                    "its session follows the rules %d, and this program knows 1 to %d",
                    h->settings.rules, RULES_NEWEST);
    if (h->settings.rules < 1 || h->loose_count > CASE_LOOSE_MAX ||
        !settings_are_valid(&h->settings) || !view_optic_is_valid(&h->optic) ||
        !time_is_sane(h->start_ns) || !utc_is_sane(h->start_utc_ns) || h->part < 1)
        return fail(err, RESULT_FORMAT, "a setting in its header is out of range");
    return RESULT_OK;
}

// Whose it is, and of which sessions it is a copy.
static void read_session(struct reader *r, unsigned version, struct trace_header *h) {
    read_array(r, h->session_id, sizeof h->session_id);
    if (version >= 3)
        read_array(r, h->parent, sizeof h->parent);
    if (version >= 4)
        read_array(r, h->parent_id, sizeof h->parent_id);
    else if (has_parent(h)) // then all were pieces
        memcpy(h->parent_id, h->session_id, sizeof h->parent_id);
    read_text(r, h->station, sizeof h->station);
    read_text(r, h->trainee, sizeof h->trainee);
    read_text(r, h->case_name, sizeof h->case_name);
    read_text(r, h->case_dir, sizeof h->case_dir);
    h->case_hash = read_u64(r);
    h->start_utc_ns = read_i64(r);
    h->start_ns = read_i64(r);
}

static void read_part(struct reader *r, unsigned version, struct trace_header *h) {
    h->part = 1;
    if (version < TRACE_FIRST_WITH_PARTS)
        return;
    h->part = read_u16(r);
    read_text(r, h->server, sizeof h->server);
    h->token = read_u64(r);
}

enum result header_decode(const uint8_t *data, size_t size, unsigned version, struct chain *chain,
                          struct trace_header *h, struct error *err) {
    if (!checksum_matches(data, size, version, chain))
        return fail(err, RESULT_CORRUPT, "the checksum of its header is wrong");
    return header_decode_bare(data, size, version, h, err);
}

enum result header_decode_bare(const uint8_t *data, size_t size, unsigned version,
                               struct trace_header *h, struct error *err) {
    memset(h, 0, sizeof *h);
    struct reader r = {data, size - checksum_size(version), HEADER_PREFIX, false};
    h->version = (uint16_t)version;
    read_session(&r, version, h);
    read_settings(&r, version, &h->settings);
    h->optic = view_optic_usual();
    if (version >= 4) {
        h->optic.tilt_deg = read_f64(&r);
        h->optic.field_deg = read_f64(&r);
    }
    read_text(&r, h->build, sizeof h->build);
    read_text(&r, h->libc, sizeof h->libc);
    read_text(&r, h->cpu, sizeof h->cpu);
    if (version >= 6 && read_described(&r, &h->settings, err) != RESULT_OK)
        return fail_in(err, RESULT_FORMAT, "its header: ");
    h->loose_count = version >= 6 ? read_u8(&r) : 0;
    read_part(&r, version, h);
    if (r.underflow || r.used != r.size)
        return fail(err, RESULT_FORMAT, "its header has not the size of its fields");
    return check_settings(h, err);
}
