#include "web/answer.h"

#include "base/check.h"
#include "web/gzip.h"

#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define COMPRESSED_MAX (64 << 20)

static const char policy[] =
    "default-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self' ws://127.0.0.1:* ws://localhost:*; style-src 'self'; script-src 'self'; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'self'";

// Of a page that stands alone: its own style, and nothing else at all.
static const char policy_alone[] = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; "
                                   "frame-ancestors 'none'; base-uri 'none'; form-action 'none'; "
                                   "sandbox";

static const char security[] = "X-Content-Type-Options: nosniff\r\n"
                               "Referrer-Policy: no-referrer\r\n"
                               "Cross-Origin-Opener-Policy: same-origin\r\n"
                               "Cross-Origin-Resource-Policy: same-origin\r\n";

static const char *status_text(int status) {
    static const struct {
        int status;
        const char *text;
    } texts[] = {
        {200, "OK"},
        {201, "Created"},
        {204, "No Content"},
        {206, "Partial Content"},
        {303, "See Other"},
        {304, "Not Modified"},
        {400, "Bad Request"},
        {401, "Unauthorized"},
        {403, "Forbidden"},
        {404, "Not Found"},
        {405, "Method Not Allowed"},
        {406, "Not Acceptable"},
        {408, "Request Timeout"},
        {409, "Conflict"},
        {411, "Length Required"},
        {413, "Content Too Large"},
        {416, "Range Not Satisfiable"},
        {421, "Misdirected Request"},
        {426, "Upgrade Required"},
        {429, "Too Many Requests"},
        {500, "Internal Server Error"},
        {503, "Service Unavailable"},
    };
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++)
        if (texts[i].status == status)
            return texts[i].text;
    return "";
}

// ---- heads --------------------------------------------------------------------------------------

static void put(struct answer *a, const char *format, ...) __attribute__((format(printf, 2, 3)));

static void put(struct answer *a, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    int length =
        vsnprintf(a->head + a->head_size, sizeof a->head - a->head_size, format, arguments);
    va_end(arguments);
    CHECK(length >= 0 && (size_t)length < sizeof a->head - a->head_size);
    a->head_size += (size_t)length;
}

static bool is_one_line(const char *text) {
    for (; *text; text++)
        if ((unsigned char)*text < ' ')
            return false;
    return true;
}

// A header with a value from the handler.
static void put_header(struct answer *a, const char *name, const char *value) {
    CHECK(is_one_line(value)); // else it could end the headers
    if (value[0])
        put(a, "%s: %s\r\n", name, value);
}

static void begin_with(struct answer *a, int status, const char *content_policy) {
    a->status = status;
    put(a, "HTTP/1.1 %d %s\r\nContent-Security-Policy: %s\r\n%s", status, status_text(status),
        content_policy, security);
}

static void begin(struct answer *a, int status) {
    begin_with(a, status, policy);
}

static void end(struct answer *a, int64_t length) {
    if (length >= 0)
        put(a, "Content-Length: %lld\r\n", (long long)length);
    if (a->closes)
        put(a, "Connection: close\r\n");
    put(a, "\r\n");
}

// ---- life ---------------------------------------------------------------------------------------

struct answer answer_none(void) {
    return (struct answer){.file = -1};
}

void answer_release(struct answer *answer) {
    free(answer->owned);
    gzip_file_release(&answer->packed);
    if (answer->file >= 0)
        close(answer->file);
    *answer = answer_none();
}

struct answer answer_refusal(int status, const char *code, const char *text, bool closes) {
    struct answer a = answer_none();
    size_t size = strlen(code) + strlen(text) + 64;
    a.owned = alloc(size, 1);
    a.bytes = a.owned;
    a.size = (size_t)snprintf((char *)a.owned, size,
                              "{\"error\":{\"code\":\"%s\",\"text\":\"%s\"}}\n", code, text);
    a.closes = closes;
    begin(&a, status);
    put(&a, "Content-Type: application/json\r\nCache-Control: no-store\r\n");
    if (status == 405)
        put(&a, "Allow: GET, HEAD\r\n");
    if (status == 429 || status == 503)
        put(&a, "Retry-After: 1\r\n");
    end(&a, (int64_t)a.size);
    return a;
}

static struct answer failure(void) {
    return answer_refusal(500, "failed", "The request failed; the server's log says why.", false);
}

static void drop_body(struct answer *a) {
    free(a->owned);
    gzip_file_release(&a->packed);
    a->owned = NULL;
    a->bytes = NULL;
    a->size = 0;
    if (a->file >= 0)
        close(a->file);
    a->file = -1;
    a->left = 0;
}

// ---- what the browser has already ---------------------------------------------------------------

// Weak comparison (RFC 9110, 8.8.3.2) with each of a list.
static bool matches(const char *list, const char *etag) {
    size_t length = strlen(etag);
    if (!etag[0])
        return false;
    if (!strcmp(list, "*"))
        return true;
    for (const char *at = strchr(list, '"'); at; at = strchr(at, '"')) {
        const char *close_quote = strchr(++at, '"');
        if (!close_quote)
            return false;
        if ((size_t)(close_quote - at) == length && !memcmp(at, etag, length))
            return true;
        at = close_quote + 1;
    }
    return false;
}

static void put_etag(struct answer *a, const char *etag, bool packed) {
    CHECK(is_one_line(etag));
    if (etag[0])
        put(a, "ETag: %s\"%s\"\r\n", packed ? "W/" : "", etag); // of two forms of the same content
}

// ---- pages --------------------------------------------------------------------------------------

struct answer answer_page(const struct web_page *page, const struct answer_options *options) {
    struct answer a = answer_none();
    bool known = matches(options->none_match, page->etag);
    if (known) {
        begin(&a, 304);
    } else if (options->takes_gzip) {
        a.bytes = page->gzip;
        a.size = page->gzip_size;
        begin(&a, 200);
        put(&a, "Content-Encoding: gzip\r\n");
    } else if ((a.owned = gzip_unpack(page->gzip, page->gzip_size, page->size))) {
        a.bytes = a.owned;
        a.size = page->size;
        begin(&a, 200);
    } else {
        return failure();
    }
    put_header(&a, "Content-Type", page->type);
    put_etag(&a, page->etag, true);
    put(&a, "Vary: Accept-Encoding\r\nCache-Control: %s\r\n",
        page->hashed ? "public, max-age=31536000, immutable" : "no-cache");
    end(&a, known ? -1 : (int64_t)a.size);
    if (options->head_only)
        drop_body(&a);
    return a;
}

// ---- the handler's ------------------------------------------------------------------------------

static bool open_file(struct answer *a, const char *path) {
    struct stat status;
    a->file = open(path, O_RDONLY | O_CLOEXEC | O_NOCTTY | O_NONBLOCK);
    if (a->file >= 0 && fstat(a->file, &status) == 0 && S_ISREG(status.st_mode)) {
        a->left = status.st_size;
        return true;
    }
    drop_body(a);
    return false;
}

static bool take_file(struct answer *a, FILE *file) {
    struct stat status;
    a->file = fcntl(fileno(file), F_DUPFD_CLOEXEC, 0);
    fclose(file);
    if (a->file < 0 || fstat(a->file, &status) != 0)
        return false;
    a->left = status.st_size;
    return true;
}

bool answer_read(struct answer *a) {
    size_t wanted = a->left < ANSWER_PIECE ? (size_t)a->left : ANSWER_PIECE;
    ssize_t count = 0;
    free(a->owned);
    a->bytes = a->owned = alloc(wanted, 1);
    a->size = 0;
    while (a->size < wanted) {
        count = pread(a->file, a->owned + a->size, wanted - a->size, a->at);
        if (count < 0 && errno == EINTR)
            continue;
        if (count <= 0)
            return false;
        a->size += (size_t)count;
        a->at += count;
        a->left -= count;
    }
    return true;
}

// Reads all of the file.
static bool load(struct answer *a) {
    size_t size = (size_t)a->left;
    uint8_t *bytes = alloc(size, 1);
    while (a->left > 0 && answer_read(a))
        memcpy(bytes + a->at - (int64_t)a->size, a->bytes, a->size);
    bool whole = a->left == 0;
    drop_body(a);
    a->bytes = a->owned = bytes;
    a->size = size;
    return whole;
}

// The name identifies this version of the file; older versions drop out of the cache.
static bool load_packed(struct answer *a, const char *path, struct gzip_cache *cache) {
    char name[GZIP_CACHE_NAME_MAX];
    struct stat status;
    if (fstat(a->file, &status) != 0)
        return false;
    snprintf(name, sizeof name, "%s %lld.%09ld %lld", path, (long long)status.st_mtim.tv_sec,
             status.st_mtim.tv_nsec, (long long)status.st_size);
    const struct gzip_file *packed = gzip_cache_take(cache, name);
    if (!packed) {
        if (!load(a))
            return false;
        size_t size;
        uint8_t *bytes = gzip_pack(a->bytes, a->size, &size);
        packed = gzip_cache_put(cache, name, bytes, size);
    }
    drop_body(a);
    a->packed = packed;
    a->bytes = packed->bytes;
    a->size = packed->size;
    return true;
}

static void pack(struct answer *a) {
    size_t size;
    uint8_t *packed = gzip_pack(a->bytes, a->size, &size);
    free(a->owned);
    a->bytes = a->owned = packed;
    a->size = size;
}

static bool is_known(const struct web_response *r, const struct answer_options *options) {
    return r->status == 200 && matches(options->none_match, r->etag);
}

// A file that the browser already has is neither read nor compressed.
static bool is_packed(const struct web_response *r, const struct answer_options *options) {
    return r->compress && options->takes_gzip && !is_known(r, options);
}

// The status; for 206 and 416 also the range of the file.
static int choose(struct answer *a, const struct web_response *r,
                  const struct answer_options *options, int64_t size) {
    char quoted[sizeof r->etag + 2];
    snprintf(quoted, sizeof quoted, "\"%s\"", r->etag);
    int status = r->status ? r->status : 204;
    if (is_known(r, options))
        return 304;
    if (status != 200 || a->file < 0 || (options->if_range[0] && strcmp(options->if_range, quoted)))
        return status;
    int64_t to;
    enum range_verdict range = range_parse(options->range, size, &a->at, &to);
    a->left = to - a->at;
    return range == RANGE_NONE ? status : range == RANGE_SOME ? 206 : 416;
}

static void put_range(struct answer *a, const struct web_response *r, int64_t size) {
    if (a->file < 0)
        return;
    put(a, "Accept-Ranges: bytes\r\n");
    if (r->content_range[0]) {
        put_header(a, "Content-Range", r->content_range);
        return;
    }
    if (a->status == 206)
        put(a, "Content-Range: bytes %lld-%lld/%lld\r\n", (long long)a->at,
            (long long)(a->at + a->left - 1), (long long)size);
    if (a->status == 416)
        put(a, "Content-Range: bytes */%lld\r\n", (long long)size);
}

// A name that every system takes; others were an invitation to play tricks with it.
static void put_disposition(struct answer *a, const char *name) {
    static const char good[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_. ";
    if (!name[0])
        return;
    put(a, "Content-Disposition: attachment; filename=\"");
    for (; *name; name++)
        put(a, "%c", strchr(good, *name) ? *name : '_');
    put(a, "\"\r\n");
}

static void put_cookie(struct answer *a, const char *cookie, bool over_tls) {
    char secure[sizeof((struct web_response *)NULL)->cookie + sizeof "; Secure"];
    snprintf(secure, sizeof secure, "%s; Secure", cookie);
    put_header(a, "Set-Cookie", over_tls && cookie[0] ? secure : cookie);
}

static void put_headers(struct answer *a, const struct web_response *r, bool over_tls) {
    put_header(a, "Content-Type", r->type[0] ? r->type : "application/json");
    put_cookie(a, r->cookie, over_tls);
    put_cookie(a, r->second_cookie, over_tls);
    put_header(a, "Location", r->location);
    put_etag(a, r->etag, r->compress);
    put_disposition(a, r->download);
    put(a, "Cache-Control: %s\r\n", r->etag[0] ? "private, no-cache" : "no-store");
    if (r->compress)
        put(a, "Vary: Accept-Encoding\r\n");
    if (r->retry_after_s > 0)
        put(a, "Retry-After: %d\r\n", r->retry_after_s);
}

struct answer answer_of(const struct web_response *r, const struct answer_options *options,
                        struct gzip_cache *cache) {
    struct answer a = answer_none();
    a.bytes = a.owned = (uint8_t *)r->body;
    a.size = r->size;
    if (r->file[0] && !open_file(&a, r->file))
        return answer_refusal(404, "not_found", "There is no such file.", false);
    if (r->open_file && !take_file(&a, r->open_file)) {
        answer_release(&a);
        return failure();
    }
    bool packed = is_packed(r, options) && a.left <= COMPRESSED_MAX;
    if (packed && a.file < 0)
        pack(&a);
    else if (packed && !load_packed(&a, r->file, cache)) {
        answer_release(&a);
        return failure();
    }
    int64_t size = a.file >= 0 ? a.left : (int64_t)a.size;
    int status = choose(&a, r, options, size);
    begin_with(&a, status, r->stands_alone ? policy_alone : policy);
    put_headers(&a, r, options->over_tls);
    if (packed)
        put(&a, "Content-Encoding: gzip\r\n");
    put_range(&a, r, size);
    bool bare = status == 304 || status == 204;
    end(&a, bare ? -1 : status == 416 ? 0 : a.file >= 0 ? a.left : (int64_t)a.size);
    if (bare || status == 416 || options->head_only)
        drop_body(&a);
    return a;
}
