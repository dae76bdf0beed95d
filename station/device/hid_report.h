// Reads the values of instrument handles out of the input reports of a HID device. Bytes in, values
// out: no device, no clock.
//
// Bits are counted as HID counts them: bit 0 is the lowest of the first byte, a field's lowest bit
// comes first. The number of a report is no part of its bits.
#pragma once

#include "base/result.h"
#include "base/sample.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define HID_REPORT_BYTES_MAX 4096

struct hid_field {
    uint8_t report; // 0: the device does not number its reports
    int bit, count; // count 1 to 32; 0: the handle has no such field
};

struct hid_axis {
    struct hid_field field;
    int64_t closed, open; // raw values of opening 0 and 1; signed where one of them is negative
    double dead;          // of the way at both ends, 0 to 0.4
};

// What is read of each instrument, by channel - CHANNEL_FIRST_INSTRUMENT. Either all of the fields
// have a report's number or none has.
struct hid_layout {
    struct hid_handle {
        struct hid_axis opening;
        struct hid_field buttons; // bit i of the field: button i is down
    } handles[INSTRUMENT_COUNT];
    struct hid_field counter; // of reports, or of the device's time; count 0: none
    double count_ms;          // the time of one count
};

// What a device has said since it was opened.
struct hid_state {
    struct handle handles[INSTRUMENT_COUNT];
    bool has_opening[INSTRUMENT_COUNT], has_buttons[INSTRUMENT_COUNT];
    bool has_count; // the newest report
    uint32_t count;
};

// "[REPORT:]BIT COUNT CLOSED OPEN [DEAD]" and "[REPORT:]BIT COUNT", whole numbers but DEAD. False:
// not of that form, a field beyond HID_REPORT_BYTES_MAX, CLOSED and OPEN are equal or not values of
// such a field.
bool hid_axis_parse(const char *text, struct hid_axis *out_axis);
bool hid_field_parse(const char *text, struct hid_field *out_field);

// "[REPORT:]BIT COUNT MS": a field that counts, each count MS milliseconds (0.01 to 1000).
bool hid_counter_parse(const char *text, struct hid_field *out_field, double *out_count_ms);

bool hid_layout_is_numbered(const struct hid_layout *layout);

// The opening that a raw value stands for: 0 and 1 in the dead zones and beyond the ends, a
// straight line between.
double hid_opening(const struct hid_axis *axis, int64_t raw);

// Brings the state up to date with one report as hidraw gives it, its number first where the layout
// is numbered. Bit i of *out_news: the report has fields of instrument i (none: not a report that
// concerns us). RESULT_FORMAT: too short for its fields; the state is as it was.
enum result hid_report_read(const struct hid_layout *layout, const uint8_t *bytes, size_t size,
                            struct hid_state *state, uint32_t *out_news, struct error *err);

// All that the layout reads of instrument i has been said.
bool hid_state_is_whole(const struct hid_layout *layout, const struct hid_state *state, int i);
