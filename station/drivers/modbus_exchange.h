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
    // Instead: discrete inputs (function 2), or coils (function 1); each comes as a 0 or a 1.
    bool bits;
};

struct modbus_connection {
    modbus_t *modbus;
    bool is_serial;
    bool echo;       // the adapter hears what it sends itself
    bool is_shared;  // other slaves have it too
    int64_t byte_ns; // how long one takes on a serial line; else 0
    uint16_t transaction;
};

// 0, or the errno of the system or of libmodbus. *out_deadline_ns: when the reply must have begun.
int modbus_send(struct modbus_connection *connection, const struct modbus_request *request,
                int64_t *out_deadline_ns);

// Waits for the reply to begin, at most until until_ns; MODBUS_PENDING: it may still come. Then it
// has its own length's time; one that has not ended then is MODBUS_UNFINISHED: more of it may come.
// 0, or an errno as above. A reply of another transaction (TCP) is passed over, and the wait goes
// on. So is one of another slave, function or length on a line that is shared; else it is an error
// at once.
#define MODBUS_UNFINISHED (-2)
#define MODBUS_ECHO (-6)    // the request itself came back, and `echo` is not set
#define MODBUS_NO_ECHO (-7) // it did not come back, and `echo` is set
#define MODBUS_PENDING (-5)
int modbus_receive_reply(struct modbus_connection *connection, const struct modbus_request *request,
                         int64_t deadline_ns, int64_t until_ns, uint16_t *out_registers);

bool modbus_is_gone(int code);   // the connection is of no use any more
bool modbus_is_answer(int code); // the slave itself says no: it is in step
bool modbus_is_absent(int code); // no whole answer, or a gateway's word for that
