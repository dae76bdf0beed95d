// Forces that an OpenIGTLink server tells as SENSOR messages.
//
//   force.CHANNEL     the name of the device that sends them
//   elements.CHANNEL  which of its numbers, from 1: one, or three for the length of a vector; 1
//   scale.CHANNEL     the newtons of one; what the message's unit says
//   zero.CHANNEL      the force, or its three components, with nothing pressing (drivers/force.h)
#pragma once

#include "drivers/force.h"
#include "drivers/stamp.h"
#include "igtl/stream.h"

struct tracker_force {
    char device[IGTL_DEVICE_SIZE]; // empty: there is no such force
    struct force force;
    int elements[FORCE_PARTS_MAX]; // from 0
    double scale;                  // 0: by the unit
    struct stamp_clock clock;      // the gauge's own
    bool is_unstamped;             // its stamps stand still
    int64_t stamp_ns, arrival_ns;  // of the newest value; 0: none
    double parts_n[FORCE_PARTS_MAX];
};

enum result tracker_force_configure(const struct device_config *config,
                                    struct tracker_force out[CHANNEL_COUNT],
                                    struct device_outputs *outputs, struct error *err);

// A connection begins.
void tracker_force_begin(struct tracker_force forces[CHANNEL_COUNT]);

// Adds a SENSOR's force to the reading. *out_is_ours: a device that is named sent it.
enum result tracker_force_take(struct tracker_force forces[CHANNEL_COUNT], bool uses_stamps,
                               const struct igtl_message *message, int64_t arrival_ns,
                               struct device_reading *reading, bool *out_is_ours,
                               struct error *err);
