// Reads the values of instrument handles and gauges out of the input reports of a HID device. Bytes
// in, values out: no device, no clock.
//
// Bits are counted as HID counts them: bit 0 is the lowest of the first byte, a field's lowest bit
// comes first. The number of a report is no part of its bits.
#pragma once

#include "base/result.h"
#include "base/sample.h"
#include "drivers/edges.h"
#include "drivers/force.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define HID_REPORT_BYTES_MAX 4096
#define HID_FORCE_NEWS INSTRUMENT_COUNT
#define HID_MARK_NEWS (1u << 31)

struct hid_field {
    uint8_t report; // 0: the device does not number its reports
    int bit, count; // count 1 to 32; 0: the handle has no such field
};

struct hid_axis {
    struct hid_field field;
    int64_t closed, open; // raw values of opening 0 and 1
    bool is_signed;       // said so, or one of them is negative
    double dead;          // of the way at both ends, 0 to 0.4
};

// newtons = scale · raw + offset; raw is NaN at an end of its range other than 0, where the force
// may be beyond (not of fewer than 8 bits).
struct hid_gauge {
    struct hid_field field;
    bool is_signed;
    double scale, offset;
};

// What is read of each instrument, by channel - CHANNEL_FIRST_INSTRUMENT. Either all of the fields
// have a report's number or none has.
struct hid_layout {
    struct hid_handle {
        struct hid_axis opening;
        struct hid_field buttons; // bit i of the field: button i is down
    } handles[INSTRUMENT_COUNT];
    struct hid_force {
        struct force force; // of count 0: none
        struct hid_gauge parts[FORCE_PARTS_MAX];
    } forces[CHANNEL_COUNT];
    struct hid_field marks[EDGES_MAX]; // markers: one bit each
    int mark_count;
    struct hid_field counter; // of reports, or of the device's time; count 0: none
    double count_ms;          // the time of one count
};

// What a device has said since it was opened.
struct hid_state {
    struct handle handles[INSTRUMENT_COUNT];
    bool has_opening[INSTRUMENT_COUNT], has_buttons[INSTRUMENT_COUNT];
    double forces_n[CHANNEL_COUNT][FORCE_PARTS_MAX];
    uint8_t has_force[CHANNEL_COUNT]; // bit i: part i
    uint32_t marks;                   // bit i: that of mark i
    uint32_t has_marks;
    bool has_count; // the newest report
    uint32_t count;
};

// "[REPORT:]BIT COUNT CLOSED OPEN [DEAD] [signed]" and "[REPORT:]BIT COUNT", whole numbers but
// DEAD. False: not of that form, a field beyond HID_REPORT_BYTES_MAX, CLOSED and OPEN are equal or
// not values of such a field.
bool hid_axis_parse(const char *text, struct hid_axis *out_axis);
bool hid_field_parse(const char *text, struct hid_field *out_field);

// "[REPORT:]BIT COUNT [SCALE [OFFSET]] [signed | unsigned]"; 1, 0, signed.
bool hid_gauge_parse(const char *text, struct hid_gauge *out_gauge);

// "[REPORT:]BIT COUNT MS": a field that counts, each count MS milliseconds (0.01 to 1000).
bool hid_counter_parse(const char *text, struct hid_field *out_field, double *out_count_ms);

bool hid_layout_is_numbered(const struct hid_layout *layout);

// The opening that a raw value stands for: 0 and 1 in the dead zones and beyond the ends, a
// straight line between.
double hid_opening(const struct hid_axis *axis, int64_t raw);

// Brings the state up to date with one report as hidraw gives it, its number first where the layout
// is numbered. Bit i of *out_news: the report has fields of instrument i's handle, bit
// HID_FORCE_NEWS + channel: of its force, HID_MARK_NEWS: of markers (none: not a report that
// concerns us). RESULT_FORMAT: too short for its fields; the state is as it was.
enum result hid_report_read(const struct hid_layout *layout, const uint8_t *bytes, size_t size,
                            struct hid_state *state, uint32_t *out_news, struct error *err);

// All that the layout reads of the handle of instrument i has been said.
bool hid_state_is_whole(const struct hid_layout *layout, const struct hid_state *state, int i);

// The same of a force.
bool hid_force_is_whole(const struct hid_layout *layout, const struct hid_state *state,
                        enum channel channel);
