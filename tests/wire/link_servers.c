// A station's link and two control rooms of one authority.
#include "base/clock.h"
#include "link/link.h"
#include "net/authority.h"
#include "test.h"
#include "wire/test_server.h"

#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#define SOON_NS (4 * NS_PER_S)

static struct test_server a, b;
static char anna[128];
static struct link *station;

static int set_up(void **state) {
    (void)state;
    char command[512];
    a = b = (struct test_server){0};
    test_server_open(&a);
    test_server_enrol(&a, "anna", anna);
    // The other server has the same authority, and a certificate of its own.
    pthread_mutex_init(&b.lock, NULL);
    snprintf(b.keys, sizeof b.keys, "%s/b", a.dir);
    snprintf(command, sizeof command, "cp -r %s %s", a.keys, b.keys);
    assert_int_equal(system(command), 0);
    const char *host = "localhost";
    struct authority_server made;
    assert_int_equal(authority_renew_server(b.keys, &host, 1, &made, NULL), RESULT_OK);
    test_server_start(&b);
    station = NULL;
    return 0;
}

static int tear_down(void **state) {
    (void)state;
    if (station)
        link_destroy(&station);
    if (b.control)
        test_server_stop(&b);
    pthread_mutex_destroy(&b.lock);
    test_server_close(&a);
    return 0;
}

static void start_station(const struct server_address *list, int count) {
    struct link_config config = {.server_count = count,
                                 .keys_dir = anna,
                                 .station = "anna",
                                 .software = "test",
                                 .device_count = 1,
                                 .devices = {{"arm", "modbus"}}};
    struct error err;
    memcpy(config.servers, list, (size_t)count * sizeof *list);
    if (link_create(&config, &station, &err) != RESULT_OK)
        fail_msg("%s", err.text);
}

static void start_between_both(void) {
    start_station((struct server_address[]){{"127.0.0.1", a.port}, {"localhost", b.port}}, 2);
}

static struct link_status status(void) {
    struct link_status s;
    link_get_status(station, &s);
    return s;
}

static bool is_at(const struct test_server *server) {
    struct link_status s = status();
    return s.welcomed && s.server.port == server->port;
}

static void expect_at(const struct test_server *server) {
    int64_t until_ns = clock_now_ns() + 10 * NS_PER_S;
    while (!is_at(server) && clock_now_ns() < until_ns)
        usleep(2000);
    assert_true(is_at(server));
}

static void address_of(const struct test_server *server, char out[SERVER_TEXT_SIZE]) {
    server_write(&(struct server_address){"localhost", server->port}, out);
}

static arthron_Refusal elsewhere(const struct test_server *server) {
    arthron_Refusal refusal = {arthron_Refusal_Reason_ELSEWHERE, "it is at the other one", "", 0};
    address_of(server, refusal.server);
    return refusal;
}

// A port of this machine that takes connections and says nothing.
static int silent_port(int *out_fd) {
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof at;
    *out_fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    assert_int_equal(bind(*out_fd, (struct sockaddr *)&at, sizeof at), 0);
    assert_int_equal(listen(*out_fd, 8), 0);
    assert_int_equal(getsockname(*out_fd, (struct sockaddr *)&at, &size), 0);
    return ntohs(at.sin_port);
}

// ---- where servers send it ----------------------------------------------------------------------

static void a_refusal_that_names_the_owner_is_followed(void **state) {
    (void)state;
    arthron_Refusal refusal = elsewhere(&b);
    a.refusal = &refusal;
    start_station(&(struct server_address){"localhost", a.port}, 1); // it knows no other
    expect_at(&b);
    assert_int_equal(atomic_load(&a.refused), 1);
    assert_string_equal(status().refusal, "");
    assert_string_equal(status().server.host, "localhost");
}

static void a_station_that_is_moved_goes_at_once(void **state) {
    (void)state;
    char to[SERVER_TEXT_SIZE];
    struct link_session session;
    uint64_t seen = 0;
    start_between_both();
    expect_at(&a);
    address_of(&b, to);
    assert_true(control_move(a.control, a.peer, to));
    assert_true(wait_for(&a.gone, 1));
    expect_at(&b);
    assert_false(control_move(a.control, a.peer, to)); // it is gone
    assert_int_equal(b.hello.connection, a.hello.connection);
    address_of(&a, to);
    assert_true(control_move(b.control, b.peer, to));
    expect_at(&a);
    assert_true(wait_for(&a.clocks, 2));
    for (int i = 0; i < 5000 && !(link_get_session(station, &seen, &session) &&
                                  session.server.port == a.port && session.connection == 3);
         i++)
        usleep(2000);
    assert_int_equal(session.server.port, a.port);
}

static void a_server_that_wants_time_is_asked_again(void **state) {
    (void)state;
    a.refusal = &(arthron_Refusal){arthron_Refusal_Reason_BUSY, "wait", "", 400};
    int64_t start_ns = clock_now_ns();
    start_between_both();
    assert_true(wait_for(&a.refused, 3));
    assert_in_range(clock_now_ns() - start_ns, 800 * NS_PER_MS, 8 * NS_PER_S);
    assert_int_equal(atomic_load(&b.hellos), 0);
    a.refusal = NULL;
    expect_at(&a);
}

static void a_server_that_is_named_but_not_trusted_is_left(void **state) {
    (void)state;
    arthron_Refusal refusal = elsewhere(&b);
    snprintf(refusal.server, sizeof refusal.server, "127.0.0.1:%d", b.port);
    a.refusal = &refusal; // b's certificate is not for this address
    start_station(&(struct server_address){"localhost", a.port}, 1);
    assert_true(wait_for(&a.refused, 2));
    assert_int_equal(atomic_load(&b.hellos), 0);
    assert_non_null(strstr(status().problem, "not for 127.0.0.1"));
    a.refusal = NULL;
    expect_at(&a);
}

// ---- servers that are lost ----------------------------------------------------------------------

static void another_one_is_there_when_a_connection_ends(void **state) {
    (void)state;
    start_between_both();
    expect_at(&a);
    test_server_stop(&a);
    expect_at(&b);
    test_server_start(&a);
    test_server_stop(&b);
    expect_at(&a);
}

static void a_port_that_is_silent_is_given_up(void **state) {
    (void)state;
    int fd, port = silent_port(&fd);
    int64_t start_ns = clock_now_ns();
    start_station((struct server_address[]){{"127.0.0.1", port}, {"localhost", b.port}}, 2);
    expect_at(&b);
    assert_in_range(clock_now_ns() - start_ns, 2 * NS_PER_S, SOON_NS);
    close(fd);
}

// ---- tokens -------------------------------------------------------------------------------------

static void a_server_with_an_old_state_is_left(void **state) {
    (void)state;
    a.session_id[0] = b.session_id[0] = 1;
    a.token = 5;
    b.token = 6;
    start_between_both();
    expect_at(&a);
    test_server_stop(&a);
    expect_at(&b);
    test_server_start(&a); // as it was
    test_server_stop(&b);
    assert_true(wait_for(&a.hellos, 3)); // asked again, and left again
    assert_false(status().welcomed);
    a.token = 7;
    expect_at(&a);
}

static void a_new_session_may_have_any_token(void **state) {
    (void)state;
    a.session_id[0] = 1;
    b.session_id[0] = 2;
    a.token = 5;
    b.token = 1;
    start_between_both();
    expect_at(&a);
    test_server_stop(&a);
    expect_at(&b);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_refusal_that_names_the_owner_is_followed, set_up,
                                        tear_down),
        cmocka_unit_test_setup_teardown(a_station_that_is_moved_goes_at_once, set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_server_that_wants_time_is_asked_again, set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_server_that_is_named_but_not_trusted_is_left, set_up,
                                        tear_down),
        cmocka_unit_test_setup_teardown(another_one_is_there_when_a_connection_ends, set_up,
                                        tear_down),
        cmocka_unit_test_setup_teardown(a_port_that_is_silent_is_given_up, set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_server_with_an_old_state_is_left, set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_new_session_may_have_any_token, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
