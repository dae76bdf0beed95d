// The section of a Modbus device in the config (drivers/modbus.c has its keys).
#pragma once

#include "drivers/device.h"
#include "drivers/force.h"
#include "drivers/modbus_edges.h"
#include "drivers/modbus_line.h"
#include "drivers/modbus_value.h"
#include "drivers/options.h"

#define MODBUS_JOINT_VALUES 6 // flexion, varus, internal, shift, drawer, distraction
#define MODBUS_JOINT_ANGLES 3 // the first of them
#define MODBUS_VALUES_MAX                                                                          \
    (MODBUS_JOINT_VALUES + 2 * INSTRUMENT_COUNT + FORCE_PARTS_MAX * (CHANNEL_COUNT - 1))

enum modbus_what {
    MODBUS_OPENING = MODBUS_JOINT_VALUES, // below: a value of the joint
    MODBUS_BUTTONS,
    MODBUS_FORCE // and the index of its part
};

struct modbus_settings {
    char address[OPTION_TEXT_MAX], serial[OPTION_TEXT_MAX]; // one of them is empty
    int baud, stop_bits;
    char parity; // as libmodbus has it: N, E, O
    bool echo;
    struct modbus_numbering numbering;
    enum modbus_order order;
    struct modbus_request request; // one block, with all values
    int64_t period_ns, latency_ns;
    int sequence; // its address, -1: none
    int turn;     // counts after which an encoder of an angle begins anew; 0: it does not
    int value_count;
    struct modbus_named {
        enum channel channel;
        int what;
        struct modbus_value in;
    } values[MODBUS_VALUES_MAX];
    struct force forces[CHANNEL_COUNT]; // of count 0: none
    struct modbus_edges edges;
};

// Zeroes *out first.
enum result modbus_configure(const struct device_config *config, struct modbus_settings *out,
                             struct device_outputs *outputs, struct error *err);

enum sample_kind modbus_kind_of(const struct modbus_named *value);

// The register's number as the maker prints it.
int modbus_printed(const struct modbus_settings *settings, int address);
