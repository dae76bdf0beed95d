// Reads HID report descriptors (Device Class Definition for HID 1.11, chapter 6.2.2) and proposes
// the keys of a device's section from them. Bytes in, fields out: no device.
#pragma once

#include "base/result.h"
#include "base/sample.h"
#include "drivers/hid_report.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define HID_DESCRIPTOR_BYTES_MAX 4096
#define HID_FIELDS_MAX 1024

// One variable of an input report. Padding is left out; so are arrays (keys of a keyboard: each
// element names the key that is down), which have no bits of their own for a button.
struct hid_descriptor_field {
    uint16_t collection_page, collection; // the usage of the top-level collection
    uint16_t usage_page, usage;
    struct hid_field place;
    int64_t low, high; // raw values
    bool is_relative;
};

struct hid_descriptor {
    int count;
    struct hid_descriptor_field fields[HID_FIELDS_MAX];
};

// RESULT_FORMAT, with the byte where it is: an item cut short, collections or the item stack out of
// balance, a report's number out of range or only on some reports, a field of no bits or more than
// its report may have, bounds out of order; RESULT_LIMIT: more than HID_FIELDS_MAX fields or
// HID_DESCRIPTOR_BYTES_MAX bytes.
enum result hid_descriptor_read(const uint8_t *bytes, size_t size, struct hid_descriptor *out,
                                struct error *err);

#define HID_PROPOSAL_BYTES_MAX 512

// Lines of config for an instrument: `usage`, `CHANNEL.opening` for the first absolute axis and
// `CHANNEL.buttons` for the first row of buttons; empty where there is neither.
void hid_propose(const struct hid_descriptor *descriptor, enum channel channel,
                 char out_text[HID_PROPOSAL_BYTES_MAX]);
