// What a client asks an OpenIGTLink server for.
#pragma once

#include "igtl/framing.h"

enum igtl_query_kind {
    IGTL_QUERY_OTHER, // a message that asks for nothing we know: it is passed over
    IGTL_QUERY_GET,   // send it once
    IGTL_QUERY_START, // send it from now on
    IGTL_QUERY_STOP
};

enum igtl_type {
    IGTL_TYPE_TRANSFORM,
    IGTL_TYPE_POSITION,
    IGTL_TYPE_TDATA,
    IGTL_TYPE_QTDATA,
    IGTL_TYPE_POLYDATA,
    IGTL_TYPE_STATUS,
    IGTL_TYPE_CAPABILITY
};

struct igtl_query {
    enum igtl_query_kind kind;
    enum igtl_type type;
    char device[IGTL_DEVICE_SIZE]; // that is asked; empty: any
    int interval_ms; // START of TDATA and QTDATA: the shortest between two messages; not negative
};

// Reads a frame of a known version. RESULT_CORRUPT: its checksum is wrong; RESULT_FORMAT and
// RESULT_LIMIT: it asks for something and has another length than such a message has. *out_query's
// kind and type are right then, too: the answer is that it failed.
enum result igtl_query_read(const struct igtl_frame *frame, struct igtl_query *out_query,
                            struct error *err);

// "TRANSFORM", ...
const char *igtl_type_name(enum igtl_type type);
