#include "wire/reception.h"

#include "base/check.h"
#include "base/clock.h"
#include "net/authority.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#define SCRIPT_SIZE 100000

static uint8_t index_packed[256], script_packed[SCRIPT_SIZE];
static struct web_page pages[3];

static size_t pack(const void *bytes, size_t size, uint8_t *out, size_t out_size) {
    z_stream stream = {.next_in = (uint8_t *)(uintptr_t)bytes, .next_out = out};
    stream.avail_in = (uInt)size;
    stream.avail_out = (uInt)out_size;
    deflateInit2(&stream, 9, Z_DEFLATED, 31, 9, Z_DEFAULT_STRATEGY);
    CHECK(deflate(&stream, Z_FINISH) == Z_STREAM_END);
    deflateEnd(&stream);
    return stream.total_out;
}

static struct web_pages make_pages(void) {
    static const char index[] = "<!doctype html><title>Arthron</title>";
    static char script[SCRIPT_SIZE];
    for (int i = 0; i < SCRIPT_SIZE; i++)
        script[i] = (char)('a' + i % 26);
    pages[0] = (struct web_page){"/index.html", "text/html; charset=utf-8", "i1", false,
                                 index_packed,  .size = sizeof index - 1};
    pages[0].gzip_size = pack(index, sizeof index - 1, index_packed, sizeof index_packed);
    pages[1] = (struct web_page){"/main-1234.js", "text/javascript",  "s1", true,
                                 script_packed,   .size = SCRIPT_SIZE};
    pages[1].gzip_size = pack(script, SCRIPT_SIZE, script_packed, sizeof script_packed);
    pages[2] = pages[1];
    pages[2].path = "/broken.js"; // does not unpack to that
    pages[2].size = SCRIPT_SIZE - 1;
    return (struct web_pages){pages, 3};
}

// ---- /api/v1 ------------------------------------------------------------------------------------

static void echo(const struct web_request *q, struct web_response *out) {
    size_t size = q->size + 4096;
    out->status = 200;
    out->body = malloc(size);
    out->size =
        (size_t)snprintf(out->body, size, "%s|%s|%s|%s|%d|%s|%s", q->method, q->path, q->query,
                         q->token ? q->token : "-", q->by_cookie, q->address, q->body);
}

// Ten bytes of a larger file, as another server gave them.
static void answer_later(void *data, struct web_response *out) {
    struct reception *r = data;
    atomic_fetch_add(&r->later, 1);
    while (out && atomic_load(&r->blocks))
        usleep(1000);
    if (out) {
        out->status = 206;
        out->open_file = tmpfile();
        fputs("0123456789", out->open_file);
        fflush(out->open_file);
        strcpy(out->content_range, "bytes 5-14/100");
    }
    atomic_fetch_add(&r->released, 1);
}

static void tell_of_passing_on(const struct web_request *q, struct web_response *out) {
    out->status = 200;
    out->body = malloc(512);
    out->size = (size_t)snprintf(out->body, 512, "%d|%s|%s", q->is_passed_on,
                                 q->range ? q->range : "-", q->if_range ? q->if_range : "-");
}

static void on_request(void *user, const struct web_request *q, struct web_response *out) {
    struct reception *r = user;
    if (q->token && !strncmp(q->token, "good", 4))
        strcpy(out->account.name, q->token);
    out->account.keeps_one = q->token && !strcmp(q->token, "good-host");
    if (!strcmp(q->path, "/api/v1/slow")) {
        atomic_fetch_add(&r->waiting, 1);
        while (atomic_load(&r->blocks))
            usleep(1000);
    }
    if (!strcmp(q->path, "/api/v1/file") || !strcmp(q->path, "/api/v1/packed")) {
        out->status = 200;
        out->compress = q->path[8] == 'p';
        strcpy(out->type, "application/octet-stream");
        strcpy(out->etag, "f1");
        strcpy(out->download, "a \"b\"\r\n.bin");
        snprintf(out->file, sizeof out->file, "%s/file", r->dir);
    } else if (!strcmp(q->path, "/api/v1/lost")) {
        out->status = 200;
        snprintf(out->file, sizeof out->file, "%s", r->dir); // a folder
    } else if (!strcmp(q->path, "/api/v1/later")) {
        out->later = answer_later;
        out->later_data = r;
    } else if (!strcmp(q->path, "/api/v1/via")) {
        tell_of_passing_on(q, out);
    } else if (!strcmp(q->path, "/api/v1/cookie")) {
        strcpy(out->cookie, "arthron=good; Path=/; HttpOnly; SameSite=Strict");
        out->retry_after_s = 7;
    } else {
        echo(q, out);
    }
    atomic_fetch_add(&r->requests, 1);
}

// ---- /live --------------------------------------------------------------------------------------

static enum result on_enter(void *user, const char *token, struct web_account *out) {
    struct reception *r = user;
    if (!strcmp(token, "slow"))
        usleep(300000);
    else if (strcmp(token, "good"))
        return RESULT_MISSING;
    atomic_fetch_add(&r->entered, 1);
    if (atomic_load(&r->forgetful))
        return RESULT_TIMEOUT;
    strcpy(out->name, "anna");
    strcpy(out->role, atomic_load(&r->promoted) ? "instructor" : "trainee");
    return atomic_load(&r->signed_out) ? RESULT_MISSING : RESULT_OK;
}

struct viewer {
    uint32_t batches;
    int64_t next_ns;
};

static void *on_viewer(void *user, const struct web_account *account, const char *token) {
    (void)token;
    struct reception *r = user;
    CHECK(!strcmp(account->name, "anna"));
    atomic_fetch_add(&r->viewers, 1);
    return calloc(1, sizeof(struct viewer));
}

static bool on_page(void *user, void *viewer, const arthron_Page *message) {
    struct reception *r = user;
    CHECK(viewer && message->which_message != arthron_Page_drawn_tag);
    atomic_fetch_add(&r->pages, 1);
    return !atomic_load(&r->refuses_pages);
}

static size_t on_batch(void *user, void *viewer, int64_t now_ns, uint8_t *out, size_t size,
                       int64_t *out_next_ns) {
    struct reception *r = user;
    struct viewer *v = viewer;
    size_t wanted = atomic_load(&r->batch_size);
    atomic_fetch_add(&r->asked, 1);
    if (wanted == 0 || now_ns < v->next_ns) {
        *out_next_ns = wanted ? v->next_ns : now_ns;
        return 0;
    }
    CHECK(wanted <= size);
    memset(out, 0, wanted);
    v->batches++;
    memcpy(out, &v->batches, sizeof v->batches);
    *out_next_ns = v->next_ns = now_ns + atomic_load(&r->batch_gap_ns);
    return wanted;
}

static void on_left(void *user, void *viewer) {
    struct reception *r = user;
    free(viewer);
    atomic_fetch_add(&r->left, 1);
}

// ---- life ---------------------------------------------------------------------------------------

static void write_file(const char *path) {
    FILE *file = fopen(path, "wb");
    for (int i = 0; i < RECEPTION_FILE_SIZE; i++)
        fputc((i * 7 + i / 256) & 0xff, file);
    CHECK(fclose(file) == 0);
}

void reception_open(struct reception *r) {
    static const char *const hosts[] = {"localhost", "127.0.0.1", "hall.example"};
    char keys[FOLDER_MAX + 16], certificate[FOLDER_MAX + 32], key[FOLDER_MAX + 32],
        file[FOLDER_MAX + 16];
    struct error err;
    folder_make(r->dir);
    snprintf(keys, sizeof keys, "%s/keys", r->dir);
    snprintf(certificate, sizeof certificate, "%s/server.pem", keys);
    snprintf(key, sizeof key, "%s/server.key", keys);
    snprintf(file, sizeof file, "%s/file", r->dir);
    CHECK(authority_init(keys, hosts, 3, NULL) == RESULT_OK);
    write_file(file);
    struct web_config config = {.address = "127.0.0.1",
                                .certificate = certificate,
                                .key = key,
                                .names = {"other.example"},
                                .pages = make_pages(),
                                .timeout_s = r->patience_s};
    struct web_handler handler = {r, on_request, on_enter, on_viewer, on_page, on_batch, on_left};
    CHECK(web_create(&config, &handler, &r->web, &err) == RESULT_OK);
    r->port = web_port(r->web);
}

void reception_close(struct reception *r) {
    if (r->web)
        web_destroy(&r->web);
    CHECK(atomic_load(&r->viewers) == atomic_load(&r->left));
    folder_remove(r->dir);
}

bool reception_wait(atomic_int *counter, int wanted) {
    int64_t end_ns = clock_now_ns() + 10 * NS_PER_S;
    while (atomic_load(counter) < wanted && clock_now_ns() < end_ns)
        usleep(1000);
    return atomic_load(counter) >= wanted;
}

// ---- of the test that runs ----------------------------------------------------------------------

struct reception reception;

int reception_begin(void **state) {
    (void)state;
    reception = (struct reception){.patience_s = 2};
    reception_open(&reception);
    return 0;
}

int reception_begin_patiently(void **state) {
    (void)state;
    reception = (struct reception){0};
    reception_open(&reception);
    return 0;
}

int reception_end(void **state) {
    (void)state;
    reception_close(&reception);
    return 0;
}
