#include "peers/ask.h"

#include "base/check.h"
#include "https/https.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>

#define CONNECT_MS 3000
#define URL_MAX 8192
#define HEADER_MAX 512

struct peers {
    char *authority;
    atomic_bool breaks_off;
};

struct peers *peers_create(const char *authority) {
    struct peers *peers = alloc(1, sizeof *peers);
    peers->authority = alloc_text(authority);
    curl_global_init(CURL_GLOBAL_DEFAULT);
    return peers;
}

void peers_break_off(struct peers *peers) {
    atomic_store(&peers->breaks_off, true);
}

void peers_destroy(struct peers **peers) {
    if (*peers)
        free((*peers)->authority);
    free(*peers);
    *peers = NULL;
}

// ---- the request --------------------------------------------------------------------------------

bool peer_escape(const char *text, char *out, size_t size) {
    size_t used = 0;
    for (; *text && used + 4 <= size; text++) {
        unsigned char c = (unsigned char)*text;
        bool plain = isalnum(c) || strchr("-._~/", c);
        used += (size_t)sprintf(out + used, plain ? "%c" : "%%%02X", c);
    }
    if (used < size)
        out[used] = '\0';
    return !*text && used < size;
}

struct transfer {
    struct peers *peers;
    const struct peer_request *request;
    FILE *body;
    int64_t received;
    bool file_failed;
};

static size_t take_body(char *bytes, size_t size, size_t count, void *user) {
    struct transfer *t = user;
    size_t all = size * count;
    if ((int64_t)all > t->request->most - t->received)
        return 0;
    t->received += (int64_t)all;
    t->file_failed = fwrite(bytes, 1, all, t->body) != all;
    return t->file_failed ? 0 : all;
}

static void add_header(struct curl_slist **headers, const char *name, const char *value) {
    char line[HEADER_MAX];
    if (!value)
        return;
    int length = snprintf(line, sizeof line, "%s: %s", name, value);
    CHECK(length < (int)sizeof line && !strpbrk(value, "\r\n"));
    *headers = curl_slist_append(*headers, line);
    NEED(*headers, "memory");
}

static struct curl_slist *make_headers(const struct peer_request *r) {
    char bearer[HEADER_MAX / 2];
    struct curl_slist *headers = NULL;
    int length = snprintf(bearer, sizeof bearer, "Bearer %s", r->token);
    CHECK(length < (int)sizeof bearer);
    add_header(&headers, "Authorization", bearer);
    add_header(&headers, "Via", r->via);
    add_header(&headers, "Content-Type", r->body ? "application/json" : NULL);
    add_header(&headers, "Range", r->range);
    add_header(&headers, "If-Range", r->if_range);
    return headers;
}

static void set_limits(CURL *c, struct transfer *t) {
    const struct peer_request *r = t->request;
    curl_easy_setopt(c, CURLOPT_CONNECTTIMEOUT_MS, (long)CONNECT_MS);
    curl_easy_setopt(c, CURLOPT_LOW_SPEED_LIMIT, 1L);
    curl_easy_setopt(c, CURLOPT_LOW_SPEED_TIME, (long)r->silence_s);
    curl_easy_setopt(c, CURLOPT_TIMEOUT_MS, 1000L * r->patience_s);
    curl_easy_setopt(c, CURLOPT_MAXFILESIZE_LARGE, (curl_off_t)r->most);
}

static void set_request(CURL *c, const char *url, struct transfer *t) {
    const struct peer_request *r = t->request;
    curl_easy_setopt(c, CURLOPT_URL, url);
    curl_easy_setopt(c, CURLOPT_CUSTOMREQUEST, r->method);
    if (strcmp(r->method, "GET") != 0) {
        curl_easy_setopt(c, CURLOPT_POSTFIELDSIZE_LARGE, (curl_off_t)(r->body ? r->size : 0));
        curl_easy_setopt(c, CURLOPT_POSTFIELDS, r->body ? r->body : "");
    }
    curl_easy_setopt(c, CURLOPT_WRITEFUNCTION, take_body);
    curl_easy_setopt(c, CURLOPT_WRITEDATA, t);
}

// ---- the answer ---------------------------------------------------------------------------------

static const char *header_of(CURL *c, const char *name) {
    struct curl_header *header;
    return curl_easy_header(c, name, 0, CURLH_HEADER, -1, &header) == CURLHE_OK ? header->value
                                                                                : "";
}

static void copy_header(CURL *c, const char *name, char *out, size_t size) {
    const char *value = header_of(c, name);
    bool good = strlen(value) < size;
    for (const char *at = value; *at; at++)
        good = good && *at >= ' ' && *at <= '~';
    snprintf(out, size, "%s", good ? value : "");
}

static void read_answer(CURL *c, struct peer_answer *out) {
    static const char before[] = "attachment; filename=\"";
    char disposition[sizeof before + sizeof out->download];
    long status = 0;
    *out = (struct peer_answer){0};
    curl_easy_getinfo(c, CURLINFO_RESPONSE_CODE, &status);
    out->status = (int)status;
    copy_header(c, "Content-Type", out->type, sizeof out->type);
    copy_header(c, "Content-Range", out->content_range, sizeof out->content_range);
    copy_header(c, "Content-Disposition", disposition, sizeof disposition);
    if (!strncmp(disposition, before, sizeof before - 1))
        snprintf(out->download, sizeof out->download, "%.*s",
                 (int)strcspn(disposition + sizeof before - 1, "\""),
                 disposition + sizeof before - 1);
    out->retry_after_s = atoi(header_of(c, "Retry-After"));
}

static enum result result_of(CURLcode code, const struct transfer *t) {
    switch (code) {
    case CURLE_OK:
        return RESULT_OK;
    case CURLE_ABORTED_BY_CALLBACK:
        return RESULT_CLOSED;
    case CURLE_FILESIZE_EXCEEDED:
        return RESULT_LIMIT;
    case CURLE_WRITE_ERROR:
        return t->file_failed ? RESULT_IO : RESULT_LIMIT;
    case CURLE_PEER_FAILED_VERIFICATION:
    case CURLE_SSL_CACERT_BADFILE:
        return RESULT_REFUSED;
    default:
        return RESULT_TIMEOUT;
    }
}

static enum result perform(CURL *c, const struct transfer *t, struct error *err) {
    char why[CURL_ERROR_SIZE] = "";
    curl_easy_setopt(c, CURLOPT_ERRORBUFFER, why);
    CURLcode code = curl_easy_perform(c);
    enum result result = result_of(code, t);
    if (result == RESULT_LIMIT)
        return fail(err, result, "https://%s: the answer has more than %lld bytes",
                    t->request->pages, (long long)t->request->most);
    if (result != RESULT_OK)
        return fail(err, result, "https://%s: %s", t->request->pages,
                    why[0] ? why : curl_easy_strerror(code));
    if (fflush(t->body) != 0)
        return fail(err, RESULT_IO, "https://%s: the answer could not be written",
                    t->request->pages);
    return RESULT_OK;
}

enum result peer_ask(struct peers *peers, const struct peer_request *r, FILE *body,
                     struct peer_answer *out, struct error *err) {
    char url[URL_MAX];
    struct transfer transfer = {.peers = peers, .request = r, .body = body};
    int length = snprintf(url, sizeof url, "https://%s%s%s%s", r->pages, r->path,
                          r->query[0] ? "?" : "", r->query);
    if (length >= (int)sizeof url || !r->pages[0] || strpbrk(r->pages, "/@?# "))
        return fail(err, RESULT_INVALID, "%s: not the address of a server's pages", r->pages);
    CURL *c = https_create(peers->authority, HTTPS_AUTHORITY_AND_SYSTEM, &peers->breaks_off);
    struct curl_slist *headers = make_headers(r);
    curl_easy_setopt(c, CURLOPT_HTTPHEADER, headers);
    curl_easy_setopt(c, CURLOPT_NOPROXY, "*");
    set_limits(c, &transfer);
    set_request(c, url, &transfer);
    enum result result = perform(c, &transfer, err);
    read_answer(c, out);
    curl_easy_cleanup(c);
    curl_slist_free_all(headers);
    return result;
}
