// Slaves of another make that share a line: their types of registers, and what one of them does to
// the others.

#include "base/clock.h"
#include "drivers/device.h"
#include "other_slaves.h"
#include "samples/runner.h"
#include "test.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum { OPTIONS_MAX = 12, ENOUGH = 20, LATE = 1, PROMPT = 2, DEAD = 3 };

static const struct device_driver *driver;

static struct device_config config_of(const char *name, const struct device_option *options) {
    struct device_config config = {"", options, 0};
    snprintf(config.name, sizeof config.name, "%s", name);
    while (config.option_count < OPTIONS_MAX && options[config.option_count].key)
        config.option_count++;
    return config;
}

// The first reading that comes.
static struct joint_angles read_once(const struct device_option *options) {
    struct device_config config = config_of("encoders", options);
    struct device_outputs outputs = {0};
    struct device_reading reading = {0};
    struct error err = {{0}};
    void *device;
    if (driver->create(&config, &device, &outputs, &err) != RESULT_OK ||
        driver->open(device, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    for (int i = 0; i < 50 && !reading.count; i++)
        driver->poll(device, &reading, &err);
    if (!reading.count)
        fail_msg("no reading: %s", err.text);
    driver->close(device);
    driver->destroy(device);
    return reading.samples[0].joint;
}

// 3.14 and 100000 (17 bits) and -2 in the words that a slave of that order sends.
static void values_of_two_input_registers_are_read_in_each_order(void **state) {
    (void)state;
    static const struct {
        const char *order;
        uint16_t words[6];
    } rows[] = {
        {"ABCD", {0x4048, 0xf5c3, 0x0001, 0x86a0, 0xffff, 0xfffe}},
        {"CDAB", {0xf5c3, 0x4048, 0x86a0, 0x0001, 0xfffe, 0xffff}},
        {"BADC", {0x4840, 0xc3f5, 0x0100, 0xa086, 0xffff, 0xfeff}},
        {"DCBA", {0xc3f5, 0x4840, 0xa086, 0x0100, 0xfeff, 0xffff}},
    };
    struct other_slaves slaves;
    other_slaves_start(&slaves);
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        memcpy(slaves.inputs, rows[i].words, sizeof rows[i].words);
        const struct device_option options[OPTIONS_MAX] = {
            {"serial", slaves.name},      {"stop_bits", "2"},       {"first_register", "30001"},
            {"order", rows[i].order},     {"flexion", "30001 f32"}, {"varus", "30003 0.001 u17"},
            {"internal", "30005 1 0 i32"}};
        struct joint_angles joint = read_once(options);
        assert_near(joint.flexion_deg, (double)3.14F, 0);
        assert_near(joint.varus_deg, 100, 1e-9);
        assert_near(joint.internal_deg, -2, 0);
    }
    other_slaves_stop(&slaves);
}

static void registers_are_counted_as_the_maker_does(void **state) {
    (void)state;
    static const struct {
        const char *first, *registers, *flexion;
        double value;
    } rows[] = {{"0", "holding", "7", 2007},    {"1", "holding", "7", 2006},
                {"40001", NULL, "40008", 2007}, {"400001", "holding", "400008", 2007},
                {"1", "input", "3", 302},       {"300001", NULL, "300004", 303}};
    struct other_slaves slaves;
    other_slaves_start_gateway(&slaves);
    for (int i = 0; i < OTHER_INPUTS; i++)
        slaves.inputs[i] = (uint16_t)(300 + i);
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        const struct device_option options[OPTIONS_MAX] = {
            {"address", slaves.name},
            {"slave", "2"},
            {"first_register", rows[i].first},
            {"flexion", rows[i].flexion},
            {rows[i].registers ? "registers" : NULL, rows[i].registers}};
        assert_near(read_once(options).flexion_deg, rows[i].value, 0);
    }
    other_slaves_stop(&slaves);
}

static void an_echo_is_passed_over_where_the_config_says_that_there_is_one(void **state) {
    (void)state;
    struct other_slaves slaves;
    other_slaves_start(&slaves);
    atomic_store(&slaves.echo, true);
    const struct device_option options[OPTIONS_MAX] = {
        {"serial", slaves.name}, {"echo", "yes"}, {"flexion", "5"}, {"latency_ms", "20"}};
    assert_near(read_once(options).flexion_deg, 1005, 0);
    other_slaves_stop(&slaves);
}

// The error of the first poll that has one.
static struct error refused(const struct device_option *options) {
    struct device_config config = config_of("encoders", options);
    struct device_outputs outputs = {0};
    struct device_reading reading = {0};
    struct error err = {{0}};
    void *device;
    if (driver->create(&config, &device, &outputs, &err) != RESULT_OK ||
        driver->open(device, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    while (driver->poll(device, &reading, &err) == RESULT_OK)
        assert_int_equal(reading.count, 0);
    driver->close(device);
    driver->destroy(device);
    return err;
}

// Replies shorter than a request, longer, and with an address that reads as a long reply's size.
static void a_config_that_is_wrong_about_an_echo_is_told_so(void **state) {
    (void)state;
    static const char *const flexion[] = {"5", "5 f32", "40000"};
    struct other_slaves slaves;
    other_slaves_start(&slaves);
    for (int i = 0; i < 6; i++) {
        bool echo = i % 2;
        atomic_store(&slaves.echo, echo);
        const struct device_option options[OPTIONS_MAX] = {
            {"serial", slaves.name}, {"echo", echo ? "no" : "yes"}, {"flexion", flexion[i / 2]}};
        struct error err = refused(options);
        if (!strstr(err.text, echo ? "the adapter hears itself: set echo = yes"
                                   : "the adapter does not hear itself: set echo = no"))
            fail_msg("%s", err.text);
        usleep(20000); // the reply's rest comes before the next device
    }
    other_slaves_stop(&slaves);
}

// ---- one slave and the others -------------------------------------------------------------------

struct shared {
    struct other_slaves slaves;
    struct runner *runner;
};

// Slaves 1 to 3 of the line, each a device that reads its register 7.
static void run_all(struct shared *s, bool tcp, const char *latency_ms) {
    static const char *const numbers[] = {"1", "2", "3"};
    static const char *const keys[] = {"flexion", "probe.opening", "punch.opening"};
    struct device_option options[OTHER_SLAVES][OPTIONS_MAX];
    struct device_config configs[OTHER_SLAVES];
    struct error err;
    for (int i = 0; i < OTHER_SLAVES; i++) {
        const struct device_option mine[OPTIONS_MAX] = {
            {"driver", "modbus"},           {tcp ? "address" : "serial", s->slaves.name},
            {"slave", numbers[i]},          {"rate_hz", "200"},
            {"timeout_ms", "20"},           {"latency_ms", latency_ms},
            {keys[i], i ? "7 0.0001" : "7"}};
        memcpy(options[i], mine, sizeof mine);
        configs[i] = config_of(numbers[i], options[i]);
    }
    if (runner_create(configs, OTHER_SLAVES, &s->runner, &err) != RESULT_OK)
        fail_msg("%s", err.text);
}

static struct device_status status_of(const struct shared *s, int slave) {
    struct device_status status;
    runner_status(s->runner, slave - 1, &status);
    return status;
}

static void wait_for_readings(const struct shared *s, int slave, uint64_t more) {
    uint64_t wanted = status_of(s, slave).readings + more;
    int64_t end_ns = clock_now_ns() + 30 * NS_PER_S;
    while (status_of(s, slave).readings < wanted && clock_now_ns() < end_ns)
        usleep(2000);
    assert_true(status_of(s, slave).readings >= wanted);
}

static void end(struct shared *s) {
    runner_destroy(&s->runner);
    other_slaves_stop(&s->slaves);
}

// What slave 2 says is 2007 · 0.0001, which no other slave ever says.
static void expect_value_of_the_prompt_one(const struct shared *s) {
    struct frame frame = {0};
    runner_collect(s->runner, clock_now_ns(), &frame);
    for (int i = 0; i < frame.count; i++)
        if (frame.samples[i].channel == CHANNEL_PROBE)
            assert_near(frame.samples[i].handle.opening, 0.2007, 1e-9);
}

// Its replies come 10 ms after its time, while the next slave is asked.
static void replies_that_are_always_late_cost_the_others_nothing(void **state) {
    (void)state;
    for (int tcp = 0; tcp < 2; tcp++) {
        struct shared s;
        (tcp ? other_slaves_start_gateway : other_slaves_start)(&s.slaves);
        atomic_store(&s.slaves.each[LATE].delay_ms, 30);
        atomic_store(&s.slaves.each[PROMPT].delay_ms, 12);
        run_all(&s, tcp, "50");
        for (int i = 0; i < 4; i++) {
            wait_for_readings(&s, PROMPT, ENOUGH / 4);
            expect_value_of_the_prompt_one(&s);
        }
        assert_int_equal(status_of(&s, PROMPT).malformed, 0);
        assert_int_equal(status_of(&s, LATE).readings, 0);
        end(&s);
    }
}

static void a_dead_slave_is_asked_seldom_until_it_answers(void **state) {
    (void)state;
    for (int tcp = 0; tcp < 2; tcp++) {
        struct shared s;
        (tcp ? other_slaves_start_gateway : other_slaves_start)(&s.slaves);
        atomic_store(&s.slaves.each[DEAD].silent, true);
        run_all(&s, tcp, "1");
        wait_for_readings(&s, PROMPT, 2 * ENOUGH);
        int asked = atomic_load(&s.slaves.each[DEAD].asked);
        assert_true(asked >= 1 && asked <= 6); // not every 20 ms
        assert_true(status_of(&s, LATE).readings >= ENOUGH);
        assert_int_equal(status_of(&s, DEAD).readings, 0);
        atomic_store(&s.slaves.each[DEAD].silent, false);
        wait_for_readings(&s, DEAD, 3);
        assert_true(status_of(&s, DEAD).connected);
        end(&s);
    }
}

// A poll that waits in steps comes back without a reading before the reply is there.
static void a_slow_slave_is_waited_for_in_steps(void **state) {
    (void)state;
    for (int tcp = 0; tcp < 2; tcp++) {
        struct other_slaves slaves;
        (tcp ? other_slaves_start_gateway : other_slaves_start)(&slaves);
        atomic_store(&slaves.each[2].delay_ms, 350);
        const struct device_option options[OPTIONS_MAX] = {
            {tcp ? "address" : "serial", slaves.name},
            {"slave", "2"},
            {"timeout_ms", "2000"},
            {"flexion", "5"}};
        const struct device_config config = config_of("slow", options);
        struct device_outputs outputs = {0};
        struct device_reading reading = {0};
        struct error err;
        void *device;
        if (driver->create(&config, &device, &outputs, &err) != RESULT_OK ||
            driver->open(device, &err) != RESULT_OK)
            fail_msg("%s", err.text);
        int empty = 0;
        for (; !reading.count; empty += !reading.count)
            assert_int_equal(RESULT_OK, driver->poll(device, &reading, &err));
        assert_true(empty >= 2);
        assert_near(reading.samples[0].joint.flexion_deg, 2005, 0);
        assert_int_equal(atomic_load(&slaves.each[2].asked), 1);
        for (int i = 0; i < 2; i++) // and closed while it waits
            driver->poll(device, &reading, &err);
        driver->close(device);
        driver->destroy(device);
        other_slaves_stop(&slaves);
    }
}

// Each byte comes soon after the last one, and the reply takes as long as three others' time.
static void a_slave_that_drips_costs_the_others_little(void **state) {
    (void)state;
    for (int tcp = 0; tcp < 2; tcp++) {
        struct shared s;
        (tcp ? other_slaves_start_gateway : other_slaves_start)(&s.slaves);
        atomic_store(&s.slaves.each[DEAD].drip_ms, 10);
        run_all(&s, tcp, "50");
        for (int i = 0; i < 4; i++) {
            wait_for_readings(&s, PROMPT, ENOUGH / 2);
            expect_value_of_the_prompt_one(&s);
        }
        assert_true(atomic_load(&s.slaves.each[DEAD].asked) >= 1);
        assert_int_equal(status_of(&s, DEAD).readings, 0);
        assert_int_equal(status_of(&s, PROMPT).malformed, 0);
        atomic_store(&s.slaves.each[DEAD].drip_ms, 0);
        wait_for_readings(&s, DEAD, 3);
        end(&s);
    }
}

static void a_wrong_checksum_is_refused_and_the_others_go_on(void **state) {
    (void)state;
    struct shared s;
    other_slaves_start(&s.slaves);
    atomic_store(&s.slaves.each[LATE].spoil_every, 2);
    run_all(&s, false, "50");
    wait_for_readings(&s, PROMPT, ENOUGH);
    wait_for_readings(&s, LATE, 2);
    assert_true(status_of(&s, LATE).malformed >= 1);
    assert_int_equal(status_of(&s, PROMPT).malformed, 0);
    end(&s);
}

// Each third reply has a wrong checksum: the channel is held for a moment, and never lost.
static void a_reply_with_a_wrong_checksum_costs_one_reading(void **state) {
    (void)state;
    struct other_slaves slaves;
    other_slaves_start(&slaves);
    atomic_store(&slaves.each[2].spoil_every, 3);
    const struct device_option options[OPTIONS_MAX] = {
        {"driver", "modbus"}, {"serial", slaves.name}, {"slave", "2"},
        {"rate_hz", "50"},    {"hold_ms", "300"},      {"flexion", "3 0.01"}};
    const struct device_config config = config_of("knee", options);
    struct runner *runner;
    struct error err;
    struct device_status status;
    if (runner_create(&config, 1, &runner, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    do {
        usleep(5000);
        runner_status(runner, 0, &status);
    } while (status.malformed < 6);
    assert_int_equal(status.losses, 0);
    runner_destroy(&runner);
    other_slaves_stop(&slaves);
}

static void the_slaves_behind_a_gateway_share_one_connection(void **state) {
    (void)state;
    struct shared s;
    other_slaves_start_gateway(&s.slaves);
    run_all(&s, true, "50");
    for (int i = 1; i <= OTHER_SLAVES; i++)
        wait_for_readings(&s, i, 5);
    assert_int_equal(atomic_load(&s.slaves.connections), 1);
    assert_int_equal(atomic_load(&s.slaves.collisions), 0);
    end(&s);
}

// ---- a joint of two encoders --------------------------------------------------------------------

static struct frame joint_of(struct runner *runner, enum validity wanted) {
    struct frame frame;
    do {
        usleep(1000);
        frame = (struct frame){.number = 1};
        runner_collect(runner, clock_now_ns(), &frame);
    } while (frame.samples[0].validity != wanted);
    assert_true(frame_is_valid(&frame));
    return frame;
}

static void the_encoders_of_a_joint_may_be_several_slaves(void **state) {
    (void)state;
    struct other_slaves slaves;
    other_slaves_start(&slaves);
    const struct device_option knee[OPTIONS_MAX] = {{"driver", "modbus"},
                                                    {"serial", slaves.name},
                                                    {"slave", "2"},
                                                    {"latency_ms", "20"},
                                                    {"internal", "5 0.001"},
                                                    {"drawer", "6 -0.001"}},
                               turn[OPTIONS_MAX] = {{"driver", "modbus"},  {"serial", slaves.name},
                                                    {"slave", "1"},        {"latency_ms", "20"},
                                                    {"flexion", "3 0.01"}, {"punch.buttons", "7"}};
    const struct device_config configs[] = {config_of("turn", knee), config_of("knee", turn)};
    struct runner *runner;
    struct error err;
    if (runner_create(configs, 2, &runner, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    struct frame frame = joint_of(runner, VALIDITY_OK);
    assert_int_equal(frame.count, 2);
    const struct sample *joint = &frame.samples[0];
    assert_near(joint->joint.flexion_deg, 10.03, 1e-9);
    assert_near(joint->joint.internal_deg, 2.005, 1e-9);
    assert_near(joint->joint.drawer_mm, -2.006, 1e-9);
    assert_int_equal(joint->device, 1);
    for (int slave = 1; slave <= 2; slave++) { // as valid as the worst
        atomic_store(&slaves.each[slave].silent, true);
        joint_of(runner, VALIDITY_LOST);
        atomic_store(&slaves.each[slave].silent, false);
        joint_of(runner, VALIDITY_OK);
    }
    runner_destroy(&runner);
    other_slaves_stop(&slaves);
}

int main(void) {
    driver = device_driver("modbus");
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(values_of_two_input_registers_are_read_in_each_order),
        cmocka_unit_test(registers_are_counted_as_the_maker_does),
        cmocka_unit_test(an_echo_is_passed_over_where_the_config_says_that_there_is_one),
        cmocka_unit_test(a_config_that_is_wrong_about_an_echo_is_told_so),
        cmocka_unit_test(replies_that_are_always_late_cost_the_others_nothing),
        cmocka_unit_test(a_dead_slave_is_asked_seldom_until_it_answers),
        cmocka_unit_test(a_slow_slave_is_waited_for_in_steps),
        cmocka_unit_test(a_slave_that_drips_costs_the_others_little),
        cmocka_unit_test(a_wrong_checksum_is_refused_and_the_others_go_on),
        cmocka_unit_test(a_reply_with_a_wrong_checksum_costs_one_reading),
        cmocka_unit_test(the_slaves_behind_a_gateway_share_one_connection),
        cmocka_unit_test(the_encoders_of_a_joint_may_be_several_slaves),
    };
    return cmocka_run_group_tests_name("device_shared", tests, NULL, NULL);
}
