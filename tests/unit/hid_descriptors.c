// Report descriptors of real devices, from the shared data: each as the device gives it ("real")
// and as hidapi rebuilds it from what Windows parsed ("expected").

#include "drivers/hid_descriptor.h"
#include "test.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static FILE *open_data(const char *name, const char *kind) {
    const char *data = getenv("ARTHRON_DATA");
    char path[512];
    snprintf(path, sizeof path, "%s/protocol/hid_descriptors/%s_%s.rpt_desc", data ? data : DATA,
             name, kind);
    return fopen(path, "r");
}

// The bytes of a text: words "0x05," where it has any, else words of two hexadecimal digits.
static size_t bytes_of(const char *text, uint8_t out[HID_DESCRIPTOR_BYTES_MAX]) {
    static const char blanks[] = " \t\r\n";
    size_t size = 0, lead = strstr(text, "0x") ? 2 : 0;
    for (text += strspn(text, blanks); *text; text += strspn(text, blanks)) {
        size_t length = strcspn(text, blanks);
        char *end;
        unsigned long byte = strtoul(text + (length > lead ? lead : 0), &end, 16);
        if (!strncmp(text, "//", 2))
            length = strcspn(text, "\n");
        else if (!strncmp(text, "0x", lead) && end == text + lead + 2 && strchr(", \t\r\n", *end) &&
                 size < HID_DESCRIPTOR_BYTES_MAX)
            out[size++] = (uint8_t)byte;
        text += length;
    }
    return size;
}

static void load(const char *name, const char *kind, struct hid_descriptor *out) {
    static uint8_t bytes[HID_DESCRIPTOR_BYTES_MAX];
    static char text[1 << 16];
    FILE *file = open_data(name, kind);
    struct error err = {{0}};
    assert_non_null(file);
    text[fread(text, 1, sizeof text - 1, file)] = 0;
    fclose(file);
    size_t size = bytes_of(text, bytes);
    if (hid_descriptor_read(bytes, size, out, &err) != RESULT_OK)
        fail_msg("%s_%s: %s", name, kind, err.text);
    assert_true(out->count > 0 || strstr(name, "C534"));
}

static void real_devices_get_the_layout_that_their_makers_meant(void **state) {
    (void)state;
    static const struct {
        const char *name, *real, *rebuilt; // NULL: the same
    } rows[] = {
        {"045E_02FF_0005_0001", // gamepad; Windows does not tell how large 255 was meant to be
         "usage = 0x0001 0x0005\npunch.opening = 0 16 0 65535\npunch.buttons = 80 16\n",
         "usage = 0x0001 0x0005\npunch.opening = 0 16 0 255\npunch.buttons = 80 16\n"},
        {"046A_0011_0006_0001", // keyboard: shift, control, ...
         "usage = 0x0001 0x0006\npunch.buttons = 0 8\n", NULL},
        {"046D_C077_0002_0001", // mouse: its axes are relative
         "usage = 0x0001 0x0002\npunch.buttons = 0 8\n", NULL},
        {"046D_C283_0004_0001", // joystick
         "usage = 0x0001 0x0004\npunch.opening = 0 8 0 255\npunch.buttons = 32 7\n", NULL},
        {"046D_C534_0080_0001", "", NULL}, // system control: an array of three keys
        {"17CC_1130_0000_FF01",            // mixing desk
         "usage = 0xff01 0x0000\npunch.opening = 1:0 4 0 15\n", NULL},
    };
    static struct hid_descriptor d;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char text[HID_PROPOSAL_BYTES_MAX];
        load(rows[i].name, "real", &d);
        hid_propose(&d, CHANNEL_PUNCH, text);
        assert_string_equal(rows[i].real, text);
        load(rows[i].name, "expected", &d);
        hid_propose(&d, CHANNEL_PUNCH, text);
        assert_string_equal(rows[i].rebuilt ? rows[i].rebuilt : rows[i].real, text);
    }
}

int main(void) {
    FILE *file = open_data("046D_C077_0002_0001", "real");
    if (!file) {
        printf("skipped: no report descriptors of real devices (ARTHRON_DATA)\n");
        return 77;
    }
    fclose(file);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(real_devices_get_the_layout_that_their_makers_meant),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
