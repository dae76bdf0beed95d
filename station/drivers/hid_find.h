// Finds HID devices that are plugged in. Safe from any thread: hidapi's own enumeration is not, and
// all of the project goes through this one.
#pragma once

#include "base/result.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct hid_device_; // hidapi

#define HID_TEXT_MAX 128
#define HID_PATH_MAX 256

// Of a device to be found, and of one that was: there, all is known.
struct hid_identity {
    uint16_t vid, pid;
    char serial[HID_TEXT_MAX];  // empty: any
    char port[HID_TEXT_MAX];    // where it is plugged in, as the kernel calls it; empty: any
    uint16_t usage_page, usage; // of a top-level collection; page 0: any
};

struct hid_plugged {
    struct hid_identity identity;
    char product[HID_TEXT_MAX];
    char path[HID_PATH_MAX]; // "/dev/hidraw0"
};

// Whether a device that was found is the one that is wanted.
bool hid_matches(const struct hid_identity *wanted, const struct hid_identity *found);

// All that is plugged in, one entry for each top-level collection of each device, at most `max`
// entries. Bytes of names that are not printable ASCII become '?'. Returns how many.
int hid_list(struct hid_plugged *out_plugged, int max);

// *out_device: a hid_device of hidapi; release with hid_close. RESULT_MISSING: not plugged in;
// RESULT_INVALID: several are, and the identity does not say which; RESULT_IO: cannot be opened.
enum result hid_find(const struct hid_identity *identity, struct hid_device_ **out_device,
                     struct error *err);

// The report descriptor of the device at a path of hid_list, at most HID_DESCRIPTOR_BYTES_MAX bytes
// (drivers/hid_descriptor.h).
enum result hid_read_descriptor(const char *path, uint8_t *out_bytes, size_t *out_size,
                                struct error *err);
