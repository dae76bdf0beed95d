// Edges of what a device measures: the markers of its config. A button or coil is 1 or 0; of a
// register each change is an edge.
#pragma once

#include "drivers/device.h"

#define EDGES_MAX 16 // of one device

struct edge {
    char name[MARKER_TEXT_MAX];
    bool each;  // change counts; else only one to a value other than 0
    bool known; // since the device was opened
    double value;
    int64_t last_ns;
};

// The key "marker.NAME" of a device's section. Returns its value, or NULL: the key is another one.
const char *edge_key(const struct device_option *option);

// Gives the edge its name. RESULT_INVALID: the name, or the device's, is none that a marker can
// have.
enum result edge_init(struct edge *edge, const struct device_config *config, const char *key,
                      struct error *err);

// "WORD both" and the like: takes `both` off the end of a text. True: it was there.
bool edge_take_both(char *text);

// The config is read. RESULT_INVALID: a marker that is held (base/marker.h) needs `both`.
enum result edge_check(const struct edge *edge, const struct device_config *config, const char *key,
                       struct error *err);

// The device is opened anew: nobody knows when what has changed since did so.
void edge_begin(struct edge *edge);

// What was measured. Adds a marker to the reading where that is an edge. What follows within 5 ms
// is bouncing, and looked at again after that.
void edge_see(struct edge *edge, double value, int64_t time_ns, struct device_reading *reading);

// `name` must stay.
void reading_add_marker(struct device_reading *reading, const char *name, int64_t time_ns,
                        double value);
