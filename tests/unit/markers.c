// Markers of a station on their way into the trace of its session.
#include "base/clock.h"
#include "test.h"
#include "trace/player.h"
#include "unit/hall.h"

#include <string.h>

static atomic_uint_fast64_t acknowledged; // the last number that the station was told

bool __wrap_control_send(struct control *control, struct control_peer peer,
                         const arthron_Control *message);
bool __wrap_control_send(struct control *control, struct control_peer peer,
                         const arthron_Control *message) {
    (void)control;
    (void)peer;
    if (message->which_message == arthron_Control_marker_ack_tag)
        atomic_store(&acknowledged, message->message.marker_ack.number);
    return true;
}

// A disk that has at once what is written. One test waits for the real one, which takes a second.
static atomic_bool disk_is_real;

bool __real_trace_is_on_disk(const struct trace_writer *writer, uint64_t position);
bool __wrap_trace_is_on_disk(const struct trace_writer *writer, uint64_t position);
bool __wrap_trace_is_on_disk(const struct trace_writer *writer, uint64_t position) {
    return !atomic_load(&disk_is_real) || __real_trace_is_on_disk(writer, position);
}

static void assert_acknowledged(uint64_t number) {
    for (int i = 0; i < 10000 && atomic_load(&acknowledged) != number; i++)
        hall_wait_ms(1);
    assert_int_equal(atomic_load(&acknowledged), number);
}

#define MOST 1000

struct found {
    int count;
    struct marker markers[MOST];
};

static bool take(void *user, const struct marker *marker) {
    struct found *found = user;
    assert_true(found->count < MOST);
    found->markers[found->count++] = *marker;
    return true;
}

static struct found *find(const char *trace) {
    static struct found found;
    struct trace_player player = {.user = &found, .marker = take};
    struct trace_reader *reader;
    found.count = 0;
    assert_int_equal(trace_reader_create(trace, &reader, NULL), RESULT_OK);
    trace_play(reader, &player, NULL);
    trace_reader_destroy(&reader);
    return &found;
}

// What was appended comes into the file within 20 ms.
static struct found *find_all(const char *trace, int count) {
    struct found *found = find(trace);
    for (int i = 0; i < 1000 && found->count < count; i++, found = find(trace))
        hall_wait_ms(10);
    assert_int_equal(found->count, count);
    return found;
}

static struct sessions *begin(void) {
    struct sessions *sessions = hall_open();
    atomic_store(&acknowledged, 0);
    atomic_store(&disk_is_real, false);
    hall_join(sessions);
    return sessions;
}

static void a_marker_is_acknowledged_once_it_is_in_the_file_with_its_time(void **state) {
    (void)state;
    struct sessions *sessions = begin();
    struct station_status status = hall_status(sessions);
    atomic_store(&disk_is_real, true);
    int64_t time_ns = clock_now_ns(); // the station's clock is the server's
    hall_mark(sessions, 1, time_ns);
    assert_acknowledged(1);
    const struct found *found = find(status.about.trace);
    assert_int_equal(found->count, 1);
    assert_int_equal(found->markers[0].time_ns, time_ns);
    assert_int_equal(found->markers[0].run, 1);
    assert_string_equal(found->markers[0].name, "start");
    assert_string_equal(found->markers[0].device, "pedal");
    sessions_destroy(&sessions);
}

static void what_comes_again_is_acknowledged_again_and_not_recorded_twice(void **state) {
    (void)state;
    struct sessions *sessions = begin();
    struct station_status status = hall_status(sessions);
    int64_t time_ns = clock_now_ns();
    hall_mark(sessions, 1, time_ns);
    hall_mark(sessions, 4, time_ns + 1); // two between were lost at the station
    assert_acknowledged(4);
    hall_leave(sessions);
    atomic_store(&acknowledged, 0);
    hall_connect(sessions, 1);
    hall_wait_ms(50); // until the worker knows of the connection
    hall_mark(sessions, 1, time_ns);
    hall_mark(sessions, 4, time_ns + 1);
    assert_acknowledged(4);
    hall_mark(sessions, 5, time_ns - 1); // late, and before the others
    assert_acknowledged(5);
    const struct found *found = find_all(status.about.trace, 3);
    assert_int_equal(found->markers[1].number, 4);
    assert_int_equal(found->markers[2].time_ns, time_ns - 1);
    sessions_destroy(&sessions);
}

static void another_run_of_the_station_numbers_anew(void **state) {
    (void)state;
    struct sessions *sessions = begin();
    struct station_status status = hall_status(sessions);
    hall_mark(sessions, 9, clock_now_ns());
    assert_acknowledged(9);
    hall_leave(sessions);
    hall_connect(sessions, 2);
    hall_wait_ms(50);
    hall_mark(sessions, 1, clock_now_ns());
    assert_acknowledged(1);
    const struct found *found = find_all(status.about.trace, 2);
    assert_int_equal(found->markers[1].run, 2);
    sessions_destroy(&sessions);
}

static void what_is_not_of_the_sessions_time_is_counted_and_not_recorded(void **state) {
    (void)state;
    struct sessions *sessions = begin();
    struct station_status status = hall_status(sessions);
    hall_mark(sessions, 1, status.about.start_ns - 1);
    hall_mark(sessions, 2, clock_now_ns() + 60 * NS_PER_S);
    hall_mark(sessions, 3, status.about.start_ns);
    assert_acknowledged(3);
    assert_int_equal(atomic_load(&hall_counts(sessions)->markers_refused), 2);
    const struct found *found = find_all(status.about.trace, 1);
    assert_int_equal(found->markers[0].number, 3);
    sessions_destroy(&sessions);
}

// A session that follows another one gets none of its markers.
static void a_session_that_follows_does_not_record_what_the_one_before_has(void **state) {
    (void)state;
    struct sessions *sessions = begin();
    hall_mark(sessions, 1, clock_now_ns());
    assert_acknowledged(1);
    atomic_store(&acknowledged, 0);
    hall_command(sessions, arthron_Command_Kind_CASE);
    while (hall_status(sessions).state != SESSION_RUNNING)
        hall_wait_ms(1);
    hall_mark(sessions, 1, clock_now_ns());
    hall_mark(sessions, 2, clock_now_ns());
    assert_acknowledged(2);
    const struct found *found = find_all(hall_status(sessions).about.trace, 1);
    assert_int_equal(found->markers[0].number, 2);
    sessions_destroy(&sessions);
}

// What comes too fast waits, or is dropped and has to come again: never is one lost that is
// acknowledged.
static void a_flood_is_slowed_down_and_loses_nothing_that_is_acknowledged(void **state) {
    (void)state;
    enum { FLOOD = 2000 };
    struct sessions *sessions = begin();
    struct station_status status = hall_status(sessions);
    for (uint64_t number = 1; number <= FLOOD; number++)
        hall_mark(sessions, number, clock_now_ns());
    for (int i = 0; i < 10000 && !atomic_load(&acknowledged); i++)
        hall_wait_ms(1);
    hall_wait_ms(100);
    uint64_t last = atomic_load(&acknowledged);
    const struct found *found = find(status.about.trace);
    assert_true(last > 0 && found->count > 0 && found->count < 400);
    for (int i = 1; i < found->count; i++)
        assert_true(found->markers[i].number > found->markers[i - 1].number);
    sessions_destroy(&sessions);
}

static void pages_get_each_marker_of_their_session_once(void **state) {
    (void)state;
    struct sessions *sessions = begin();
    struct station_status status = hall_status(sessions);
    struct marker out[3];
    uint64_t told = 0;
    for (uint64_t number = 1; number <= 5; number++)
        hall_mark(sessions, number, clock_now_ns());
    assert_acknowledged(5);
    uint64_t serial = status.about.serial;
    assert_int_equal(sessions_markers(sessions, 0, serial + 1, &told, out, 3), 0);
    assert_int_equal(sessions_markers(sessions, 0, serial, &told, out, 3), 3);
    assert_int_equal(out[2].number, 3);
    assert_int_equal(sessions_markers(sessions, 0, serial, &told, out, 3), 2);
    assert_int_equal(out[1].number, 5);
    assert_int_equal(sessions_markers(sessions, 0, serial, &told, out, 3), 0);
    sessions_destroy(&sessions);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_marker_is_acknowledged_once_it_is_in_the_file_with_its_time),
        cmocka_unit_test(what_comes_again_is_acknowledged_again_and_not_recorded_twice),
        cmocka_unit_test(another_run_of_the_station_numbers_anew),
        cmocka_unit_test(what_is_not_of_the_sessions_time_is_counted_and_not_recorded),
        cmocka_unit_test(a_session_that_follows_does_not_record_what_the_one_before_has),
        cmocka_unit_test(a_flood_is_slowed_down_and_loses_nothing_that_is_acknowledged),
        cmocka_unit_test(pages_get_each_marker_of_their_session_once),
    };
    return cmocka_run_group_tests_name("markers", tests, hall_make, hall_remove);
}
