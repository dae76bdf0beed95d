// One contract for all that a station reads. A driver reads its device in a thread of its own and
// knows nothing of sessions or the network; the runner (samples/runner.h) gives every device its
// thread, holds and loses silent ones, and catches jumps.
#pragma once

#include "base/marker.h"
#include "base/result.h"
#include "base/sample.h"

#define DEVICE_NAME_MAX 32
#define DEVICE_SAMPLES_MAX (3 * CHANNEL_COUNT) // of one reading: all that there may be

#define DEVICE_MARKERS_MAX 64 // of one reading

// The keys of a device's section in the station's config, in the order of the file.
struct device_option {
    const char *key, *value;
};

struct device_config {
    char name[DEVICE_NAME_MAX]; // [device NAME]
    const struct device_option *options;
    int option_count;
};

// What a device gives: one line for each channel and kind, known before it is connected.
struct device_outputs {
    int count;
    struct device_output {
        enum channel channel;
        enum sample_kind kind;
        uint8_t joint_values; // of a joint: bit i is value i of struct joint_angles; 0: all
    } outputs[DEVICE_SAMPLES_MAX];
};

// What one poll brought. channel, kind, time_ns and value are set by the driver; validity is OK or
// LOST (the source itself says that the value has no meaning; the value is not read then).
struct device_reading {
    int count;
    int malformed; // how many messages or values were refused
    int skipped;   // how many messages are of no interest to us
    bool heard;    // the device answered, also where that is no sample
    struct sample samples[DEVICE_SAMPLES_MAX];
    // Edges of its marker.NAME keys, with the time at which they were measured.
    int marker_count, markers_lost; // there was no room for so many
    struct device_marker {
        const char *name; // of the driver's; it stays
        int64_t time_ns;
        double value;
    } markers[DEVICE_MARKERS_MAX];
};

// create .. destroy live as long as the station; open .. close once for each connection, always in
// this order. `config` is not kept: a driver copies what it needs.
struct device_driver {
    const char *name; // "modbus", "hid", "tracker", "recorded", "simulated"

    // Checks every option and reads files that they name, but touches no device. An unknown key, a
    // value out of range: RESULT_INVALID; a missing one: RESULT_MISSING; the error names the key.
    enum result (*create)(const struct device_config *config, void **out_device,
                          struct device_outputs *out_outputs, struct error *err);

    // Connects, within about a second (a name server's answer aside). Any failure: the runner tries
    // again after a growing pause.
    enum result (*open)(void *device, struct error *err);

    // Waits for the next reading, at most about 100 ms. RESULT_OK with count >= 0;
    // RESULT_TIMEOUT: silent, ask again; RESULT_FORMAT: something malformed was refused, ask again
    // (the reading counts it, and samples may have come with it); anything else, as RESULT_CLOSED:
    // gone, the runner closes it and opens it again. The caller zeroes *out_reading.
    enum result (*poll)(void *device, struct device_reading *out_reading, struct error *err);

    void (*close)(void *device);
    void (*destroy)(void *device);
};

// The table, ended by NULL.
extern const struct device_driver *const device_drivers[];

const struct device_driver *device_driver(const char *name); // NULL: no such driver
