// What browsers get over HTTPS: pages, and a status for what is no good request.
#include "net/authority.h"
#include "wire/asking.h"

#include <openssl/ssl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

// ---- pages --------------------------------------------------------------------------------------

static void pages_come_packed_or_not_and_are_kept(void **state) {
    (void)state;
    struct browser *browser = call();
    struct answered a = browser_ask(browser, "GET /", "");
    assert_int_equal(a.status, 200);
    assert_string_equal(a.body, "<!doctype html><title>Arthron</title>");
    expect_header(&a, "Content-Type", "text/html; charset=utf-8");
    expect_header(&a, "Cache-Control", "no-cache");
    expect_header(&a, "ETag", "W/\"i1\"");
    expect_header(&a, "X-Content-Type-Options", "nosniff");
    expect_header(&a, "Referrer-Policy", "no-referrer");
    assert_non_null(strstr(a.head, "frame-ancestors 'none'"));
    assert_null(strstr(a.head, "unsafe"));
    free(a.body);
    a = browser_ask(browser, "GET /main-1234.js", "Accept-Encoding: br, gzip\r\n");
    assert_int_equal(a.status, 200);
    assert_true(a.size < 10000);
    assert_memory_equal(a.body, "\x1f\x8b", 2);
    expect_header(&a, "Content-Encoding", "gzip");
    expect_header(&a, "Vary", "Accept-Encoding");
    expect_header(&a, "Cache-Control", "public, max-age=31536000, immutable");
    free(a.body);
    a = browser_ask(browser, "GET /main-1234.js", "Accept-Encoding: br, gzip;q=0\r\n");
    assert_int_equal(a.size, 100000);
    for (int i = 0; i < 100000; i++)
        assert_int_equal(a.body[i], 'a' + i % 26);
    free(a.body);
    browser_close(browser);
}

static void a_page_that_is_known_is_not_sent_again(void **state) {
    (void)state;
    static const struct {
        const char *header;
        int status;
    } rows[] = {
        {"If-None-Match: \"i1\"\r\n", 304},
        {"If-None-Match: W/\"i1\"\r\n", 304},
        {"If-None-Match: \"x\", W/\"i1\"\r\n", 304},
        {"If-None-Match: *\r\n", 304},
        {"If-None-Match: \"i12\"\r\n", 200},
        {"If-None-Match: \"i\r\n", 200},
        {"If-None-Match: i1\r\n", 200},
    };
    struct browser *browser = call();
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct answered a = browser_ask(browser, "GET /index.html", rows[i].header);
        if (a.status != rows[i].status || (a.status == 304) != (a.size == 0))
            fail_msg("%s: %d", rows[i].header, a.status);
        free(a.body);
    }
    browser_close(browser);
}

static void a_head_has_no_body(void **state) {
    (void)state;
    static const char *const lines[] = {"HEAD /", "HEAD /nothing", "HEAD /api/v1/file",
                                        "HEAD /api/v1/echo"};
    static const int statuses[] = {200, 404, 200, 200};
    struct browser *browser = call();
    for (int i = 0; i < 4; i++) {
        struct answered a = browser_ask(browser, lines[i], "");
        char length[512];
        assert_int_equal(a.status, statuses[i]);
        assert_true(atoi(answered_header(&a, "Content-Length", length)) > 10);
        free(a.body);
    }
    struct answered a = browser_ask(browser, "GET /", ""); // not the rest of an answer before
    assert_int_equal(a.status, 200);
    free(a.body);
    browser_close(browser);
}

static void old_tls_is_refused(void **state) {
    (void)state;
    static const int versions[] = {TLS1_VERSION, TLS1_1_VERSION, TLS1_2_VERSION, TLS1_3_VERSION};
    for (int i = 0; i < 4; i++) {
        struct browser *browser = browser_open_with(reception.port, versions[i]);
        assert_int_equal(browser != NULL, i >= 2);
        if (browser)
            browser_close(browser);
    }
}

static void what_cannot_be_served_is_named(void **state) {
    (void)state;
    char certificate[256], key[256], other[256], missing[256];
    snprintf(certificate, sizeof certificate, "%s/keys/server.pem", reception.dir);
    snprintf(key, sizeof key, "%s/keys/server.key", reception.dir);
    snprintf(other, sizeof other, "%s/keys/authority.key", reception.dir);
    snprintf(missing, sizeof missing, "%s/none.pem", reception.dir);
    const struct {
        const char *certificate, *key;
        int port;
        enum result result;
        const char *named;
    } rows[] = {
        {missing, key, 0, RESULT_MISSING, missing},
        {key, key, 0, RESULT_FORMAT, key},
        {certificate, missing, 0, RESULT_MISSING, missing},
        {certificate, other, 0, RESULT_FORMAT, other},
        {certificate, certificate, 0, RESULT_FORMAT, certificate},
        {certificate, key, reception.port, RESULT_IO, "127.0.0.1"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct web_config config = {.address = "127.0.0.1",
                                    .port = rows[i].port,
                                    .certificate = rows[i].certificate,
                                    .key = rows[i].key};
        const struct web_handler handler = {0};
        struct web *web;
        struct error err;
        assert_int_equal(web_create(&config, &handler, &web, &err), rows[i].result);
        assert_null(web);
        assert_non_null(strstr(err.text, rows[i].named));
    }
}

// ---- what is no good request --------------------------------------------------------------------

struct bad {
    const char *what, *text;
    int status; // -1: the connection ends without an answer
    bool ends;
};

#define TO_US "Host: localhost\r\n"

static const struct bad bad_requests[] = {
    {"no page", "GET /x HTTP/1.1\r\n" TO_US "\r\n", 404, false},
    {"the API's other versions", "GET /api/v2/me HTTP/1.1\r\n" TO_US "\r\n", 404, false},
    {"a page that is broken", "GET /broken.js HTTP/1.1\r\n" TO_US "\r\n", 500, false},
    {"up and out", "GET /../../etc/passwd HTTP/1.1\r\n" TO_US "\r\n", 404, false},
    {"up and out, escaped", "GET /%2e%2e/%2e%2e/etc/passwd HTTP/1.1\r\n" TO_US "\r\n", 404, false},
    {"nothing in the path", "GET /index.html%00.js HTTP/1.1\r\n" TO_US "\r\n", -1, true},
    {"no WebSocket", "GET /live HTTP/1.1\r\n" TO_US "\r\n", 426, false},
    {"a page is changed", "DELETE /index.html HTTP/1.1\r\n" TO_US "\r\n", 405, false},
    {"a page is posted", "POST / HTTP/1.1\r\n" TO_US "Content-Length: 2\r\n\r\nhi", 405, false},
    {"options", "OPTIONS /api/v1/me HTTP/1.1\r\n" TO_US "Content-Length: 0\r\n\r\n", 405, false},
    {"a method that is none", "BREW / HTTP/1.1\r\n" TO_US "\r\n", -1, true},
    {"a proxy's", "CONNECT localhost:22 HTTP/1.1\r\n" TO_US "\r\n", -1, true},
    {"no HTTP", "hello\r\n\r\n", -1, true},
    {"no host", "GET / HTTP/1.1\r\n\r\n", 400, false},
    {"a stranger's host", "GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n", 421, false},
    {"a host that ends like ours", "GET / HTTP/1.1\r\nHost: xlocalhost\r\n\r\n", 421, false},
    {"a host that begins like ours", "GET / HTTP/1.1\r\nHost: localhost.evil\r\n\r\n", 421, false},
    {"a host with a user", "GET / HTTP/1.1\r\nHost: localhost:@evil\r\n\r\n", 421, false},
    {"chunks", "POST /api/v1/a HTTP/1.1\r\n" TO_US "Transfer-Encoding: chunked\r\n\r\n", 411, true},
    {"no length", "POST /api/v1/a HTTP/1.1\r\n" TO_US "\r\n", 411, true},
    {"a negative length", "POST /api/v1/a HTTP/1.1\r\n" TO_US "Content-Length: -1\r\n\r\n", 411,
     true},
    {"half a length", "POST /api/v1/a HTTP/1.1\r\n" TO_US "Content-Length: 5x\r\n\r\n", 411, true},
    {"two lengths",
     "POST /api/v1/a HTTP/1.1\r\n" TO_US "Content-Length: 5\r\nContent-Length: 6\r\n\r\n", 411,
     true},
    {"a length beyond all",
     "POST /api/v1/a HTTP/1.1\r\n" TO_US "Content-Length: 99999999999999999999\r\n\r\n", 411, true},
    {"another protocol's upgrade",
     "GET /live HTTP/1.1\r\n" TO_US "Connection: Upgrade, HTTP2-Settings\r\nUpgrade: h2c\r\n"
     "HTTP2-Settings: AAMAAABkAARAAAAAAAIAAAAA\r\n\r\n",
     404, true},
    {"another site's post",
     "POST /api/v1/a HTTP/1.1\r\n" TO_US
     "Origin: https://evil.example\r\nContent-Length: 0\r\n\r\n",
     403, false},
    {"another port's post",
     "POST /api/v1/a HTTP/1.1\r\n" TO_US
     "Origin: https://localhost:99\r\nContent-Length: 0\r\n\r\n",
     403, false},
    {"no TLS there",
     "POST /api/v1/a HTTP/1.1\r\n" TO_US "Origin: http://localhost\r\nContent-Length: 0\r\n\r\n",
     403, false},
    {"a hidden page's post",
     "POST /api/v1/a HTTP/1.1\r\n" TO_US "Origin: null\r\nContent-Length: 0\r\n\r\n", 403, false},
    {"a cookie from nowhere", "DELETE /api/v1/a HTTP/1.1\r\n" TO_US "Cookie: arthron=good\r\n\r\n",
     403, false},
};

static void bad_requests_get_their_status(void **state) {
    (void)state;
    for (size_t i = 0; i < sizeof bad_requests / sizeof *bad_requests; i++) {
        const struct bad *bad = &bad_requests[i];
        struct browser *browser = call();
        say(browser, bad->text);
        struct answered a = browser_hear(browser, false);
        if (a.status != bad->status)
            fail_msg("%s: %d", bad->what, a.status);
        if (a.status != -1 && !strstr(a.body, "{\"error\":{\"code\":\""))
            fail_msg("%s: %s", bad->what, a.body);
        free(a.body);
        if (bad->ends && !browser_is_ended(browser))
            fail_msg("%s: goes on", bad->what);
        if (!bad->ends) {
            a = browser_ask(browser, "GET /", "");
            if (a.status != 200)
                fail_msg("%s: then %d", bad->what, a.status);
            free(a.body);
        }
        browser_close(browser);
    }
    assert_int_equal(atomic_load(&reception.requests), 0);
}

static void too_much_of_anything_is_refused(void **state) {
    (void)state;
    static char text[20000], much[16001];
    static const char *const parts[][2] = {{"GET /", " HTTP/1.1\r\n" TO_US "\r\n"},
                                           {"GET /?", " HTTP/1.1\r\n" TO_US "\r\n"},
                                           {"GET / HTTP/1.1\r\n" TO_US "X: ", "\r\n\r\n"},
                                           {"GET / HTTP/1.1\r\nHost: ", "\r\n\r\n"},
                                           {"GET / HTTP/1.1\r\n" TO_US "Cookie: ", "\r\n\r\n"},
                                           {"", ""}};
    static const int sizes[] = {300, 600, 3000, 8100, 9000, 16000};
    memset(much, 'a', 16000);
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) {
            snprintf(text, sizeof text, "%s%.*s%s", parts[i][0], sizes[j], much, parts[i][1]);
            struct browser *browser = call();
            say(browser, text);
            shutdown(browser_fd(browser), SHUT_WR);
            struct answered a = browser_hear(browser, false);
            assert_true(a.status == -1 || a.status == 400 || a.status == 404 || a.status == 421 ||
                        (a.status == 200 && i >= 1));
            free(a.body);
            browser_close(browser);
        }
    for (int i = 0, used = sprintf(text, "GET / HTTP/1.1\r\n" TO_US); i < 1000; i++)
        used += sprintf(text + used, "A%d: b\r\n", i);
    struct browser *browser = call();
    say(browser, text);
    assert_true(browser_is_ended(browser));
    browser_close(browser);
}

static void shown_certificate(char out[65]) {
    struct browser *browser = call();
    browser_certificate(browser, out);
    browser_close(browser);
}

static void replace(const char *name) {
    char from[256], to[256];
    snprintf(from, sizeof from, "%s/new/%s", reception.dir, name);
    snprintf(to, sizeof to, "%s/keys/%s", reception.dir, name);
    assert_int_equal(rename(from, to), 0);
}

static bool is_own(const char *host) {
    char text[128];
    struct browser *browser = call();
    snprintf(text, sizeof text, "GET / HTTP/1.1\r\nHost: %s\r\n\r\n", host);
    say(browser, text);
    struct answered a = browser_hear(browser, false);
    free(a.body);
    browser_close(browser);
    return a.status == 200;
}

// One file after the other, as certbot and people do it; who is there goes on.
static void a_certificate_that_is_replaced_is_shown(void **state) {
    (void)state;
    static const char *const hosts[] = {"localhost", "127.0.0.1", "renewed.example"};
    char new[256], before[65], now[65];
    struct browser *there = call();
    snprintf(new, sizeof new, "%s/new", reception.dir);
    assert_int_equal(authority_init(new, hosts, 3, NULL), RESULT_OK);
    shown_certificate(before);
    assert_false(is_own("renewed.example"));
    replace("server.pem");
    usleep(2200000); // it has looked
    shown_certificate(now);
    assert_string_equal(now, before);
    replace("server.key");
    for (int i = 0; i < 100 && !strcmp(now, before); i++) {
        usleep(50000);
        shown_certificate(now);
    }
    assert_string_not_equal(now, before);
    assert_true(is_own("renewed.example"));
    struct answered a = browser_ask(there, "GET /", "");
    assert_int_equal(a.status, 200);
    free(a.body);
    browser_close(there);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(pages_come_packed_or_not_and_are_kept, reception_begin,
                                        reception_end),
        cmocka_unit_test_setup_teardown(a_page_that_is_known_is_not_sent_again, reception_begin,
                                        reception_end),
        cmocka_unit_test_setup_teardown(a_head_has_no_body, reception_begin, reception_end),
        cmocka_unit_test_setup_teardown(old_tls_is_refused, reception_begin, reception_end),
        cmocka_unit_test_setup_teardown(what_cannot_be_served_is_named, reception_begin,
                                        reception_end),
        cmocka_unit_test_setup_teardown(bad_requests_get_their_status, reception_begin,
                                        reception_end),
        cmocka_unit_test_setup_teardown(a_certificate_that_is_replaced_is_shown,
                                        reception_begin_patiently, reception_end),
        cmocka_unit_test_setup_teardown(too_much_of_anything_is_refused, reception_begin,
                                        reception_end),
    };
    return cmocka_run_group_tests_name("web", tests, NULL, NULL);
}
