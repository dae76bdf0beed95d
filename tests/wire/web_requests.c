// What requests to /api/v1 bring to the handler and back, files in whole and in part, and how much
// of everything one browser may take.
#include "base/clock.h"
#include "wire/asking.h"

#include <arpa/inet.h>
#include <dirent.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>
#include <zlib.h>

#define TO_US "Host: localhost\r\n"

// ---- the handler --------------------------------------------------------------------------------

static void expect_echo(struct answered a, const char *body) {
    assert_int_equal(a.status, 200);
    assert_string_equal(a.body, body);
    expect_header(&a, "Content-Type", "application/json");
    expect_header(&a, "Cache-Control", "no-store");
    free(a.body);
}

static void the_handler_gets_what_was_asked(void **state) {
    (void)state;
    struct browser *browser = call();
    expect_echo(browser_ask(browser, "GET /api/v1/a%20b?c=%26d+e&f", ""),
                "GET|/api/v1/a b|c=%26d%20e&f|-|0|127.0.0.1|");
    expect_echo(browser_ask(browser, "GET /api/v1/a", "Cookie: x=y; arthron=abc-1; z\r\n"),
                "GET|/api/v1/a||abc-1|1|127.0.0.1|");
    expect_echo(
        browser_ask(browser, "GET /api/v1/a", "Authorization: bearer t.1\r\nCookie: arthron=c\r\n"),
        "GET|/api/v1/a||t.1|0|127.0.0.1|");
    expect_echo(browser_ask(browser, "GET /api/v1/a", "Cookie: xarthron=a; arthron=a,b\r\n"),
                "GET|/api/v1/a||-|0|127.0.0.1|");
    expect_echo(browser_ask(browser, "DELETE /api/v1/a", "Authorization: Bearer t\r\n"),
                "DELETE|/api/v1/a||t|0|127.0.0.1|");
    expect_echo(
        browser_ask(browser, "PATCH /api/v1/a",
                    "Cookie: arthron=c\r\nOrigin: https://localhost:1\r\nContent-Length: 0\r\n"),
        "PATCH|/api/v1/a||c|1|127.0.0.1|");
    say(browser, "POST /api/v1/a HTTP/1.1\r\n" TO_US "Content-Length: 5\r\n\r\nhe");
    usleep(20000);
    say(browser, "llo");
    expect_echo(browser_hear(browser, false), "POST|/api/v1/a||-|0|127.0.0.1|hello");
    struct answered a = browser_ask(browser, "GET /api/v1/cookie", "");
    assert_int_equal(a.status, 204);
    expect_header(&a, "Set-Cookie", "arthron=good; Path=/; HttpOnly; SameSite=Strict; Secure");
    expect_header(&a, "Retry-After", "7");
    free(a.body);
    browser_close(browser);
}

static void every_own_host_is_known(void **state) {
    (void)state;
    static const char *const hosts[] = {"localhost",      "LOCALHOST:4880", "127.0.0.1:4880",
                                        "10.1.2.3",       "[::1]:4880",     "hall.example",
                                        "hall.example:9", "other.example"};
    struct browser *browser = call();
    for (size_t i = 0; i < sizeof hosts / sizeof *hosts; i++) {
        char text[512];
        snprintf(text, sizeof text,
                 "POST /api/v1/a HTTP/1.1\r\nHost: %s\r\nOrigin: https://%s\r\n"
                 "Cookie: arthron=c\r\nContent-Length: 0\r\n\r\n",
                 hosts[i], hosts[i]);
        say(browser, text);
        expect_echo(browser_hear(browser, false), "POST|/api/v1/a||c|1|127.0.0.1|");
    }
    browser_close(browser);
}

static void a_body_has_its_limit(void **state) {
    (void)state;
    static const struct {
        int length, status;
    } rows[] = {{65536, 200}, {65537, 413}, {1 << 20, 413}, {(1 << 20) + 1, 413}};
    static char bytes[(1 << 20) + 1];
    memset(bytes, 'b', sizeof bytes);
    for (int i = 0; i < 4; i++) {
        char head[256];
        struct browser *browser = call();
        snprintf(head, sizeof head,
                 "POST /api/v1/a HTTP/1.1\r\n" TO_US "Content-Length: %d\r\n\r\n", rows[i].length);
        say(browser, head);
        if (rows[i].length <= 1 << 20) // beyond, the server hangs up
            assert_true(browser_say(browser, bytes, (size_t)rows[i].length));
        struct answered a = browser_hear(browser, false);
        assert_int_equal(a.status, rows[i].status);
        if (a.status == 200)
            assert_int_equal(a.size, strlen("POST|/api/v1/a||-|0|127.0.0.1|") + 65536);
        free(a.body);
        browser_close(browser);
    }
}

static void requests_on_one_connection_are_answered_in_order(void **state) {
    (void)state;
    struct browser *browser = call();
    say(browser, "GET /api/v1/1 HTTP/1.1\r\n" TO_US "\r\n"
                 "GET /main-1234.js HTTP/1.1\r\n" TO_US "\r\n"
                 "GET /api/v1/2 HTTP/1.1\r\n" TO_US "\r\n");
    expect_echo(browser_hear(browser, false), "GET|/api/v1/1||-|0|127.0.0.1|");
    struct answered a = browser_hear(browser, false);
    assert_int_equal(a.size, 100000);
    free(a.body);
    expect_echo(browser_hear(browser, false), "GET|/api/v1/2||-|0|127.0.0.1|");
    browser_close(browser);
}

// libwebsockets cannot take what follows a body before its answer: it must end there, no more.
static void pipelining_after_a_body_closes_only_its_own_connection(void **state) {
    (void)state;
    static const char *const texts[] = {
        "POST /api/v1/1 HTTP/1.1\r\n" TO_US "Content-Length: 2\r\n\r\nhiGET / HTTP/1.1\r\n\r\n",
        "GET / HTTP/1.1\r\n" TO_US "\r\nPOST /api/v1/1 HTTP/1.1\r\n" TO_US
        "Content-Length: 2\r\n\r\nhi",
        "GET /api/v1/1 HTTP/1.1\r\n" TO_US "\r\nPOST /api/v1/1 HTTP/1.1\r\n" TO_US
        "Content-Length: 2\r\n\r\nhiGET / HTTP/1.1\r\n" TO_US "\r\n",
        "GET /api/v1/1 HTTP/1.1\r\n" TO_US "\r\nPOST / HTTP/1.1\r\n" TO_US
        "Content-Length: 0\r\n\r\nGET / HTTP/1.1\r\n" TO_US "\r\n"};
    for (int i = 0; i < 4; i++) {
        struct browser *rude = call(), *browser = call();
        say(rude, texts[i]);
        expect_echo(browser_ask(browser, "GET /api/v1/a", ""), "GET|/api/v1/a||-|0|127.0.0.1|");
        browser_close(browser);
        shutdown(browser_fd(rude), SHUT_WR);
        assert_true(browser_is_ended(rude));
        browser_close(rude);
    }
}

static void a_slow_answer_holds_up_no_page_and_may_find_nobody(void **state) {
    (void)state;
    struct browser *slow[3];
    atomic_store(&reception.blocks, true);
    for (int i = 0; i < 3; i++) {
        slow[i] = call();
        say(slow[i], "GET /api/v1/slow HTTP/1.1\r\n" TO_US "\r\nGET / HTTP/1.1\r\n" TO_US "\r\n");
    }
    assert_true(reception_wait(&reception.waiting, 2)); // of two threads
    struct browser *browser = call();
    struct answered a = browser_ask(browser, "GET /", "");
    assert_int_equal(a.status, 200);
    free(a.body);
    browser_close(slow[0]);
    atomic_store(&reception.blocks, false);
    for (int i = 1; i < 3; i++) {
        expect_echo(browser_hear(slow[i], false), "GET|/api/v1/slow||-|0|127.0.0.1|");
        a = browser_hear(slow[i], false);
        assert_int_equal(a.status, 200);
        free(a.body);
        browser_close(slow[i]);
    }
    assert_true(reception_wait(&reception.requests, 3));
    expect_echo(browser_ask(browser, "GET /api/v1/a", ""), "GET|/api/v1/a||-|0|127.0.0.1|");
    browser_close(browser);
}

enum { LATER = 2 * WEB_LATER_THREADS };

static void what_waits_for_others_holds_up_nobody_and_may_find_nobody(void **state) {
    (void)state;
    struct browser *waits[LATER];
    atomic_store(&reception.blocks, true);
    for (int i = 0; i < LATER; i++) {
        waits[i] = call();
        say(waits[i], "GET /api/v1/later HTTP/1.1\r\n" TO_US "Range: bytes=5-14\r\n\r\n");
    }
    assert_true(reception_wait(&reception.later, WEB_LATER_THREADS));
    struct browser *browser = call();
    expect_echo(browser_ask(browser, "GET /api/v1/a", ""), "GET|/api/v1/a||-|0|127.0.0.1|");
    assert_int_equal(atomic_load(&reception.later), WEB_LATER_THREADS);
    browser_close(waits[0]);
    browser_close(waits[LATER - 1]);
    atomic_store(&reception.blocks, false);
    for (int i = 1; i < LATER - 1; i++) {
        struct answered a = browser_hear(waits[i], false);
        assert_int_equal(a.status, 206);
        expect_header(&a, "Content-Range", "bytes 5-14/100");
        expect_header(&a, "Content-Length", "10");
        assert_string_equal(a.body, "0123456789");
        free(a.body);
        browser_close(waits[i]);
    }
    assert_true(reception_wait(&reception.released, LATER));
    browser_close(browser);
}

static void an_end_releases_what_still_waits(void **state) {
    (void)state;
    struct browser *waits[LATER];
    atomic_store(&reception.blocks, true);
    for (int i = 0; i < LATER; i++) {
        waits[i] = call();
        say(waits[i], "GET /api/v1/later HTTP/1.1\r\n" TO_US "\r\n");
    }
    assert_true(reception_wait(&reception.requests, LATER));
    assert_true(reception_wait(&reception.later, WEB_LATER_THREADS));
    atomic_store(&reception.blocks, false);
    web_destroy(&reception.web);
    assert_int_equal(atomic_load(&reception.released), LATER);
    for (int i = 0; i < LATER; i++)
        browser_close(waits[i]);
}

static void who_passes_a_request_on_says_so(void **state) {
    (void)state;
    static const struct {
        const char *headers, *told;
    } rows[] = {{"", "0|-|-"},
                {"Via: 1.1 proxy.example\r\n", "0|-|-"},
                {"Via: 1.1 " WEB_VIA "\r\nRange: bytes=1-\r\n", "1|bytes=1-|-"},
                {"Via: 1.1 a, 1.1 " WEB_VIA "\r\nIf-Range: \"x\"\r\n", "1|-|\"x\""}};
    struct browser *browser = call();
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct answered a = browser_ask(browser, "GET /api/v1/via", rows[i].headers);
        assert_string_equal(a.body, rows[i].told);
        free(a.body);
    }
    browser_close(browser);
}

// ---- files --------------------------------------------------------------------------------------

static void expect_part(struct answered a, int from, int to) {
    assert_int_equal(a.size, to - from);
    for (int i = from; i < to; i++)
        if ((uint8_t)a.body[i - from] != ((i * 7 + i / 256) & 0xff))
            fail_msg("byte %d of %d to %d", i, from, to);
    free(a.body);
}

static void a_file_comes_whole_or_in_part(void **state) {
    (void)state;
    enum { ALL = RECEPTION_FILE_SIZE };
    static const struct {
        const char *headers;
        int status, from, to;
        const char *extent;
    } rows[] = {
        {"", 200, 0, ALL, ""},
        {"Range: bytes=0-0\r\n", 206, 0, 1, "bytes 0-0/3000017"},
        {"Range: bytes=5-\r\n", 206, 5, ALL, "bytes 5-3000016/3000017"},
        {"Range: bytes=262140-524290\r\n", 206, 262140, 524291, "bytes 262140-524290/3000017"},
        {"Range: bytes=-3\r\n", 206, ALL - 3, ALL, "bytes 3000014-3000016/3000017"},
        {"Range: bytes=-9000000\r\n", 206, 0, ALL, "bytes 0-3000016/3000017"},
        {"Range: bytes=9-9000000\r\n", 206, 9, ALL, "bytes 9-3000016/3000017"},
        {"Range: bytes=3000016-\r\n", 206, ALL - 1, ALL, "bytes 3000016-3000016/3000017"},
        {"Range: bytes=3000017-\r\n", 416, 0, 0, "bytes */3000017"},
        {"Range: bytes=-0\r\n", 416, 0, 0, "bytes */3000017"},
        {"Range: bytes=5-2\r\n", 200, 0, ALL, ""},
        {"Range: bytes=0-1,3-4\r\n", 200, 0, ALL, ""},
        {"Range: bytes=-\r\n", 200, 0, ALL, ""},
        {"Range: bytes=1\r\n", 200, 0, ALL, ""},
        {"Range: bytes=99999999999999999999-\r\n", 200, 0, ALL, ""},
        {"Range: lines=1-2\r\n", 200, 0, ALL, ""},
        {"Range: bytes=0-1\r\nIf-Range: \"f1\"\r\n", 206, 0, 2, "bytes 0-1/3000017"},
        {"Range: bytes=0-1\r\nIf-Range: \"f0\"\r\n", 200, 0, ALL, ""},
        {"Range: bytes=0-1\r\nIf-None-Match: \"f1\"\r\n", 304, 0, 0, ""},
    };
    struct browser *browser = call();
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct answered a = browser_ask(browser, "GET /api/v1/file", rows[i].headers);
        if (a.status != rows[i].status)
            fail_msg("%s: %d", rows[i].headers, a.status);
        expect_header(&a, "Content-Range", rows[i].extent);
        expect_header(&a, "Content-Disposition", "attachment; filename=\"a _b___.bin\"");
        expect_part(a, rows[i].from, rows[i].to);
    }
    browser_close(browser);
}

// The first of the file's bytes is another one; its size and the time of its change stay.
static void change_unseen(const char *path, int first, const struct timespec times[2]) {
    FILE *file = fopen(path, "r+b");
    fputc(first, file);
    assert_int_equal(fclose(file), 0);
    assert_int_equal(utimensat(AT_FDCWD, path, times, 0), 0);
}

static int first_unpacked(struct browser *browser) {
    uint8_t first;
    struct answered a = browser_ask(browser, "GET /api/v1/packed", "Accept-Encoding: gzip\r\n");
    z_stream stream = {.next_in = (uint8_t *)a.body, .next_out = &first, .avail_out = 1};
    stream.avail_in = (uInt)a.size;
    assert_int_equal(inflateInit2(&stream, 31), Z_OK);
    assert_int_equal(inflate(&stream, Z_NO_FLUSH), Z_OK);
    inflateEnd(&stream);
    free(a.body);
    return first;
}

static void a_file_is_packed_once_until_it_changes(void **state) {
    (void)state;
    char path[sizeof reception.dir + 16];
    struct browser *browser = call();
    struct timespec times[2] = {{1000, 0}, {1000, 0}};
    snprintf(path, sizeof path, "%s/file", reception.dir);
    change_unseen(path, 'a', times);
    assert_int_equal(first_unpacked(browser), 'a');
    change_unseen(path, 'b', times);
    assert_int_equal(first_unpacked(browser), 'a'); // who packed it again had seen it
    times[1].tv_nsec = 1;
    change_unseen(path, 'c', times);
    assert_int_equal(first_unpacked(browser), 'c');
    browser_close(browser);
}

static void a_file_is_packed_where_the_handler_wants_it(void **state) {
    (void)state;
    struct browser *browser = call();
    struct answered a = browser_ask(browser, "GET /api/v1/packed", "Accept-Encoding: gzip\r\n");
    assert_int_equal(a.status, 200);
    expect_header(&a, "Content-Encoding", "gzip");
    expect_header(&a, "ETag", "W/\"f1\"");
    assert_memory_equal(a.body, "\x1f\x8b", 2);
    assert_true(a.size < RECEPTION_FILE_SIZE / 4);
    free(a.body);
    a = browser_ask(browser, "GET /api/v1/packed",
                    "Accept-Encoding: gzip\r\nIf-None-Match: W/\"f1\"\r\n");
    assert_int_equal(a.status, 304);
    expect_header(&a, "Content-Encoding", ""); // it was not packed for nothing
    expect_header(&a, "ETag", "W/\"f1\"");
    free(a.body);
    expect_part(browser_ask(browser, "GET /api/v1/packed", ""), 0, RECEPTION_FILE_SIZE);
    a = browser_ask(browser, "GET /api/v1/lost", "");
    assert_int_equal(a.status, 404);
    free(a.body);
    browser_close(browser);
}

// ---- who does not go on -------------------------------------------------------------------------

static int count_open_files(void) {
    int count = 0;
    DIR *folder = opendir("/proc/self/fd");
    while (readdir(folder))
        count++;
    closedir(folder);
    return count;
}

static void a_request_that_stops_in_the_middle_is_closed(void **state) {
    (void)state;
    enum { COUNT = 5 };
    static const char *const texts[COUNT] = {
        "", "GET / HT", "GET / HTTP/1.1\r\n" TO_US "A: b\r\n",
        "POST /api/v1/a HTTP/1.1\r\n" TO_US "Content-Length: 9\r\n\r\nhi",
        "GET /api/v1/file HTTP/1.1\r\n" TO_US "\r\nGET / HTTP/1.1\r\n" TO_US "\r\n"};
    struct browser *browsers[COUNT];
    int files = count_open_files();
    for (int i = 0; i < COUNT; i++) {
        browsers[i] = call();
        say(browsers[i], texts[i]);
    }
    int64_t end_ns = clock_now_ns() + 10 * NS_PER_S;
    bool says = true;
    // The server has its end of each connection, too; a byte now and then buys no time.
    while (count_open_files() > files + COUNT && clock_now_ns() < end_ns) {
        says = says && browser_say(browsers[3], "x", 1) && browser_say(browsers[2], "x", 1);
        usleep(250000);
    }
    assert_int_equal(count_open_files(), files + COUNT);
    for (int i = 0; i < COUNT; i++)
        browser_close(browsers[i]);
}

static double processor_seconds(void) {
    struct timespec time;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

static void a_peer_that_sends_and_never_reads_gets_no_processor(void **state) {
    (void)state;
    struct browser *rude = call();
    int small = 4096;
    setsockopt(browser_fd(rude), SOL_SOCKET, SO_RCVBUF, &small, sizeof small);
    say(rude, "GET /api/v1/file HTTP/1.1\r\n" TO_US "\r\nGET / HTTP/1.1\r\n" TO_US "\r\n");
    assert_true(reception_wait(&reception.requests, 1));
    usleep(200000);
    double begun = processor_seconds();
    sleep(1);
    assert_true(processor_seconds() - begun < 0.5);
    browser_close(rude);
}

// A connection without TLS. Handshakes of all would last longer, on a busy machine, than the server
// waits for the first request.
static int knock(void) {
    struct sockaddr_in address = {.sin_family = AF_INET,
                                  .sin_port = htons((uint16_t)reception.port)};
    inet_pton(AF_INET, "127.0.0.1", &address.sin_addr);
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    assert_int_equal(connect(fd, (struct sockaddr *)&address, sizeof address), 0);
    return fd;
}

// Whether the server has ended it: waits for that as long as it takes, if it is to happen.
static bool is_shut(int fd, bool waits) {
    char byte;
    struct timeval time = {waits ? 10 : 0, 1000};
    setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &time, sizeof time);
    return recv(fd, &byte, 1, 0) == 0;
}

static void of_the_strangers_at_one_address_the_oldest_make_room(void **state) {
    (void)state;
    enum { MOST = 256 };
    int callers[MOST];
    for (int i = 0; i < MOST; i++)
        callers[i] = knock();
    assert_false(is_shut(callers[0], false));
    struct browser *browser = call();
    assert_true(is_shut(callers[0], true));
    assert_false(is_shut(callers[1], false));
    struct answered a = browser_ask(browser, "GET /", "");
    assert_int_equal(a.status, 200);
    free(a.body);
    browser_close(browser);
    for (int i = 0; i < MOST; i++)
        close(callers[i]);
}

static int ask_as(struct browser *browser, const char *token) {
    char cookie[64];
    snprintf(cookie, sizeof cookie, "Cookie: arthron=%s\r\n", token);
    struct answered a = browser_ask(browser, "GET /api/v1/a", cookie);
    free(a.body);
    return a.status;
}

static void who_is_signed_in_makes_no_room_for_strangers(void **state) {
    (void)state;
    enum { MOST = 300 };
    int callers[MOST];
    struct browser *trainee = call();
    assert_int_equal(ask_as(trainee, "good-1"), 200);
    for (int i = 0; i < MOST; i++)
        callers[i] = knock();
    assert_true(is_shut(callers[MOST - 256], true));
    assert_int_equal(ask_as(trainee, "good-1"), 200);
    for (int i = 0; i < MOST; i++)
        close(callers[i]);
    browser_close(trainee);
}

static void an_account_has_only_so_many_connections(void **state) {
    (void)state;
    enum { MOST = 96 };
    struct browser *own[MOST + 1], *other = call(), *host = call();
    assert_int_equal(ask_as(host, "good-host"), 200);
    assert_int_equal(ask_as(other, "good-2"), 200);
    for (int i = 0; i < MOST + 1; i++) {
        own[i] = call();
        assert_int_equal(ask_as(own[i], "good-1"), 200);
    }
    assert_true(browser_is_ended(own[0]));
    assert_int_equal(ask_as(own[1], "good-1"), 200);
    assert_int_equal(ask_as(other, "good-2"), 200);
    assert_int_equal(ask_as(host, "good-host"), 200);
    for (int i = 0; i < MOST + 1; i++)
        browser_close(own[i]);
    browser_close(other);
    browser_close(host);
}

static void one_address_asks_only_so_often(void **state) {
    (void)state;
    struct browser *browser = call();
    int refused = 0;
    for (int i = 0; i < 300; i++) {
        struct answered a = browser_ask(browser, "GET /api/v1/a", "");
        assert_true(a.status == 200 || a.status == 429);
        refused += a.status == 429;
        free(a.body);
    }
    assert_true(refused > 0);
    struct answered a = browser_ask(browser, "GET /", ""); // pages cost nothing
    assert_int_equal(a.status, 200);
    free(a.body);
    browser_close(browser);
}

static int count_refused(struct browser *browser, const char *token, int times) {
    int refused = 0;
    for (int i = 0; i < times; i++) {
        int status = ask_as(browser, token);
        assert_true(status == 200 || status == 429);
        refused += status == 429;
    }
    return refused;
}

// Whatever the others at the address do, once it is known who it is.
static void each_account_asks_only_so_often_wherever_it_is(void **state) {
    (void)state;
    struct browser *browser = call();
    assert_int_equal(ask_as(browser, "good-1"), 200);
    assert_true(count_refused(browser, "bad", 300) > 0);
    assert_true(count_refused(browser, "good-1", 300) > 0);
    struct browser *other = call();
    assert_true(count_refused(other, "good-1", 100) > 0);
    browser_close(browser);
    browser_close(other);
}

static void who_is_signed_in_asks_while_others_at_the_address_ask_too_often(void **state) {
    (void)state;
    struct browser *browser = call();
    assert_int_equal(ask_as(browser, "good-2"), 200);
    assert_true(count_refused(browser, ",", 300) > 0);
    assert_true(count_refused(browser, "bad", 300) > 0);
    assert_int_equal(ask_as(browser, "good-2"), 200);
    assert_int_equal(count_refused(browser, "good-2", 100), 0);
    browser_close(browser);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(the_handler_gets_what_was_asked, reception_begin,
                                        reception_end),
        cmocka_unit_test_setup_teardown(every_own_host_is_known, reception_begin, reception_end),
        cmocka_unit_test_setup_teardown(a_body_has_its_limit, reception_begin, reception_end),
        cmocka_unit_test_setup_teardown(requests_on_one_connection_are_answered_in_order,
                                        reception_begin, reception_end),
        cmocka_unit_test_setup_teardown(pipelining_after_a_body_closes_only_its_own_connection,
                                        reception_begin, reception_end),
        cmocka_unit_test_setup_teardown(a_slow_answer_holds_up_no_page_and_may_find_nobody,
                                        reception_begin, reception_end),
        cmocka_unit_test_setup_teardown(what_waits_for_others_holds_up_nobody_and_may_find_nobody,
                                        reception_begin, reception_end),
        cmocka_unit_test_setup_teardown(an_end_releases_what_still_waits, reception_begin,
                                        reception_end),
        cmocka_unit_test_setup_teardown(who_passes_a_request_on_says_so, reception_begin,
                                        reception_end),
        cmocka_unit_test_setup_teardown(a_file_comes_whole_or_in_part, reception_begin,
                                        reception_end),
        cmocka_unit_test_setup_teardown(a_file_is_packed_once_until_it_changes, reception_begin,
                                        reception_end),
        cmocka_unit_test_setup_teardown(a_file_is_packed_where_the_handler_wants_it,
                                        reception_begin, reception_end),
        cmocka_unit_test_setup_teardown(a_request_that_stops_in_the_middle_is_closed,
                                        reception_begin, reception_end),
        cmocka_unit_test_setup_teardown(a_peer_that_sends_and_never_reads_gets_no_processor,
                                        reception_begin, reception_end),
        cmocka_unit_test_setup_teardown(of_the_strangers_at_one_address_the_oldest_make_room,
                                        reception_begin_patiently, reception_end),
        cmocka_unit_test_setup_teardown(who_is_signed_in_makes_no_room_for_strangers,
                                        reception_begin_patiently, reception_end),
        cmocka_unit_test_setup_teardown(an_account_has_only_so_many_connections,
                                        reception_begin_patiently, reception_end),
        cmocka_unit_test_setup_teardown(each_account_asks_only_so_often_wherever_it_is,
                                        reception_begin, reception_end),
        cmocka_unit_test_setup_teardown(
            who_is_signed_in_asks_while_others_at_the_address_ask_too_often, reception_begin,
            reception_end),
        cmocka_unit_test_setup_teardown(one_address_asks_only_so_often, reception_begin,
                                        reception_end),
    };
    return cmocka_run_group_tests_name("web_requests", tests, NULL, NULL);
}
