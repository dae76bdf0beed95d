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
//   timeout_ms  longest wait for a reply, 1 to 2000; 50
//   latency_ms  after this time no late reply can come any more, 1 to 10000; 500, over TCP 50
//   sequence    the register that counts the slave's updates
//   turn        counts after which the encoders of flexion, varus and internal begin anew; none
//   registers   holding or input (functions 3 and 4); holding
//   first_register  the number that the maker gives to the first register (drivers/modbus_value.h);
//               0
//   order       of the bytes of a value in two registers: ABCD, CDAB, BADC, DCBA; ABCD
//
// and for each value `REGISTER [SCALE [OFFSET]] [TYPE]`, value = scale · registers + offset:
//   flexion, varus, internal (degrees), shift, drawer, distraction (mm); i16
//   CHANNEL.opening (0 to 1; a little beyond is cut, more refused); u16
//   CHANNEL.buttons (only a register)
//   CHANNEL.force (newtons; three of them, separated by commas: the length of the vector); i16
//
// and zero.CHANNEL: the force, or its three components, with nothing pressing (drivers/force.h).
//
// Markers are coils, inputs and registers (drivers/modbus_edges.h). Bits cost a request of their
// own.
//
// Devices with the same `serial` or `address` are slaves of one line (drivers/modbus_line.h): each
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
#include "drivers/drivers.h"
#include "drivers/modbus_config.h"
#include "drivers/modbus_line.h"

#include <errno.h>
#include <modbus.h>
#include <stdlib.h>
#include <string.h>

enum { TIMEOUTS_BEFORE_REOPENING = 4 };
static const int64_t sequence_memory_ns = 1500 * NS_PER_MS;
static const int64_t rest_ns = 20 * NS_PER_MS; // in which the rest of a reply comes
static const double opening_slack = 0.1, fastest_sequence_hz = 10000;

struct modbus_device {
    struct modbus_settings settings;
    struct modbus_line *line;
    struct modbus_user user;
    int next_request; // of this reading: 0 the registers, then the kinds of bits
    int64_t next_ns;
    int timeouts; // in a row
    int64_t opened_ns;
    bool answered; // since then
    bool was_torn; // the newest reply had a wrong checksum
    bool has_last;
    int64_t last_ns; // when the sequence last followed
    uint16_t last[MODBUS_MAX_READ_REGISTERS];
};

static enum result modbus_create(const struct device_config *config, void **out_device,
                                 struct device_outputs *out_outputs, struct error *err) {
    struct modbus_device *d = alloc(1, sizeof *d);
    enum result result = modbus_configure(config, &d->settings, out_outputs, err);
    struct modbus_line_settings line = {
        config->name,       d->settings.address,   d->settings.serial, d->settings.baud,
        d->settings.parity, d->settings.stop_bits, d->settings.echo};
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
    enum result result = modbus_line_open(d->line, &d->user, err);
    d->next_ns = d->opened_ns = clock_now_ns();
    d->answered = d->was_torn = false;
    d->timeouts = d->next_request = 0;
    d->has_last = false;
    modbus_edges_begin(&d->settings.edges);
    return result;
}

static void modbus_close_line(void *device) {
    struct modbus_device *d = device;
    modbus_line_close(d->line, &d->user);
}

// From now on the slave is not asked until its late replies have come in and are thrown away. A
// single reply that came in its time with a wrong checksum is not late: what is left of it is.
static void leave_alone(struct modbus_device *d, int code) {
    bool is_torn = code == EMBBADCRC || code == EMBBADDATA || code == MODBUS_ECHO;
    int64_t pause_ns = is_torn && !d->was_torn ? rest_ns : d->settings.latency_ns;
    d->was_torn = is_torn;
    modbus_line_leave_alone(d->line, d->settings.request.slave, clock_now_ns() + pause_ns);
}

// Where other slaves of the line answer, the line is well: a slave that has never answered is not
// asked again and again in their time.
static bool is_given_up(struct modbus_device *d) {
    bool others = modbus_line_answered_since(d->line, d->opened_ns);
    int most = others && !d->answered ? 1 : TIMEOUTS_BEFORE_REOPENING;
    return ++d->timeouts >= most;
}

static enum result explain(struct modbus_device *d, const struct modbus_request *r, int code,
                           struct device_reading *reading, struct error *err) {
    const char *name = modbus_line_name(d->line), *what = r->bits ? "bits" : "registers";
    int low = d->settings.numbering.first;
    int first = r->first + (r->bits ? low != 0 : low), last = first + r->count - 1;
    if (code == MODBUS_PENDING)
        return RESULT_OK;
    if (code == MODBUS_BUSY)
        return fail(err, RESULT_TIMEOUT, "%s: a slave's reply does not end", name);
    if (modbus_is_gone(code))
        return fail(err, RESULT_CLOSED, "%s: %s", name,
                    code == ENOTCONN ? "the line was closed" : modbus_strerror(code));
    reading->malformed += code != ETIMEDOUT;
    if (modbus_is_answer(code))
        return fail(err, RESULT_FORMAT, "%s, slave %d, %s %d to %d: %s", name, r->slave, what,
                    first, last, modbus_strerror(code));
    leave_alone(d, code);
    if (code == MODBUS_JUNK)
        return fail(err, RESULT_FORMAT, "%s: the slave sent bytes without a request", name);
    if (code == MODBUS_ECHO)
        return fail(err, RESULT_FORMAT, "%s: the adapter hears itself: set echo = yes", name);
    if (!modbus_is_absent(code))
        return fail(err, RESULT_FORMAT, "%s, slave %d: %s", name, r->slave, modbus_strerror(code));
    bool is_closed = code == MODBUS_UNFINISHED && !d->settings.serial[0];
    enum result result = is_given_up(d) || is_closed ? RESULT_CLOSED : RESULT_TIMEOUT;
    if (code == MODBUS_NO_ECHO)
        return fail(err, result, "%s: the adapter does not hear itself: set echo = no", name);
    if (code == MODBUS_UNFINISHED)
        return fail(err, result, "%s, slave %d: the reply began, but does not end", name, r->slave);
    if (code == ETIMEDOUT)
        return fail(err, result, "%s, slave %d, %s %d to %d: no reply within %d ms", name, r->slave,
                    what, first, last, r->timeout_ms);
    return fail(err, result, "%s, slave %d: the gateway says: %s", name, r->slave,
                modbus_strerror(code));
}

// RESULT_FORMAT: a reply that cannot be this request's. *out_is_new: not what the last one said.
static enum result check_sequence(struct modbus_device *d, const uint16_t *registers,
                                  bool *out_is_new, struct device_reading *reading,
                                  struct error *err) {
    *out_is_new = true;
    if (d->settings.sequence < 0)
        return RESULT_OK;
    size_t size = (size_t)d->settings.request.count * sizeof *registers;
    int at = d->settings.sequence - d->settings.request.first;
    int64_t now_ns = clock_now_ns(), since_ns = now_ns - d->last_ns;
    int step = d->has_last ? (int16_t)(modbus_word(d->settings.order, registers[at]) -
                                       modbus_word(d->settings.order, d->last[at]))
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
    leave_alone(d, 0);
    reading->malformed++;
    return fail(err, RESULT_FORMAT, "%s, slave %d, register %d: the sequence %s",
                modbus_line_name(d->line), d->settings.request.slave,
                modbus_printed(&d->settings, d->settings.sequence),
                leaps  ? "leapt ahead"
                : step ? "went back"
                       : "stood still while values changed");
}

// ---- readings -----------------------------------------------------------------------------------

static void set_value(const struct modbus_device *d, const struct modbus_named *v,
                      const uint16_t *registers, struct sample *sample) {
    const uint16_t *words = registers + v->in.address - d->settings.request.first;
    double number = modbus_value_number(&v->in, d->settings.order, words);
    struct joint_angles *j = &sample->joint;
    double *const joint[] = {&j->flexion_deg, &j->varus_deg, &j->internal_deg,
                             &j->shift_mm,    &j->drawer_mm, &j->distraction_mm};
    if (v->what < MODBUS_JOINT_ANGLES && d->settings.turn)
        *joint[v->what] = remainder(number, v->in.scale * d->settings.turn);
    else if (v->what < MODBUS_JOINT_VALUES)
        *joint[v->what] = number;
    else if (v->what == MODBUS_OPENING)
        sample->handle.opening = number < -opening_slack || number > 1 + opening_slack
                                     ? NAN // no opening
                                     : fmax(0, fmin(1, number));
    else
        sample->handle.buttons = modbus_word(d->settings.order, words[0]);
}

static struct sample *sample_of(struct device_reading *reading, const struct modbus_named *v,
                                int64_t time_ns) {
    enum sample_kind kind = modbus_kind_of(v);
    for (int i = 0; i < reading->count; i++)
        if (reading->samples[i].channel == v->channel && reading->samples[i].kind == kind)
            return &reading->samples[i];
    struct sample *sample = &reading->samples[reading->count++];
    *sample = (struct sample){.channel = v->channel, .kind = kind, .time_ns = time_ns};
    return sample;
}

// `v` is the first of the force's parts, which follow each other. A gauge at the end of its range
// measures nothing.
static double force_now(const struct modbus_device *d, const struct modbus_named *v,
                        const uint16_t *registers) {
    const struct force *force = &d->settings.forces[v->channel];
    double parts_n[FORCE_PARTS_MAX] = {0};
    for (int i = 0; i < force->count; i++) {
        const uint16_t *words = registers + v[i].in.address - d->settings.request.first;
        parts_n[i] = modbus_value_is_at_end(&v[i].in, d->settings.order, words)
                         ? NAN
                         : modbus_value_number(&v[i].in, d->settings.order, words);
    }
    return force_of(force, parts_n);
}

static void read_values(const struct modbus_device *d, const uint16_t *registers, int64_t time_ns,
                        struct device_reading *reading) {
    for (int i = 0; i < d->settings.value_count; i++) {
        const struct modbus_named *v = &d->settings.values[i];
        if (v->what == MODBUS_FORCE)
            sample_of(reading, v, time_ns)->force_n = force_now(d, v, registers);
        else if (v->what < MODBUS_FORCE)
            set_value(d, v, registers, sample_of(reading, v, time_ns));
    }
}

// False: not yet, or the slave is left alone.
static bool is_time(struct modbus_device *d) {
    d->next_ns = due_within(d->next_ns, d->settings.period_ns);
    int64_t quiet_until_ns = modbus_line_quiet_until(d->line, d->settings.request.slave);
    if (!wait_until(quiet_until_ns ? quiet_until_ns : d->next_ns))
        return false;
    int64_t now_ns = clock_now_ns();
    d->next_ns += d->settings.period_ns;
    if (d->next_ns < now_ns)
        d->next_ns = now_ns;
    return true;
}

static int ask_device(struct modbus_device *d, const struct modbus_request *request,
                      uint16_t *out_words, int64_t *out_time_ns) {
    int code = modbus_line_ask(d->line, &d->user, request, out_words, out_time_ns);
    d->timeouts = code ? d->timeouts : 0;
    d->answered |= !code;
    d->was_torn &= code != 0;
    return code;
}

static enum result ask_for_registers(struct modbus_device *d, struct device_reading *reading,
                                     struct error *err) {
    struct modbus_settings *s = &d->settings;
    uint16_t registers[MODBUS_MAX_READ_REGISTERS];
    int64_t time_ns;
    bool is_new;
    int code = ask_device(d, &s->request, registers, &time_ns);
    if (code)
        return explain(d, &s->request, code, reading, err);
    reading->heard = true;
    enum result result = check_sequence(d, registers, &is_new, reading, err);
    if (result != RESULT_OK || !is_new)
        return result;
    read_values(d, registers, time_ns, reading);
    modbus_edges_see_registers(&s->edges, s->order, s->request.first, registers, time_ns, reading);
    return RESULT_OK;
}

static enum result ask_for_bits(struct modbus_device *d, enum modbus_bits kind,
                                struct device_reading *reading, struct error *err) {
    const struct modbus_request *request = &d->settings.edges.requests[kind];
    uint16_t bits[MODBUS_EDGE_BITS_MAX];
    int64_t time_ns;
    int code = ask_device(d, request, bits, &time_ns);
    if (code)
        return explain(d, request, code, reading, err);
    reading->heard = true;
    modbus_edges_see_bits(&d->settings.edges, kind, bits, time_ns, reading);
    return RESULT_OK;
}

static enum result modbus_poll(void *device, struct device_reading *reading, struct error *err) {
    struct modbus_device *d = device;
    enum result result = RESULT_OK;
    if (!d->user.waits && !is_time(d))
        return RESULT_OK;
    for (; d->next_request <= MODBUS_BITS_COUNT && result == RESULT_OK; d->next_request++) {
        enum modbus_bits kind = (enum modbus_bits)(d->next_request - 1);
        if (d->next_request == 0 && d->settings.request.count)
            result = ask_for_registers(d, reading, err);
        else if (d->next_request > 0 && d->settings.edges.requests[kind].count)
            result = ask_for_bits(d, kind, reading, err);
        if (d->user.waits)
            return result; // the next poll goes on with it
    }
    d->next_request = 0;
    return result;
}

const struct device_driver modbus_driver = {
    "modbus", modbus_create, modbus_open, modbus_poll, modbus_close_line, modbus_destroy,
};
