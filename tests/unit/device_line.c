// Several slaves on one serial line (a pseudo terminal), each a device of its own.

#include "base/clock.h"
#include "drivers/device.h"
#include "other_slaves.h"
#include "test.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <unistd.h>

enum { SILENT = OTHER_SLAVES, READINGS = 60 };

static const struct device_driver *driver;

// ---- the devices --------------------------------------------------------------------------------

static void *created(const char *path, const char *slave, const char *baud, struct error *err) {
    const struct device_option options[] = {
        {"serial", path},   {"slave", slave},     {"baud", baud},       {"flexion", "7"},
        {"rate_hz", "200"}, {"timeout_ms", "60"}, {"latency_ms", "20"},
    };
    struct device_config config = {"", options, sizeof options / sizeof *options};
    snprintf(config.name, sizeof config.name, "slave %s", slave);
    struct device_outputs outputs = {0};
    void *device = NULL;
    return driver->create(&config, &device, &outputs, err) == RESULT_OK ? device : NULL;
}

static void *opened(const char *path, const char *slave) {
    struct error err;
    void *device = created(path, slave, "115200", &err);
    if (!device || driver->open(device, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return device;
}

static void closed(void *device) {
    driver->close(device);
    driver->destroy(device);
}

struct user {
    pthread_t thread;
    void *device;
    int slave, readings, wrong, closings, malformed;
};

// A busy machine may make a reply late, and its request be given up.
static void *use(void *argument) {
    struct user *user = argument;
    int64_t end_ns = clock_now_ns() + 30 * NS_PER_S;
    while (user->readings < READINGS && clock_now_ns() < end_ns) {
        struct device_reading reading = {0};
        struct error err;
        enum result result = driver->poll(user->device, &reading, &err);
        user->closings += result == RESULT_CLOSED;
        user->malformed += reading.malformed;
        user->readings += reading.count;
        for (int i = 0; i < reading.count; i++)
            user->wrong += reading.samples[i].joint.flexion_deg != 1000 * user->slave + 7;
        if (result == RESULT_CLOSED)
            break;
    }
    return NULL;
}

static void start(struct user *user, const struct other_slaves *bus, int slave) {
    char number[16];
    snprintf(number, sizeof number, "%d", slave);
    *user = (struct user){.device = opened(bus->name, number), .slave = slave};
    assert_int_equal(0, pthread_create(&user->thread, NULL, use, user));
}

static void two_slaves_of_one_line_are_read_by_turns(void **state) {
    (void)state;
    struct other_slaves bus;
    struct user users[2];
    int given_up = 0;
    other_slaves_start(&bus);
    for (int i = 0; i < 2; i++)
        start(&users[i], &bus, i + 1);
    for (int i = 0; i < 2; i++) {
        pthread_join(users[i].thread, NULL);
        assert_int_equal(users[i].readings, READINGS);
        assert_int_equal(users[i].wrong, 0);
        assert_int_equal(users[i].closings, 0);
        given_up += atomic_load(&bus.each[i + 1].asked) - READINGS;
    }
    assert_true(atomic_load(&bus.collisions) <= given_up);
    for (int i = 0; i < 2; i++)
        closed(users[i].device);
    other_slaves_stop(&bus);
}

static void a_silent_slave_is_given_up_alone(void **state) {
    (void)state;
    struct other_slaves bus;
    struct user users[2], silent;
    other_slaves_start(&bus);
    for (int i = 0; i < 2; i++)
        start(&users[i], &bus, i + 1);
    while (!atomic_load(&bus.each[1].asked) || !atomic_load(&bus.each[2].asked))
        usleep(1000);
    atomic_store(&bus.each[SILENT].silent, true);
    start(&silent, &bus, SILENT);
    pthread_join(silent.thread, NULL);
    assert_int_equal(silent.closings, 1);
    assert_int_equal(silent.readings, 0);
    driver->close(silent.device);
    driver->destroy(silent.device);
    for (int i = 0; i < 2; i++) {
        pthread_join(users[i].thread, NULL);
        assert_int_equal(users[i].readings, READINGS);
        assert_int_equal(users[i].wrong + users[i].closings, 0);
        closed(users[i].device);
    }
    other_slaves_stop(&bus);
}

static void a_line_has_one_speed(void **state) {
    (void)state;
    struct other_slaves bus;
    struct error err;
    char name[] = "/tmp/arthron-line-XXXXXX";
    other_slaves_start(&bus);
    assert_true(close(mkstemp(name)) == 0 && unlink(name) == 0);
    assert_int_equal(0, symlink(bus.name, name)); // as /dev/serial/by-id
    void *first = created(bus.name, "1", "115200", &err), *third;
    assert_non_null(first);
    assert_null(created(name, "2", "9600", &err));
    assert_non_null(strstr(err.text, "[device slave 1] and [device slave 2] share"));
    assert_non_null(strstr(err.text, "baud, parity, stop_bits and echo must be the same"));
    assert_non_null(third = created(name, "3", "115200", &err));
    driver->destroy(first);
    driver->destroy(third);
    assert_non_null(first = created(name, "2", "9600", &err)); // the others have gone
    driver->destroy(first);
    unlink(name);
    other_slaves_stop(&bus);
}

static void a_line_that_another_program_has_is_refused(void **state) {
    (void)state;
    struct other_slaves bus;
    struct error err;
    other_slaves_start(&bus);
    assert_int_equal(0, flock(bus.other_end, LOCK_EX));
    void *device = created(bus.name, "1", "115200", &err);
    assert_int_equal(RESULT_REFUSED, driver->open(device, &err));
    assert_non_null(strstr(err.text, "another program uses it"));
    assert_int_equal(0, flock(bus.other_end, LOCK_UN));
    assert_int_equal(RESULT_OK, driver->open(device, &err));
    closed(device);
    other_slaves_stop(&bus);
}

int main(void) {
    driver = device_driver("modbus");
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(two_slaves_of_one_line_are_read_by_turns),
        cmocka_unit_test(a_silent_slave_is_given_up_alone),
        cmocka_unit_test(a_line_has_one_speed),
        cmocka_unit_test(a_line_that_another_program_has_is_refused),
    };
    return cmocka_run_group_tests_name("device_line", tests, NULL, NULL);
}
