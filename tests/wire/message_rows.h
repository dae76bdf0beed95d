// Bytes that are not messages, or just so, and what the decoders say to them.
#pragma once

#include "base/result.h"

#include <stddef.h>

enum { KIND_CONTROL, KIND_CONSOLE, KIND_FRAME, KIND_REPLY, KIND_PAGE };

struct message_row {
    const char *what;
    int kind;
    enum result result;
    const char *bytes;
    size_t size;
    size_t more; // bytes of `filler` that follow
    unsigned char filler;
};

extern const struct message_row message_rows[];
extern const int message_row_count;
