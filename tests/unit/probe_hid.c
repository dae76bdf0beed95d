// What `arthron-station probe` proposes for HID devices that are plugged in.
#include "base/check.h"
#include "folder.h"
#include "loop/config.h"
#include "test.h"
#include "tools/probe.h"

#include <stdlib.h>
#include <string.h>

// A joystick with a slider of 16 bits and three buttons.
static enum result read_descriptor(const char *path, uint8_t *out_bytes, size_t *out_size,
                                   struct error *err) {
    static const uint8_t descriptor[] = {
        0x05, 0x01, 0x09, 0x04, 0xa1, 0x01, 0x09, 0x36, 0x16, 0x18, 0xfc, 0x26, 0xe8,
        0x03, 0x75, 0x10, 0x95, 0x01, 0x81, 0x02, 0x05, 0x09, 0x19, 0x01, 0x29, 0x03,
        0x15, 0x00, 0x25, 0x01, 0x75, 0x01, 0x95, 0x03, 0x81, 0x02, 0xc0,
    };
    (void)path, (void)err;
    memcpy(out_bytes, descriptor, sizeof descriptor);
    *out_size = sizeof descriptor;
    return RESULT_OK;
}

static struct hid_plugged plug(const char *path, const char *serial, const char *port) {
    struct hid_plugged p = {.identity = {.vid = 0x1209, .pid = 1, .usage_page = 1, .usage = 4},
                            .product = "Handle"};
    snprintf(p.path, sizeof p.path, "%s", path);
    snprintf(p.identity.serial, sizeof p.identity.serial, "%s", serial);
    snprintf(p.identity.port, sizeof p.identity.port, "%s", port);
    return p;
}

// The proposal, loaded as a station's config.
static struct station_config *proposed(const struct hid_plugged *plugged, int count) {
    char dir[FOLDER_MAX], path[FOLDER_MAX + 16];
    struct station_config *config = NULL;
    struct error err;
    json_t *list = json_array();
    folder_make(dir);
    snprintf(path, sizeof path, "%s/proposed.ini", dir);
    FILE *file = fopen(path, "w");
    fputs("[station]\nname = room-1\nserver = localhost:1\nkeys = keys\n", file);
    probe_hid_plugged(plugged, count, read_descriptor, file, list);
    fclose(file);
    assert_int_equal(json_array_size(list), count);
    if (station_config_load(path, NULL, 0, &config, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    json_decref(list);
    folder_remove(dir);
    return config;
}

static struct hid_identity identity_of(const struct station_device *device) {
    struct hid_identity identity = {0};
    for (int i = 0; i < device->config.option_count; i++) {
        const char *key = device->options[i].key, *value = device->options[i].value;
        if (!strcmp(key, "vid"))
            identity.vid = (uint16_t)strtol(value, NULL, 16);
        else if (!strcmp(key, "pid"))
            identity.pid = (uint16_t)strtol(value, NULL, 16);
        else if (!strcmp(key, "serial"))
            strcpy(identity.serial, value);
        else if (!strcmp(key, "port"))
            strcpy(identity.port, value);
    }
    return identity;
}

// Every section finds one device, and no two the same.
static void expect_each_found(const struct hid_plugged *plugged, int count) {
    struct station_config *config = proposed(plugged, count);
    bool taken[8] = {false};
    assert_int_equal(config->device_count, count);
    for (int d = 0; d < count; d++) {
        struct hid_identity wanted = identity_of(&config->devices[d]);
        int found = 0;
        for (int i = 0; i < count; i++)
            if (hid_matches(&wanted, &plugged[i].identity)) {
                assert_false(taken[i]);
                taken[i] = true;
                found++;
            }
        assert_int_equal(found, 1);
    }
    station_config_destroy(&config);
}

static void two_handles_that_are_alike_get_two_sections(void **state) {
    (void)state;
    const struct hid_plugged by_serial[] = {plug("/dev/hidraw0", "left", "usb-1/input0"),
                                            plug("/dev/hidraw1", "right", "usb-2/input0")};
    const struct hid_plugged without[] = {plug("/dev/hidraw0", "", "usb-1/input0"),
                                          plug("/dev/hidraw1", "", "usb-2/input0")};
    const struct hid_plugged same[] = {plug("/dev/hidraw0", "1", "usb-1/input0"),
                                       plug("/dev/hidraw1", "1", "usb-2/input0"),
                                       plug("/dev/hidraw2", "2", "usb-3/input0")};
    expect_each_found(by_serial, 2);
    expect_each_found(without, 2);
    expect_each_found(same, 3);
}

static void a_handle_that_is_alone_may_be_plugged_in_anywhere(void **state) {
    (void)state;
    const struct hid_plugged one = plug("/dev/hidraw0", "7", "usb-1/input0");
    struct station_config *config = proposed(&one, 1);
    assert_string_equal(identity_of(&config->devices[0]).port, "");
    station_config_destroy(&config);
}

static void a_device_of_two_collections_gets_one_section(void **state) {
    (void)state;
    const struct hid_plugged both[] = {plug("/dev/hidraw0", "7", "usb-1/input0"),
                                       plug("/dev/hidraw0", "7", "usb-1/input0")};
    struct station_config *config = proposed(both, 2);
    assert_int_equal(config->device_count, 1);
    station_config_destroy(&config);
}

// Two interfaces: one handle. The second one is there to be chosen, and the other handle is not it.
static void a_handle_of_two_interfaces_is_one(void **state) {
    (void)state;
    const struct hid_plugged handles[] = {
        plug("/dev/hidraw0", "7", "usb-1/input0"), plug("/dev/hidraw1", "7", "usb-1/input1"),
        plug("/dev/hidraw2", "8", "usb-2/input0"), plug("/dev/hidraw3", "8", "usb-2/input1")};
    struct station_config *config = proposed(handles, 4);
    assert_int_equal(config->device_count, 2);
    for (int d = 0; d < 2; d++) {
        struct hid_identity found = identity_of(&config->devices[d]);
        assert_string_equal(found.serial, d ? "8" : "7");
        assert_string_equal(found.port, d ? "usb-2/input0" : "usb-1/input0");
    }
    station_config_destroy(&config);
}

static void nobody_has_to_unplug_a_handle_of_two_interfaces(void **state) {
    (void)state;
    const struct hid_plugged handle[] = {plug("/dev/hidraw0", "7", "usb-1/input0"),
                                         plug("/dev/hidraw1", "7", "usb-1/input1")};
    char *text = NULL;
    size_t size;
    json_t *list = json_array();
    FILE *file = open_memstream(&text, &size);
    probe_hid_plugged(handle, 2, read_descriptor, file, list);
    fclose(file);
    assert_null(strstr(text, "unplug one"));
    assert_non_null(strstr(text, "; port = usb-1/input1\n"));
    free(text);
    json_decref(list);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(two_handles_that_are_alike_get_two_sections),
        cmocka_unit_test(a_handle_that_is_alone_may_be_plugged_in_anywhere),
        cmocka_unit_test(a_device_of_two_collections_gets_one_section),
        cmocka_unit_test(a_handle_of_two_interfaces_is_one),
        cmocka_unit_test(nobody_has_to_unplug_a_handle_of_two_interfaces),
    };
    return cmocka_run_group_tests_name("probe_hid", tests, NULL, NULL);
}
