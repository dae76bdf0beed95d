// The queue of markers between a station and its server.
#include "link/marker_queue.h"

#include "test.h"

#include <string.h>

static struct marker_queue queue;

static int set_up(void **state) {
    (void)state;
    marker_queue_init(&queue);
    marker_queue_begin(&queue);
    return 0;
}

static int tear_down(void **state) {
    (void)state;
    marker_queue_fini(&queue);
    return 0;
}

static void put(int count) {
    for (int i = 0; i < count; i++)
        assert_true(marker_queue_put(&queue, &(struct marker){.value = i}));
}

static void assert_next(uint64_t first, uint64_t last) {
    struct marker marker;
    for (uint64_t number = first; number <= last; number++) {
        assert_true(marker_queue_next(&queue, &marker));
        assert_int_equal(marker.number, number);
    }
}

static void assert_none_next(void) {
    assert_false(marker_queue_next(&queue, &(struct marker){0}));
}

static void so_many_are_on_their_way_until_one_is_acknowledged(void **state) {
    (void)state;
    put(MARKERS_ON_WAY + 5);
    assert_next(1, MARKERS_ON_WAY);
    assert_none_next();
    marker_queue_acknowledge(&queue, 2);
    assert_next(MARKERS_ON_WAY + 1, MARKERS_ON_WAY + 2);
    assert_none_next();
}

static void a_new_connection_repeats_what_is_not_acknowledged_and_nothing_else(void **state) {
    (void)state;
    put(5);
    assert_next(1, 4);
    marker_queue_acknowledge(&queue, 2);
    marker_queue_begin(&queue);
    assert_next(3, 5);
    assert_none_next();
    marker_queue_acknowledge(&queue, 5);
    marker_queue_begin(&queue);
    assert_none_next();
}

// A server cannot take away what it was never sent.
static void an_acknowledgement_beyond_what_was_sent_loses_nothing(void **state) {
    (void)state;
    put(3);
    assert_next(1, 1);
    marker_queue_acknowledge(&queue, UINT64_MAX);
    assert_next(2, 3);
}

static void what_finds_no_room_is_lost_and_its_number_tells_so(void **state) {
    (void)state;
    put(MARKERS_QUEUED);
    assert_false(marker_queue_put(&queue, &(struct marker){0}));
    assert_next(1, MARKERS_ON_WAY);
    marker_queue_acknowledge(&queue, 1);
    put(1);
    for (uint64_t number = MARKERS_ON_WAY + 1; number <= MARKERS_QUEUED; number++) {
        assert_next(number, number);
        marker_queue_acknowledge(&queue, number);
    }
    assert_next(MARKERS_QUEUED + 2, MARKERS_QUEUED + 2); // one between is missing
    assert_none_next();
}

static void a_server_that_takes_none_gets_none_and_the_next_one_gets_new_ones(void **state) {
    (void)state;
    put(3);
    assert_int_equal(marker_queue_refuse(&queue), 3);
    assert_false(marker_queue_put(&queue, &(struct marker){0}));
    assert_none_next();
    marker_queue_begin(&queue);
    put(1);
    assert_next(5, 5);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(so_many_are_on_their_way_until_one_is_acknowledged, set_up,
                                        tear_down),
        cmocka_unit_test_setup_teardown(
            a_new_connection_repeats_what_is_not_acknowledged_and_nothing_else, set_up, tear_down),
        cmocka_unit_test_setup_teardown(an_acknowledgement_beyond_what_was_sent_loses_nothing,
                                        set_up, tear_down),
        cmocka_unit_test_setup_teardown(what_finds_no_room_is_lost_and_its_number_tells_so, set_up,
                                        tear_down),
        cmocka_unit_test_setup_teardown(
            a_server_that_takes_none_gets_none_and_the_next_one_gets_new_ones, set_up, tear_down),
    };
    return cmocka_run_group_tests_name("marker_queue", tests, NULL, NULL);
}
