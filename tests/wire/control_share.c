// A certificate that wants more of the server than its station needs.
#include "base/clock.h"
#include "test.h"
#include "wire/test_server.h"
#include "wire/websocket.h"

#include <string.h>
#include <time.h>

#define ASKS 100
#define FRAMES 6000
#define FAST_PINGS 10
#define BETWEEN_NS (NS_PER_S / 4)
#define CALLS 60
#define CALLS_OF_4_S 16

static struct test_server test_server;
static char anna[128];
static atomic_int asks, last_ask;

static void on_mesh(struct test_server *server, struct control_peer peer,
                    const arthron_Control *message) {
    (void)server;
    (void)peer;
    atomic_store(&last_ask, (int)message->message.mesh_ask.have[0].number);
    atomic_fetch_add(&asks, 1);
}

static int set_up(void **state) {
    (void)state;
    test_server = (struct test_server){.on_mesh = on_mesh};
    atomic_store(&asks, 0);
    test_server_open(&test_server);
    test_server_enrol(&test_server, "anna", anna);
    return 0;
}

static int tear_down(void **state) {
    (void)state;
    test_server_close(&test_server);
    return 0;
}

static void tell(struct websocket *socket, const arthron_Control *message) {
    uint8_t bytes[WIRE_CONTROL_MAX];
    size_t size;
    assert_int_equal(wire_encode_control(message, bytes, sizeof bytes, &size), RESULT_OK);
    assert_true(websocket_send(socket, WEBSOCKET_BINARY, true, bytes, size));
}

// The next message of that kind. False: the connection has ended.
static bool hear_kind(struct websocket *socket, int kind, arthron_Control *out) {
    uint8_t bytes[WIRE_CONTROL_MAX];
    for (int size; (size = websocket_receive(socket, bytes, sizeof bytes)) >= 0;)
        if (wire_decode_control(bytes, (size_t)size, out, NULL) == RESULT_OK &&
            out->which_message == kind)
            return true;
    return false;
}

static struct websocket *greet(uint64_t connection, bool visit) {
    struct websocket *socket = websocket_open(test_server.port, anna, WIRE_SUBPROTOCOL);
    arthron_Control message = {.which_message = arthron_Control_hello_tag};
    arthron_Hello *hello = &message.message.hello;
    assert_non_null(socket);
    hello->version_min = WIRE_VERSION_MIN;
    hello->version_max = WIRE_VERSION_MAX;
    hello->connection = connection;
    hello->visit = visit;
    strcpy(hello->station, "anna");
    strcpy(hello->capabilities[hello->capabilities_count++], "meshes");
    tell(socket, &message);
    assert_true(hear_kind(socket, arthron_Control_welcome_tag, &message));
    return socket;
}

static void expect_replaced(struct websocket *socket) {
    arthron_Control message;
    assert_true(hear_kind(socket, arthron_Control_refusal_tag, &message));
    assert_int_equal(message.message.refusal.reason, arthron_Refusal_Reason_BUSY);
    assert_false(hear_kind(socket, arthron_Control_ping_tag, &message));
    websocket_close(socket);
}

static void expect_pong(struct websocket *socket) {
    arthron_Control message = {.which_message = arthron_Control_ping_tag};
    message.message.ping.sent_ns = 4711;
    tell(socket, &message);
    assert_true(hear_kind(socket, arthron_Control_pong_tag, &message));
}

static void a_station_has_one_connection_and_one_visit(void **state) {
    (void)state;
    struct websocket *stays = greet(1, false), *visits = greet(2, true);
    for (int i = 0; i < 5; i++) {
        struct websocket *later = greet((uint64_t)i, true);
        expect_replaced(visits);
        visits = later;
    }
    expect_pong(stays);
    struct websocket *again = greet(1, false);
    expect_replaced(stays);
    assert_true(wait_for(&test_server.gone, 6));
    expect_pong(again);
    expect_pong(visits);
    websocket_close(again);
    websocket_close(visits);
}

// As a station does that waits: without a pong for 5 s it counts as gone.
static void answer_ping(struct websocket *socket) {
    arthron_Control ping;
    assert_true(hear_kind(socket, arthron_Control_ping_tag, &ping));
    ping.which_message = arthron_Control_pong_tag;
    tell(socket, &ping);
}

static void whoever_asks_for_meshes_too_often_waits_and_the_last_ask_counts(void **state) {
    (void)state;
    struct websocket *socket = greet(1, false);
    arthron_Control message = {.which_message = arthron_Control_mesh_ask_tag};
    message.message.mesh_ask.have_count = 1;
    strcpy(message.message.mesh_ask.have[0].group, "meniscus_medial");
    for (int i = 1; i <= ASKS; i++) {
        message.message.mesh_ask.have[0].number = (uint32_t)i;
        tell(socket, &message);
    }
    while (atomic_load(&last_ask) != ASKS)
        answer_ping(socket);
    assert_in_range(atomic_load(&asks), 1, ASKS / 2);
    websocket_close(socket);
}

static void frames_that_come_too_fast_wait_and_none_is_lost(void **state) {
    (void)state;
    struct websocket *socket = greet(1, false);
    arthron_Control message = {.which_message = arthron_Control_frame_tag};
    for (int i = 1; i <= FRAMES; i++) {
        message.message.frame.number = (uint64_t)i;
        tell(socket, &message);
    }
    while (atomic_load(&test_server.frames) < FRAMES)
        answer_ping(socket);
    assert_int_equal(atomic_load(&test_server.frames), FRAMES);
    expect_pong(socket);
    websocket_close(socket);
}

// Pings as a station does, until its own answer comes, and counts the server's pings before that.
// False: the connection has ended.
static bool call(struct websocket *socket, bool rests, bool answers, int *pings) {
    uint8_t bytes[WIRE_CONTROL_MAX];
    arthron_Control message = {.which_message = arthron_Control_ping_tag};
    size_t size;
    message.message.ping.rests = rests;
    assert_int_equal(wire_encode_control(&message, bytes, sizeof bytes, &size), RESULT_OK);
    if (!websocket_send(socket, WEBSOCKET_BINARY, true, bytes, size))
        return false;
    for (int got; (got = websocket_receive(socket, bytes, sizeof bytes)) >= 0;) {
        assert_int_equal(wire_decode_control(bytes, (size_t)got, &message, NULL), RESULT_OK);
        if (message.which_message == arthron_Control_pong_tag)
            return true;
        if (message.which_message != arthron_Control_ping_tag)
            continue;
        ++*pings;
        message.which_message = arthron_Control_pong_tag;
        if (answers)
            tell(socket, &message);
    }
    return false;
}

static void pause_between(void) {
    nanosleep(&(struct timespec){0, BETWEEN_NS}, NULL);
}

// The server's pings while the station calls so often.
static int pings_of(struct websocket *socket, bool rests, int calls) {
    int pings = 0;
    for (; calls > 0; calls--) {
        assert_true(call(socket, rests, true, &pings));
        pause_between();
    }
    return pings;
}

static void a_station_that_rests_is_asked_rarely_until_it_rests_no_more(void **state) {
    (void)state;
    struct websocket *socket = greet(1, false);
    assert_in_range(pings_of(socket, true, CALLS_OF_4_S), FAST_PINGS, FAST_PINGS + 1);
    assert_int_equal(pings_of(socket, true, CALLS_OF_4_S), 0);
    assert_true(pings_of(socket, false, CALLS_OF_4_S) >= FAST_PINGS); // as at the beginning
    websocket_close(socket);
}

static void answers_that_are_missed_end_a_connection_that_sends_pings(void **state) {
    (void)state;
    struct websocket *socket = greet(1, false);
    int calls = 0, pings = 0;
    while (call(socket, false, false, &pings) && calls++ < CALLS)
        pause_between();
    assert_in_range(calls, 1, CALLS - 1);
    websocket_close(socket);
}

#define WITH_SERVER(test) cmocka_unit_test_setup_teardown(test, set_up, tear_down)

int main(void) {
    const struct CMUnitTest tests[] = {
        WITH_SERVER(a_station_has_one_connection_and_one_visit),
        WITH_SERVER(whoever_asks_for_meshes_too_often_waits_and_the_last_ask_counts),
        WITH_SERVER(frames_that_come_too_fast_wait_and_none_is_lost),
        WITH_SERVER(a_station_that_rests_is_asked_rarely_until_it_rests_no_more),
        WITH_SERVER(answers_that_are_missed_end_a_connection_that_sends_pings),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
