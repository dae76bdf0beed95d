// One request to a Modbus slave, and its reply, on a connection of libmodbus. libmodbus writes and
// reads the messages; here is told which reply belongs to which request. No threads.
#pragma once

#include <modbus.h>
#include <stdbool.h>
#include <stdint.h>

struct modbus_request {
    int slave;
    bool input; // input registers (function 4), else holding registers (function 3)
    int first, count;
    int timeout_ms;
};

struct modbus_connection {
    modbus_t *modbus;
    bool is_serial;
    bool echo;      // the adapter hears what it sends itself
    bool is_shared; // other slaves have it too
    uint16_t transaction;
};

// 0, or the errno of the system or of libmodbus. A reply of another transaction (TCP) is passed
// over, and the wait goes on. So is one of another slave, function or length on a line that is
// shared; else it is an error at once.
int modbus_exchange(struct modbus_connection *connection, const struct modbus_request *request,
                    uint16_t *out_registers);

bool modbus_is_gone(int code);   // the connection is of no use any more
bool modbus_is_answer(int code); // the slave itself says no: it is in step
bool modbus_is_absent(int code); // no answer, or a gateway's word that it got none
