#include "device/modbus_exchange.h"

#include "base/clock.h"

#include <errno.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum { REQUEST_BYTES = 6, RTU_BYTES = REQUEST_BYTES + 2, TCP_BYTES = REQUEST_BYTES + 6 };
enum { RTU_CHECKSUM_BYTES = 2, EXCEPTION = 0x80 };

// What came: 0 for the reply, libmodbus's errno for an error, this for another one's.
static const int not_ours = -1;

static void write_16(uint8_t *out, int value) {
    out[0] = (uint8_t)(value >> 8);
    out[1] = (uint8_t)value;
}

static void encode(const struct modbus_request *r, uint8_t out[REQUEST_BYTES]) {
    out[0] = (uint8_t)r->slave;
    out[1] = r->input ? MODBUS_FC_READ_INPUT_REGISTERS : MODBUS_FC_READ_HOLDING_REGISTERS;
    write_16(out + 2, r->first);
    write_16(out + 4, r->count);
}

// libmodbus sends a request with a transaction's number only together with the wait for its reply.
static int send_numbered(struct modbus_connection *c, const uint8_t request[REQUEST_BYTES]) {
    uint8_t bytes[TCP_BYTES] = {0};
    write_16(bytes, ++c->transaction);
    write_16(bytes + 4, REQUEST_BYTES);
    memcpy(bytes + 6, request, REQUEST_BYTES);
    ssize_t size = send(modbus_get_socket(c->modbus), bytes, sizeof bytes, MSG_NOSIGNAL);
    return size == (ssize_t)sizeof bytes ? 0 : size < 0 ? errno : EIO;
}

// The request comes back before the reply does.
static int take_echo(struct modbus_connection *c, const uint8_t request[REQUEST_BYTES],
                     int64_t deadline_ns) {
    uint8_t bytes[RTU_BYTES];
    int fd = modbus_get_socket(c->modbus);
    for (size_t used = 0; used < sizeof bytes;) {
        struct pollfd ready = {.fd = fd, .events = POLLIN};
        int64_t left_ms = (deadline_ns - clock_now_ns()) / NS_PER_MS;
        if (left_ms < 0 || poll(&ready, 1, (int)left_ms) == 0)
            return ETIMEDOUT;
        ssize_t size = read(fd, bytes + used, sizeof bytes - used);
        if (size <= 0)
            return size ? errno : EIO;
        used += (size_t)size;
    }
    return memcmp(bytes, request, REQUEST_BYTES) ? EMBBADDATA : 0;
}

static int send_request(struct modbus_connection *c, const struct modbus_request *r,
                        int64_t deadline_ns) {
    uint8_t request[REQUEST_BYTES];
    encode(r, request);
    if (!c->is_serial)
        return send_numbered(c, request);
    if (modbus_send_raw_request(c->modbus, request, sizeof request) < 0)
        return errno;
    return c->echo ? take_echo(c, request, deadline_ns) : 0;
}

static int exception_of(uint8_t code) {
    return code >= MODBUS_EXCEPTION_ILLEGAL_FUNCTION && code < MODBUS_EXCEPTION_MAX
               ? MODBUS_ENOBASE + code
               : EMBBADEXC;
}

// `length` bytes of a message whose checksum is right.
static int read_reply(const struct modbus_connection *c, const struct modbus_request *r,
                      const uint8_t *bytes, int length, uint16_t *out_registers) {
    int header = modbus_get_header_length(c->modbus), size = 2 * r->count;
    int whole = header + 2 + size + (c->is_serial ? RTU_CHECKSUM_BYTES : 0);
    uint8_t request[REQUEST_BYTES];
    encode(r, request);
    if (!c->is_serial && (bytes[0] << 8 | bytes[1]) != c->transaction)
        return not_ours;
    if (bytes[header - 1] != request[0] && (c->is_serial || c->is_shared))
        return c->is_shared ? not_ours : EMBBADSLAVE;
    if (bytes[header] == (request[1] | EXCEPTION))
        return exception_of(bytes[header + 1]);
    if (bytes[header] != request[1] || bytes[header + 1] != size || length != whole)
        return c->is_shared ? not_ours : EMBBADDATA;
    for (int i = 0; i < r->count; i++)
        out_registers[i] = (uint16_t)(bytes[header + 2 + 2 * i] << 8 | bytes[header + 3 + 2 * i]);
    return 0;
}

int modbus_exchange(struct modbus_connection *c, const struct modbus_request *r,
                    uint16_t *out_registers) {
    int64_t deadline_ns = clock_now_ns() + r->timeout_ms * NS_PER_MS, left_ns;
    modbus_set_slave(c->modbus, r->slave);
    int code = send_request(c, r, deadline_ns);
    if (code)
        return code;
    while ((left_ns = deadline_ns - clock_now_ns()) > 0) {
        uint8_t bytes[MODBUS_MAX_ADU_LENGTH] = {0};
        modbus_set_response_timeout(c->modbus, 0, (uint32_t)(left_ns / 1000 + 1));
        int length = modbus_receive_confirmation(c->modbus, bytes);
        if (length < 0)
            return errno;
        code = read_reply(c, r, bytes, length, out_registers);
        if (code != not_ours)
            return code;
    }
    return ETIMEDOUT;
}

bool modbus_is_gone(int code) {
    return code && code < MODBUS_ENOBASE && code != ETIMEDOUT && code != EINTR;
}

bool modbus_is_answer(int code) {
    return code >= EMBXILFUN && code < EMBXGPATH;
}

bool modbus_is_absent(int code) {
    return code == ETIMEDOUT || code == EMBXGPATH || code == EMBXGTAR;
}
