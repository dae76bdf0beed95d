#include "base/check.h"
#include "device/socket.h"
#include "tools/probe.h"

#include <errno.h>
#include <modbus.h>
#include <stdbool.h>
#include <string.h>
#include <time.h>

#define REGISTERS_MAX 16
#define READINGS 4
#define TIMEOUT_US 200000
#define SERIAL_BAUD 115200

// Values of the block from register 0, read several times.
struct block {
    int count;
    uint16_t values[READINGS][REGISTERS_MAX];
};

static void pause_ms(long ms) {
    struct timespec time = {0, ms * 1000000};
    nanosleep(&time, NULL);
}

static bool is_serial(const char *line) {
    return line[0] == '/' || !strchr(line, ':');
}

static enum result open_line(const char *line, modbus_t **out_modbus, struct error *err) {
    char host[SOCKET_HOST_MAX], port[SOCKET_PORT_MAX];
    modbus_t *modbus;
    if (is_serial(line)) {
        modbus = modbus_new_rtu(line, SERIAL_BAUD, 'N', 8, 1);
    } else {
        enum result result = socket_split(line, host, port, err);
        if (result != RESULT_OK)
            return result;
        modbus = modbus_new_tcp_pi(host, port);
    }
    CHECK(modbus);
    modbus_set_response_timeout(modbus, 1, 0); // of connecting
    if (modbus_connect(modbus)) {
        fail(err, RESULT_CLOSED, "cannot connect to %s: %s", line, modbus_strerror(errno));
        modbus_free(modbus);
        return RESULT_CLOSED;
    }
    modbus_set_response_timeout(modbus, 0, TIMEOUT_US);
    *out_modbus = modbus;
    return RESULT_OK;
}

// The largest block from register 0 that the slave gives; 0: no slave. A slave that refuses an
// address is one; a line that was silent is flushed, for a late reply would answer the next
// request.
static int find_count(modbus_t *modbus, uint16_t *values) {
    for (int count = REGISTERS_MAX; count > 0; count--) {
        if (modbus_read_registers(modbus, 0, count, values) == count)
            return count;
        if (errno != EMBXILADD && errno != EMBXILVAL) {
            pause_ms(TIMEOUT_US / 1000);
            modbus_flush(modbus);
            return 0;
        }
    }
    return 0;
}

static bool read_block(modbus_t *modbus, struct block *out) {
    out->count = find_count(modbus, out->values[0]);
    for (int i = 1; i < READINGS && out->count; i++) {
        pause_ms(50);
        if (modbus_read_registers(modbus, 0, out->count, out->values[i]) != out->count)
            return false;
    }
    return out->count > 0;
}

// The register that rises from reading to reading; -1: none does.
static int find_sequence(const struct block *block) {
    for (int r = 0; r < block->count; r++) {
        bool rises = true;
        for (int i = 1; i < READINGS && rises; i++) {
            int step = (int16_t)(block->values[i][r] - block->values[i - 1][r]);
            rises = step > 0 && step < 1000;
        }
        if (rises)
            return r;
    }
    return -1;
}

static void propose_values(const struct block *block, int sequence, FILE *config) {
    static const char *const keys[] = {"flexion", "varus",  "internal",
                                       "shift",   "drawer", "distraction"};
    bool ours = sequence == 0 && block->count >= 9;
    if (sequence >= 0)
        fprintf(config, "sequence = %d\n", sequence);
    if (ours)
        fputs(
            "; a guess, from the registers of arthron-mockup: compare the values with the joint\n",
            config);
    else
        fputs("; name the registers: KEY = REGISTER SCALE [OFFSET]\n", config);
    for (int i = 0; i < 6; i++)
        if (ours)
            fprintf(config, "%s = %d 0.01\n", keys[i], i + 1);
        else
            fprintf(config, "; %s =\n", keys[i]);
    if (ours)
        fputs("punch.opening = 7 0.0001\npunch.buttons = 8\n", config);
}

static void report(const char *line, int slave, const struct block *block, FILE *config,
                   json_t *out) {
    const uint16_t *newest = block->values[READINGS - 1];
    int sequence = find_sequence(block);
    json_t *registers = json_array();
    fprintf(config, "\n; %s, slave %d, registers:", line, slave);
    for (int r = 0; r < block->count; r++) {
        fprintf(config, " %d:%u", r, newest[r]);
        json_array_append_new(registers, json_integer(newest[r]));
    }
    fprintf(config, "\n[device modbus-%zu]\ndriver = modbus\n%s = %s\nslave = %d\n",
            json_array_size(out) + 1, is_serial(line) ? "serial" : "address", line, slave);
    propose_values(block, sequence, config);
    json_array_append_new(out, json_pack("{s:s, s:i, s:o, s:i}", "line", line, "slave", slave,
                                         "registers", registers, "sequence", sequence));
}

enum result probe_modbus(const char *line, int slaves, FILE *config, json_t *out,
                         struct error *err) {
    modbus_t *modbus;
    enum result result = open_line(line, &modbus, err);
    if (result != RESULT_OK)
        return result;
    int found = 0;
    for (int slave = 1; slave <= slaves; slave++) {
        struct block block;
        modbus_set_slave(modbus, slave);
        if (!read_block(modbus, &block))
            continue;
        report(line, slave, &block, config, out);
        found++;
    }
    modbus_close(modbus);
    modbus_free(modbus);
    return found ? RESULT_OK
                 : fail(err, RESULT_TIMEOUT,
                        "%s: no slave from 1 to %d answers. Check its cable, baud rate and number",
                        line, slaves);
}
