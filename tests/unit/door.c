// Who gets a place at the stations' port.
#include "net/door.h"

#include "base/clock.h"
#include "test.h"

#include <arpa/inet.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#define STATIONS 64
#define CONNECTIONS_MAX 4096
#define BEGIN_NS (1000 * NS_PER_S)

struct connection {
    bool open, shut;
};

static struct connection connections[CONNECTIONS_MAX];
static int connection_count;
static struct door *door;
static int64_t now_ns;

static void on_shut(void *connection) {
    ((struct connection *)connection)->shut = true;
}

static int set_up(void **state) {
    (void)state;
    memset(connections, 0, sizeof connections);
    connection_count = 0;
    now_ns = BEGIN_NS;
    door = door_create(STATIONS, door_places(STATIONS), on_shut);
    return 0;
}

static int tear_down(void **state) {
    (void)state;
    door_destroy(&door);
    return 0;
}

static struct source ip(int number) {
    struct source source = {0};
    memset(source.address.s6_addr + 10, 0xff, 2);
    source.address.s6_addr[12] = 10;
    source.address.s6_addr[14] = (uint8_t)(number >> 8);
    source.address.s6_addr[15] = (uint8_t)number;
    return source;
}

// NULL: it was turned away.
static struct connection *come(int source_number) {
    struct source source = ip(source_number);
    now_ns += NS_PER_MS;
    if (!door_let_in(door, &source, now_ns))
        return NULL;
    assert_true(connection_count < CONNECTIONS_MAX);
    struct connection *connection = &connections[connection_count++];
    connection->open = true;
    door_open(door, connection, now_ns);
    return connection;
}

// What was shut leaves, as a server makes it between two turns.
static void settle(void) {
    for (int i = 0; i < connection_count; i++)
        if (connections[i].open && connections[i].shut) {
            connections[i].open = false;
            door_close(door, &connections[i]);
        }
}

static int count_open(void) {
    int count = 0;
    for (int i = 0; i < connection_count; i++)
        count += connections[i].open && !connections[i].shut;
    return count;
}

static void whoever_has_the_most_strangers_makes_room(void **state) {
    (void)state;
    struct connection *lone = come(7);
    for (int i = 0; i < 200; i++) {
        now_ns += 20 * NS_PER_MS; // not too often
        assert_non_null(come(1));
        assert_non_null(come(2));
        settle();
    }
    assert_false(lone->shut);
    assert_int_equal(count_open(), DOOR_STRANGERS_MAX);
    assert_non_null(come(8));
    assert_false(lone->shut);
}

static void the_oldest_stranger_of_a_full_source_makes_room(void **state) {
    (void)state;
    struct connection *first = come(1), *second = come(1);
    for (int i = 2; i < DOOR_STRANGERS_PER_SOURCE; i++)
        assert_non_null(come(1));
    assert_false(first->shut);
    assert_non_null(come(1));
    assert_true(first->shut);
    assert_false(second->shut);
}

static void a_proved_connection_is_no_stranger(void **state) {
    (void)state;
    struct connection *station = come(1);
    assert_true(door_prove(door, station, "A1", now_ns));
    for (int i = 0; i < 2 * DOOR_STRANGERS_PER_SOURCE; i++) {
        now_ns += 10 * NS_PER_MS;
        assert_non_null(come(1));
        settle();
    }
    assert_false(station->shut);
    assert_int_equal(count_open(), DOOR_STRANGERS_PER_SOURCE + 1);
}

static void a_source_that_comes_too_often_is_turned_away_and_no_other(void **state) {
    (void)state;
    int let_in = 0;
    for (int i = 0; i < 2000; i++) { // two seconds
        let_in += come(1) != NULL;
        settle();
    }
    assert_in_range(let_in, DOOR_CONNECTIONS_BURST,
                    DOOR_CONNECTIONS_BURST + 2 * DOOR_CONNECTIONS_PER_S + 1);
    assert_non_null(come(2));
}

static void
sources_that_never_proved_anything_share_a_rate_that_known_ones_do_not_pay(void **state) {
    (void)state;
    assert_true(door_prove(door, come(999), "A1", now_ns));
    int let_in = 0;
    for (int i = 0; i < 2000; i++) { // two seconds, each source twice
        let_in += come(i % 998) != NULL;
        settle();
    }
    assert_in_range(let_in, DOOR_UNKNOWN_BURST, DOOR_UNKNOWN_BURST + 2 * DOOR_UNKNOWN_PER_S + 1);
    assert_non_null(come(999));
}

static void places_that_are_being_left_are_counted_until_they_are_empty(void **state) {
    (void)state;
    int let_in = 0;
    for (int i = 0; i < 600; i++)
        let_in += come(i % 300) != NULL; // nobody leaves
    assert_int_equal(let_in, door_places(STATIONS));
    settle();
    assert_non_null(come(1));
}

static void with_few_places_strangers_leave_room_for_stations(void **state) {
    (void)state;
    int stations = 0;
    door_destroy(&door);
    door = door_create(STATIONS, 8, on_shut);
    for (int i = 0; i < 6; i++) {
        char serial[8];
        struct connection *c = come(1);
        assert_non_null(c);
        snprintf(serial, sizeof serial, "A%d", i);
        stations += door_prove(door, c, serial, now_ns);
        settle();
        for (int k = 0; k < 20; k++, now_ns += 20 * NS_PER_MS) { // strangers come again and again
            assert_non_null(come(k % 2));
            settle();
        }
    }
    assert_int_equal(stations, 4);
    assert_in_range(count_open(), 5, 8);
}

static void a_certificate_has_few_connections_and_those_in_use_stay(void **state) {
    (void)state;
    struct connection *used = come(1);
    assert_true(door_prove(door, used, "A1", now_ns));
    door_keep(door, used);
    struct connection *later[DOOR_CERTIFICATE_MAX];
    for (int i = 0; i < DOOR_CERTIFICATE_MAX; i++) {
        later[i] = come(1);
        assert_true(door_prove(door, later[i], "A1", now_ns));
    }
    assert_false(used->shut);
    assert_true(later[0]->shut);
    assert_false(later[1]->shut);
    struct connection *other = come(1);
    assert_true(door_prove(door, other, "B2", now_ns));
    assert_false(later[1]->shut);
}

static void a_certificate_comes_only_so_often(void **state) {
    (void)state;
    int let_in = 0;
    for (int i = 0; i < 200; i++) {
        now_ns += 10 * NS_PER_MS;
        struct connection *c = come(1);
        let_in += door_prove(door, c, "A1", now_ns);
        c->shut = true;
        settle();
    }
    assert_in_range(let_in, DOOR_CERTIFICATE_BURST, DOOR_CERTIFICATE_BURST + 6);
    assert_true(door_prove(door, come(1), "B2", now_ns));
}

static void codes_that_one_source_tries_keep_no_other_from_enrolling(void **state) {
    (void)state;
    struct connection *junk = come(1);
    for (int i = 0; i < DOOR_ENROLMENTS_BURST; i++)
        assert_true(door_may_enrol(door, junk, now_ns));
    assert_false(door_may_enrol(door, junk, now_ns));
    assert_false(door_may_enrol(door, come(1), now_ns));
    assert_true(door_may_enrol(door, come(2), now_ns));
    assert_true(door_may_enrol(door, junk, now_ns + 2 * NS_PER_S));
}

static void what_was_turned_away_and_shut_is_told_with_a_source(void **state) {
    (void)state;
    struct source source;
    char text[SOURCE_TEXT_SIZE];
    assert_int_equal(door_take_shut(door, &source), 0);
    for (int i = 0; i < DOOR_STRANGERS_PER_SOURCE + 3; i++)
        assert_non_null(come(258));
    assert_int_equal(door_take_shut(door, &source), 3);
    source_write(&source, text);
    assert_string_equal(text, "10.0.1.2");
    assert_int_equal(door_take_shut(door, &source), 0);
}

static void an_ipv6_source_is_a_network_of_64_bits(void **state) {
    (void)state;
    struct source source = {0};
    char text[SOURCE_TEXT_SIZE];
    assert_int_equal(inet_pton(AF_INET6, "2001:db8:1:2::", &source.address), 1);
    source_write(&source, text);
    assert_string_equal(text, "2001:db8:1:2::/64");
}

// The hall's own network: one address is one person, and no other pays for it.
static void an_ipv6_source_of_the_same_network_is_an_address(void **state) {
    (void)state;
    struct sockaddr_in6 here = {.sin6_family = AF_INET6, .sin6_addr = IN6ADDR_LOOPBACK_INIT};
    socklen_t size = sizeof here;
    struct source source;
    char text[SOURCE_TEXT_SIZE];
    int listener = socket(AF_INET6, SOCK_STREAM, 0), caller = socket(AF_INET6, SOCK_STREAM, 0);
    if (listener < 0 || bind(listener, (struct sockaddr *)&here, size) != 0)
        skip(); // a machine without IPv6
    assert_int_equal(listen(listener, 1), 0);
    assert_int_equal(getsockname(listener, (struct sockaddr *)&here, &size), 0);
    assert_int_equal(connect(caller, (struct sockaddr *)&here, size), 0);
    int fd = accept(listener, NULL, NULL);
    assert_true(source_of(fd, &source));
    source_write(&source, text);
    assert_string_equal(text, "::1");
    close(fd);
    close(caller);
    close(listener);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(whoever_has_the_most_strangers_makes_room, set_up,
                                        tear_down),
        cmocka_unit_test_setup_teardown(the_oldest_stranger_of_a_full_source_makes_room, set_up,
                                        tear_down),
        cmocka_unit_test_setup_teardown(a_proved_connection_is_no_stranger, set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_source_that_comes_too_often_is_turned_away_and_no_other,
                                        set_up, tear_down),
        cmocka_unit_test_setup_teardown(
            sources_that_never_proved_anything_share_a_rate_that_known_ones_do_not_pay, set_up,
            tear_down),
        cmocka_unit_test_setup_teardown(places_that_are_being_left_are_counted_until_they_are_empty,
                                        set_up, tear_down),
        cmocka_unit_test_setup_teardown(with_few_places_strangers_leave_room_for_stations, set_up,
                                        tear_down),
        cmocka_unit_test_setup_teardown(a_certificate_has_few_connections_and_those_in_use_stay,
                                        set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_certificate_comes_only_so_often, set_up, tear_down),
        cmocka_unit_test_setup_teardown(codes_that_one_source_tries_keep_no_other_from_enrolling,
                                        set_up, tear_down),
        cmocka_unit_test_setup_teardown(what_was_turned_away_and_shut_is_told_with_a_source, set_up,
                                        tear_down),
        cmocka_unit_test(an_ipv6_source_is_a_network_of_64_bits),
        cmocka_unit_test(an_ipv6_source_of_the_same_network_is_an_address),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
