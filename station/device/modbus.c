// Encoders and handles of a mock-up that is a Modbus slave, over TCP or a serial line (RTU).
//
//   address     host:port                       one of the two
//   serial      /dev/ttyUSB0 or the like
//   baud        115200                          of the serial line
//   parity      none, even or odd; none
//   stop_bits   1 or 2; 1
//   echo        yes: the adapter hears what it sends itself; no
//   slave       1 to 247; 1
//   rate_hz     readings a second, 1 to 2000; 100
//   timeout_ms  longest wait for a reply, 1 to 100; 50
//   latency_ms  after this time no late reply can come any more, 1 to 10000; 500, over TCP 50
//   sequence    the register that counts the slave's updates
//   registers   holding or input (functions 3 and 4); holding
//   first_register  the number that the maker gives to the first register (device/modbus_value.h);
//               0
//   order       of the bytes of a value in two registers: ABCD, CDAB, BADC, DCBA; ABCD
//
// and for each value `REGISTER [SCALE [OFFSET]] [TYPE]`, value = scale · registers + offset:
//   flexion, varus, internal (degrees), shift, drawer, distraction (mm); i16
//   CHANNEL.opening (0 to 1; a little beyond is cut, more refused); u16
//   CHANNEL.buttons (only a register)
//
// Devices with the same `serial` or `address` are slaves of one line (device/modbus_line.h): each
// has its own rate, and one that is silent does not close the line that others answer on.
//
// All registers are read in one block. A time stamp is the middle between request and reply.
//
// RTU replies carry no number: one that comes after its timeout would answer the next request, and
// every later reply would be one behind for ever. So after a timeout the line is left alone for
// latency_ms and flushed; bytes that wait before a request, and a sequence that goes back, lead to
// the same. (TCP replies are numbered. A slave that is alone at its address may reply by another
// slave's number: only the sequence finds another slave there.)
// A sequence that stands still is no new reading. One that goes back or leaps ahead is refused for
// a while; then the slave was started anew.

#include "base/check.h"
#include "base/clock.h"
#include "base/number.h"
#include "device/drivers.h"
#include "device/modbus_line.h"
#include "device/modbus_value.h"
#include "device/options.h"
#include "device/socket.h"

#include <errno.h>
#include <modbus.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { VALUES_MAX = 6 + 2 * INSTRUMENT_COUNT, TIMEOUTS_BEFORE_REOPENING = 4 };
static const int64_t sequence_memory_ns = 1500 * NS_PER_MS;
static const double opening_slack = 0.1, fastest_sequence_hz = 10000;
static const char *const joint_keys[] = {"flexion", "varus",  "internal",
                                         "shift",   "drawer", "distraction"};
enum { JOINT_VALUES = 6, OPENING = JOINT_VALUES, BUTTONS };

struct value {
    enum channel channel;
    int what; // index of joint_keys, OPENING or BUTTONS
    struct modbus_value in;
};

struct modbus_device {
    char address[OPTION_TEXT_MAX], serial[OPTION_TEXT_MAX]; // one of them is empty
    int baud, stop_bits;
    char parity; // as libmodbus has it: N, E, O
    bool echo;
    struct modbus_numbering numbering;
    enum modbus_order order;
    struct modbus_request request;
    int64_t period_ns, latency_ns;
    int sequence; // its address, -1: none
    int value_count;
    struct value values[VALUES_MAX];

    struct modbus_line *line;
    uint64_t connection;
    int64_t next_ns;
    int timeouts; // in a row
    int64_t opened_ns;
    bool answered; // since then
    bool has_last;
    int64_t last_ns; // when the sequence last followed
    uint16_t last[MODBUS_MAX_READ_REGISTERS];
};

// ---- config -------------------------------------------------------------------------------------

static enum result add_value(struct modbus_device *d, const struct device_config *config,
                             const char *key, enum channel channel, int what, struct error *err) {
    const char *text = option_text(config, key);
    if (!text)
        return RESULT_OK;
    struct value v = {channel, what, {.bits = 16}};
    v.in.kind = what < JOINT_VALUES ? MODBUS_SIGNED : MODBUS_UNSIGNED;
    if (!modbus_value_parse(text, &d->numbering, &v.in) ||
        (what == BUTTONS && strpbrk(text, " \t")))
        return option_fail(config, key, err, RESULT_INVALID,
                           "\"%s\" is not %s, registers counted from %d", text,
                           what == BUTTONS ? "a register" : "REGISTER [SCALE [OFFSET]] [TYPE]",
                           d->numbering.first);
    d->values[d->value_count++] = v;
    return RESULT_OK;
}

static enum result add_handle(struct modbus_device *d, const struct device_config *config,
                              enum channel channel, struct error *err) {
    char key[64];
    snprintf(key, sizeof key, "%s.opening", channel_name(channel));
    enum result result = add_value(d, config, key, channel, OPENING, err);
    snprintf(key, sizeof key, "%s.buttons", channel_name(channel));
    if (result == RESULT_OK)
        result = add_value(d, config, key, channel, BUTTONS, err);
    return result;
}

// The register's number as the maker prints it.
static int printed(const struct modbus_device *d, int address) {
    return d->numbering.first + address;
}

// The block from the lowest to the highest register that is named.
static enum result find_block(struct modbus_device *d, const struct device_config *config,
                              struct error *err) {
    int low = d->sequence >= 0 ? d->sequence : 65535, high = d->sequence;
    for (int i = 0; i < d->value_count; i++) {
        const struct modbus_value *v = &d->values[i].in;
        int last = v->address + modbus_value_words(v) - 1;
        low = v->address < low ? v->address : low;
        high = last > high ? last : high;
    }
    d->request.first = low;
    d->request.count = high - low + 1;
    if (d->request.count > MODBUS_MAX_READ_REGISTERS)
        return fail(err, RESULT_LIMIT,
                    "[device %s]: registers %d to %d are too many: one reading has at most %d",
                    config->name, printed(d, low), printed(d, high), MODBUS_MAX_READ_REGISTERS);
    return RESULT_OK;
}

static enum result configure_values(struct modbus_device *d, const struct device_config *config,
                                    struct device_outputs *outputs, struct error *err) {
    enum result result = RESULT_OK;
    for (int i = 0; i < JOINT_VALUES && result == RESULT_OK; i++)
        result = add_value(d, config, joint_keys[i], CHANNEL_JOINT, i, err);
    for (int c = CHANNEL_FIRST_INSTRUMENT; c < CHANNEL_COUNT && result == RESULT_OK; c++)
        result = add_handle(d, config, (enum channel)c, err);
    if (result != RESULT_OK)
        return result;
    if (!d->value_count)
        return fail(err, RESULT_MISSING,
                    "[device %s]: the section names no register, as flexion = 1 does",
                    config->name);
    for (int i = 0; i < d->value_count; i++)
        outputs_add(outputs, d->values[i].channel,
                    d->values[i].channel == CHANNEL_JOINT ? SAMPLE_JOINT : SAMPLE_HANDLE);
    return find_block(d, config, err);
}

static enum result read_parity(struct modbus_device *d, const struct device_config *config,
                               struct error *err) {
    const char *parity = option_text(config, "parity");
    d->parity = !parity || !strcmp(parity, "none") ? 'N'
                : !strcmp(parity, "even")          ? 'E'
                : !strcmp(parity, "odd")           ? 'O'
                                                   : 0;
    return d->parity ? RESULT_OK
                     : option_fail(config, "parity", err, RESULT_INVALID,
                                   "\"%s\" is neither none, even nor odd", parity);
}

static enum result read_address(struct modbus_device *d, const struct device_config *config,
                                struct error *err) {
    char host[SOCKET_HOST_MAX], port[SOCKET_PORT_MAX];
    struct error why;
    enum result result = option_required(config, "address", d->address, err);
    if (result == RESULT_OK && socket_split(d->address, host, port, &why) != RESULT_OK)
        result = option_fail(config, "address", err, RESULT_INVALID, "%s", why.text);
    return result;
}

static enum result configure_line(struct modbus_device *d, const struct device_config *config,
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
    enum result result = read_parity(d, config, err);
    if (result == RESULT_OK)
        result = option_integer(config, "baud", 300, 4000000, 115200, &d->baud, err);
    if (result == RESULT_OK)
        result = option_integer(config, "stop_bits", 1, 2, 1, &d->stop_bits, err);
    if (result == RESULT_OK)
        result = option_switch(config, "echo", false, &d->echo, err);
    if (result != RESULT_OK)
        return result;
    return rtu ? option_required(config, "serial", d->serial, err) : read_address(d, config, err);
}

static enum result read_order(struct modbus_device *d, const struct device_config *config,
                              struct error *err) {
    const char *order = option_text(config, "order");
    if (!order)
        return RESULT_OK;
    while (d->order < MODBUS_ORDER_COUNT && strcmp(order, modbus_order_names[d->order]) != 0)
        d->order++;
    return d->order < MODBUS_ORDER_COUNT
               ? RESULT_OK
               : option_fail_name(config, "order", err, "no such order of bytes", order,
                                  modbus_order_names);
}

// Which registers are read, and how they are counted.
static enum result configure_registers(struct modbus_device *d, const struct device_config *config,
                                       struct error *err) {
    const char *kind = option_text(config, "registers"), *first;
    first = option_text(config, "first_register");
    if (first && !modbus_numbering_parse(first, &d->numbering))
        return option_fail(config, "first_register", err, RESULT_INVALID,
                           "\"%s\" is not 0, 1, 30001, 40001, 300001 or 400001", first);
    d->request.input = kind ? !strcmp(kind, "input") : d->numbering.tells_input;
    if (kind && !d->request.input && strcmp(kind, "holding") != 0)
        return option_fail(config, "registers", err, RESULT_INVALID,
                           "\"%s\" is neither holding nor input", kind);
    if (d->request.input ? d->numbering.tells_holding : d->numbering.tells_input)
        return option_fail(config, "registers", err, RESULT_INVALID,
                           "first_register %s does not count %s registers", first, kind);
    int low = d->numbering.first, sequence;
    enum result result =
        option_integer(config, "sequence", low, low + 65535, low - 1, &sequence, err);
    d->sequence = sequence - low;
    return result == RESULT_OK ? read_order(d, config, err) : result;
}

static enum result configure(struct modbus_device *d, const struct device_config *config,
                             struct device_outputs *outputs, struct error *err) {
    static const char *const keys[] = {
        "address", "serial",      "baud",       "parity",     "stop_bits", "echo",
        "slave",   "rate_hz",     "timeout_ms", "latency_ms", "registers", "first_register",
        "order",   "sequence",    "flexion",    "varus",      "internal",  "shift",
        "drawer",  "distraction", ".opening",   ".buttons",   NULL};
    double rate_hz, latency_ms;
    enum result result = options_check(config, keys, err);
    if (result == RESULT_OK)
        result = configure_line(d, config, err);
    if (result == RESULT_OK)
        result = option_integer(config, "slave", 1, 247, 1, &d->request.slave, err);
    if (result == RESULT_OK)
        result = option_integer(config, "timeout_ms", 1, 100, 50, &d->request.timeout_ms, err);
    if (result == RESULT_OK)
        result = configure_registers(d, config, err);
    if (result == RESULT_OK)
        result = option_number(config, "rate_hz", 1, 2000, 100, &rate_hz, err);
    if (result == RESULT_OK)
        result = option_number(config, "latency_ms", 1, 10000, d->serial[0] ? 500 : 50, &latency_ms,
                               err);
    if (result != RESULT_OK)
        return result;
    d->period_ns = (int64_t)(NS_PER_S / rate_hz);
    d->latency_ns = (int64_t)(latency_ms * NS_PER_MS);
    return configure_values(d, config, outputs, err);
}

static enum result modbus_create(const struct device_config *config, void **out_device,
                                 struct device_outputs *out_outputs, struct error *err) {
    struct modbus_device *d = alloc(1, sizeof *d);
    enum result result = configure(d, config, out_outputs, err);
    struct modbus_line_settings line = {config->name, d->address,   d->serial, d->baud,
                                        d->parity,    d->stop_bits, d->echo};
    if (result == RESULT_OK)
        result = modbus_line_join(&line, &d->line, err);
    if (result == RESULT_OK)
        *out_device = d;
    else
        free(d);
    return result;
}

static void modbus_destroy(void *device) {
    struct modbus_device *d = device;
    modbus_line_leave(&d->line);
    free(d);
}

// ---- the line -----------------------------------------------------------------------------------

static enum result modbus_open(void *device, struct error *err) {
    struct modbus_device *d = device;
    enum result result = modbus_line_open(d->line, &d->connection, err);
    d->next_ns = d->opened_ns = clock_now_ns();
    d->answered = false;
    d->timeouts = 0;
    d->has_last = false;
    return result;
}

static void modbus_close_line(void *device) {
    struct modbus_device *d = device;
    modbus_line_close(d->line);
}

// From now on the slave is not asked until its late replies have come in and are thrown away.
static void leave_alone(struct modbus_device *d) {
    modbus_line_leave_alone(d->line, d->request.slave, clock_now_ns() + d->latency_ns);
}

// Where other slaves of the line answer, the line is well: a slave that has never answered is not
// asked again and again in their time.
static bool is_given_up(struct modbus_device *d) {
    bool others = modbus_line_answered_since(d->line, d->opened_ns);
    int most = others && !d->answered ? 1 : TIMEOUTS_BEFORE_REOPENING;
    return ++d->timeouts >= most;
}

static enum result explain(struct modbus_device *d, int code, struct device_reading *reading,
                           struct error *err) {
    const char *name = modbus_line_name(d->line);
    const struct modbus_request *r = &d->request;
    int first = printed(d, r->first), last = printed(d, r->first + r->count - 1);
    if (modbus_is_gone(code) && code != MODBUS_JUNK)
        return fail(err, RESULT_CLOSED, "%s: %s", name,
                    code == ENOTCONN ? "the line was closed" : modbus_strerror(code));
    reading->malformed += code != ETIMEDOUT;
    if (modbus_is_answer(code))
        return fail(err, RESULT_FORMAT, "%s, slave %d, registers %d to %d: %s", name, r->slave,
                    first, last, modbus_strerror(code));
    leave_alone(d);
    if (code == MODBUS_JUNK)
        return fail(err, RESULT_FORMAT, "%s: the slave sent bytes without a request", name);
    if (!modbus_is_absent(code))
        return fail(err, RESULT_FORMAT, "%s, slave %d: %s", name, r->slave, modbus_strerror(code));
    enum result result = is_given_up(d) ? RESULT_CLOSED : RESULT_TIMEOUT;
    if (code == ETIMEDOUT)
        return fail(err, result, "%s, slave %d, registers %d to %d: no reply within %d ms", name,
                    r->slave, first, last, r->timeout_ms);
    return fail(err, result, "%s, slave %d: the gateway says: %s", name, r->slave,
                modbus_strerror(code));
}

// RESULT_FORMAT: a reply that cannot be this request's. *out_is_new: not what the last one said.
static enum result check_sequence(struct modbus_device *d, const uint16_t *registers,
                                  bool *out_is_new, struct device_reading *reading,
                                  struct error *err) {
    *out_is_new = true;
    if (d->sequence < 0)
        return RESULT_OK;
    size_t size = (size_t)d->request.count * sizeof *registers;
    int at = d->sequence - d->request.first;
    int64_t now_ns = clock_now_ns(), since_ns = now_ns - d->last_ns;
    int step =
        d->has_last
            ? (int16_t)(modbus_word(d->order, registers[at]) - modbus_word(d->order, d->last[at]))
            : 1;
    bool same = d->has_last && !memcmp(registers, d->last, size);
    bool leaps = d->has_last && step > 10 + fastest_sequence_hz * (double)since_ns / NS_PER_S;
    bool follows = same || (step > 0 && !leaps);
    *out_is_new = !same;
    if (follows || since_ns > sequence_memory_ns) {
        memcpy(d->last, registers, size);
        d->has_last = true;
        d->last_ns = same ? d->last_ns : now_ns;
        return RESULT_OK;
    }
    leave_alone(d);
    reading->malformed++;
    return fail(err, RESULT_FORMAT, "%s, slave %d, register %d: the sequence %s",
                modbus_line_name(d->line), d->request.slave, printed(d, d->sequence),
                leaps  ? "leapt ahead"
                : step ? "went back"
                       : "stood still while values changed");
}

// ---- readings -----------------------------------------------------------------------------------

static void set_value(const struct modbus_device *d, const struct value *v,
                      const uint16_t *registers, struct sample *sample) {
    const uint16_t *words = registers + v->in.address - d->request.first;
    double number = modbus_value_number(&v->in, d->order, words);
    struct joint_angles *j = &sample->joint;
    double *const joint[] = {&j->flexion_deg, &j->varus_deg, &j->internal_deg,
                             &j->shift_mm,    &j->drawer_mm, &j->distraction_mm};
    if (v->what < JOINT_VALUES)
        *joint[v->what] = number;
    else if (v->what == OPENING)
        sample->handle.opening = number < -opening_slack || number > 1 + opening_slack
                                     ? NAN // no opening
                                     : fmax(0, fmin(1, number));
    else
        sample->handle.buttons = modbus_word(d->order, words[0]);
}

static struct sample *sample_of(struct device_reading *reading, enum channel channel,
                                int64_t time_ns) {
    for (int i = 0; i < reading->count; i++)
        if (reading->samples[i].channel == channel)
            return &reading->samples[i];
    struct sample *sample = &reading->samples[reading->count++];
    *sample = (struct sample){.channel = channel, .time_ns = time_ns};
    sample->kind = channel == CHANNEL_JOINT ? SAMPLE_JOINT : SAMPLE_HANDLE;
    return sample;
}

// False: not yet, or the slave is left alone.
static bool is_time(struct modbus_device *d) {
    d->next_ns = due_within(d->next_ns, d->period_ns);
    int64_t quiet_until_ns = modbus_line_quiet_until(d->line, d->request.slave);
    if (!wait_until(quiet_until_ns ? quiet_until_ns : d->next_ns))
        return false;
    int64_t now_ns = clock_now_ns();
    d->next_ns += d->period_ns;
    if (d->next_ns < now_ns)
        d->next_ns = now_ns;
    return true;
}

static enum result modbus_poll(void *device, struct device_reading *reading, struct error *err) {
    struct modbus_device *d = device;
    uint16_t registers[MODBUS_MAX_READ_REGISTERS];
    int64_t time_ns;
    bool is_new;
    if (!is_time(d))
        return RESULT_OK;
    int code = modbus_line_ask(d->line, d->connection, &d->request, registers, &time_ns);
    if (code)
        return explain(d, code, reading, err);
    d->timeouts = 0;
    d->answered = true;
    enum result result = check_sequence(d, registers, &is_new, reading, err);
    for (int i = 0; i < d->value_count && result == RESULT_OK && is_new; i++) {
        const struct value *v = &d->values[i];
        set_value(d, v, registers, sample_of(reading, v->channel, time_ns));
    }
    return result;
}

const struct device_driver modbus_driver = {
    "modbus", modbus_create, modbus_open, modbus_poll, modbus_close_line, modbus_destroy,
};
