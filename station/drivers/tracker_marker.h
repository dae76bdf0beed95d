// Markers that an OpenIGTLink server tells as STRING messages.
//
//   marker.NAME  string DEVICE: each STRING of this device. The value is the number that the text
//                says, else 1
#pragma once

#include "drivers/edges.h"
#include "drivers/stamp.h"
#include "igtl/stream.h"

struct tracker_markers {
    int count;
    struct tracker_marker {
        struct edge edge; // its name
        char device[IGTL_DEVICE_SIZE];
    } all[EDGES_MAX];
    struct stamp_clock clock; // of the sender
};

enum result tracker_markers_configure(const struct device_config *config,
                                      struct tracker_markers *out, struct error *err);

void tracker_markers_begin(struct tracker_markers *markers); // a connection

// Adds the markers of a STRING to the reading, at the time of its stamp, or of its arrival where it
// has none that can be believed. False: no device that is named sent it.
bool tracker_markers_take(struct tracker_markers *markers, bool uses_stamps,
                          const struct igtl_message *message, int64_t arrival_ns,
                          struct device_reading *reading);
