// What somebody said to the trainee during a session, or a point to touch: part of its record, and
// no input of it.
#pragma once

#include "base/pose.h"
#include "base/sample.h"
#include "case/case.h"

#define REMARKS_MAX 256 // of a session
#define REMARK_TEXT_MAX 256
#define REMARK_AUTHOR_MAX 64

struct remark {
    uint32_t number; // from 1, at most REMARKS_MAX; the same again: as it is from now on
    int64_t time_ns; // on the session's clock
    char author[REMARK_AUTHOR_MAX];
    char text[REMARK_TEXT_MAX]; // empty for a marker alone
    bool withdrawn;             // is to be shown no longer
    bool has_marker;            // a point to touch:
    enum body body;
    vec3 point; // in the virtual body's frame, within ±10 m
};

bool remark_is_valid(const struct remark *remark);
