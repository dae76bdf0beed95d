#include "handle.h"

#include "base/check.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/uhid.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

static const char device_path[] = "/dev/uhid";
enum { REPORT = 1 };

static const uint8_t descriptor[] = {
    0x05, 0x01,         // usage page: generic desktop
    0x09, 0x04,         // usage: joystick
    0xa1, 0x01,         // collection
    0x85, REPORT,       //   report's number
    0x09, 0x36,         //   usage: slider (the opening)
    0x15, 0x00,         //   logical minimum 0
    0x26, 0x10,   0x27, //   logical maximum 10000
    0x75, 0x10,         //   16 bits
    0x95, 0x01,         //   once
    0x81, 0x02,         //   input: data, variable, absolute
    0x05, 0x09,         //   usage page: buttons
    0x19, 0x01,         //   first
    0x29, 0x08,         //   last
    0x25, 0x01,         //   logical maximum 1
    0x75, 0x01,         //   1 bit
    0x95, 0x08,         //   eight times
    0x81, 0x02,         //   input: data, variable, absolute
    0xc0,               // end
};

static enum result tell_kernel(int handle, const struct uhid_event *event, struct error *err) {
    if (write(handle, event, sizeof *event) != sizeof *event)
        return fail(err, RESULT_IO, "%s: %s", device_path, strerror(errno));
    return RESULT_OK;
}

enum result handle_plug(const char *serial, const char *port, int *out_handle, struct error *err) {
    struct uhid_event event = {.type = UHID_CREATE2};
    struct uhid_create2_req *create = &event.u.create2;
    CHECK(strlen(serial) < sizeof create->uniq && strlen(port) < sizeof create->phys);
    snprintf((char *)create->phys, sizeof create->phys, "%s", port);
    snprintf((char *)create->name, sizeof create->name, "Arthron punch");
    snprintf((char *)create->uniq, sizeof create->uniq, "%s", serial);
    create->bus = BUS_USB;
    create->vendor = HANDLE_VID;
    create->product = HANDLE_PID;
    create->rd_size = sizeof descriptor;
    memcpy(create->rd_data, descriptor, sizeof descriptor);
    int handle = open(device_path, O_RDWR | O_CLOEXEC);
    if (handle < 0)
        return fail(err, errno == ENOENT ? RESULT_MISSING : RESULT_IO, "%s: %s%s", device_path,
                    strerror(errno), errno == ENOENT ? " (modprobe uhid)" : "");
    enum result result = tell_kernel(handle, &event, err);
    if (result == RESULT_OK)
        *out_handle = handle;
    else
        close(handle);
    return result;
}

void handle_report(double opening, uint8_t buttons, uint8_t out[HANDLE_REPORT_BYTES]) {
    uint16_t raw = (uint16_t)round(10000 * fmax(0, fmin(1, opening)));
    out[0] = REPORT;
    out[1] = (uint8_t)raw;
    out[2] = (uint8_t)(raw >> 8);
    out[3] = buttons;
}

enum result handle_send(int handle, const uint8_t *bytes, size_t size, struct error *err) {
    struct uhid_event event = {.type = UHID_INPUT2};
    CHECK(size <= sizeof event.u.input2.data);
    event.u.input2.size = (uint16_t)size;
    memcpy(event.u.input2.data, bytes, size);
    return tell_kernel(handle, &event, err);
}

void handle_unplug(int handle) {
    struct uhid_event event = {.type = UHID_DESTROY};
    tell_kernel(handle, &event, NULL);
    close(handle);
}
