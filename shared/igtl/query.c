#include "igtl/query.h"

#include "igtl/content.h"

#include <openigtlink/igtl_tdata.h>
#include <string.h>

static const struct {
    const char *name;
    enum igtl_query_kind kind;
    enum igtl_type type;
} queries[] = {
    {"GET_TRANS", IGTL_QUERY_GET, IGTL_TYPE_TRANSFORM},
    {"GET_TRANSFOR", IGTL_QUERY_GET, IGTL_TYPE_TRANSFORM},
    {"GET_POSITION", IGTL_QUERY_GET, IGTL_TYPE_POSITION},
    {"GET_TDATA", IGTL_QUERY_GET, IGTL_TYPE_TDATA},
    {"GET_QTDATA", IGTL_QUERY_GET, IGTL_TYPE_QTDATA},
    {"GET_POLYDATA", IGTL_QUERY_GET, IGTL_TYPE_POLYDATA},
    {"GET_STATUS", IGTL_QUERY_GET, IGTL_TYPE_STATUS},
    {"GET_CAPABIL", IGTL_QUERY_GET, IGTL_TYPE_CAPABILITY},
    {"STT_TDATA", IGTL_QUERY_START, IGTL_TYPE_TDATA},
    {"STT_QTDATA", IGTL_QUERY_START, IGTL_TYPE_QTDATA},
    {"STP_TDATA", IGTL_QUERY_STOP, IGTL_TYPE_TDATA},
    {"STP_QTDATA", IGTL_QUERY_STOP, IGTL_TYPE_QTDATA},
};

const char *igtl_type_name(enum igtl_type type) {
    static const char *const names[] = {"TRANSFORM", "POSITION", "TDATA",     "QTDATA",
                                        "POLYDATA",  "STATUS",   "CAPABILITY"};
    return names[type];
}

// Other clients leave out the body of a start, and mean: as fast as possible.
static enum result read_start(const struct igtl_frame *frame, struct igtl_query *out,
                              struct error *err) {
    struct igtl_content content;
    igtl_stt_tdata body = {0};
    if (igtl_frame_content(frame, &content, err) != RESULT_OK)
        return RESULT_FORMAT;
    if (content.size != sizeof body && content.size)
        return fail(err, RESULT_FORMAT, "%s with a content of %zu bytes", frame->type,
                    content.size);
    if (content.size)
        memcpy(&body, content.bytes, sizeof body);
    igtl_stt_tdata_convert_byte_order(&body);
    out->interval_ms = body.resolution > 0 ? body.resolution : 0;
    return RESULT_OK;
}

enum result igtl_query_read(const struct igtl_frame *frame, struct igtl_query *out,
                            struct error *err) {
    *out = (struct igtl_query){.kind = IGTL_QUERY_OTHER};
    memcpy(out->device, frame->device, sizeof out->device);
    for (size_t i = 0; i < sizeof queries / sizeof *queries; i++)
        if (!strcmp(frame->type, queries[i].name)) {
            out->kind = queries[i].kind;
            out->type = queries[i].type;
        }
    if (!frame->intact)
        return fail(err, RESULT_CORRUPT, "%s: wrong checksum", frame->type);
    return out->kind == IGTL_QUERY_START ? read_start(frame, out, err) : RESULT_OK;
}
