// The markers of a Modbus slave: coils and discrete inputs, which are asked for in requests of
// their own, and registers, which are read with the slave's other values.
//
//   marker.NAME  coil N [both], input N [both], or register REGISTER [SCALE [OFFSET]] [TYPE]
//
// N counts as the maker does: from 0, or from 1 where first_register is not 0.
#pragma once

#include "drivers/edges.h"
#include "drivers/modbus_exchange.h"
#include "drivers/modbus_value.h"

#define MODBUS_EDGE_BITS_MAX MODBUS_MAX_READ_REGISTERS // between the first and the last

enum modbus_bits { MODBUS_COILS, MODBUS_INPUTS, MODBUS_BITS_COUNT };

struct modbus_edges {
    int count;
    struct modbus_edge {
        struct edge edge;
        bool is_register;
        enum modbus_bits kind;
        int bit;                // its address
        struct modbus_value in; // of a register
    } all[EDGES_MAX];
    struct modbus_request requests[MODBUS_BITS_COUNT]; // count 0: none
};

// Reads the keys. `request`: whom to ask, and how long to wait.
enum result modbus_edges_read(const struct device_config *config,
                              const struct modbus_numbering *numbering,
                              const struct modbus_request *request, struct modbus_edges *out_edges,
                              struct error *err);

// Widens a block of registers to those that are markers.
void modbus_edges_widen(const struct modbus_edges *edges, int *low, int *high);

void modbus_edges_begin(struct modbus_edges *edges); // the slave is opened anew

// What the block of registers from `first` on says, and what bits say that were asked for.
void modbus_edges_see_registers(struct modbus_edges *edges, enum modbus_order order, int first,
                                const uint16_t *registers, int64_t time_ns,
                                struct device_reading *reading);
void modbus_edges_see_bits(struct modbus_edges *edges, enum modbus_bits kind, const uint16_t *bits,
                           int64_t time_ns, struct device_reading *reading);
