// Several slaves on one serial line (a pseudo terminal), each a device of its own.

#include "base/clock.h"
#include "device/device.h"
#include "test.h"

#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

enum { REQUEST_BYTES = 8, SLAVES = 3, READINGS = 60 };

static const struct device_driver *driver;

// Slaves 1 and 2 answer each request for one register with 1000 times their number and the
// register's; slave 3 never does. A request that comes before the last one was answered is a
// collision.
struct bus {
    pthread_t thread;
    int fd, other_end;
    char path[64];
    atomic_bool stop;
    atomic_int collisions, asked[SLAVES + 1];
};

// ---- the slaves, without libmodbus --------------------------------------------------------------

static uint16_t crc_of(const uint8_t *bytes, int count) {
    uint16_t crc = 0xffff;
    for (int i = 0; i < count; i++) {
        crc ^= bytes[i];
        for (int bit = 0; bit < 8; bit++)
            crc = crc & 1 ? (uint16_t)(crc >> 1 ^ 0xa001) : (uint16_t)(crc >> 1);
    }
    return crc;
}

static void answer(struct bus *bus, const uint8_t *request) {
    int slave = request[0], value = 1000 * slave + (request[2] << 8 | request[3]), waiting = 0;
    uint8_t reply[] = {(uint8_t)slave, 3, 2, (uint8_t)(value >> 8), (uint8_t)value, 0, 0};
    uint16_t crc = crc_of(reply, 5);
    reply[5] = (uint8_t)crc;
    reply[6] = (uint8_t)(crc >> 8);
    if (slave < 1 || slave > SLAVES)
        return;
    atomic_fetch_add(&bus->asked[slave], 1);
    usleep(3000); // a slave takes its time
    if (ioctl(bus->fd, FIONREAD, &waiting) == 0 && waiting)
        atomic_fetch_add(&bus->collisions, 1);
    if (slave != SLAVES)
        assert_int_equal(sizeof reply, write(bus->fd, reply, sizeof reply));
}

static void *serve(void *argument) {
    struct bus *bus = argument;
    uint8_t request[REQUEST_BYTES];
    int used = 0;
    while (!atomic_load(&bus->stop)) {
        struct pollfd ready = {.fd = bus->fd, .events = POLLIN};
        if (poll(&ready, 1, 10) <= 0)
            continue;
        ssize_t size = read(bus->fd, request + used, (size_t)(REQUEST_BYTES - used));
        used += size > 0 ? (int)size : 0;
        if (used < REQUEST_BYTES)
            continue;
        used = 0;
        answer(bus, request);
    }
    return NULL;
}

static void bus_start(struct bus *bus) {
    memset(bus, 0, sizeof *bus);
    bus->fd = posix_openpt(O_RDWR | O_NOCTTY);
    assert_true(bus->fd >= 0 && !grantpt(bus->fd) && !unlockpt(bus->fd));
    assert_int_equal(0, ptsname_r(bus->fd, bus->path, sizeof bus->path));
    bus->other_end = open(bus->path, O_RDWR | O_NOCTTY);
    struct termios raw;
    tcgetattr(bus->other_end, &raw);
    cfmakeraw(&raw);
    tcsetattr(bus->other_end, TCSANOW, &raw);
    assert_int_equal(0, pthread_create(&bus->thread, NULL, serve, bus));
}

static void bus_stop(struct bus *bus) {
    atomic_store(&bus->stop, true);
    pthread_join(bus->thread, NULL);
    close(bus->fd);
    close(bus->other_end);
}

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

static void start(struct user *user, const struct bus *bus, int slave) {
    char number[16];
    snprintf(number, sizeof number, "%d", slave);
    *user = (struct user){.device = opened(bus->path, number), .slave = slave};
    assert_int_equal(0, pthread_create(&user->thread, NULL, use, user));
}

static void two_slaves_of_one_line_are_read_by_turns(void **state) {
    (void)state;
    struct bus bus;
    struct user users[2];
    int given_up = 0;
    bus_start(&bus);
    for (int i = 0; i < 2; i++)
        start(&users[i], &bus, i + 1);
    for (int i = 0; i < 2; i++) {
        pthread_join(users[i].thread, NULL);
        assert_int_equal(users[i].readings, READINGS);
        assert_int_equal(users[i].wrong, 0);
        assert_int_equal(users[i].closings, 0);
        given_up += atomic_load(&bus.asked[i + 1]) - READINGS;
    }
    assert_true(atomic_load(&bus.collisions) <= given_up);
    for (int i = 0; i < 2; i++)
        closed(users[i].device);
    bus_stop(&bus);
}

static void a_silent_slave_is_given_up_alone(void **state) {
    (void)state;
    struct bus bus;
    struct user users[2], silent;
    bus_start(&bus);
    for (int i = 0; i < 2; i++)
        start(&users[i], &bus, i + 1);
    while (!atomic_load(&bus.asked[1]) || !atomic_load(&bus.asked[2]))
        usleep(1000);
    start(&silent, &bus, SLAVES);
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
    bus_stop(&bus);
}

static void a_line_has_one_speed(void **state) {
    (void)state;
    struct bus bus;
    struct error err;
    char name[] = "/tmp/arthron-line-XXXXXX";
    bus_start(&bus);
    assert_true(close(mkstemp(name)) == 0 && unlink(name) == 0);
    assert_int_equal(0, symlink(bus.path, name)); // as /dev/serial/by-id
    void *first = created(bus.path, "1", "115200", &err), *third;
    assert_non_null(first);
    assert_null(created(name, "2", "9600", &err));
    assert_non_null(strstr(err.text, "[device slave 1] and [device slave 2] share"));
    assert_non_null(strstr(err.text, "baud and parity must be the same"));
    assert_non_null(third = created(name, "3", "115200", &err));
    driver->destroy(first);
    driver->destroy(third);
    assert_non_null(first = created(name, "2", "9600", &err)); // the others have gone
    driver->destroy(first);
    unlink(name);
    bus_stop(&bus);
}

static void a_line_that_another_program_has_is_refused(void **state) {
    (void)state;
    struct bus bus;
    struct error err;
    bus_start(&bus);
    assert_int_equal(0, flock(bus.other_end, LOCK_EX));
    void *device = created(bus.path, "1", "115200", &err);
    assert_int_equal(RESULT_REFUSED, driver->open(device, &err));
    assert_non_null(strstr(err.text, "another program uses it"));
    assert_int_equal(0, flock(bus.other_end, LOCK_UN));
    assert_int_equal(RESULT_OK, driver->open(device, &err));
    closed(device);
    bus_stop(&bus);
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
