// The line to Modbus slaves: a serial line, or a TCP address (a slave's, or a gateway's to
// several). It owns the one port or connection. Devices that name the same line share it as its
// slaves: their requests go out one after the other, in the order in which they ask, and a slave
// that does not answer costs the others its timeout and no more.
#pragma once

#include "base/result.h"
#include "drivers/modbus_exchange.h"

#include <stdbool.h>
#include <stdint.h>

struct modbus_line;

struct modbus_line_settings {
    const char *device;           // which one asks
    const char *address, *serial; // one of them is empty
    int baud;
    char parity; // as libmodbus has it: N, E, O
    int stop_bits;
    bool echo;
};

// Of any thread. Nothing is opened yet. RESULT_INVALID: another device has this line with other
// settings; the error names both.
enum result modbus_line_join(const struct modbus_line_settings *settings,
                             struct modbus_line **out_line, struct error *err);
void modbus_line_leave(struct modbus_line **line);

// Of one device: what is left of its last call is in here. Zeroed at first.
struct modbus_user {
    uint64_t connection, ticket;
    bool waits;     // for its turn, or
    bool has_asked; // in its turn, for the reply
    int64_t sent_ns, deadline_ns;
};

// Connects, unless another device has done so. A serial port is locked: no other program that locks
// it, and no line of another name, can have it.
enum result modbus_line_open(struct modbus_line *line, struct modbus_user *user, struct error *err);
void modbus_line_close(struct modbus_line *line, struct modbus_user *user);

// Waits for its turn and asks once. 0: the registers are there, and *out_time_ns is the middle
// between request and reply. MODBUS_PENDING: after 100 ms that is still to come; call again with
// the same request. Else an errno of modbus_exchange.h; ENOTCONN: the connection was closed;
// MODBUS_JUNK: not asked, because bytes waited that nobody had asked for; MODBUS_BUSY: not asked,
// because an earlier reply still comes. MODBUS_UNFINISHED closes a TCP connection.
#define MODBUS_JUNK (-1)
#define MODBUS_BUSY (-4)
int modbus_line_ask(struct modbus_line *line, struct modbus_user *user,
                    const struct modbus_request *request, uint16_t *out_registers,
                    int64_t *out_time_ns);

// Late replies of the slave are waited for until then, and thrown away before the next request.
// Until when the slave should not be asked; 0: it may be.
void modbus_line_leave_alone(struct modbus_line *line, int slave, int64_t until_ns);
int64_t modbus_line_quiet_until(struct modbus_line *line, int slave);

const char *modbus_line_name(const struct modbus_line *line);

// Some slave answered since then (clock_now_ns()).
bool modbus_line_answered_since(struct modbus_line *line, int64_t time_ns);
