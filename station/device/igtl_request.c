#include "device/igtl_request.h"

#include "base/clock.h"

#include <openigtlink/igtl_header.h>
#include <openigtlink/igtl_tdata.h>
#include <openigtlink/igtl_util.h>
#include <string.h>

static const int64_t patience_ns = 500 * NS_PER_MS;  // with a server that may send by itself
static const int64_t pause_ns = 2 * NS_PER_S;        // before it is asked again
static const int64_t get_pause_ns = 100 * NS_PER_MS; // before a GET_ is sent again
static const enum igtl_request_kind first_kind = IGTL_REQUEST_TDATA;
static const enum igtl_request_kind last_kind = IGTL_REQUEST_POSITION;

// From version 2 on: the sizes of this header (12), of the metadata's (2) and of the metadata (0),
// and a message's number; behind the content, the metadata's count.
static const uint8_t extended_header[12] = {0, 12, 0, 2};
static const uint8_t no_metadata[2];

const char *igtl_request_name(enum igtl_request_kind kind) {
    static const char *const names[] = {"auto", "TDATA", "QTDATA", "TRANSFORM", "POSITION", "none"};
    return names[kind];
}

static bool is_get(enum igtl_request_kind kind) {
    return kind == IGTL_REQUEST_TRANSFORM || kind == IGTL_REQUEST_POSITION;
}

void igtl_request_begin(struct igtl_request *r, int64_t now_ns) {
    r->due_ns = r->kind == IGTL_REQUEST_AUTO ? now_ns + patience_ns : now_ns;
    r->count = 0;
    r->asked = IGTL_REQUEST_NONE;
    r->answered_ns = now_ns - pause_ns;
    r->version = 1;
}

void igtl_request_heard(struct igtl_request *r, int version) {
    if (version >= 1 && version <= IGTL_NEWEST_VERSION)
        r->version = version;
}

void igtl_request_answered(struct igtl_request *r, int64_t now_ns) {
    int64_t next_ns = r->asked_ns + r->interval_ms * NS_PER_MS;
    r->due_ns = !is_get(r->asked) ? now_ns + pause_ns : next_ns > now_ns ? next_ns : now_ns;
    r->answered_ns = now_ns;
    r->count = 0;
}

// ---- messages -----------------------------------------------------------------------------------

static size_t encode(const struct igtl_request *r, const char *type, const char *device,
                     const void *content, size_t size, uint8_t *out) {
    uint8_t *body = out + IGTL_HEADER_SIZE, *end = body;
    if (r->version > 1) {
        memcpy(end, extended_header, sizeof extended_header);
        end += sizeof extended_header;
    }
    if (size)
        memcpy(end, content, size);
    end += size;
    if (r->version > 1) {
        memcpy(end, no_metadata, sizeof no_metadata);
        end += sizeof no_metadata;
    }
    igtl_header header = {.version = (igtl_uint16)r->version,
                          .body_size = (igtl_uint64)(end - body)};
    memcpy(header.name, type, strlen(type));
    memcpy(header.device_name, device, strlen(device));
    header.crc = crc64(body, (int)(end - body), 0);
    igtl_header_convert_byte_order(&header);
    memcpy(out, &header, sizeof header);
    return (size_t)(end - out);
}

// STT_TDATA and STT_QTDATA have the same body.
static size_t encode_start(const struct igtl_request *r, uint8_t *out) {
    igtl_stt_tdata body = {.resolution = r->interval_ms};
    memcpy(body.coord_name, r->coordinates, strlen(r->coordinates));
    igtl_stt_tdata_convert_byte_order(&body);
    const char *type = r->asked == IGTL_REQUEST_TDATA ? "STT_TDATA" : "STT_QTDATA";
    return encode(r, type, r->device, &body, sizeof body, out);
}

static size_t encode_gets(const struct igtl_request *r, uint8_t *out) {
    const char *type = r->asked == IGTL_REQUEST_TRANSFORM ? "GET_TRANS" : "GET_POSITION";
    size_t size = 0;
    if (!r->tool_count)
        return encode(r, type, "", NULL, 0, out);
    for (int i = 0; i < r->tool_count; i++)
        size += encode(r, type, r->tools[i], NULL, 0, out + size);
    return size;
}

// ---- whom to ask for what -----------------------------------------------------------------------

// A GET_ brings one pose: it goes out again and again.
static bool is_polling(const struct igtl_request *r, int64_t now_ns) {
    return is_get(r->asked) && now_ns - r->answered_ns < pause_ns;
}

static void choose(struct igtl_request *r, int64_t now_ns) {
    bool again = r->asked != IGTL_REQUEST_NONE;
    if (again && (!r->count || is_polling(r, now_ns)))
        return; // what was answered
    if (r->kind != IGTL_REQUEST_AUTO)
        r->asked = r->kind;
    else
        r->asked = !again || r->asked == last_kind ? first_kind : r->asked + 1;
}

static int64_t pause_after(const struct igtl_request *r, int64_t now_ns) {
    if (is_polling(r, now_ns))
        return get_pause_ns;
    return r->kind == IGTL_REQUEST_AUTO && r->asked != last_kind ? patience_ns : pause_ns;
}

size_t igtl_request_next(struct igtl_request *r, int64_t now_ns,
                         uint8_t out[IGTL_REQUEST_BYTES_MAX]) {
    size_t size = 0;
    if (r->kind == IGTL_REQUEST_NONE || now_ns < r->due_ns)
        return 0;
    choose(r, now_ns);
    r->due_ns = now_ns + pause_after(r, now_ns);
    r->asked_ns = now_ns;
    if (r->kind == IGTL_REQUEST_AUTO && r->asked == first_kind)
        size = encode(r, "GET_STATUS", r->device, NULL, 0, out);
    size += is_get(r->asked) ? encode_gets(r, out + size) : encode_start(r, out + size);
    r->count++;
    return size;
}
