#include "drivers/modbus_exchange.h"

#include "base/clock.h"

#include <errno.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum { REQUEST_BYTES = 6, RTU_BYTES = REQUEST_BYTES + 2, TCP_BYTES = REQUEST_BYTES + 6 };
enum { RTU_CHECKSUM_BYTES = 2, EXCEPTION = 0x80 };

// What came: 0 for the reply, libmodbus's errno for an error, this for another one's.
static const int not_ours = -3;

// Beyond twice the time that a reply's bytes need. USB adapters hold bytes back for 16 ms.
static const int64_t reply_slack_ns = 40 * NS_PER_MS;

static void write_16(uint8_t *out, int value) {
    out[0] = (uint8_t)(value >> 8);
    out[1] = (uint8_t)value;
}

static void encode(const struct modbus_request *r, uint8_t out[REQUEST_BYTES]) {
    out[0] = (uint8_t)r->slave;
    out[1] = r->bits    ? (r->input ? MODBUS_FC_READ_DISCRETE_INPUTS : MODBUS_FC_READ_COILS)
             : r->input ? MODBUS_FC_READ_INPUT_REGISTERS
                        : MODBUS_FC_READ_HOLDING_REGISTERS;
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

// `used` bytes that came instead of the whole echo.
static bool is_reply(const uint8_t *bytes, size_t used, const uint8_t request[REQUEST_BYTES]) {
    size_t compared = used < REQUEST_BYTES ? used : REQUEST_BYTES;
    return memcmp(bytes, request, compared) && bytes[0] == request[0] &&
           (bytes[1] & ~EXCEPTION) == request[1];
}

// The request comes back before the reply does.
static int take_echo(struct modbus_connection *c, const uint8_t request[REQUEST_BYTES],
                     int64_t deadline_ns) {
    uint8_t bytes[RTU_BYTES] = {0};
    int fd = modbus_get_socket(c->modbus);
    for (size_t used = 0; used < sizeof bytes;) {
        struct pollfd ready = {.fd = fd, .events = POLLIN};
        int64_t left_ms = (deadline_ns - clock_now_ns()) / NS_PER_MS;
        if (left_ms < 0 || poll(&ready, 1, (int)left_ms) == 0)
            return !used || is_reply(bytes, used, request) ? MODBUS_NO_ECHO : ETIMEDOUT;
        ssize_t size = read(fd, bytes + used, sizeof bytes - used);
        if (size <= 0)
            return size ? errno : EIO;
        used += (size_t)size;
    }
    bool came_back = !memcmp(bytes, request, REQUEST_BYTES);
    return came_back ? 0 : is_reply(bytes, sizeof bytes, request) ? MODBUS_NO_ECHO : EMBBADDATA;
}

static int send_modbus_request(struct modbus_connection *c, const struct modbus_request *r,
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

static int reply_bytes(const struct modbus_request *r) {
    return r->bits ? (r->count + 7) / 8 : 2 * r->count;
}

// `length` bytes of a message whose checksum is right.
static int read_reply(const struct modbus_connection *c, const struct modbus_request *r,
                      const uint8_t *bytes, int length, uint16_t *out_registers) {
    int header = modbus_get_header_length(c->modbus);
    int size = reply_bytes(r);
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
    const uint8_t *data = bytes + header + 2;
    for (int i = 0; i < r->count; i++)
        out_registers[i] =
            r->bits ? data[i / 8] >> i % 8 & 1 : (uint16_t)(data[2 * i] << 8 | data[2 * i + 1]);
    return 0;
}

static bool starts_within(const struct modbus_connection *c, int64_t left_ns) {
    struct pollfd ready = {.fd = modbus_get_socket(c->modbus), .events = POLLIN};
    return poll(&ready, 1, (int)(left_ns / NS_PER_MS) + 1) != 0;
}

// What libmodbus takes of a request for a reply is five bytes at least.
static bool is_echo(const struct modbus_request *r, const uint8_t *bytes) {
    uint8_t request[REQUEST_BYTES];
    encode(r, request);
    return !memcmp(bytes, request, REQUEST_BYTES - 1);
}

// A message whose first byte is there. libmodbus without a byte's time-out has one for the whole.
static int receive(struct modbus_connection *c, const struct modbus_request *r, uint8_t *bytes,
                   int *out_length) {
    int whole = modbus_get_header_length(c->modbus) + 2 + reply_bytes(r) + RTU_CHECKSUM_BYTES;
    int64_t most_us = (reply_slack_ns + 2 * whole * c->byte_ns) / 1000;
    modbus_set_response_timeout(c->modbus, (uint32_t)(most_us / 1000000),
                                (uint32_t)(most_us % 1000000));
    modbus_set_byte_timeout(c->modbus, 0, 0);
    *out_length = modbus_receive_confirmation(c->modbus, bytes);
    if (*out_length >= 0)
        return 0;
    int code = errno == ETIMEDOUT ? MODBUS_UNFINISHED : errno;
    return c->is_serial && !modbus_is_gone(code) && is_echo(r, bytes) ? MODBUS_ECHO : code;
}

int modbus_send(struct modbus_connection *c, const struct modbus_request *r,
                int64_t *out_deadline_ns) {
    int64_t now_ns = clock_now_ns();
    *out_deadline_ns = now_ns + r->timeout_ms * NS_PER_MS;
    modbus_set_slave(c->modbus, r->slave);
    return send_modbus_request(c, r, now_ns + reply_slack_ns + 2 * RTU_BYTES * c->byte_ns);
}

int modbus_receive_reply(struct modbus_connection *c, const struct modbus_request *r,
                         int64_t deadline_ns, int64_t until_ns, uint16_t *out_registers) {
    int64_t end_ns = until_ns < deadline_ns ? until_ns : deadline_ns, left_ns;
    while ((left_ns = end_ns - clock_now_ns()) > 0 && starts_within(c, left_ns)) {
        uint8_t bytes[MODBUS_MAX_ADU_LENGTH] = {0};
        int length, code = receive(c, r, bytes, &length);
        if (!code)
            code = read_reply(c, r, bytes, length, out_registers);
        if (code != not_ours)
            return code;
    }
    return clock_now_ns() < deadline_ns ? MODBUS_PENDING : ETIMEDOUT;
}

bool modbus_is_gone(int code) {
    return code > 0 && code < MODBUS_ENOBASE && code != ETIMEDOUT && code != EINTR;
}

bool modbus_is_answer(int code) {
    return code >= EMBXILFUN && code < EMBXGPATH;
}

bool modbus_is_absent(int code) {
    return code == ETIMEDOUT || code == MODBUS_UNFINISHED || code == MODBUS_NO_ECHO ||
           code == EMBXGPATH || code == EMBXGTAR;
}
