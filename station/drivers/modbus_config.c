#include "drivers/modbus_config.h"

#include "base/clock.h"
#include "drivers/drivers.h"
#include "drivers/socket.h"

#include <modbus.h>
#include <stdio.h>
#include <string.h>

static const char *const joint_keys[MODBUS_JOINT_VALUES] = {"flexion", "varus",  "internal",
                                                            "shift",   "drawer", "distraction"};

enum sample_kind modbus_kind_of(const struct modbus_named *v) {
    return v->what < MODBUS_JOINT_VALUES ? SAMPLE_JOINT
           : v->what < MODBUS_FORCE      ? SAMPLE_HANDLE
                                         : SAMPLE_FORCE;
}

int modbus_printed(const struct modbus_settings *settings, int address) {
    return settings->numbering.first + address;
}

static enum result add_text(struct modbus_settings *s, const struct device_config *config,
                            const char *key, const char *text, enum channel channel, int what,
                            struct error *err) {
    struct modbus_named v = {channel, what, {.bits = 16}};
    v.in.kind = what == MODBUS_OPENING || what == MODBUS_BUTTONS ? MODBUS_UNSIGNED : MODBUS_SIGNED;
    if (!modbus_value_parse(text, &s->numbering, &v.in) ||
        (what == MODBUS_BUTTONS && strpbrk(text, " \t")))
        return option_fail(
            config, key, err, RESULT_INVALID, "\"%s\" is not %s, registers counted from %d", text,
            what == MODBUS_BUTTONS ? "a register" : "REGISTER [SCALE [OFFSET]] [TYPE]",
            s->numbering.first);
    s->values[s->value_count++] = v;
    return RESULT_OK;
}

static enum result add_value(struct modbus_settings *s, const struct device_config *config,
                             const char *key, enum channel channel, int what, struct error *err) {
    const char *text = option_text(config, key);
    return text ? add_text(s, config, key, text, channel, what, err) : RESULT_OK;
}

static enum result add_modbus_force(struct modbus_settings *s, const struct device_config *config,
                                    enum channel channel, struct error *err) {
    char key[64], parts[FORCE_PARTS_MAX][FORCE_TEXT_MAX];
    enum result result = RESULT_OK;
    struct force *force = &s->forces[channel];
    snprintf(key, sizeof key, "%s.force", channel_name(channel));
    const char *text = option_text(config, key);
    if (text && !(force->count = force_split(text, parts)))
        return option_fail(config, key, err, RESULT_INVALID,
                           "\"%s\" is neither one value nor three, separated by commas", text);
    for (int i = 0; i < force->count && result == RESULT_OK; i++)
        result = add_text(s, config, key, parts[i], channel, MODBUS_FORCE + i, err);
    return result == RESULT_OK ? force_read_zero(config, channel, force, err) : result;
}

static enum result add_handle(struct modbus_settings *s, const struct device_config *config,
                              enum channel channel, struct error *err) {
    char key[64];
    snprintf(key, sizeof key, "%s.opening", channel_name(channel));
    enum result result = add_value(s, config, key, channel, MODBUS_OPENING, err);
    snprintf(key, sizeof key, "%s.buttons", channel_name(channel));
    if (result == RESULT_OK)
        result = add_value(s, config, key, channel, MODBUS_BUTTONS, err);
    return result;
}

// The block from the lowest to the highest register that is named.
static enum result find_block(struct modbus_settings *s, const struct device_config *config,
                              struct error *err) {
    int low = s->sequence >= 0 ? s->sequence : 65535, high = s->sequence;
    for (int i = 0; i < s->value_count; i++) {
        const struct modbus_value *v = &s->values[i].in;
        int last = v->address + modbus_value_words(v) - 1;
        low = v->address < low ? v->address : low;
        high = last > high ? last : high;
    }
    modbus_edges_widen(&s->edges, &low, &high);
    s->request.first = low;
    s->request.count = high < low ? 0 : high - low + 1;
    if (s->request.count > MODBUS_MAX_READ_REGISTERS)
        return fail(err, RESULT_LIMIT,
                    "[device %s]: registers %d to %d are too many: one reading has at most %d",
                    config->name, modbus_printed(s, low), modbus_printed(s, high),
                    MODBUS_MAX_READ_REGISTERS);
    return RESULT_OK;
}

static enum result configure_values(struct modbus_settings *s, const struct device_config *config,
                                    struct device_outputs *outputs, struct error *err) {
    enum result result = RESULT_OK;
    for (int i = 0; i < MODBUS_JOINT_VALUES && result == RESULT_OK; i++)
        result = add_value(s, config, joint_keys[i], CHANNEL_JOINT, i, err);
    for (int c = CHANNEL_FIRST_INSTRUMENT; c < CHANNEL_COUNT && result == RESULT_OK; c++)
        result = add_handle(s, config, (enum channel)c, err);
    for (int c = 0; c < CHANNEL_COUNT && result == RESULT_OK; c++)
        result = add_modbus_force(s, config, (enum channel)c, err);
    if (result != RESULT_OK)
        return result;
    if (!s->value_count && !s->edges.count)
        return fail(
            err, RESULT_MISSING,
            "[device %s]: the section names no register, as flexion = 1 does, and no marker",
            config->name);
    for (int i = 0; i < s->value_count; i++)
        outputs_add(outputs, s->values[i].channel, modbus_kind_of(&s->values[i]));
    for (int i = 0; i < s->value_count; i++)
        if (s->values[i].channel == CHANNEL_JOINT) // the first output, then
            outputs->outputs[0].joint_values |= (uint8_t)(1 << s->values[i].what);
    return find_block(s, config, err);
}

// The rates that libmodbus sets; another one would silently be 9600.
static enum result read_baud(struct modbus_settings *s, const struct device_config *config,
                             struct error *err) {
    static const int known[] = {300,     600,     1200,    2400,    4800,    9600,
                                19200,   38400,   57600,   115200,  230400,  460800,
                                500000,  576000,  921600,  1000000, 1152000, 1500000,
                                2500000, 3000000, 3500000, 4000000};
    enum result result = option_integer(config, "baud", 300, 4000000, 115200, &s->baud, err);
    for (size_t i = 0; i < sizeof known / sizeof *known && result == RESULT_OK; i++)
        if (known[i] == s->baud)
            return RESULT_OK;
    return result != RESULT_OK
               ? result
               : option_fail(config, "baud", err, RESULT_INVALID,
                             "%d is not a rate that a serial line has: 9600, 19200, 38400, 57600, "
                             "115200, 230400, 460800, 500000, 921600, 1000000 and so on",
                             s->baud);
}

// Over TCP a device that is no gateway has 255, or whatever.
static enum result read_slave(struct modbus_settings *s, const struct device_config *config,
                              struct error *err) {
    bool serial = s->serial[0];
    enum result result =
        option_integer(config, "slave", serial, serial ? 247 : 255, 1, &s->request.slave, err);
    if (result == RESULT_OK && s->request.slave > 247 && s->request.slave < 255)
        return option_fail(config, "slave", err, RESULT_INVALID,
                           "%d is neither a number from 0 to 247 nor 255", s->request.slave);
    return result;
}

static enum result read_parity(struct modbus_settings *s, const struct device_config *config,
                               struct error *err) {
    const char *parity = option_text(config, "parity");
    s->parity = !parity || !strcmp(parity, "none") ? 'N'
                : !strcmp(parity, "even")          ? 'E'
                : !strcmp(parity, "odd")           ? 'O'
                                                   : 0;
    return s->parity ? RESULT_OK
                     : option_fail(config, "parity", err, RESULT_INVALID,
                                   "\"%s\" is neither none, even nor odd", parity);
}

static enum result read_address(struct modbus_settings *s, const struct device_config *config,
                                struct error *err) {
    char host[SOCKET_HOST_MAX], port[SOCKET_PORT_MAX];
    struct error why;
    enum result result = option_required(config, "address", s->address, err);
    if (result == RESULT_OK && socket_split(s->address, host, port, &why) != RESULT_OK)
        result = option_fail(config, "address", err, RESULT_INVALID, "%s", why.text);
    return result;
}

static enum result configure_line(struct modbus_settings *s, const struct device_config *config,
                                  struct error *err) {
    static const char *const serial_keys[] = {"baud", "parity", "stop_bits", "echo"};
    bool tcp = option_text(config, "address"), rtu = option_text(config, "serial");
    if (tcp == rtu)
        return option_fail(config, "address", err, tcp ? RESULT_INVALID : RESULT_MISSING,
                           "one of address and serial is required");
    for (int i = 0; i < 4 && tcp; i++)
        if (option_text(config, serial_keys[i]))
            return option_fail(config, serial_keys[i], err, RESULT_INVALID,
                               "only a serial line has one");
    enum result result = read_parity(s, config, err);
    if (result == RESULT_OK)
        result = read_baud(s, config, err);
    if (result == RESULT_OK)
        result = option_integer(config, "stop_bits", 1, 2, 1, &s->stop_bits, err);
    if (result == RESULT_OK)
        result = option_switch(config, "echo", false, &s->echo, err);
    if (result != RESULT_OK)
        return result;
    return rtu ? option_required(config, "serial", s->serial, err) : read_address(s, config, err);
}

static enum result read_order(struct modbus_settings *s, const struct device_config *config,
                              struct error *err) {
    const char *order = option_text(config, "order");
    if (!order)
        return RESULT_OK;
    while (s->order < MODBUS_ORDER_COUNT && strcmp(order, modbus_order_names[s->order]) != 0)
        s->order++;
    return s->order < MODBUS_ORDER_COUNT
               ? RESULT_OK
               : option_fail_name(config, "order", err, "no such order of bytes", order,
                                  modbus_order_names);
}

// Which registers are read, and how they are counted.
static enum result configure_registers(struct modbus_settings *s,
                                       const struct device_config *config, struct error *err) {
    const char *kind = option_text(config, "registers"), *first;
    first = option_text(config, "first_register");
    if (first && !modbus_numbering_parse(first, &s->numbering))
        return option_fail(config, "first_register", err, RESULT_INVALID,
                           "\"%s\" is not 0, 1, 30001, 40001, 300001 or 400001", first);
    s->request.input = kind ? !strcmp(kind, "input") : s->numbering.tells_input;
    if (kind && !s->request.input && strcmp(kind, "holding") != 0)
        return option_fail(config, "registers", err, RESULT_INVALID,
                           "\"%s\" is neither holding nor input", kind);
    if (s->request.input ? s->numbering.tells_holding : s->numbering.tells_input)
        return option_fail(config, "registers", err, RESULT_INVALID,
                           "first_register %s does not count %s registers", first, kind);
    int low = s->numbering.first, sequence;
    enum result result =
        option_integer(config, "sequence", low, low + 65535, low - 1, &sequence, err);
    s->sequence = sequence - low;
    if (result == RESULT_OK)
        result = option_integer(config, "turn", 2, INT32_MAX, 0, &s->turn, err);
    return result == RESULT_OK ? read_order(s, config, err) : result;
}

enum result modbus_configure(const struct device_config *config, struct modbus_settings *s,
                             struct device_outputs *outputs, struct error *err) {
    static const char *const keys[] = {
        "address",  "serial",      "baud",       "parity",     "stop_bits", "echo",
        "slave",    "rate_hz",     "timeout_ms", "latency_ms", "registers", "first_register",
        "order",    "sequence",    "flexion",    "varus",      "internal",  "shift",
        "drawer",   "distraction", ".opening",   ".buttons",   ".force",    "zero.",
        "marker.*", "turn",        NULL};
    double rate_hz, latency_ms;
    *s = (struct modbus_settings){0};
    enum result result = options_check(config, keys, err);
    if (result == RESULT_OK)
        result = configure_line(s, config, err);
    if (result == RESULT_OK)
        result = read_slave(s, config, err);
    if (result == RESULT_OK)
        result = option_integer(config, "timeout_ms", 1, 2000, 50, &s->request.timeout_ms, err);
    if (result == RESULT_OK)
        result = configure_registers(s, config, err);
    if (result == RESULT_OK)
        result = option_number(config, "rate_hz", 1, 2000, 100, &rate_hz, err);
    if (result == RESULT_OK)
        result = option_number(config, "latency_ms", 1, 10000, s->serial[0] ? 500 : 50, &latency_ms,
                               err);
    if (result != RESULT_OK)
        return result;
    s->period_ns = (int64_t)(NS_PER_S / rate_hz);
    s->latency_ns = (int64_t)(latency_ms * NS_PER_MS);
    result = modbus_edges_read(config, &s->numbering, &s->request, &s->edges, err);
    return result == RESULT_OK ? configure_values(s, config, outputs, err) : result;
}
