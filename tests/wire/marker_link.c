// Markers between a station's link and a control room: what is not acknowledged comes again.
#include "base/clock.h"
#include "link/link.h"
#include "net/control_parts.h"
#include "test.h"
#include "wire/test_server.h"

#include <string.h>
#include <unistd.h>

static struct test_server test_server;
static char anna[128];
static atomic_bool is_old; // the server: it knows no markers

static struct {
    atomic_int count;
    arthron_Marker markers[64];
} heard;

static void on_message(struct test_server *server, struct control_peer peer,
                       const arthron_Control *message) {
    (void)server;
    (void)peer;
    int count = atomic_load(&heard.count);
    assert_int_equal(message->which_message, arthron_Control_marker_tag);
    assert_true(count < 64);
    heard.markers[count] = message->message.marker;
    atomic_store(&heard.count, count + 1);
}

void __real_control_send_urgent(struct peer *peer, const arthron_Control *message, bool last);
void __wrap_control_send_urgent(struct peer *peer, const arthron_Control *message, bool last);
void __wrap_control_send_urgent(struct peer *peer, const arthron_Control *message, bool last) {
    arthron_Control changed = *message;
    arthron_Welcome *welcome = &changed.message.welcome;
    if (atomic_load(&is_old) && message->which_message == arthron_Control_welcome_tag)
        for (int i = 0; i < welcome->capabilities_count; i++)
            if (!strcmp(welcome->capabilities[i], "markers"))
                strcpy(welcome->capabilities[i], "x");
    __real_control_send_urgent(peer, &changed, last);
}

static int set_up(void **state) {
    (void)state;
    test_server = (struct test_server){.on_mesh = on_message};
    atomic_store(&heard.count, 0);
    atomic_store(&is_old, false);
    test_server_open(&test_server);
    test_server_enrol(&test_server, "anna", anna);
    return 0;
}

static int tear_down(void **state) {
    (void)state;
    test_server_close(&test_server);
    return 0;
}

static struct link *new_link(void) {
    struct link_config config = {.server_count = 1,
                                 .servers = {{"localhost", test_server.port}},
                                 .keys_dir = anna,
                                 .station = "anna",
                                 .software = "test",
                                 .markers = true};
    struct link *link;
    struct error err;
    if (link_create(&config, &link, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return link;
}

static bool mark(struct link *link, const char *name) {
    struct marker marker = {.time_ns = clock_now_ns(), .value = 1, .device = "pedal"};
    strcpy(marker.name, name);
    return link_mark(link, &marker);
}

static void acknowledge(uint64_t number) {
    arthron_Control message = {.which_message = arthron_Control_marker_ack_tag};
    message.message.marker_ack.number = number;
    assert_true(control_send(test_server.control, test_server.peer, &message));
}

static void restart(struct link *link) {
    uint64_t connects;
    struct link_status status;
    link_get_status(link, &status);
    connects = status.connects;
    test_server_stop(&test_server);
    test_server_start(&test_server);
    for (int i = 0; i < 5000 && status.connects == connects; i++) {
        usleep(2000);
        link_get_status(link, &status);
    }
    assert_int_equal(status.connects, connects + 1);
}

static void assert_heard(int from, int count, const uint64_t *numbers) {
    assert_true(wait_for(&heard.count, from + count));
    for (int i = 0; i < count; i++)
        assert_int_equal(heard.markers[from + i].number, numbers[i]);
}

static void what_is_not_acknowledged_comes_again_with_each_connection(void **state) {
    (void)state;
    test_server_stop(&test_server);
    struct link *link = new_link();
    assert_true(mark(link, "one"));
    assert_true(mark(link, "two"));
    test_server_start(&test_server);
    assert_heard(0, 2, (uint64_t[]){1, 2});
    assert_string_equal(heard.markers[1].name, "two");
    assert_string_equal(heard.markers[1].device, "pedal");
    restart(link);
    assert_heard(2, 2, (uint64_t[]){1, 2});
    acknowledge(1);
    assert_true(mark(link, "three"));
    assert_heard(4, 1, (uint64_t[]){3}); // behind the acknowledgement
    restart(link);
    assert_heard(5, 2, (uint64_t[]){2, 3});
    usleep(50000);
    assert_int_equal(atomic_load(&heard.count), 7);
    link_destroy(&link);
}

static void a_server_that_knows_none_is_sent_none(void **state) {
    (void)state;
    atomic_store(&is_old, true);
    struct link *link = new_link();
    assert_true(mark(link, "too early to know"));
    assert_true(wait_for(&test_server.clocks, 2));
    assert_false(mark(link, "lost"));
    atomic_store(&is_old, false);
    restart(link);
    for (int i = 0; i < 5000 && !mark(link, "kept"); i++)
        usleep(2000);
    assert_true(wait_for(&heard.count, 1));
    assert_string_equal(heard.markers[0].name, "kept");
    link_destroy(&link);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(what_is_not_acknowledged_comes_again_with_each_connection,
                                        set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_server_that_knows_none_is_sent_none, set_up, tear_down),
    };
    return cmocka_run_group_tests_name("marker_link", tests, NULL, NULL);
}
