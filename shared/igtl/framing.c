#include "igtl/framing.h"

#include "igtl/big_endian.h"

#include <openigtlink/igtl_util.h>
#include <string.h>

_Static_assert(IGTL_TYPE_SIZE == IGTL_HEADER_TYPE_SIZE + 1, "a type and a 0");

enum { EXTENDED_SIZE = 12, VERSION_MAX = 255 };

void igtl_framing_init(struct igtl_framing *f) {
    f->header_used = 0;
    f->body_used = f->crc = 0;
}

static size_t take_header(struct igtl_framing *f, const uint8_t *bytes, size_t size) {
    size_t missing = sizeof f->header - f->header_used, taken = size < missing ? size : missing;
    memcpy((uint8_t *)&f->header + f->header_used, bytes, taken);
    f->header_used += taken;
    if (taken && f->header_used == sizeof f->header)
        igtl_header_convert_byte_order(&f->header);
    return taken;
}

static size_t take_body(struct igtl_framing *f, const uint8_t *bytes, size_t size) {
    uint64_t missing = f->header.body_size - f->body_used;
    size_t taken = size < missing ? size : (size_t)missing;
    if (f->header.body_size <= IGTL_BODY_MAX)
        memcpy(f->body + f->body_used, bytes, taken);
    f->crc = crc64((unsigned char *)bytes, taken, f->crc);
    f->body_used += taken;
    return taken;
}

void igtl_copy_name(char *out, const char *name, size_t size) {
    size_t length = strnlen(name, size);
    while (length && name[length - 1] == ' ')
        length--;
    memset(out, 0, size + 1);
    memcpy(out, name, length);
}

static struct igtl_frame frame_of(const struct igtl_framing *f) {
    const igtl_header *h = &f->header;
    struct igtl_frame frame = {.version = h->version,
                               .known = h->version >= 1 && h->version <= IGTL_NEWEST_VERSION,
                               .intact = !h->body_size || f->crc == h->crc,
                               .stamp = h->timestamp,
                               .body_size = h->body_size,
                               .body = f->body};
    igtl_copy_name(frame.type, h->name, IGTL_HEADER_TYPE_SIZE);
    igtl_copy_name(frame.device, h->device_name, IGTL_HEADER_NAME_SIZE);
    return frame;
}

// After a piece that is missing, what is read as a header is none: it may have any length.
static bool is_header(const igtl_header *h) {
    bool text = h->name[0] || h->version;
    for (int i = 0; i < IGTL_HEADER_TYPE_SIZE && h->name[i]; i++)
        text &= h->name[i] >= ' ' && h->name[i] <= '~';
    return text && h->version <= VERSION_MAX;
}

size_t igtl_framing_feed(struct igtl_framing *f, const uint8_t *bytes, size_t size,
                         enum igtl_framing_event *out_event, struct igtl_frame *out_frame,
                         struct error *err) {
    size_t taken = take_header(f, bytes, size);
    *out_event = IGTL_FRAMING_PART;
    if (f->header_used < sizeof f->header)
        return taken;
    if (!is_header(&f->header)) {
        fail(err, RESULT_FORMAT, "what should be a message's header is none");
        *out_event = IGTL_FRAMING_BROKEN;
        return taken;
    }
    if (f->header.body_size > IGTL_SKIP_MAX) {
        fail(err, RESULT_LIMIT, "a message of %llu bytes", (unsigned long long)f->header.body_size);
        *out_event = IGTL_FRAMING_BROKEN;
        return taken;
    }
    taken += take_body(f, bytes + taken, size - taken);
    if (f->body_used < f->header.body_size)
        return taken;
    *out_frame = frame_of(f);
    *out_event = IGTL_FRAMING_MESSAGE;
    igtl_framing_init(f);
    return taken;
}

enum result igtl_frame_content(const struct igtl_frame *f, struct igtl_content *out,
                               struct error *err) {
    if (f->body_size > IGTL_BODY_MAX)
        return fail(err, RESULT_LIMIT, "%s with a body of %llu bytes", f->type,
                    (unsigned long long)f->body_size);
    *out =
        (struct igtl_content){.bytes = f->body, .size = (size_t)f->body_size, .device = f->device};
    if (f->version == 1)
        return RESULT_OK;
    if (f->body_size < EXTENDED_SIZE)
        return fail(err, RESULT_FORMAT, "a body of %zu bytes has no extended header", out->size);
    size_t extended = (size_t)big_endian_get(f->body, 2);
    size_t index = (size_t)big_endian_get(f->body + 2, 2);
    size_t metadata = (size_t)big_endian_get(f->body + 4, 4);
    if (extended < EXTENDED_SIZE || extended + index + metadata > out->size)
        return fail(err, RESULT_FORMAT,
                    "an extended header of %zu, %zu and %zu bytes in a body of %zu", extended,
                    index, metadata, out->size);
    out->bytes += extended;
    out->size -= extended + index + metadata;
    out->index = out->bytes + out->size;
    out->index_size = index;
    out->metadata_size = metadata;
    return RESULT_OK;
}
