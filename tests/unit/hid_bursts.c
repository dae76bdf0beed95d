// Reports of a HID device that come several at a time: their times, the channel, and the driver on
// a hidapi that is played here.
#include "base/clock.h"
#include "drivers/device.h"
#include "drivers/hid_stamp.h"
#include "samples/slot.h"
#include "test.h"

#include <hidapi.h>
#include <stdlib.h>
#include <string.h>
#include <wchar.h>

enum { PACK_MAX = 64, COUNTER_BITS = 8 };

static const double report_ms = 8;

// ---- times --------------------------------------------------------------------------------------

struct source {
    double true_ms;       // between two reports
    int pack, lose_every; // lose_every 0: none
    bool split;           // the first report of a pack comes 2 ms before the others
    bool counts;
};

struct arrived {
    int64_t now_ns;
    int count;
    double made_ns[PACK_MAX];
    uint32_t counts[PACK_MAX];
};

// The k-th arrival. Reports are made at true_ms · i and come 1 ms after the last one of their pack.
static struct arrived arrival_of(const struct source *s, int k) {
    bool splits = s->split && s->pack > 1;
    int whole = splits ? k / 2 : k, first = whole * s->pack, end = first + s->pack;
    double came_ms = s->true_ms * (end - 1) + 1;
    struct arrived a = {0};
    if (splits && k % 2 == 0) {
        end = first + 1;
        came_ms -= 2;
    } else if (splits) {
        first++;
    }
    a.now_ns = (int64_t)((came_ms + 1000) * NS_PER_MS);
    for (int i = first; i < end; i++) {
        if (s->lose_every && i % s->lose_every == s->lose_every - 1)
            continue;
        a.made_ns[a.count] = (s->true_ms * i + 1000) * NS_PER_MS;
        a.counts[a.count++] = (uint32_t)i & ((1 << COUNTER_BITS) - 1);
    }
    return a;
}

static struct hid_stamps stamps_of(const struct source *s) {
    struct hid_stamps stamps = {.counter_bits = s->counts ? COUNTER_BITS : 0,
                                .count_ms = report_ms};
    hid_stamps_begin(&stamps);
    return stamps;
}

static const struct source sources[] = {
    {8, 1, 0, false, false},  {8, 4, 0, false, false},  {8, 8, 0, true, false},
    {8, 4, 5, true, false},   {8, 1, 0, false, true},   {8, 4, 0, false, true},
    {8.05, 8, 0, true, true}, {7.95, 4, 5, true, true},
};

enum { SOURCES = sizeof sources / sizeof *sources, ARRIVALS = 400, LEARNT = 40 };

static void times_rise_and_are_not_of_the_future(void **state) {
    (void)state;
    for (int i = 0; i < SOURCES; i++) {
        struct hid_stamps stamps = stamps_of(&sources[i]);
        int64_t times_ns[PACK_MAX], last_ns = 0;
        for (int k = 0; k < ARRIVALS; k++) {
            struct arrived a = arrival_of(&sources[i], k);
            if (!a.count)
                continue;
            hid_stamps_of(&stamps, sources[i].counts ? a.counts : NULL, a.count, a.now_ns,
                          times_ns);
            for (int n = 0; n < a.count; n++) {
                assert_true(times_ns[n] > last_ns);
                last_ns = times_ns[n];
            }
            assert_true(last_ns <= a.now_ns + PACK_MAX * 1000);
        }
    }
}

// 1 ms on the way; the device's clock may be off by 6 in 1000, and a pack may hide it for its time.
static void times_by_the_counter_are_those_of_the_device(void **state) {
    (void)state;
    for (int i = 0; i < SOURCES; i++) {
        struct hid_stamps stamps = stamps_of(&sources[i]);
        int64_t times_ns[PACK_MAX];
        for (int k = 0; k < ARRIVALS && sources[i].counts; k++) {
            struct arrived a = arrival_of(&sources[i], k);
            if (!a.count)
                continue;
            hid_stamps_of(&stamps, a.counts, a.count, a.now_ns, times_ns);
            for (int n = 0; n < a.count && k > LEARNT; n++)
                assert_near((double)times_ns[n] / NS_PER_MS, a.made_ns[n] / NS_PER_MS + 1, 2.5);
        }
    }
}

static void without_a_counter_a_pack_is_spread_over_the_time_in_which_it_was_made(void **state) {
    (void)state;
    const struct source source = {8, 4, 0, false, false};
    struct hid_stamps stamps = stamps_of(&source);
    int64_t times_ns[PACK_MAX];
    for (int k = 0; k < ARRIVALS; k++) {
        struct arrived a = arrival_of(&source, k);
        hid_stamps_of(&stamps, NULL, a.count, a.now_ns, times_ns);
        for (int n = 0; n < a.count && k > LEARNT; n++)
            assert_near((double)times_ns[n] / NS_PER_MS, a.made_ns[n] / NS_PER_MS + 1, 0.01);
    }
}

// ---- the channel --------------------------------------------------------------------------------

static void take(struct slot *slot, struct hid_stamps *stamps, const struct source *source,
                 const struct arrived *a) {
    int64_t times_ns[PACK_MAX];
    hid_stamps_of(stamps, source->counts ? a->counts : NULL, a->count, a->now_ns, times_ns);
    for (int n = 0; n < a->count; n++) {
        struct sample sample = {
            .channel = CHANNEL_PUNCH, .kind = SAMPLE_HANDLE, .time_ns = times_ns[n]};
        assert_int_equal(SLOT_USED, slot_take(slot, &sample, a->now_ns));
    }
    slot_arrived(slot, a->count, a->now_ns);
}

static void a_channel_does_not_flicker_between_packs(void **state) {
    (void)state;
    for (int i = 0; i < SOURCES; i++) {
        struct hid_stamps stamps = stamps_of(&sources[i]);
        struct slot slot;
        slot_init(&slot, CHANNEL_PUNCH, SAMPLE_HANDLE, 0, 100, 50);
        for (int k = 0; k < ARRIVALS; k++) {
            struct arrived a = arrival_of(&sources[i], k), next = arrival_of(&sources[i], k + 1);
            if (a.count)
                take(&slot, &stamps, &sources[i], &a);
            for (int64_t t = a.now_ns; t < next.now_ns && k > LEARNT; t += NS_PER_MS) {
                slot_age(&slot, t);
                assert_int_equal(slot.validity, VALIDITY_OK);
            }
        }
    }
}

// As many as the kernel keeps, because nobody fetched them; then one at a time again.
static void a_backlog_does_not_make_the_channel_impatient(void **state) {
    (void)state;
    const struct source source = {8, 1, 0, false, false};
    struct hid_stamps stamps = stamps_of(&source);
    struct slot slot;
    slot_init(&slot, CHANNEL_PUNCH, SAMPLE_HANDLE, 0, 100, 50);
    for (int k = 0; k < ARRIVALS; k++) {
        struct arrived a = arrival_of(&source, k), next = arrival_of(&source, k + 1);
        a.count = k == 200 ? 16 : 1;
        take(&slot, &stamps, &source, &a);
        for (int64_t t = a.now_ns; t < next.now_ns && k > LEARNT; t += NS_PER_MS) {
            slot_age(&slot, t);
            assert_int_equal(slot.validity, VALIDITY_OK);
        }
    }
    slot_age(&slot, slot.arrived_ns + 40 * NS_PER_MS);
    assert_int_equal(slot.validity, VALIDITY_HELD); // and it is noticed when the device is silent
}

// ---- the driver, on two handles that are alike --------------------------------------------------

enum { REPORT_BYTES = 4 };

static struct played {
    wchar_t serial[8];
    char path[8];
    int queued;
    bool is_unplugged;
    const uint8_t *held; // what it answers when it is asked; NULL: nothing
    uint8_t reports[PACK_MAX][REPORT_BYTES];
} handles[2] = {{L"left", "left", .queued = 0}, {L"right", "right", .queued = 0}};

struct hid_device_info *hid_enumerate(unsigned short vid, unsigned short pid) {
    struct hid_device_info *all = NULL;
    for (int i = 0; i < 2; i++) {
        struct hid_device_info *info = calloc(1, sizeof *info);
        info->path = handles[i].path;
        info->vendor_id = vid;
        info->product_id = pid;
        info->serial_number = handles[i].serial;
        info->next = all;
        all = info;
    }
    return all;
}

void hid_free_enumeration(struct hid_device_info *all) {
    while (all) {
        struct hid_device_info *next = all->next;
        free(all);
        all = next;
    }
}

hid_device *hid_open_path(const char *path) {
    return (hid_device *)&handles[strcmp(path, "left") ? 1 : 0];
}

int hid_read_timeout(hid_device *device, unsigned char *out, size_t size, int milliseconds) {
    struct played *handle = (struct played *)device;
    (void)size, (void)milliseconds;
    if (!handle->queued)
        return handle->is_unplugged ? -1 : 0;
    memcpy(out, handle->reports[0], REPORT_BYTES);
    memmove(handle->reports[0], handle->reports[1], (size_t)--handle->queued * REPORT_BYTES);
    return REPORT_BYTES;
}

int hid_get_input_report(hid_device *device, unsigned char *data, size_t size) {
    struct played *handle = (struct played *)device;
    if (!handle->held || data[0] != handle->held[0])
        return -1;
    assert_true(size >= REPORT_BYTES);
    memcpy(data, handle->held, REPORT_BYTES);
    return REPORT_BYTES;
}

void hid_close(hid_device *device) {
    (void)device;
}

static void queue(struct played *handle, uint8_t opening, uint8_t buttons, uint8_t count) {
    const uint8_t report[REPORT_BYTES] = {1, opening, buttons, count};
    memcpy(handle->reports[handle->queued++], report, REPORT_BYTES);
}

static const struct device_driver *driver;

static void *opened(const char *serial, const char *counter) {
    const struct device_option options[] = {{"vid", "1209"},
                                            {"pid", "1"},
                                            {"serial", serial},
                                            {"on_change", "no"},
                                            {"punch.opening", "1:0 8 0 100"},
                                            {"punch.buttons", "1:8 8"},
                                            {"counter", counter}};
    struct device_config config = {"punch", options, counter ? 7 : 6};
    struct device_outputs outputs = {0};
    struct error err;
    void *device;
    if (driver->create(&config, &device, &outputs, &err) != RESULT_OK ||
        driver->open(device, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return device;
}

static struct device_reading polled(void *device, enum result wanted) {
    struct device_reading reading = {0};
    struct error err;
    assert_int_equal(wanted, driver->poll(device, &reading, &err));
    return reading;
}

static void each_of_two_handles_that_are_alike_has_its_own_reports(void **state) {
    (void)state;
    void *left = opened("left", NULL), *right = opened("right", NULL);
    queue(&handles[0], 25, 1, 0);
    queue(&handles[1], 75, 2, 0);
    assert_near(polled(left, RESULT_OK).samples[0].handle.opening, 0.25, 1e-9);
    assert_near(polled(right, RESULT_OK).samples[0].handle.opening, 0.75, 1e-9);
    driver->destroy(left);
    driver->destroy(right);
}

static void no_report_of_a_burst_is_left_out(void **state) {
    (void)state;
    void *device = opened("left", "1:16 8 8");
    int64_t last_ns = 0;
    for (int i = 0; i < 6; i++)
        queue(&handles[0], (uint8_t)(10 * i), (uint8_t)(i == 3), (uint8_t)(250 + 2 * i));
    queue(&handles[0], 50, 0, (uint8_t)260); // said again
    struct device_reading reading = polled(device, RESULT_OK);
    assert_int_equal(reading.count, 6);
    assert_int_equal(reading.skipped, 1);
    for (int i = 0; i < reading.count; i++) {
        assert_near(reading.samples[i].handle.opening, i / 10.0, 1e-9);
        assert_int_equal(reading.samples[i].handle.buttons, i == 3);
        if (i)
            assert_near((double)(reading.samples[i].time_ns - last_ns) / NS_PER_MS, 16, 1e-3);
        last_ns = reading.samples[i].time_ns;
    }
    assert_true(last_ns <= clock_now_ns());
    driver->destroy(device);
}

// Three bytes as a vector of newtons: 3, 4 and 12 over what they say at rest.
static void a_force_is_the_length_of_three_fields_without_what_they_say_at_rest(void **state) {
    (void)state;
    const struct device_option options[] = {
        {"vid", "1209"},          {"pid", "1"},
        {"serial", "left"},       {"probe.force", "1:0 8 0.1, 1:8 8 0.1 , 1:16 8 0.1 0 signed"},
        {"zero.probe", "1 2 -1"}, {"punch.buttons", "1:0 8"}};
    const struct device_config config = {"gauge", options, 6};
    struct device_outputs outputs = {0};
    struct error err;
    void *device;
    if (driver->create(&config, &device, &outputs, &err) != RESULT_OK ||
        driver->open(device, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    assert_int_equal(outputs.count, 2);
    queue(&handles[0], 40, 60, 110);
    queue(&handles[0], 40, 127, 110); // at the end of its range
    struct device_reading reading = polled(device, RESULT_OK);
    assert_int_equal(reading.count, 4);
    assert_int_equal(reading.samples[1].channel, CHANNEL_PROBE);
    assert_int_equal(reading.samples[1].kind, SAMPLE_FORCE);
    assert_near(reading.samples[1].force_n, 13, 1e-9);
    assert_true(isnan(reading.samples[3].force_n));
    driver->destroy(device);
}

// Of a device that gives nothing but markers, 40 reports at once: an edge in each eighth.
static void no_edge_of_a_burst_is_left_out_and_each_has_its_reports_time(void **state) {
    (void)state;
    const struct device_option options[] = {{"vid", "1209"},
                                            {"pid", "1"},
                                            {"serial", "left"},
                                            {"marker.start", "bit 1:8"},
                                            {"marker.all", "bit 1:8 both"},
                                            {"counter", "1:16 8 8"}};
    const struct device_config config = {"pedal", options, 6};
    struct device_outputs outputs = {0};
    struct error err;
    void *device;
    if (driver->create(&config, &device, &outputs, &err) != RESULT_OK ||
        driver->open(device, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    assert_int_equal(outputs.count, 0);
    for (int i = 0; i < 40; i++)
        queue(&handles[0], 0, i % 8 >= 4, (uint8_t)i);
    struct device_reading reading = polled(device, RESULT_OK);
    assert_int_equal(reading.count, 0);
    assert_true(reading.heard);
    int starts = 0, all = 0;
    int64_t last_ns = 0;
    for (int i = 0; i < reading.marker_count; i++) {
        const struct device_marker *m = &reading.markers[i];
        bool start = !strcmp(m->name, "start");
        starts += start;
        all += !start;
        if (start && last_ns)
            assert_near((double)(m->time_ns - last_ns) / NS_PER_MS, 64, 1e-3);
        last_ns = start ? m->time_ns : last_ns;
    }
    assert_int_equal(starts, 5);
    assert_int_equal(all, 9);
    assert_true(polled(device, RESULT_OK).heard); // it reports changes only, so silence is no fault
    driver->destroy(device);
}

// A pedal that reports changes only, and that nobody has touched since the station started.
static void a_pedal_that_says_nothing_is_asked_how_it_is(void **state) {
    (void)state;
    static const uint8_t rest[REPORT_BYTES] = {1, 25, 0, 0},
                         unnumbered[REPORT_BYTES] = {0, 0, 6, 0};
    const struct device_option options[] = {{"vid", "1209"},
                                            {"pid", "1"},
                                            {"serial", "left"},
                                            {"shaver.opening", "1:0 8 0 100"},
                                            {"marker.start", "bit 1:8"},
                                            {"shaver.buttons", "8 8"}};
    const struct device_config pedal = {"pedal", options, 5};
    struct device_option plain[] = {options[0], options[1], options[2], options[5]};
    const struct device_config buttons = {"pedal", plain, 4};
    struct device_outputs outputs = {0};
    struct error err;
    void *device;
    handles[0].held = rest;
    assert_int_equal(driver->create(&pedal, &device, &outputs, &err), RESULT_OK);
    assert_int_equal(driver->open(device, &err), RESULT_OK);
    struct device_reading reading = polled(device, RESULT_OK);
    assert_int_equal(reading.count, 1);
    assert_near(reading.samples[0].handle.opening, 0.25, 1e-9);
    queue(&handles[0], 25, 1, 0);
    assert_int_equal(polled(device, RESULT_OK).marker_count, 1); // the first press is an edge
    driver->destroy(device);
    handles[0].held = unnumbered;
    outputs = (struct device_outputs){0};
    assert_int_equal(driver->create(&buttons, &device, &outputs, &err), RESULT_OK);
    assert_int_equal(driver->open(device, &err), RESULT_OK);
    assert_int_equal(polled(device, RESULT_OK).samples[0].handle.buttons, 6);
    handles[0].held = NULL; // and one that does not answer is as it was
    driver->close(device);
    assert_int_equal(driver->open(device, &err), RESULT_OK);
    assert_int_equal(polled(device, RESULT_OK).count, 0);
    driver->destroy(device);
}

static void what_a_handle_said_before_it_was_unplugged_is_read(void **state) {
    (void)state;
    void *device = opened("left", NULL);
    queue(&handles[0], 10, 0, 0);
    queue(&handles[0], 20, 0, 0);
    handles[0].is_unplugged = true;
    assert_int_equal(polled(device, RESULT_CLOSED).count, 2);
    handles[0].is_unplugged = false;
    driver->destroy(device);
}

static void of_more_reports_than_there_is_room_for_the_newest_are_read(void **state) {
    (void)state;
    void *device = opened("left", NULL);
    for (int i = 0; i < 40; i++)
        queue(&handles[0], (uint8_t)i, 0, 0);
    struct device_reading reading = polled(device, RESULT_OK);
    assert_int_equal(reading.count, DEVICE_SAMPLES_MAX);
    for (int i = 0; i < reading.count; i++)
        assert_near(reading.samples[i].handle.opening, (40 - DEVICE_SAMPLES_MAX + i) / 100.0, 1e-9);
    driver->destroy(device);
}

static void a_counter_that_is_none_is_refused(void **state) {
    (void)state;
    static const char *const wrong[] = {"1:16 8", "1:16 8 0", "1:16 33 8", "16 8 8", "x", ""};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        const struct device_option options[] = {
            {"vid", "1209"}, {"pid", "1"}, {"punch.buttons", "1:8 8"}, {"counter", wrong[i]}};
        struct device_config config = {"punch", options, 4};
        struct device_outputs outputs = {0};
        struct error err;
        void *device;
        assert_int_equal(RESULT_INVALID, driver->create(&config, &device, &outputs, &err));
    }
}

int main(void) {
    driver = device_driver("hid");
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(times_rise_and_are_not_of_the_future),
        cmocka_unit_test(times_by_the_counter_are_those_of_the_device),
        cmocka_unit_test(without_a_counter_a_pack_is_spread_over_the_time_in_which_it_was_made),
        cmocka_unit_test(a_channel_does_not_flicker_between_packs),
        cmocka_unit_test(a_backlog_does_not_make_the_channel_impatient),
        cmocka_unit_test(each_of_two_handles_that_are_alike_has_its_own_reports),
        cmocka_unit_test(no_report_of_a_burst_is_left_out),
        cmocka_unit_test(a_force_is_the_length_of_three_fields_without_what_they_say_at_rest),
        cmocka_unit_test(no_edge_of_a_burst_is_left_out_and_each_has_its_reports_time),
        cmocka_unit_test(a_pedal_that_says_nothing_is_asked_how_it_is),
        cmocka_unit_test(what_a_handle_said_before_it_was_unplugged_is_read),
        cmocka_unit_test(of_more_reports_than_there_is_room_for_the_newest_are_read),
        cmocka_unit_test(a_counter_that_is_none_is_refused),
    };
    return cmocka_run_group_tests_name("hid_bursts", tests, NULL, NULL);
}
