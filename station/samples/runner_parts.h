// What the runner's files share.
#pragma once

#include "base/bucket.h"
#include "base/ring.h"
#include "samples/runner.h"
#include "samples/slot.h"

#include <pthread.h>

struct device {
    const struct device_driver *driver;
    void *handle;
    pthread_t thread;
    int64_t pause_ns;     // before the next try to open
    uint8_t joint_values; // that it gives: bit i is value i of struct joint_angles
    int64_t delay_ns;     // from a measurement to the time that the driver gives it
    bool was_open;
    bool has_markers;      // a key names one
    struct ring *markers;  // of struct marker, to the loop
    struct bucket marking; // how many there may be
    bool logged_lost[DEVICE_SAMPLES_MAX];
    int64_t refusal_logged_ns;

    pthread_mutex_t lock; // of what follows; held for copies only
    pthread_cond_t wake;
    bool stop;
    struct device_status status;
    int slot_count;
    struct slot slots[DEVICE_SAMPLES_MAX];
    int64_t second_ns; // start of the second in which readings are counted for the rate
    uint64_t second_readings;
};

struct runner {
    int64_t common_ns; // the time that the newest frame tells of
    double pace_ns;    // of the fastest tracker; INFINITY: there is none
    double alignment_ms;
    int count, started;
    struct device devices[RUNNER_DEVICES_MAX];
};

// Of a sample that the device gave. Both: with the device's lock.
struct slot *runner_slot(struct device *device, const struct sample *sample);
void runner_age_slots(struct device *device, int64_t now_ns);
