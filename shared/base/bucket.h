// Tokens that come back over time.
#pragma once

#include <stdbool.h>
#include <stdint.h>

struct bucket { // a zeroed one is full
    double spent;
    int64_t checked_ns;
};

// Takes one of `most` tokens, of which `per_s` come back each second. False if none is left.
bool bucket_take(struct bucket *bucket, double per_s, double most, int64_t now_ns);
