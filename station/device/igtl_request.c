#include "device/igtl_request.h"

#include "base/clock.h"

#include <openigtlink/igtl_header.h>
#include <openigtlink/igtl_tdata.h>
#include <openigtlink/igtl_util.h>
#include <string.h>

static const int64_t patience_ns = 500 * NS_PER_MS; // with a server that may send by itself
static const int64_t pause_ns = 2 * NS_PER_S;       // before it is asked again

const char *igtl_request_name(enum igtl_request_kind kind) {
    static const char *const names[] = {"auto", "TDATA", "QTDATA", "none"};
    return names[kind];
}

void igtl_request_begin(struct igtl_request *r, int64_t now_ns) {
    r->due_ns = r->kind == IGTL_REQUEST_AUTO ? now_ns + patience_ns : now_ns;
    r->count = 0;
    r->asked = IGTL_REQUEST_NONE;
}

void igtl_request_answered(struct igtl_request *r, int64_t now_ns) {
    r->due_ns = now_ns + pause_ns;
    r->count = 0;
}

// STT_TDATA and STT_QTDATA have the same body.
static size_t encode(const struct igtl_request *r, uint8_t *out) {
    igtl_stt_tdata body = {.resolution = r->interval_ms};
    memcpy(body.coord_name, r->coordinates, strlen(r->coordinates));
    igtl_stt_tdata_convert_byte_order(&body);
    igtl_header header = {.version = 1, .body_size = sizeof body};
    const char *type = r->asked == IGTL_REQUEST_TDATA ? "STT_TDATA" : "STT_QTDATA";
    memcpy(header.name, type, strlen(type));
    memcpy(header.device_name, "Arthron", strlen("Arthron"));
    header.crc = crc64((unsigned char *)&body, sizeof body, 0);
    igtl_header_convert_byte_order(&header);
    memcpy(out, &header, sizeof header);
    memcpy(out + sizeof header, &body, sizeof body);
    _Static_assert(sizeof header + sizeof body == IGTL_REQUEST_BYTES, "a request's size");
    return IGTL_REQUEST_BYTES;
}

size_t igtl_request_next(struct igtl_request *r, int64_t now_ns, uint8_t out[IGTL_REQUEST_BYTES]) {
    if (r->kind == IGTL_REQUEST_NONE || now_ns < r->due_ns)
        return 0;
    bool second = r->kind == IGTL_REQUEST_AUTO && r->count % 2;
    r->asked = r->kind == IGTL_REQUEST_QTDATA || second ? IGTL_REQUEST_QTDATA : IGTL_REQUEST_TDATA;
    r->count++;
    r->due_ns = now_ns + (r->kind == IGTL_REQUEST_AUTO && !second ? patience_ns : pause_ns);
    return encode(r, out);
}
