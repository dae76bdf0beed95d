// A note or a point to touch from an instructor to the trainee. It is recorded in the session's
// trace, but is no input of the session.
#pragma once

#include "base/pose.h"
#include "base/sample.h"
#include "case/case.h"

#define REMARKS_MAX 256 // of a session
#define REMARK_TEXT_MAX 256
#define REMARK_AUTHOR_MAX 64

struct remark {
    uint32_t number; // 1 to REMARKS_MAX; a later remark with the same number replaces this one
    int64_t time_ns; // on the session's clock
    char author[REMARK_AUTHOR_MAX];
    char text[REMARK_TEXT_MAX]; // empty for a marker alone
    bool withdrawn;             // must not be shown any more
    bool has_marker;            // body and point are a point to touch
    enum body body;
    vec3 point; // in the virtual body's frame, within ±10 m
};

bool remark_is_valid(const struct remark *remark);

// In one line, for programs that show texts only: what it says, where it points, whether it was
// withdrawn.
#define REMARK_DESCRIPTION_SIZE (REMARK_TEXT_MAX + 64)
void remark_describe(const struct remark *remark, char out_text[REMARK_DESCRIPTION_SIZE]);
