#include "igtl/message.h"

#include "base/check.h"
#include "base/clock.h"
#include "igtl/big_endian.h"

#include <openigtlink/igtl_header.h>
#include <openigtlink/igtl_util.h>
#include <string.h>

_Static_assert(IGTL_DEVICE_SIZE == IGTL_HEADER_NAME_SIZE + 1, "a device's name and a 0");

#define EXTENDED_HEADER_SIZE                                                                       \
    12                     // sizes of itself (2), of the index (2), of the metadata (4); an id (4)
#define INDEX_COUNT_SIZE 2 // how many entries there are
#define INDEX_ENTRY_SIZE 8 // lengths of key (2) and value (4), the value's encoding (2) between
#define US_ASCII 3         // of IANA's character sets

// Rounded up, so that igtl_stamp_ns gives the same time back.
uint64_t igtl_stamp(int64_t utc_ns) {
    uint64_t ns = utc_ns < 0 ? 0 : (uint64_t)utc_ns, within = ns % NS_PER_S;
    return ns / NS_PER_S << 32 | ((within << 32) + NS_PER_S - 1) / NS_PER_S;
}

int64_t igtl_stamp_ns(uint64_t stamp) {
    uint64_t fraction = stamp & UINT32_MAX;
    return (int64_t)(stamp >> 32) * NS_PER_S + (int64_t)((fraction * NS_PER_S) >> 32);
}

static size_t index_size(const struct igtl_head *h) {
    return INDEX_COUNT_SIZE + (size_t)h->metadata_count * INDEX_ENTRY_SIZE;
}

static size_t metadata_size(const struct igtl_head *h) {
    size_t size = 0;
    for (int i = 0; i < h->metadata_count; i++)
        size += strlen(h->metadata[i].key) + strlen(h->metadata[i].value);
    return size;
}

size_t igtl_message_content(int version) {
    return IGTL_HEADER_SIZE + (version > 1 ? EXTENDED_HEADER_SIZE : 0);
}

size_t igtl_message_size(const struct igtl_head *h, size_t content_size) {
    size_t behind = h->version > 1 ? index_size(h) + metadata_size(h) : 0;
    return igtl_message_content(h->version) + content_size + behind;
}

static uint8_t *put_text(uint8_t *out, const char *text) {
    size_t size = strlen(text);
    memcpy(out, text, size);
    return out + size;
}

static void put_extended(const struct igtl_head *h, uint8_t *out) {
    out = big_endian_put(out, EXTENDED_HEADER_SIZE, 2);
    out = big_endian_put(out, index_size(h), 2);
    out = big_endian_put(out, metadata_size(h), 4);
    big_endian_put(out, h->id, 4);
}

static void put_metadata(const struct igtl_head *h, uint8_t *out) {
    out = big_endian_put(out, (uint64_t)h->metadata_count, INDEX_COUNT_SIZE);
    for (int i = 0; i < h->metadata_count; i++) {
        out = big_endian_put(out, strlen(h->metadata[i].key), 2);
        out = big_endian_put(out, US_ASCII, 2);
        out = big_endian_put(out, strlen(h->metadata[i].value), 4);
    }
    for (int i = 0; i < h->metadata_count; i++)
        out = put_text(put_text(out, h->metadata[i].key), h->metadata[i].value);
}

size_t igtl_message_finish(const struct igtl_head *h, size_t content_size, uint8_t *message) {
    CHECK(h->metadata_count >= 0 && h->metadata_count <= IGTL_METADATA_MAX);
    uint8_t *body = message + IGTL_HEADER_SIZE;
    size_t size = igtl_message_size(h, content_size);
    if (h->version > 1) {
        put_extended(h, body);
        put_metadata(h, message + igtl_message_content(h->version) + content_size);
    }
    igtl_header header = {.version = (igtl_uint16)h->version,
                          .body_size = size - IGTL_HEADER_SIZE,
                          .timestamp = h->stamp};
    memcpy(header.name, h->type, strnlen(h->type, sizeof header.name));
    memcpy(header.device_name, h->device, strnlen(h->device, sizeof header.device_name));
    header.crc = crc64(body, header.body_size, 0);
    igtl_header_convert_byte_order(&header);
    memcpy(message, &header, sizeof header);
    return size;
}
