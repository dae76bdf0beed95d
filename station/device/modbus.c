// Encoders and handles of a mock-up that is a Modbus slave, over TCP or a serial line (RTU).
//
//   address     host:port                       one of the two
//   serial      /dev/ttyUSB0 or the like
//   baud        115200                          of the serial line
//   parity      none, even or odd; none
//   slave       1 to 247; 1
//   rate_hz     readings a second, 1 to 2000; 100
//   timeout_ms  longest wait for a reply, 1 to 100; 50
//   latency_ms  after this time no late reply can come any more, 1 to 10000; 500, over TCP 50
//   sequence    the register that counts the slave's updates
//
// and for each value `REGISTER [SCALE [OFFSET [signed|unsigned]]]`, value = scale · register +
// offset:
//   flexion, varus, internal (degrees), shift, drawer, distraction (mm); signed
//   CHANNEL.opening (0 to 1; a little beyond is cut, more refused), CHANNEL.buttons (only a
//   register)
//
// Devices with the same `serial` are slaves of one line, which they share by turns: each has its
// own rate, and one that is silent does not close the line that others answer on.
//
// All registers are read in one block. A time stamp is the middle between request and reply.
//
// RTU replies carry no number: one that comes after its timeout would answer the next request, and
// every later reply would be one behind for ever. So after a timeout the line is left alone for
// latency_ms and flushed; bytes that wait before a request, and a sequence that goes back, lead to
// the same. (TCP replies are numbered; a late one is recognised, but libmodbus then gives up on the
// right one too. It does not look at their slave's number: only the sequence finds another slave.)
// A sequence that stands still is no new reading. One that goes back or leaps ahead is refused for
// a while; then the slave was started anew.

#include "base/check.h"
#include "base/clock.h"
#include "base/number.h"
#include "device/drivers.h"
#include "device/modbus_line.h"
#include "device/options.h"
#include "device/socket.h"

#include <errno.h>
#include <modbus.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>

enum { VALUES_MAX = 6 + 2 * INSTRUMENT_COUNT, TIMEOUTS_BEFORE_REOPENING = 4 };
static const int64_t sequence_memory_ns = 1500 * NS_PER_MS;
static const double opening_slack = 0.1, fastest_sequence_hz = 10000;
static const char *const joint_keys[] = {"flexion", "varus",  "internal",
                                         "shift",   "drawer", "distraction"};
enum { JOINT_VALUES = 6, OPENING = JOINT_VALUES, BUTTONS };

struct value {
    enum channel channel;
    int what; // index of joint_keys, OPENING or BUTTONS
    int address;
    bool is_signed;
    double scale, offset;
};

struct modbus_device {
    char address[OPTION_TEXT_MAX], serial[OPTION_TEXT_MAX]; // one of them is empty
    int baud, slave, timeout_ms;
    char parity; // as libmodbus has it: N, E, O
    int64_t period_ns, latency_ns;
    int sequence; // register, -1: none
    int value_count, first, count;
    struct value values[VALUES_MAX];

    struct modbus_line *line;
    uint64_t connection;
    int64_t next_ns, quiet_until_ns; // quiet_until_ns 0: the slave is in step
    int timeouts;                    // in a row
    int64_t opened_ns;
    bool answered; // since then
    bool has_last;
    int64_t last_ns; // when the sequence last followed
    uint16_t last[MODBUS_MAX_READ_REGISTERS];
};

// ---- config -------------------------------------------------------------------------------------

static bool parse_value(const char *text, struct value *v) {
    char copy[OPTION_TEXT_MAX], *rest, *word;
    if (strlen(text) >= sizeof copy)
        return false;
    strcpy(copy, text);
    double numbers[3] = {0, 1, 0};
    int count = 0;
    bool ended = false;
    for (word = strtok_r(copy, " \t", &rest); word; word = strtok_r(NULL, " \t", &rest)) {
        bool sign = !strcmp(word, "signed"), unsign = !strcmp(word, "unsigned");
        if (ended ||
            (!sign && !unsign && (count == 3 || !number_double(word, -1e9, 1e9, &numbers[count]))))
            return false;
        count += !sign && !unsign;
        ended = sign || unsign;
        v->is_signed = ended ? sign : v->is_signed;
    }
    v->address = (int)fmax(-1, fmin(65536, numbers[0]));
    v->scale = numbers[1];
    v->offset = numbers[2];
    return count && v->address == numbers[0] && v->address >= 0 && v->address <= 65535;
}

static enum result add_value(struct modbus_device *d, const struct device_config *config,
                             const char *key, enum channel channel, int what, struct error *err) {
    const char *text = option_text(config, key);
    if (!text)
        return RESULT_OK;
    struct value v = {.channel = channel, .what = what, .is_signed = what < JOINT_VALUES};
    if (!parse_value(text, &v) || (what == BUTTONS && strpbrk(text, " \t")))
        return option_fail(config, key, err, RESULT_INVALID, "\"%s\" is not %s", text,
                           what == BUTTONS ? "a register"
                                           : "REGISTER [SCALE [OFFSET [signed|unsigned]]]");
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

// The block from the lowest to the highest register that is named.
static enum result find_block(struct modbus_device *d, const struct device_config *config,
                              struct error *err) {
    int low = d->sequence >= 0 ? d->sequence : 65535, high = d->sequence;
    for (int i = 0; i < d->value_count; i++) {
        low = d->values[i].address < low ? d->values[i].address : low;
        high = d->values[i].address > high ? d->values[i].address : high;
    }
    d->first = low;
    d->count = high - low + 1;
    if (d->count > MODBUS_MAX_READ_REGISTERS)
        return fail(err, RESULT_LIMIT,
                    "[device %s]: registers %d to %d are too many: one reading has at most %d",
                    config->name, low, high, MODBUS_MAX_READ_REGISTERS);
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

static enum result configure_line(struct modbus_device *d, const struct device_config *config,
                                  struct error *err) {
    char host[SOCKET_HOST_MAX], port[SOCKET_PORT_MAX];
    struct error why;
    const char *parity = option_text(config, "parity");
    bool tcp = option_text(config, "address"), rtu = option_text(config, "serial");
    if (tcp == rtu)
        return option_fail(config, "address", err, tcp ? RESULT_INVALID : RESULT_MISSING,
                           "one of address and serial is required");
    if (tcp && (parity || option_text(config, "baud")))
        return option_fail(config, parity ? "parity" : "baud", err, RESULT_INVALID,
                           "only a serial line has one");
    d->parity = !parity || !strcmp(parity, "none") ? 'N'
                : !strcmp(parity, "even")          ? 'E'
                : !strcmp(parity, "odd")           ? 'O'
                                                   : 0;
    if (!d->parity)
        return option_fail(config, "parity", err, RESULT_INVALID,
                           "\"%s\" is neither none, even nor odd", parity);
    if (rtu)
        return option_required(config, "serial", d->serial, err);
    enum result result = option_required(config, "address", d->address, err);
    if (result == RESULT_OK && socket_split(d->address, host, port, &why) != RESULT_OK)
        result = option_fail(config, "address", err, RESULT_INVALID, "%s", why.text);
    return result;
}

static enum result configure(struct modbus_device *d, const struct device_config *config,
                             struct device_outputs *outputs, struct error *err) {
    static const char *const keys[] = {
        "address",    "serial",     "baud",        "parity",   "slave",    "rate_hz",
        "timeout_ms", "latency_ms", "sequence",    "flexion",  "varus",    "internal",
        "shift",      "drawer",     "distraction", ".opening", ".buttons", NULL};
    double rate_hz, latency_ms;
    enum result result = options_check(config, keys, err);
    if (result == RESULT_OK)
        result = configure_line(d, config, err);
    if (result == RESULT_OK)
        result = option_integer(config, "baud", 300, 4000000, 115200, &d->baud, err);
    if (result == RESULT_OK)
        result = option_integer(config, "slave", 1, 247, 1, &d->slave, err);
    if (result == RESULT_OK)
        result = option_integer(config, "timeout_ms", 1, 100, 50, &d->timeout_ms, err);
    if (result == RESULT_OK)
        result = option_integer(config, "sequence", 0, 65535, -1, &d->sequence, err);
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
    struct modbus_line_settings line = {config->name, d->address, d->serial, d->baud, d->parity};
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
    d->quiet_until_ns = 0;
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
    d->quiet_until_ns = clock_now_ns() + d->latency_ns;
}

static bool bytes_wait(modbus_t *modbus) {
    int count = 0;
    return ioctl(modbus_get_socket(modbus), FIONREAD, &count) == 0 && count > 0;
}

static bool is_gone(int code) {
    return code && code < MODBUS_ENOBASE && code != ETIMEDOUT && code != EINTR;
}

// The slave itself says no: it is in step.
static bool is_answer(int code) {
    return code >= EMBXILFUN && code <= EMBXGTAR;
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
    int last = d->first + d->count - 1;
    if (is_gone(code))
        return fail(err, RESULT_CLOSED, "%s: %s", name, modbus_strerror(code));
    if (is_answer(code)) {
        reading->malformed++;
        return fail(err, RESULT_FORMAT, "%s, slave %d, registers %d to %d: %s", name, d->slave,
                    d->first, last, modbus_strerror(code));
    }
    leave_alone(d);
    if (code != ETIMEDOUT) {
        reading->malformed++;
        return fail(err, RESULT_FORMAT, "%s, slave %d: %s", name, d->slave, modbus_strerror(code));
    }
    return fail(err, is_given_up(d) ? RESULT_CLOSED : RESULT_TIMEOUT,
                "%s, slave %d, registers %d to %d: no reply within %d ms", name, d->slave, d->first,
                last, d->timeout_ms);
}

// RESULT_FORMAT: a reply that cannot be this request's. *out_is_new: not what the last one said.
static enum result check_sequence(struct modbus_device *d, const uint16_t *registers,
                                  bool *out_is_new, struct device_reading *reading,
                                  struct error *err) {
    *out_is_new = true;
    if (d->sequence < 0)
        return RESULT_OK;
    size_t size = (size_t)d->count * sizeof *registers;
    int at = d->sequence - d->first;
    int64_t now_ns = clock_now_ns(), since_ns = now_ns - d->last_ns;
    int step = d->has_last ? (int16_t)(registers[at] - d->last[at]) : 1;
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
                modbus_line_name(d->line), d->slave, d->sequence,
                leaps  ? "leapt ahead"
                : step ? "went back"
                       : "stood still while values changed");
}

// ---- readings -----------------------------------------------------------------------------------

static void set_value(const struct value *v, uint16_t word, struct sample *sample) {
    double number = v->scale * (v->is_signed ? (int16_t)word : word) + v->offset;
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
        sample->handle.buttons = word;
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
    if (!wait_until(d->quiet_until_ns ? d->quiet_until_ns : d->next_ns))
        return false;
    int64_t now_ns = clock_now_ns();
    d->next_ns += d->period_ns;
    if (d->next_ns < now_ns)
        d->next_ns = now_ns;
    return true;
}

// Bytes that wait before a request are a late reply of this slave, or of another one of the line;
// this one's have come in where it was left alone. False: the slave is left alone from now on.
static bool clear_line(struct modbus_device *d, modbus_t *modbus, struct device_reading *reading) {
    bool was_left_alone = d->quiet_until_ns;
    d->quiet_until_ns = 0;
    if (was_left_alone || !bytes_wait(modbus)) {
        if (was_left_alone)
            modbus_flush(modbus);
        return true;
    }
    reading->malformed++;
    modbus_flush(modbus);
    if (modbus_line_is_shared(d->line))
        return true;
    leave_alone(d);
    return false;
}

// 0, or errno as libmodbus has it; -1: not asked, for bytes waited that nobody had asked for.
static int ask(struct modbus_device *d, modbus_t *modbus, uint16_t *registers,
               struct device_reading *reading, int64_t *out_time_ns) {
    if (!clear_line(d, modbus, reading)) {
        modbus_line_end(d->line, LINE_SILENT);
        return -1;
    }
    int64_t sent_ns = clock_now_ns();
    int code = modbus_read_registers(modbus, d->first, d->count, registers) < 0 ? errno : 0;
    *out_time_ns = sent_ns + (clock_now_ns() - sent_ns) / 2;
    modbus_line_end(d->line, is_gone(code)              ? LINE_BROKEN
                             : !code || is_answer(code) ? LINE_ANSWERED
                                                        : LINE_SILENT);
    return code;
}

static enum result modbus_poll(void *device, struct device_reading *reading, struct error *err) {
    struct modbus_device *d = device;
    uint16_t registers[MODBUS_MAX_READ_REGISTERS];
    int64_t time_ns;
    bool is_new;
    if (!is_time(d))
        return RESULT_OK;
    modbus_t *modbus = modbus_line_begin(d->line, d->connection, d->slave, d->timeout_ms);
    if (!modbus)
        return fail(err, RESULT_CLOSED, "%s: the line was closed", modbus_line_name(d->line));
    int code = ask(d, modbus, registers, reading, &time_ns);
    if (code < 0)
        return fail(err, RESULT_FORMAT, "%s: the slave sent bytes without a request",
                    modbus_line_name(d->line));
    if (code)
        return explain(d, code, reading, err);
    d->timeouts = 0;
    d->answered = true;
    enum result result = check_sequence(d, registers, &is_new, reading, err);
    for (int i = 0; i < d->value_count && result == RESULT_OK && is_new; i++) {
        const struct value *v = &d->values[i];
        set_value(v, registers[v->address - d->first], sample_of(reading, v->channel, time_ns));
    }
    return result;
}

const struct device_driver modbus_driver = {
    "modbus", modbus_create, modbus_open, modbus_poll, modbus_close_line, modbus_destroy,
};
