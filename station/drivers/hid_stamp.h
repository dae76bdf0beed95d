// When a HID device made its reports. They carry no time, and may come several at a time: because
// the device or the bus packs them, or because nobody fetched them. No device, no clock.
#pragma once

#include <stdbool.h>
#include <stdint.h>

struct hid_stamps {
    int counter_bits; // of a field that counts, 0: none
    double count_ms;  // the time of one count

    bool is_counting; // what follows is known since the last pause
    uint32_t count;
    double device_ns, offset_ns; // by the counter; and from there to our clock, at the least delay
    double interval_ns;          // between two reports, usually; 0: not known yet
    int64_t arrival_ns, last_ns; // of what came last, and the newest time that was given
};

// The device is opened. What it is stays.
void hid_stamps_begin(struct hid_stamps *stamps);

// The times of n >= 1 reports that were found at now_ns, the oldest first; each is later than the
// one before. Where the device counts, `counts` has the counts of the reports, and times keep the
// device's own pace; else (NULL) they are spread over the usual interval between two reports.
void hid_stamps_of(struct hid_stamps *stamps, const uint32_t *counts, int n, int64_t now_ns,
                   int64_t *out_times_ns);
