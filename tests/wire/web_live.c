// The WebSocket for pages: who is let in, what a page may say, how much it is sent, and when it
// ends.
#include "base/clock.h"
#include "test.h"
#include "wire/reception.h"
#include "wire/websocket.h"

#include <pb_encode.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

// ---- asking -------------------------------------------------------------------------------------

#define CALL                                                                                       \
    " HTTP/1.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"      \
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
#define HOST "Host: localhost\r\n"
#define SPEAKS "Sec-WebSocket-Protocol: " WIRE_LIVE_SUBPROTOCOL "\r\n"
#define PROGRAM "Authorization: Bearer good\r\n"
#define BROWSER "Cookie: arthron=good\r\n"
#define OWN "Origin: https://localhost\r\n"

static struct websocket *look(const char *token) {
    char request[1024];
    int status;
    snprintf(request, sizeof request, "GET /live" CALL HOST SPEAKS OWN "Cookie: arthron=%s\r\n\r\n",
             token);
    struct websocket *socket = websocket_ask_safely(reception.port, request, &status);
    assert_int_equal(status, 101);
    return socket;
}

// ---- who is let in ------------------------------------------------------------------------------

static void only_signed_in_pages_of_this_server_and_programs_are_let_in(void **state) {
    (void)state;
    static const struct {
        const char *what, *request;
        int status;
    } rows[] = {
        {"a page", "GET /live" CALL HOST SPEAKS BROWSER OWN "\r\n", 101},
        {"a program", "GET /live" CALL HOST SPEAKS PROGRAM "\r\n", 101},
        {"a program's page", "GET /live" CALL HOST SPEAKS PROGRAM OWN "\r\n", 101},
        {"nobody", "GET /live" CALL HOST SPEAKS OWN "\r\n", 401},
        {"no token in it", "GET /live" CALL HOST SPEAKS OWN "Cookie: arthron=\r\n\r\n", 401},
        {"a cookie from nowhere", "GET /live" CALL HOST SPEAKS BROWSER "\r\n", 403},
        {"another site",
         "GET /live" CALL HOST SPEAKS BROWSER "Origin: https://evil.example\r\n\r\n", 403},
        {"another site with a program's token",
         "GET /live" CALL HOST SPEAKS PROGRAM "Origin: https://evil.example\r\n\r\n", 403},
        {"another scheme", "GET /live" CALL HOST SPEAKS BROWSER "Origin: http://localhost\r\n\r\n",
         403},
        {"another port", "GET /live" CALL HOST SPEAKS BROWSER "Origin: https://localhost:1\r\n\r\n",
         403},
        {"another name",
         "GET /live" CALL "Host: evil.example\r\n" SPEAKS BROWSER
         "Origin: https://evil.example\r\n\r\n",
         421},
        {"no name", "GET /live" CALL SPEAKS BROWSER OWN "\r\n", 400},
        {"another path", "GET /lives" CALL HOST SPEAKS BROWSER OWN "\r\n", 404},
        {"the API's", "GET /api/v1/me" CALL HOST SPEAKS BROWSER OWN "\r\n", 404},
        {"another method", "POST /live" CALL HOST SPEAKS BROWSER OWN "Content-Length: 0\r\n\r\n",
         404},
        {"another subprotocol",
         "GET /live" CALL HOST BROWSER OWN "Sec-WebSocket-Protocol: arthron.1\r\n\r\n", 400},
        {"the room's own one",
         "GET /live" CALL HOST BROWSER OWN "Sec-WebSocket-Protocol: http\r\n\r\n", 400},
        {"no subprotocol", "GET /live" CALL HOST BROWSER OWN "\r\n", 400},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        int status;
        struct websocket *socket = websocket_ask_safely(reception.port, rows[i].request, &status);
        if (status != rows[i].status)
            fail_msg("%s: %d", rows[i].what, status);
        if (socket)
            websocket_close(socket);
    }
}

static void an_unknown_viewer_gets_nothing_and_is_closed(void **state) {
    (void)state;
    atomic_store(&reception.batch_size, 10);
    struct websocket *socket = look("stranger");
    assert_int_equal(websocket_close_status(socket), 1008);
    websocket_close(socket);
    assert_int_equal(atomic_load(&reception.viewers), 0);
}

// False where the server has hung up.
static bool try_to_tell(struct websocket *socket, const arthron_Page *message) {
    uint8_t bytes[WIRE_PAGE_MAX];
    pb_ostream_t stream = pb_ostream_from_buffer(bytes, sizeof bytes);
    assert_true(pb_encode(&stream, arthron_Page_fields, message));
    return websocket_send(socket, WEBSOCKET_BINARY, true, bytes, stream.bytes_written);
}

static void tell(struct websocket *socket, const arthron_Page *message) {
    assert_true(try_to_tell(socket, message));
}

static void watch(struct websocket *socket) {
    const arthron_Page message = {.which_message = arthron_Page_watch_tag,
                                  .message.watch.what = arthron_Watch_What_WALL};
    tell(socket, &message);
}

static arthron_Page drawn(uint64_t batches) {
    return (arthron_Page){.which_message = arthron_Page_drawn_tag,
                          .message.drawn.batches = batches};
}

static void draw(struct websocket *socket, uint64_t batches) {
    const arthron_Page message = drawn(batches);
    tell(socket, &message);
}

// What a page says before it is known is heard when it is.
static void a_page_may_send_before_it_is_known(void **state) {
    (void)state;
    struct websocket *socket = look("slow");
    watch(socket);
    assert_int_equal(atomic_load(&reception.viewers), 0);
    assert_true(reception_wait(&reception.pages, 1));
    assert_int_equal(atomic_load(&reception.viewers), 1);
    websocket_close(socket);
    assert_true(reception_wait(&reception.left, 1));
}

static void a_page_ends_with_its_sign_in(void **state) {
    (void)state;
    for (int i = 0; i < 2; i++) {
        struct websocket *socket = look("good");
        watch(socket);
        assert_true(reception_wait(&reception.pages, i + 1));
        atomic_store(i ? &reception.promoted : &reception.signed_out, true);
        int64_t begun_ns = clock_now_ns();
        assert_int_equal(websocket_close_status(socket), 1008);
        assert_true(clock_now_ns() - begun_ns < 2 * NS_PER_S);
        assert_true(reception_wait(&reception.left, i + 1));
        websocket_close(socket);
        atomic_store(&reception.signed_out, false);
    }
}

static void open_pages_stay_signed_in_while_accounts_cannot_be_looked_up(void **state) {
    (void)state;
    struct websocket *socket = look("good");
    watch(socket);
    assert_true(reception_wait(&reception.pages, 1));
    atomic_store(&reception.forgetful, true);
    assert_true(reception_wait(&reception.entered, atomic_load(&reception.entered) + 2));
    watch(socket);
    assert_true(reception_wait(&reception.pages, 2));
    struct websocket *late = look("good");
    assert_int_equal(websocket_close_status(late), 1013);
    websocket_close(late);
    atomic_store(&reception.signed_out, true);
    atomic_store(&reception.forgetful, false);
    assert_int_equal(websocket_close_status(socket), 1008);
    websocket_close(socket);
    assert_int_equal(atomic_load(&reception.viewers), 1);
}

// ---- batches ------------------------------------------------------------------------------------

static void expect_batch(struct websocket *socket, uint32_t number) {
    static uint8_t bytes[WEB_BATCH_MAX];
    uint32_t got;
    int size = websocket_receive(socket, bytes, sizeof bytes);
    assert_int_equal(size, atomic_load(&reception.batch_size));
    memcpy(&got, bytes, sizeof got);
    assert_int_equal(got, number);
}

static bool is_silent(struct websocket *socket) {
    char byte;
    usleep(150000);
    return recv(websocket_fd(socket), &byte, 1, MSG_PEEK | MSG_DONTWAIT) < 0;
}

static void two_batches_are_on_their_way_and_no_more(void **state) {
    (void)state;
    atomic_store(&reception.batch_size, 60000);
    struct websocket *socket = look("good");
    expect_batch(socket, 1);
    expect_batch(socket, 2);
    assert_true(is_silent(socket));
    draw(socket, 1);
    expect_batch(socket, 3);
    assert_true(is_silent(socket));
    draw(socket, 3);
    expect_batch(socket, 4);
    expect_batch(socket, 5);
    assert_true(is_silent(socket));
    for (uint32_t i = 4; i < 200; i++) {
        draw(socket, i);
        expect_batch(socket, i + 2);
    }
    assert_int_equal(atomic_load(&reception.asked), 201);
    websocket_close(socket);
}

static void a_batch_comes_when_it_is_due_or_asked_for(void **state) {
    (void)state;
    atomic_store(&reception.batch_size, 8);
    atomic_store(&reception.batch_gap_ns, 100 * NS_PER_MS);
    struct websocket *socket = look("good");
    expect_batch(socket, 1);
    int64_t begun_ns = clock_now_ns();
    for (uint32_t i = 2; i < 7; i++) {
        draw(socket, i - 1);
        expect_batch(socket, i);
    }
    assert_true(clock_now_ns() - begun_ns > 490 * NS_PER_MS);
    assert_true(atomic_load(&reception.asked) < 30);
    draw(socket, 6);
    atomic_store(&reception.batch_size, 0); // nothing from now on
    usleep(200000);
    int asked = atomic_load(&reception.asked);
    usleep(300000);
    assert_int_equal(atomic_load(&reception.asked), asked); // nobody asks in vain
    atomic_store(&reception.batch_size, 8);
    web_wake(reception.web);
    expect_batch(socket, 7);
    websocket_close(socket);
}

// ---- what a page may say ------------------------------------------------------------------------

static void bad_messages_end_the_connection(void **state) {
    (void)state;
    static uint8_t long_message[WIRE_PAGE_MAX + 1];
    static const struct {
        const char *what;
        int opcode;
        bool last;
        const char *bytes;
        size_t size;
        int status;
    } rows[] = {
        {"text", WEBSOCKET_TEXT, true, "hello", 5, 1003},
        {"no message", WEBSOCKET_BINARY, true, "\xff\xff\xff\xff", 4, 1007},
        {"one cut short", WEBSOCKET_BINARY, true, "\x0a\x05\x08", 3, 1007},
        {"a length beyond its end", WEBSOCKET_BINARY, true, "\x0a\x7f\x08\x01", 4, 1007},
        {"an unknown subscription", WEBSOCKET_BINARY, true, "\x0a\x02\x08\x09", 4, 1007},
        {"an unknown command", WEBSOCKET_BINARY, true, "\x1a\x03\x08\xff\x01", 5, 1007},
        {"drawn before sent", WEBSOCKET_BINARY, true, "\x12\x09\x09\x05\0\0\0\0\0\0\0", 11, 1007},
        {"too long", WEBSOCKET_BINARY, true, (const char *)long_message, sizeof long_message, 1009},
        {"too long in pieces", WEBSOCKET_BINARY, false, (const char *)long_message,
         sizeof long_message, 1009},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct websocket *socket = look("good");
        websocket_send(socket, rows[i].opcode, rows[i].last, rows[i].bytes, rows[i].size);
        int status = websocket_close_status(socket);
        if (status != rows[i].status)
            fail_msg("%s: %d", rows[i].what, status);
        websocket_close(socket);
    }
    assert_int_equal(atomic_load(&reception.pages), 0);
}

static void what_is_odd_but_good_is_taken(void **state) {
    (void)state;
    struct websocket *socket = look("good");
    assert_true(websocket_send(socket, WEBSOCKET_BINARY, true, "", 0));
    assert_true(websocket_send(socket, WEBSOCKET_BINARY, true, "\x92\x06\x02\x08\x01", 5)); // later
    assert_true(websocket_send(socket, WEBSOCKET_BINARY, false, "\x0a", 1));
    assert_true(websocket_send(socket, WEBSOCKET_MORE, false, "\x02", 1));
    assert_true(websocket_send(socket, WEBSOCKET_MORE, true, "\x08\x01", 2));
    assert_true(reception_wait(&reception.pages, 1));
    atomic_store(&reception.refuses_pages, true);
    watch(socket);
    assert_int_equal(websocket_close_status(socket), 1008);
    websocket_close(socket);
}

static void a_peer_that_sends_too_much_is_closed(void **state) {
    (void)state;
    struct websocket *socket = look("good");
    int status = 0;
    for (int i = 0; i < 3000; i++)
        if (!websocket_send(socket, WEBSOCKET_BINARY, true, "\x0a\x02\x08\x01", 4))
            break;
    status = websocket_close_status(socket);
    assert_true(status == 1008 || status == -1); // or the connection went before it was read
    assert_true(reception_wait(&reception.left, 1));
    assert_in_range(atomic_load(&reception.pages), 600, 2000);
    websocket_close(socket);
}

// ---- slow, many, late ---------------------------------------------------------------------------

static void a_peer_that_never_reads_is_closed_and_delays_no_other(void **state) {
    (void)state;
    atomic_store(&reception.batch_size, 65535);
    struct websocket *slow = look("good"), *quick = look("good");
    int small = 4096;
    setsockopt(websocket_fd(slow), SOL_SOCKET, SO_RCVBUF, &small, sizeof small);
    expect_batch(quick, 1);
    for (uint32_t i = 1; atomic_load(&reception.left) == 0 && i < 2000; i++) {
        const arthron_Page says = drawn(i < 3 ? i : 2); // that it drew two, and it draws no more
        if (!try_to_tell(slow, &says))
            break;
        draw(quick, i);
        expect_batch(quick, i + 1);
        usleep(5000);
    }
    assert_true(reception_wait(&reception.left, 1));
    websocket_close(quick);
    websocket_close(slow);
}

static void there_is_room_for_64(void **state) {
    (void)state;
    static struct websocket *sockets[WEB_VIEWERS_MAX];
    int status;
    atomic_store(&reception.batch_size, 100);
    for (int i = 0; i < WEB_VIEWERS_MAX; i++)
        sockets[i] = look("good");
    for (int i = 0; i < WEB_VIEWERS_MAX; i++)
        expect_batch(sockets[i], 1);
    assert_null(
        websocket_ask_safely(reception.port, "GET /live" CALL HOST SPEAKS PROGRAM "\r\n", &status));
    assert_int_equal(status, 503);
    websocket_close(sockets[0]);
    assert_true(reception_wait(&reception.left, 1));
    sockets[0] = look("good");
    expect_batch(sockets[0], 1);
    for (int i = 0; i < WEB_VIEWERS_MAX; i++)
        websocket_close(sockets[i]);
}

static void a_server_that_stops_says_so(void **state) {
    (void)state;
    atomic_store(&reception.batch_size, 1000);
    struct websocket *sockets[4];
    for (int i = 0; i < 4; i++) {
        sockets[i] = look("good");
        expect_batch(sockets[i], 1);
    }
    web_destroy(&reception.web);
    for (int i = 0; i < 4; i++) {
        assert_int_equal(websocket_close_status(sockets[i]), 1001);
        websocket_close(sockets[i]);
    }
    assert_int_equal(atomic_load(&reception.left), 4);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(only_signed_in_pages_of_this_server_and_programs_are_let_in,
                                        reception_begin, reception_end),
        cmocka_unit_test_setup_teardown(an_unknown_viewer_gets_nothing_and_is_closed,
                                        reception_begin, reception_end),
        cmocka_unit_test_setup_teardown(a_page_may_send_before_it_is_known, reception_begin,
                                        reception_end),
        cmocka_unit_test_setup_teardown(a_page_ends_with_its_sign_in, reception_begin,
                                        reception_end),
        cmocka_unit_test_setup_teardown(
            open_pages_stay_signed_in_while_accounts_cannot_be_looked_up, reception_begin_patiently,
            reception_end),
        cmocka_unit_test_setup_teardown(two_batches_are_on_their_way_and_no_more, reception_begin,
                                        reception_end),
        cmocka_unit_test_setup_teardown(a_batch_comes_when_it_is_due_or_asked_for, reception_begin,
                                        reception_end),
        cmocka_unit_test_setup_teardown(bad_messages_end_the_connection, reception_begin,
                                        reception_end),
        cmocka_unit_test_setup_teardown(what_is_odd_but_good_is_taken, reception_begin,
                                        reception_end),
        cmocka_unit_test_setup_teardown(a_peer_that_sends_too_much_is_closed, reception_begin,
                                        reception_end),
        cmocka_unit_test_setup_teardown(a_peer_that_never_reads_is_closed_and_delays_no_other,
                                        reception_begin, reception_end),
        cmocka_unit_test_setup_teardown(there_is_room_for_64, reception_begin, reception_end),
        cmocka_unit_test_setup_teardown(a_server_that_stops_says_so, reception_begin,
                                        reception_end),
    };
    return cmocka_run_group_tests_name("web_live", tests, NULL, NULL);
}
