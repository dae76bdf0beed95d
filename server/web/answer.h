// Answers in HTTP: a status, headers, and bytes in memory or of a file. No sockets. Making an
// answer may take time, because it compresses and opens files; pages and refusals take none.
#pragma once

#include "web/gzip_cache.h"
#include "web/web.h"

#include <stdint.h>

#define ANSWER_HEAD_MAX 4096
#define ANSWER_PIECE 262144 // of a file, read at once

// The headers of a request that matter for its answer. The text of a missing header is empty.
struct answer_options {
    bool head_only;
    bool over_tls;
    bool takes_gzip;
    char range[64], if_range[96], none_match[256];
};

struct answer {
    int status;
    char head[ANSWER_HEAD_MAX];
    size_t head_size;
    uint8_t *owned;                 // memory to release with the answer
    const struct gzip_file *packed; // to release with the answer
    const uint8_t *bytes;           // `size` of them, after the head
    size_t size;
    int file; // -1: none; else `left` bytes of it, from `at` on, follow
    int64_t at, left;
    bool closes; // the connection, after the answer
};

struct answer answer_none(void);
void answer_release(struct answer *answer); // it is none then

// Takes the response's body. Compressed files go into the cache.
struct answer answer_of(const struct web_response *response, const struct answer_options *options,
                        struct gzip_cache *cache);
struct answer answer_page(const struct web_page *page, const struct answer_options *options);

// {"error": {"code": ..., "text": ...}}
struct answer answer_refusal(int status, const char *code, const char *text, bool closes);

// Reads the next piece of the file into `bytes`. False if it cannot be read.
bool answer_read(struct answer *answer);

// The part of `size` bytes that a Range header asks for.
enum range_verdict { RANGE_NONE, RANGE_SOME, RANGE_BEYOND };

// RANGE_NONE: all bytes (also for several ranges, which a server may ignore). RANGE_SOME: from
// *out_from up to, but without, *out_to. RANGE_BEYOND: there are no such bytes.
enum range_verdict range_parse(const char *range, int64_t size, int64_t *out_from, int64_t *out_to);
