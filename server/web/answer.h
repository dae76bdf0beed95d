// Answers as HTTP: a status, headers, and bytes that are there or a file's. No socket; where an
// answer is made may take time (it packs and opens files), but for pages and refusals.
#pragma once

#include "web/gzip_cache.h"
#include "web/web.h"

#include <stdint.h>

#define ANSWER_HEAD_MAX 2048
#define ANSWER_PIECE 262144 // of a file, read at once

// What a request's headers ask of the answer; texts are empty where they were not sent.
struct answer_options {
    bool head_only;
    bool takes_gzip;
    char range[64], if_range[96], none_match[256];
};

struct answer {
    int status;
    char head[ANSWER_HEAD_MAX];
    size_t head_size;
    uint8_t *owned;                 // what is released with it
    const struct gzip_file *packed; // too
    const uint8_t *bytes;           // of `size`, behind the head
    size_t size;
    int file; // -1: none; else its bytes from `at` on follow, `left` of them
    int64_t at, left;
    bool closes; // the connection, behind it
};

struct answer answer_none(void);
void answer_release(struct answer *answer); // it is none then

// Takes the response's body. What of files is packed is kept on the cache.
struct answer answer_of(const struct web_response *response, const struct answer_options *options,
                        struct gzip_cache *cache);
struct answer answer_page(const struct web_page *page, const struct answer_options *options);

// {"error": {"code": ..., "text": ...}}
struct answer answer_refusal(int status, const char *code, const char *text, bool closes);

// Reads the next piece of the file into bytes. False where it cannot be read.
bool answer_read(struct answer *answer);

// What of `size` bytes a Range header asks for.
enum range { RANGE_NONE, RANGE_SOME, RANGE_BEYOND };

// RANGE_NONE: all (also for several ranges at once, which nobody has to serve). RANGE_SOME: from
// *out_from until before *out_to. RANGE_BEYOND: nothing of it is there.
enum range range_parse(const char *range, int64_t size, int64_t *out_from, int64_t *out_to);
