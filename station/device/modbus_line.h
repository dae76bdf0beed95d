// The line to Modbus slaves. A TCP connection belongs to one device. A serial line may have several
// slaves, each a device of its own: they share the one port and speak by turns, in the order in
// which they ask.
#pragma once

#include "base/result.h"

#include <modbus.h>
#include <stdbool.h>
#include <stdint.h>

struct modbus_line;

struct modbus_line_settings {
    const char *device;           // which one asks
    const char *address, *serial; // one of them is empty
    int baud;
    char parity; // as libmodbus has it: N, E, O
};

// Of any thread. Nothing is opened yet. RESULT_INVALID: another device has this serial line with
// another baud or parity; the error names both.
enum result modbus_line_join(const struct modbus_line_settings *settings,
                             struct modbus_line **out_line, struct error *err);
void modbus_line_leave(struct modbus_line **line);

// Connects, unless another device has done so. *out_connection is what modbus_line_begin wants.
// The port is locked: no other program that locks it, and no line of another name, can have it too.
enum result modbus_line_open(struct modbus_line *line, uint64_t *out_connection, struct error *err);
void modbus_line_close(struct modbus_line *line);

// Waits for a turn: from now on nobody else speaks. NULL: the connection is gone, and there is no
// turn to end.
modbus_t *modbus_line_begin(struct modbus_line *line, uint64_t connection, int slave,
                            int timeout_ms);

enum modbus_line_outcome {
    LINE_ANSWERED,
    LINE_SILENT,
    LINE_BROKEN
}; // broken: it is closed for all
void modbus_line_end(struct modbus_line *line, enum modbus_line_outcome outcome);

const char *modbus_line_name(const struct modbus_line *line);
bool modbus_line_is_shared(struct modbus_line *line);

// Some slave answered since then (clock_now_ns()).
bool modbus_line_answered_since(struct modbus_line *line, int64_t time_ns);
