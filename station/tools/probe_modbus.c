#include "base/clock.h"
#include "drivers/modbus_line.h"
#include "drivers/socket.h"
#include "tools/probe.h"
#include "tools/probe_registers.h"

#include <errno.h>
#include <string.h>
#include <time.h>

enum { TRY_MS = 100, READ_MS = 200, TRIES = 3, VALUES_PER_LINE = 10 };

// What makers set on serial lines, the usual first. Frames of one stop bit are heard in both.
static const struct serial {
    int baud;
    char parity;
    int stop_bits;
} serials[] = {{115200, 'N', 1}, {19200, 'E', 1},  {19200, 'N', 1}, {9600, 'N', 1},
               {9600, 'E', 1},   {38400, 'N', 1},  {38400, 'E', 1}, {57600, 'N', 1},
               {57600, 'E', 1},  {115200, 'E', 1}, {19200, 'O', 1}, {9600, 'O', 1},
               {19200, 'N', 2},  {115200, 'N', 2}, {9600, 'N', 2},  {38400, 'N', 2},
               {57600, 'N', 2},  {230400, 'N', 1}};

struct probed {
    const char *name;
    struct modbus_line_settings settings;
    struct modbus_line *line;
    struct modbus_user user;
    FILE *config;
    json_t *out;
    int found;
};

static void pause_ms(long ms) {
    struct timespec time = {0, ms * NS_PER_MS};
    nanosleep(&time, NULL);
}

static enum result open_line(struct probed *p, struct error *err) {
    enum result result = modbus_line_join(&p->settings, &p->line, err);
    if (result == RESULT_OK)
        result = modbus_line_open(p->line, &p->user, err);
    if (result != RESULT_OK && p->line)
        modbus_line_leave(&p->line);
    return result == RESULT_OK ? result : fail_in(err, result, "cannot connect to ");
}

static void close_line(struct probed *p) {
    modbus_line_close(p->line, &p->user);
    modbus_line_leave(&p->line);
}

// As modbus_line_ask. What another slave says late is passed over.
static int ask(struct probed *p, int slave, bool input, int count, int timeout_ms,
               uint16_t *registers) {
    const struct modbus_request request = {slave, input, 0, count, timeout_ms};
    int64_t time_ns;
    int code = MODBUS_JUNK;
    for (int i = 0;
         i < TRIES && (code == MODBUS_JUNK || code == MODBUS_BUSY || code == EMBBADSLAVE); i++)
        do
            code = modbus_line_ask(p->line, &p->user, &request, registers, &time_ns);
        while (code == MODBUS_PENDING);
    return code;
}

static bool is_there(int code) {
    return !code || modbus_is_answer(code);
}

// ---- registers ----------------------------------------------------------------------------------

// The largest block from register 0 that the slave gives; 0: none.
static int find_count(struct probed *p, int slave, bool input) {
    uint16_t registers[PROBE_REGISTERS_MAX];
    int good = 0, bad = PROBE_REGISTERS_MAX + 1;
    while (bad - good > 1) {
        int count = (good + bad) / 2;
        if (!ask(p, slave, input, count, READ_MS, registers))
            good = count;
        else
            bad = count;
    }
    return good;
}

static bool read_block(struct probed *p, int slave, bool input, struct probe_block *out) {
    *out = (struct probe_block){.count = find_count(p, slave, input)};
    for (int i = 0; i < PROBE_READINGS && out->count; i++) {
        if (i)
            pause_ms(50);
        if (ask(p, slave, input, out->count, READ_MS, out->values[i]))
            return false;
    }
    return out->count > 0;
}

// ---- the report ---------------------------------------------------------------------------------

static const char *parity_of(const struct probed *p) {
    return p->settings.parity == 'E' ? "even" : p->settings.parity == 'O' ? "odd" : "none";
}

static void propose_line(const struct probed *p, int slave) {
    bool serial = p->settings.serial[0];
    fprintf(p->config, "[device modbus-%zu]\ndriver = modbus\n%s = %s\n",
            json_array_size(p->out) + 1, serial ? "serial" : "address", p->name);
    if (serial)
        fprintf(p->config, "baud = %d\nparity = %s\nstop_bits = %d\n", p->settings.baud,
                parity_of(p), p->settings.stop_bits);
    if (p->settings.echo)
        fputs("echo = yes\n", p->config);
    fprintf(p->config, "slave = %d\n", slave);
}

static void report_block(struct probed *p, int slave, bool input, const struct probe_block *block) {
    const uint16_t *newest = block->values[PROBE_READINGS - 1];
    json_t *registers = json_array();
    fprintf(p->config, "\n; %s, slave %d, %s registers:", p->name, slave,
            input ? "input" : "holding");
    for (int r = 0; r < block->count; r++) {
        fprintf(p->config, "%s %d:%u", r % VALUES_PER_LINE ? "" : "\n; ", r, newest[r]);
        json_array_append_new(registers, json_integer(newest[r]));
    }
    if (!block->count)
        fputs(" none from 0 on; see the maker's manual", p->config);
    fputs("\n", p->config);
    propose_line(p, slave);
    if (input)
        fputs("registers = input\n", p->config);
    probe_propose_registers(block, !json_array_size(p->out), p->config);
    json_t *entry = json_pack("{s:s, s:i, s:s, s:o, s:i}", "line", p->name, "slave", slave, "kind",
                              input ? "input" : "holding", "registers", registers, "sequence",
                              probe_sequence(block));
    if (p->settings.serial[0])
        json_object_update_new(entry, json_pack("{s:i, s:s, s:i, s:b}", "baud", p->settings.baud,
                                                "parity", parity_of(p), "stop_bits",
                                                p->settings.stop_bits, "echo", p->settings.echo));
    json_array_append_new(p->out, entry);
}

// A slave that has both kinds of registers is read by its holding registers.
static void probe_slave(struct probed *p, int slave) {
    struct probe_block block;
    bool input = !read_block(p, slave, false, &block) && read_block(p, slave, true, &block);
    report_block(p, slave, input, &block);
    p->found++;
}

// ---- lines --------------------------------------------------------------------------------------

// An adapter that echoes spoils every reply, whoever is asked.
static bool is_echo(int code) {
    return code == EMBBADCRC || code == EMBBADDATA || code == MODBUS_ECHO;
}

// Slaves 1 to `slaves` that answer, each reported. *out_spoiled: no timeouts, but what came was no
// reply.
static enum result probe_slaves(struct probed *p, int slaves, bool *out_spoiled,
                                struct error *err) {
    uint16_t value;
    int timeout_ms = p->settings.serial[0] ? TRY_MS : READ_MS;
    enum result result = open_line(p, err);
    *out_spoiled = false;
    if (result != RESULT_OK)
        return result;
    for (int slave = 1; slave <= slaves && !*out_spoiled; slave++) {
        int code = ask(p, slave, false, 1, timeout_ms, &value);
        if (is_there(code))
            probe_slave(p, slave);
        *out_spoiled = is_echo(code) && !p->found;
    }
    close_line(p);
    return RESULT_OK;
}

static enum result probe_serial(struct probed *p, int slaves, struct error *err) {
    enum result result = RESULT_OK;
    for (size_t i = 0; i < sizeof serials / sizeof *serials && !p->found; i++) {
        bool spoiled;
        p->settings.baud = serials[i].baud;
        p->settings.parity = serials[i].parity;
        p->settings.stop_bits = serials[i].stop_bits;
        p->settings.echo = false;
        result = probe_slaves(p, slaves, &spoiled, err);
        if (result == RESULT_OK && spoiled) {
            p->settings.echo = true;
            result = probe_slaves(p, slaves, &spoiled, err);
        }
        if (result != RESULT_OK)
            return result;
    }
    return result;
}

enum result probe_modbus(const char *line, int slaves, FILE *config, json_t *out,
                         struct error *err) {
    char host[SOCKET_HOST_MAX], port[SOCKET_PORT_MAX];
    bool serial = line[0] == '/' || !strchr(line, ':'), spoiled;
    struct probed p = {.name = line, .config = config, .out = out};
    p.settings = (struct modbus_line_settings){
        "probe",       serial ? "" : line, serial ? line : "", .baud = serials[0].baud,
        .parity = 'N', .stop_bits = 1};
    enum result result = serial ? RESULT_OK : socket_split(line, host, port, err);
    if (result == RESULT_OK)
        result = serial ? probe_serial(&p, slaves, err) : probe_slaves(&p, slaves, &spoiled, err);
    if (result != RESULT_OK || p.found)
        return result;
    return fail(err, RESULT_TIMEOUT, "%s: no slave from 1 to %d answers. Check its cable%s number",
                line, slaves, serial ? ", baud rate and" : " and");
}
