// A connection to /live of another server: who is let in and trusted, what goes both ways, and how
// it ends.
#include "relay/relay.h"

#include "base/clock.h"
#include "net/authority.h"
#include "test.h"
#include "wire/reception.h"

#include <arpa/inet.h>
#include <libwebsockets.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

// ---- a server's thread of pages -----------------------------------------------------------------

static struct lws_context *context;
static struct relays *relays;

static struct {
    int batches;
    uint32_t last; // the counter in it
    bool ended;
    char why[160];
    int64_t begun_ns, ended_ns;
    struct relay *relay;
} page;

static void on_heard(void *user, const uint8_t *batch, size_t size) {
    (void)user;
    page.batches++;
    assert_true(size >= sizeof page.last);
    memcpy(&page.last, batch, sizeof page.last);
}

static void on_ended(void *user, const char *why) {
    (void)user;
    assert_false(page.ended);
    page.ended = true;
    page.ended_ns = clock_now_ns();
    page.relay = NULL;
    snprintf(page.why, sizeof page.why, "%s", why);
}

// So that a turn of the thread ends.
static lws_sorted_usec_list_t tick;

static void on_tick(lws_sorted_usec_list_t *sul) {
    lws_sul_schedule(context, 0, sul, on_tick, 5 * LWS_US_PER_MS);
}

static void begin_with(const char *dir, int most) {
    char authority[FOLDER_MAX + 32];
    struct error err;
    const struct lws_context_creation_info info = {
        .port = CONTEXT_PORT_NO_LISTEN,
        .options = LWS_SERVER_OPTION_EXPLICIT_VHOSTS | LWS_SERVER_OPTION_DO_SSL_GLOBAL_INIT,
        .gid = -1,
        .uid = -1,
    };
    snprintf(authority, sizeof authority, "%s/keys/authority.pem", dir);
    lws_set_log_level(0, NULL);
    context = lws_create_context(&info);
    assert_non_null(context);
    assert_int_equal(relays_create(authority, &relays, &err), RESULT_OK);
    assert_int_equal(relays_begin(relays, context, most, &err), RESULT_OK);
    memset(&page, 0, sizeof page);
    memset(&tick, 0, sizeof tick);
    on_tick(&tick);
}

static int begin(void **state) {
    reception_begin_patiently(state);
    begin_with(reception.dir, 8);
    atomic_store(&reception.batch_size, 100);
    return 0;
}

static int end(void **state) {
    relay_close(&page.relay);
    lws_context_destroy(context);
    relays_destroy(&relays);
    return reception_end(state);
}

static void call(const char *address, const char *token) {
    const struct relay_handler handler = {NULL, on_heard, on_ended};
    page.begun_ns = clock_now_ns();
    page.relay = relay_open(relays, address, token, &handler);
    assert_non_null(page.relay);
}

static void call_reception(const char *host, const char *token) {
    char address[64];
    snprintf(address, sizeof address, "%s:%d", host, reception.port);
    call(address, token);
}

static void serve_ms(int ms) {
    int64_t until_ns = clock_now_ns() + ms * NS_PER_MS;
    while (clock_now_ns() < until_ns)
        lws_service(context, 0);
}

static void serve_until(const bool *what) {
    int64_t until_ns = clock_now_ns() + 20 * NS_PER_S;
    while (!*what && clock_now_ns() < until_ns)
        lws_service(context, 0);
    assert_true(*what);
}

static void hear(int batches) {
    int64_t until_ns = clock_now_ns() + 20 * NS_PER_S;
    while (page.batches < batches && !page.ended && clock_now_ns() < until_ns)
        lws_service(context, 0);
    assert_true(page.batches >= batches);
}

static double seconds(void) {
    return (double)(page.ended_ns - page.begun_ns) / NS_PER_S;
}

// ---- both ways ----------------------------------------------------------------------------------

static void say_drawn(uint64_t batches) {
    assert_true(relay_say(page.relay, &(arthron_Page){.which_message = arthron_Page_drawn_tag,
                                                      .message.drawn.batches = batches}));
}

static void it_hears_no_more_than_it_has_drawn(void **state) {
    (void)state;
    static const char *const hosts[] = {"localhost", "127.0.0.1"};
    for (int i = 0; i < 2; i++) {
        memset(&page, 0, sizeof page);
        call_reception(hosts[i], "good");
        hear(WEB_BATCHES_ON_WAY);
        serve_ms(200);
        assert_int_equal(page.batches, WEB_BATCHES_ON_WAY);
        for (uint64_t drawn = 1; drawn <= 20; drawn++) {
            say_drawn(drawn);
            hear(WEB_BATCHES_ON_WAY + (int)drawn);
        }
        assert_int_equal(page.last, 22);
        relay_close(&page.relay);
        serve_ms(50);
        assert_true(reception_wait(&reception.left, i + 1));
    }
}

static void what_is_said_before_it_is_let_in_comes_in_order_and_only_so_much(void **state) {
    (void)state;
    const arthron_Page message = {.which_message = arthron_Page_watch_tag};
    call_reception("localhost", "slow");
    for (int i = 0; i < RELAY_UNSAID_MAX; i++)
        assert_true(relay_say(page.relay, &message));
    assert_false(relay_say(page.relay, &message));
    hear(1);
    while (atomic_load(&reception.pages) < RELAY_UNSAID_MAX)
        lws_service(context, 0);
    assert_true(relay_say(page.relay, &message));
}

static void a_batch_may_be_as_long_as_one_is(void **state) {
    (void)state;
    atomic_store(&reception.batch_size, RELAY_BATCH_MAX);
    call_reception("localhost", "good");
    hear(2);
    assert_false(page.ended);
}

// ---- who is let in, and who is trusted ----------------------------------------------------------

static void a_token_that_is_not_known_is_tried_for_a_second(void **state) {
    (void)state;
    call_reception("localhost", "stranger");
    serve_until(&page.ended);
    assert_non_null(strstr(page.why, "does not know who has signed in"));
    assert_true(seconds() > 0.9 && seconds() < 4);
    assert_int_equal(page.batches, 0);
}

static void a_token_that_is_known_a_moment_later_is_let_in(void **state) {
    (void)state;
    atomic_store(&reception.signed_out, true);
    call_reception("localhost", "good");
    serve_ms(300);
    assert_int_equal(page.batches, 0);
    atomic_store(&reception.signed_out, false);
    hear(1);
}

static void a_certificate_for_another_host_is_not_trusted(void **state) {
    (void)state;
    call_reception("127.1", "good"); // the same machine
    serve_until(&page.ended);
    assert_non_null(strstr(page.why, "not trusted"));
    assert_int_equal(atomic_load(&reception.entered), 0);
}

static void a_certificate_of_another_authority_is_not_trusted(void **state) {
    (void)state;
    char dir[FOLDER_MAX], keys[FOLDER_MAX + 16];
    const char *const hosts[] = {"localhost"};
    lws_context_destroy(context);
    relays_destroy(&relays);
    folder_make(dir);
    snprintf(keys, sizeof keys, "%s/keys", dir);
    assert_int_equal(authority_init(keys, hosts, 1, NULL), RESULT_OK);
    begin_with(dir, 8);
    call_reception("localhost", "good");
    serve_until(&page.ended);
    assert_non_null(strstr(page.why, "not trusted"));
    assert_int_equal(atomic_load(&reception.entered), 0);
    folder_remove(dir);
}

// ---- ends ---------------------------------------------------------------------------------------

static void a_server_that_ends_is_lost(void **state) {
    (void)state;
    call_reception("localhost", "good");
    hear(1);
    web_destroy(&reception.web);
    serve_until(&page.ended);
    assert_true(page.why[0]);
}

static void a_host_that_nobody_knows_and_a_port_where_nobody_listens(void **state) {
    (void)state;
    static const char *const addresses[] = {"nowhere.invalid:4880", "127.0.0.1:1", "no address",
                                            "localhost:none", ":4880"};
    for (size_t i = 0; i < sizeof addresses / sizeof *addresses; i++) {
        memset(&page, 0, sizeof page);
        call(addresses[i], "good");
        serve_until(&page.ended);
        assert_true(page.why[0] && seconds() < 6);
    }
}

static int silent_port(int *out_fd) {
    struct sockaddr_in address = {.sin_family = AF_INET};
    socklen_t size = sizeof address;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    *out_fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    assert_int_equal(bind(*out_fd, (struct sockaddr *)&address, sizeof address), 0);
    assert_int_equal(listen(*out_fd, 8), 0);
    assert_int_equal(getsockname(*out_fd, (struct sockaddr *)&address, &size), 0);
    return ntohs(address.sin_port);
}

static void one_that_says_nothing_is_given_up(void **state) {
    (void)state;
    char address[64];
    int fd, port = silent_port(&fd);
    snprintf(address, sizeof address, "localhost:%d", port);
    call(address, "good");
    serve_until(&page.ended);
    assert_non_null(strstr(page.why, "does not answer"));
    assert_true(seconds() > 4 && seconds() < 8);
    close(fd);
}

static void a_relay_may_be_closed_at_any_time(void **state) {
    (void)state;
    for (int ms = 0; ms < 60; ms += 3) {
        call_reception("localhost", "good");
        serve_ms(ms);
        relay_close(&page.relay);
        serve_ms(2);
        assert_false(page.ended);
    }
}

static void there_are_only_so_many(void **state) {
    (void)state;
    const struct relay_handler handler = {NULL, on_heard, on_ended};
    struct relay *all[8];
    for (int i = 0; i < 8; i++)
        assert_non_null(all[i] = relay_open(relays, "localhost:1", "good", &handler));
    assert_null(relay_open(relays, "localhost:1", "good", &handler));
    relay_close(&all[3]);
    assert_non_null(all[3] = relay_open(relays, "localhost:1", "good", &handler));
    for (int i = 0; i < 8; i++)
        relay_close(&all[i]);
}

static void it_needs_an_authority(void **state) {
    (void)state;
    struct relays *none;
    struct error err;
    assert_int_equal(relays_create("/nowhere.pem", &none, &err), RESULT_FORMAT);
    assert_non_null(strstr(err.text, "/nowhere.pem"));
    assert_null(none);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, begin, end)

int main(void) {
    const struct CMUnitTest tests[] = {
        TEST(it_hears_no_more_than_it_has_drawn),
        TEST(what_is_said_before_it_is_let_in_comes_in_order_and_only_so_much),
        TEST(a_batch_may_be_as_long_as_one_is),
        TEST(a_token_that_is_not_known_is_tried_for_a_second),
        TEST(a_token_that_is_known_a_moment_later_is_let_in),
        TEST(a_certificate_for_another_host_is_not_trusted),
        TEST(a_certificate_of_another_authority_is_not_trusted),
        TEST(a_server_that_ends_is_lost),
        TEST(a_host_that_nobody_knows_and_a_port_where_nobody_listens),
        TEST(one_that_says_nothing_is_given_up),
        TEST(a_relay_may_be_closed_at_any_time),
        TEST(there_are_only_so_many),
        TEST(it_needs_an_authority),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
