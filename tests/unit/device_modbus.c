// The modbus driver against slaves that misbehave, on a serial line (a pseudo terminal).

#include "base/clock.h"
#include "drivers/device.h"
#include "test.h"

#include <fcntl.h>
#include <modbus.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

enum { REGISTERS = 8 };

static const struct device_driver *driver;

// Register 0 counts the requests that came, so that a reading tells which request it answers;
// register 1 + i is 100 + i.
struct slave {
    pthread_t thread;
    modbus_t *line;
    modbus_mapping_t *mapping;
    int fd, other_end;
    char path[64];
    atomic_bool stop, silent;
    atomic_int received;
    atomic_int late_ms, late_every;
    atomic_int sequence; // >= 0: stands in register 0 instead
};

static void answer(struct slave *s, const uint8_t *request, int length) {
    int received = atomic_fetch_add(&s->received, 1) + 1;
    int every = atomic_load(&s->late_every), fixed = atomic_load(&s->sequence);
    s->mapping->tab_registers[0] = (uint16_t)(fixed >= 0 ? fixed : received);
    if (every && received % every == 0)
        usleep((unsigned)atomic_load(&s->late_ms) * 1000);
    if (!atomic_load(&s->silent))
        modbus_reply(s->line, request, length, s->mapping);
}

static void *serve(void *argument) {
    struct slave *s = argument;
    while (!atomic_load(&s->stop)) {
        uint8_t request[MODBUS_MAX_ADU_LENGTH];
        struct pollfd ready = {.fd = s->fd, .events = POLLIN};
        if (poll(&ready, 1, 10) <= 0)
            continue;
        int length = modbus_receive(s->line, request);
        if (length > 0)
            answer(s, request, length);
        else
            usleep(1000);
    }
    return NULL;
}

static void slave_start(struct slave *s) {
    memset(s, 0, sizeof *s);
    atomic_store(&s->sequence, -1);
    s->fd = posix_openpt(O_RDWR | O_NOCTTY);
    assert_true(s->fd >= 0 && !grantpt(s->fd) && !unlockpt(s->fd));
    assert_int_equal(0, ptsname_r(s->fd, s->path, sizeof s->path));
    s->other_end = open(s->path, O_RDWR | O_NOCTTY);
    struct termios raw;
    tcgetattr(s->other_end, &raw);
    cfmakeraw(&raw);
    tcsetattr(s->other_end, TCSANOW, &raw);
    s->line = modbus_new_rtu(s->path, 115200, 'N', 8, 1);
    s->mapping = modbus_mapping_new(0, 0, REGISTERS, 0);
    modbus_set_slave(s->line, 1);
    modbus_set_socket(s->line, s->fd);
    for (int i = 1; i < REGISTERS; i++)
        s->mapping->tab_registers[i] = (uint16_t)(100 + i);
    assert_int_equal(0, pthread_create(&s->thread, NULL, serve, s));
}

static void slave_stop(struct slave *s) {
    atomic_store(&s->stop, true);
    pthread_join(s->thread, NULL);
    close(s->fd);
    close(s->other_end);
    modbus_mapping_free(s->mapping);
    modbus_free(s->line);
}

// ---- the driver ---------------------------------------------------------------------------------

static void *opened(const struct slave *s, const char *varus, const char *sequence,
                    const char *latency_ms) {
    const struct device_option options[] = {
        {"serial", s->path}, {"rate_hz", "500"},         {"timeout_ms", "60"},  {"flexion", "0"},
        {"varus", varus},    {"latency_ms", latency_ms}, {"sequence", sequence}};
    struct device_config config = {"encoders", options, sequence ? 7 : 6};
    struct device_outputs outputs = {0};
    struct error err = {{0}};
    void *device = NULL;
    if (driver->create(&config, &device, &outputs, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    assert_int_equal(1, outputs.count);
    if (driver->open(device, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return device;
}

static void closed(void *device) {
    driver->close(device);
    driver->destroy(device);
}

static enum result polled(void *device, struct device_reading *out, struct error *err) {
    *out = (struct device_reading){0};
    return driver->poll(device, out, err);
}

// Polls until something other than an empty RESULT_OK comes.
static enum result next(void *device, struct device_reading *out, struct error *err) {
    enum result result;
    do
        result = polled(device, out, err);
    while (result == RESULT_OK && !out->count);
    return result;
}

// The same, but a reply that a busy machine made late is waited for again.
static enum result answered(void *device, struct device_reading *out, struct error *err) {
    enum result result;
    do
        result = next(device, out, err);
    while (result == RESULT_TIMEOUT);
    return result;
}

static void readings_answer_the_newest_request(void **state) {
    (void)state;
    struct slave slave;
    slave_start(&slave);
    void *device = opened(&slave, "7", "0", "200");
    for (int i = 0; i < 100; i++) {
        struct device_reading r;
        struct error err;
        assert_int_equal(RESULT_OK, answered(device, &r, &err));
        assert_int_equal(1, r.count);
        assert_near(r.samples[0].joint.flexion_deg, atomic_load(&slave.received), 0);
        assert_near(r.samples[0].joint.varus_deg, 107, 0);
        assert_true(llabs(clock_now_ns() - r.samples[0].time_ns) < NS_PER_S);
    }
    closed(device);
    slave_stop(&slave);
}

// A driver that took up with its next request after the time-out would be one reply behind for
// ever.
static void late_replies_never_shift_values(void **state) {
    (void)state;
    struct slave slave;
    slave_start(&slave);
    atomic_store(&slave.late_ms, 150);
    atomic_store(&slave.late_every, 6);
    void *device = opened(&slave, "7", "0", "400");
    int readings = 0, timeouts = 0;
    while (readings < 30) {
        struct device_reading r;
        struct error err;
        enum result result = next(device, &r, &err);
        timeouts += result == RESULT_TIMEOUT;
        if (result == RESULT_OK)
            assert_near(r.samples[0].joint.flexion_deg, atomic_load(&slave.received), 0);
        else
            assert_int_equal(RESULT_TIMEOUT, result);
        readings += result == RESULT_OK;
    }
    assert_true(timeouts >= 4);
    closed(device);
    slave_stop(&slave);
}

// Later than latency_ms promises: a wrong reply cannot be told from a right one, but what then
// waits on the line can.
static void a_line_out_of_step_comes_into_step_again(void **state) {
    (void)state;
    struct slave slave;
    slave_start(&slave);
    void *device = opened(&slave, "7", "0", "10");
    struct device_reading r;
    struct error err;
    assert_int_equal(RESULT_OK, answered(device, &r, &err));
    atomic_store(&slave.late_ms, 200);
    atomic_store(&slave.late_every, 1);
    while (next(device, &r, &err) != RESULT_TIMEOUT)
        ;
    atomic_store(&slave.late_every, 0);
    int in_step = 0;
    for (int i = 0; i < 500 && in_step < 50; i++) {
        enum result result = next(device, &r, &err);
        if (result == RESULT_CLOSED) {
            driver->close(device);
            assert_int_equal(RESULT_OK, driver->open(device, &err));
        }
        bool right =
            result == RESULT_OK && r.samples[0].joint.flexion_deg == atomic_load(&slave.received);
        in_step = right ? in_step + 1 : 0;
    }
    assert_int_equal(50, in_step);
    closed(device);
    slave_stop(&slave);
}

static void junk_on_the_line_is_counted_and_thrown_away(void **state) {
    (void)state;
    struct slave slave;
    slave_start(&slave);
    void *device = opened(&slave, "7", "0", "20");
    struct device_reading r;
    struct error err;
    assert_int_equal(RESULT_OK, answered(device, &r, &err));
    assert_int_equal(5, write(slave.fd, "noise", 5));
    assert_int_equal(RESULT_FORMAT, answered(device, &r, &err));
    assert_int_equal(1, r.malformed);
    assert_int_equal(RESULT_OK, answered(device, &r, &err));
    assert_near(r.samples[0].joint.flexion_deg, atomic_load(&slave.received), 0);
    closed(device);
    slave_stop(&slave);
}

static void a_silent_slave_is_given_up_and_opened_again(void **state) {
    (void)state;
    struct slave slave;
    slave_start(&slave);
    atomic_store(&slave.silent, true);
    void *device = opened(&slave, "7", "0", "20");
    struct device_reading r;
    struct error err;
    for (int i = 0; i < 3; i++) {
        assert_int_equal(RESULT_TIMEOUT, next(device, &r, &err));
        assert_non_null(strstr(err.text, "registers 0 to 7: no reply within 60 ms"));
    }
    assert_int_equal(RESULT_CLOSED, next(device, &r, &err));
    atomic_store(&slave.silent, false);
    driver->close(device);
    assert_int_equal(RESULT_OK, driver->open(device, &err));
    assert_int_equal(RESULT_OK, answered(device, &r, &err));
    closed(device);
    slave_stop(&slave);
}

static void a_line_that_is_pulled_out_is_closed(void **state) {
    (void)state;
    struct slave slave;
    slave_start(&slave);
    void *device = opened(&slave, "7", "0", "20");
    struct device_reading r;
    struct error err;
    assert_int_equal(RESULT_OK, answered(device, &r, &err));
    slave_stop(&slave);
    assert_int_equal(RESULT_CLOSED, answered(device, &r, &err));
    assert_non_null(strstr(err.text, slave.path));
    closed(device);
}

static void a_slave_without_these_registers_says_so(void **state) {
    (void)state;
    struct slave slave;
    slave_start(&slave);
    void *device = opened(&slave, "20", "0", "20");
    for (int i = 0; i < 3; i++) {
        struct device_reading r;
        struct error err;
        assert_int_equal(RESULT_FORMAT, answered(device, &r, &err));
        assert_non_null(strstr(err.text, "slave 1, registers 0 to 20: Illegal data address"));
        assert_int_equal(1, r.malformed);
    }
    closed(device);
    slave_stop(&slave);
}

static void a_sequence_that_stands_still_is_no_new_reading(void **state) {
    (void)state;
    struct slave slave;
    slave_start(&slave);
    atomic_store(&slave.sequence, 65535);
    void *device = opened(&slave, "7", "0", "20");
    struct device_reading r;
    struct error err;
    assert_int_equal(RESULT_OK, answered(device, &r, &err));
    for (int i = 0; i < 20; i++) {
        assert_int_equal(RESULT_OK, polled(device, &r, &err));
        assert_int_equal(0, r.count);
    }
    atomic_store(&slave.sequence, 0); // wraps round
    assert_int_equal(RESULT_OK, answered(device, &r, &err));
    assert_near(r.samples[0].joint.flexion_deg, 0, 0);
    atomic_store(&slave.sequence, 65000);
    assert_int_equal(RESULT_FORMAT, answered(device, &r, &err));
    assert_non_null(strstr(err.text, "register 0: the sequence went back"));
    enum result result;
    while ((result = answered(device, &r, &err)) == RESULT_FORMAT)
        assert_non_null(strstr(err.text, "went back"));
    assert_int_equal(RESULT_OK, result); // a slave that was started again
    closed(device);
    slave_stop(&slave);
}

static void values_that_change_under_one_sequence_are_refused(void **state) {
    (void)state;
    struct slave slave;
    slave_start(&slave);
    void *device = opened(&slave, "3", "7", "20"); // register 7 never changes, register 0 does
    struct device_reading r;
    struct error err;
    assert_int_equal(RESULT_OK, answered(device, &r, &err));
    assert_int_equal(RESULT_FORMAT, answered(device, &r, &err));
    assert_non_null(strstr(err.text, "register 7: the sequence stood still while values changed"));
    closed(device);
    slave_stop(&slave);
}

static void registers_are_scaled_moved_and_signed_as_the_config_says(void **state) {
    (void)state;
    static const struct {
        const char *config;
        uint16_t word;
        double value;
    } rows[] = {
        {"2", 65535, -1},
        {"2 0.01", 32768, -327.68},
        {"2 0.01 5", 250, 7.5},
        {"2 -0.5 -1", 65534, 0},
        {"2 1 0 unsigned", 65535, 65535},
        {"2 unsigned", 40000, 40000},
        {"2 1 0 signed", 65535, -1},
        {"  2\t2  ", 3, 6},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct slave slave;
        slave_start(&slave);
        slave.mapping->tab_registers[2] = rows[i].word;
        void *device = opened(&slave, rows[i].config, NULL, "20");
        struct device_reading r;
        struct error err;
        assert_int_equal(RESULT_OK, answered(device, &r, &err));
        assert_near(r.samples[0].joint.varus_deg, rows[i].value, 1e-9);
        closed(device);
        slave_stop(&slave);
    }
}

// An encoder of 12 bits whose word begins anew at 20 degrees.
static void an_encoder_that_begins_anew_goes_on_counting(void **state) {
    (void)state;
    static const struct {
        uint16_t word;
        double flexion_deg;
    } rows[] = {{4096 - 1024, 20 - 90}, {4095, 20 - 360.0 / 4096}, {0, 20}, {1024, 110}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct slave slave;
        slave_start(&slave);
        slave.mapping->tab_registers[2] = rows[i].word;
        const struct device_option options[] = {{"serial", slave.path},
                                                {"flexion", "2 0.087890625 20 u12"},
                                                {"shift", "2 1 0 u12"},
                                                {"turn", "4096"}};
        struct device_config config = {"encoders", options, 4};
        struct device_outputs outputs = {0};
        struct device_reading r;
        struct error err;
        void *device;
        assert_int_equal(RESULT_OK, driver->create(&config, &device, &outputs, &err));
        assert_int_equal(RESULT_OK, driver->open(device, &err));
        assert_int_equal(RESULT_OK, answered(device, &r, &err));
        assert_near(r.samples[0].joint.flexion_deg, rows[i].flexion_deg, 1e-9);
        assert_near(r.samples[0].joint.shift_mm, rows[i].word, 1e-9); // no angle
        closed(device);
        slave_stop(&slave);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(readings_answer_the_newest_request),
        cmocka_unit_test(late_replies_never_shift_values),
        cmocka_unit_test(a_line_out_of_step_comes_into_step_again),
        cmocka_unit_test(junk_on_the_line_is_counted_and_thrown_away),
        cmocka_unit_test(a_silent_slave_is_given_up_and_opened_again),
        cmocka_unit_test(a_line_that_is_pulled_out_is_closed),
        cmocka_unit_test(a_slave_without_these_registers_says_so),
        cmocka_unit_test(a_sequence_that_stands_still_is_no_new_reading),
        cmocka_unit_test(values_that_change_under_one_sequence_are_refused),
        cmocka_unit_test(registers_are_scaled_moved_and_signed_as_the_config_says),
        cmocka_unit_test(an_encoder_that_begins_anew_goes_on_counting),
    };
    driver = device_driver("modbus");
    return cmocka_run_group_tests_name("device_modbus", tests, NULL, NULL);
}
