#include "slave.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "drivers/socket.h"

#include <errno.h>
#include <fcntl.h>
#include <modbus.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

enum {
    SEQUENCE,
    FLEXION,
    VARUS,
    INTERNAL,
    SHIFT,
    DRAWER,
    DISTRACTION,
    OPENING,
    BUTTONS,
    SHAVER_BUTTONS,
    NUMBER,
    PULSES,
    FLOATS = 12,  // two registers for each of the joint's values
    WHOLES = 24,  // too
    ENCODER = 36, // two registers
    FORCE = 38,
    FORCE_VECTOR = 40, // two registers for each of three components
    GRASPER_OPENING = 46,
    GRASPER_BUTTONS,
    REGISTERS
};

enum { JOINT_VALUES = 6, REQUEST_BYTES = 8, PATIENCE_MS = 5 };

static const uint32_t patience_us =
    1000 * PATIENCE_MS; // with half a request, while other masters wait
static const uint8_t unknown_function = 0x41;
static const double end_switch_opening = 0.05; // a jaw's end switch closes below it
static const double running_opening = 0.5;     // the shaver's button is down from it on
static const double encoder_steps = 1 << 17;   // of a turn

// ---- registers ----------------------------------------------------------------------------------

static uint32_t steps(double value, double lowest, double highest) {
    return (uint32_t)(int32_t)fmax(lowest, fmin(highest, round(value)));
}

static void set_wide(const struct slave *s, uint32_t value, uint16_t *registers) {
    bool low_first = s->order == MODBUS_CDAB || s->order == MODBUS_DCBA;
    registers[low_first] = (uint16_t)(value >> 16);
    registers[!low_first] = (uint16_t)value;
}

static void set_float(const struct slave *s, double value, uint16_t *registers) {
    float number = (float)value;
    uint32_t bits;
    memcpy(&bits, &number, sizeof bits);
    set_wide(s, bits, registers);
}

// A NaN is what the registers have for "no value".
static void set_joint(const struct slave *s, const double values[JOINT_VALUES],
                      uint16_t *registers) {
    for (int i = 0; i < JOINT_VALUES; i++) {
        double value = isnan(values[i]) ? -INFINITY : values[i];
        registers[FLEXION + i] = (uint16_t)steps(100 * value, INT16_MIN, INT16_MAX);
        set_float(s, values[i], registers + FLOATS + 2 * i);
        set_wide(s, steps(10000 * value, INT32_MIN, INT32_MAX), registers + WHOLES + 2 * i);
    }
    double turn = isnan(values[0]) ? 0 : (values[0] + 180) / 360;
    set_wide(s, (uint32_t)floor((turn - floor(turn)) * encoder_steps), registers + ENCODER);
}

// Jump and noise of the joint's values, and what stands for "no value".
static void spoil_joint(struct slave *s, double seconds, double values[JOINT_VALUES]) {
    const struct fault *jump = faults_strike(s->faults, FAULT_MODBUS, FAULT_JUMP, seconds);
    const struct fault *noise = faults_strike(s->faults, FAULT_MODBUS, FAULT_NOISE, seconds);
    bool none = faults_strike(s->faults, FAULT_MODBUS, FAULT_NAN, seconds);
    values[0] += jump ? jump->value : 0;
    for (int i = 0; i < JOINT_VALUES; i++) {
        values[i] += noise ? noise->value * faults_noise() : 0;
        values[i] = none ? NAN : values[i];
    }
}

// Pressed along a direction that is oblique to all axes of the gauge.
static void set_force(const struct slave *s, double newtons, uint16_t *registers) {
    static const double direction[3] = {0.48, -0.6, 0.64};
    registers[FORCE] = (uint16_t)steps(100 * newtons, INT16_MIN, INT16_MAX);
    for (int i = 0; i < 3; i++)
        set_float(s, newtons * direction[i], registers + FORCE_VECTOR + 2 * i);
}

// The first tool's that has one.
static double force_at(const struct recording *r, double t) {
    for (int i = 0; i < r->tool_count; i++)
        if (r->tools[i].has_force)
            return recording_tool_at(r, i, t).force_n;
    return 0;
}

static void set_jaw(double opening, uint16_t *out_opening, uint16_t *out_buttons) {
    *out_opening = (uint16_t)round(10000 * opening);
    *out_buttons = opening < end_switch_opening;
}

static void set_handles(const struct recording *r, double t, uint16_t *registers) {
    for (int i = 0; i < r->tool_count; i++) {
        double opening = recording_tool_at(r, i, t).opening;
        if (!r->tools[i].has_opening)
            continue;
        if (r->tools[i].channel == CHANNEL_PUNCH)
            set_jaw(opening, &registers[OPENING], &registers[BUTTONS]);
        if (r->tools[i].channel == CHANNEL_FIRST_DESCRIBED)
            set_jaw(opening, &registers[GRASPER_OPENING], &registers[GRASPER_BUTTONS]);
        if (r->tools[i].channel == CHANNEL_SHAVER)
            registers[SHAVER_BUTTONS] = opening >= running_opening;
    }
}

// That came up to an update: while the sequence stands still, no more come.
static uint16_t pulses_of(const struct slave *s, double seconds) {
    return (uint16_t)((s->player->start_ns + (int64_t)(seconds * NS_PER_S)) / PLAYER_PULSE_NS);
}

// What slave `number` says of the time `time_s`; faults are those of `seconds`.
static void set_registers(struct slave *s, int number, double time_s, double seconds,
                          uint16_t *registers) {
    const struct recording *r = &s->player->recording;
    double updates = floor(time_s * s->update_hz);
    double t = player_file_time(s->player, updates / s->update_hz);
    double joint[JOINT_VALUES] = {0};
    if (r->joints) {
        struct joint_angles a = recording_joint_at(r, t);
        memcpy(joint,
               (double[]){a.flexion_deg, a.varus_deg, a.internal_deg, a.shift_mm, a.drawer_mm,
                          a.distraction_mm},
               sizeof joint);
    }
    spoil_joint(s, seconds, joint);
    set_handles(r, t, registers);
    registers[OPENING] = isnan(joint[0]) ? 0x8000 : registers[OPENING];
    set_joint(s, joint, registers);
    set_force(s, isnan(joint[0]) ? NAN : force_at(r, t), registers);
    registers[SEQUENCE] = (uint16_t)(int64_t)updates;
    registers[NUMBER] = (uint16_t)number;
    registers[PULSES] = pulses_of(s, updates / s->update_hz);
    for (int i = 0; i < REGISTERS; i++)
        registers[i] = modbus_word(s->order, registers[i]);
}

// ---- lines --------------------------------------------------------------------------------------

static void prepare_modbus(struct slave *s) {
    CHECK(s->modbus);
    CHECK(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, s->capture) == 0);
    modbus_set_byte_timeout(s->modbus, 0, patience_us);
    // The pause that libmodbus makes, with all masters waiting, after a request that is none.
    modbus_set_response_timeout(s->modbus, 0, patience_us);
}

enum result slave_listen(struct slave *s, const char *address, struct error *err) {
    uint16_t port;
    s->other_end = -1;
    enum result result = socket_listen(address, &s->listener, &port, err);
    if (result != RESULT_OK)
        return result;
    int host = (int)(strrchr(address, ':') - address);
    if (address != s->address)
        snprintf(s->address, sizeof s->address, "%.*s:%u", host, address, port);
    s->modbus = modbus_new_tcp(NULL, 0); // only a reader and writer of frames: we own the sockets
    prepare_modbus(s);
    return RESULT_OK;
}

static enum result replace_link(const char *target, const char *path, struct error *err) {
    struct stat info;
    if (!lstat(path, &info) && !S_ISLNK(info.st_mode))
        return fail(err, RESULT_REFUSED, "%s: is there and is no symbolic link", path);
    unlink(path);
    if (symlink(target, path))
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    return RESULT_OK;
}

enum result slave_open_terminal(struct slave *s, const char *path, struct error *err) {
    int fd = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (fd < 0 || grantpt(fd) || unlockpt(fd))
        return fail(err, RESULT_IO, "a pseudo terminal: %s", strerror(errno));
    char name[64];
    CHECK(ptsname_r(fd, name, sizeof name) == 0);
    s->other_end = open(name, O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (s->other_end < 0)
        return fail(err, RESULT_IO, "%s: %s", name, strerror(errno));
    struct termios raw;
    tcgetattr(s->other_end, &raw);
    cfmakeraw(&raw);
    tcsetattr(s->other_end, TCSANOW, &raw);
    s->modbus = modbus_new_rtu(name, 115200, 'N', 8, 1);
    prepare_modbus(s);
    s->listener = -1;
    s->masters[0] = fd;
    s->master_count = 1;
    enum result result = replace_link(name, path, err);
    s->path = result == RESULT_OK ? path : NULL;
    return result;
}

void slave_close(struct slave *s) {
    if (!s->modbus)
        return;
    if (s->listener >= 0)
        close(s->listener);
    if (s->other_end >= 0)
        close(s->other_end);
    for (int i = 0; i < s->master_count; i++)
        close(s->masters[i]);
    if (s->path)
        unlink(s->path);
    close(s->capture[0]);
    close(s->capture[1]);
    modbus_free(s->modbus);
    s->modbus = NULL;
    s->listener = -1;
    s->master_count = 0;
}

// ---- serving ------------------------------------------------------------------------------------

static void sleep_ms(int ms) {
    struct timespec time = {ms / 1000, ms % 1000 * NS_PER_MS};
    nanosleep(&time, NULL);
}

static double seconds_of(const struct slave *s) {
    return player_seconds(s->player, clock_now_ns());
}

static bool is_ours(const struct slave *s, int number) {
    return number >= s->number && number < s->number + s->count;
}

// A gateway with several slaves knows who they are; a slave that is alone answers by any number.
static int answer(struct slave *s, const uint8_t *request, int length, modbus_mapping_t *mapping) {
    int number = request[modbus_get_header_length(s->modbus) - 1];
    if (s->count > 1 && !is_ours(s, number))
        return modbus_reply_exception(s->modbus, request, MODBUS_EXCEPTION_GATEWAY_TARGET);
    return modbus_reply(s->modbus, request, length, mapping);
}

// What libmodbus answers, as bytes.
static size_t encode_reply(struct slave *s, const uint8_t *request, int length,
                           modbus_mapping_t *mapping, uint8_t *out) {
    modbus_set_socket(s->modbus, s->capture[0]);
    if (answer(s, request, length, mapping) <= 0)
        return 0;
    ssize_t size = read(s->capture[1], out, MODBUS_MAX_ADU_LENGTH);
    return size < 0 ? 0 : (size_t)size;
}

static void reply(struct slave *s, int master, uint8_t *request, int length,
                  modbus_mapping_t *mapping) {
    uint8_t bytes[MODBUS_MAX_ADU_LENGTH];
    int function = modbus_get_header_length(s->modbus);
    double seconds = seconds_of(s);
    if (faults_strike(s->faults, FAULT_MODBUS, FAULT_DROPOUT, seconds))
        return;
    const struct fault *late = faults_strike(s->faults, FAULT_MODBUS, FAULT_LATE, seconds);
    double time = faults_time(s->faults, FAULT_MODBUS, seconds);
    set_registers(s, request[function - 1], time, seconds, mapping->tab_registers);
    if (faults_strike(s->faults, FAULT_MODBUS, FAULT_WRONG_SLAVE, seconds)) {
        request[function - 1]++;
        memset(mapping->tab_registers, 0, REGISTERS * sizeof(uint16_t));
    }
    mapping->tab_bits[0] = mapping->tab_input_bits[0] = player_pulse(clock_now_ns());
    memcpy(mapping->tab_input_registers, mapping->tab_registers, REGISTERS * sizeof(uint16_t));
    if (faults_strike(s->faults, FAULT_MODBUS, FAULT_NEWER_VERSION, seconds))
        request[function] = unknown_function;
    size_t size = encode_reply(s, request, length, mapping, bytes);
    size = faults_spoil(s->faults, FAULT_MODBUS, seconds, bytes, size);
    if (late)
        sleep_ms((int)late->value);
    if (size && write(s->masters[master], bytes, size) < 0)
        log_debug("mockup", "a reply: %s", strerror(errno));
}

// The functions whose requests libmodbus knows the length of.
static bool length_is_known(uint8_t function) {
    return (function >= MODBUS_FC_READ_COILS && function <= MODBUS_FC_WRITE_SINGLE_REGISTER) ||
           function == MODBUS_FC_WRITE_MULTIPLE_COILS ||
           function == MODBUS_FC_WRITE_MULTIPLE_REGISTERS ||
           function == MODBUS_FC_MASK_WRITE_REGISTER ||
           function == MODBUS_FC_WRITE_AND_READ_REGISTERS;
}

// libmodbus looks neither at the protocol's number nor at the length that the header says.
static bool header_is_honest(const uint8_t *request, int length) {
    int protocol = request[2] << 8 | request[3], rest = request[4] << 8 | request[5];
    return protocol == 0 && (rest == length - 6 || !length_is_known(request[7]));
}

static void drop_master(struct slave *s, int i) {
    close(s->masters[i]);
    s->masters[i] = s->masters[--s->master_count];
}

static speed_t speed_of(int baud) {
    static const struct {
        int baud;
        speed_t speed;
    } known[] = {{9600, B9600},   {19200, B19200},   {38400, B38400},
                 {57600, B57600}, {115200, B115200}, {230400, B230400}};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        if (known[i].baud == baud)
            return known[i].speed;
    return B0;
}

bool slave_knows_baud(int baud) {
    return speed_of(baud) != B0;
}

// Whether a master set the line as the slaves have it. (A pseudo terminal forgets the parity.)
static bool is_line_right(const struct slave *s) {
    struct termios line;
    return !s->baud ||
           (tcgetattr(s->other_end, &line) == 0 && cfgetospeed(&line) == speed_of(s->baud) &&
            (line.c_cflag & CSTOPB ? 2 : 1) == s->stop_bits);
}

// Of any slave of the line: libmodbus reads for one slave only, so it is told which. 0: of none.
static int receive_from_line(struct slave *s, int line, uint8_t *request) {
    uint8_t bytes[MODBUS_MAX_ADU_LENGTH], rest[MODBUS_MAX_ADU_LENGTH];
    struct pollfd ready = {.fd = line, .events = POLLIN};
    size_t used = 0;
    do {
        ssize_t size = read(line, bytes + used, sizeof bytes - used);
        if (size <= 0)
            return -1;
        used += (size_t)size;
    } while (used < REQUEST_BYTES && poll(&ready, 1, PATIENCE_MS) > 0);
    if (!is_ours(s, bytes[0]) || !is_line_right(s))
        return 0;
    CHECK(write(s->capture[1], bytes, used) == (ssize_t)used);
    modbus_set_slave(s->modbus, bytes[0]);
    modbus_set_socket(s->modbus, s->capture[0]);
    int length = modbus_receive(s->modbus, request);
    while (recv(s->capture[0], rest, sizeof rest, MSG_DONTWAIT) > 0)
        ;
    return length;
}

static void serve_master(struct slave *s, int i, modbus_mapping_t *mapping) {
    uint8_t request[MODBUS_MAX_ADU_LENGTH];
    bool tcp = s->listener >= 0;
    modbus_set_socket(s->modbus, s->masters[i]);
    int length =
        tcp ? modbus_receive(s->modbus, request) : receive_from_line(s, s->masters[i], request);
    if (length > 0 && (!tcp || header_is_honest(request, length))) {
        reply(s, i, request, length, mapping);
    } else if (length && tcp) {
        drop_master(s, i);
    } else if (length < 0) {
        sleep_ms(1);
    }
}

static void accept_master(struct slave *s) {
    int fd = accept4(s->listener, NULL, NULL, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (fd >= 0 && s->master_count == SLAVE_MASTERS_MAX)
        close(fd);
    else if (fd >= 0)
        s->masters[s->master_count++] = fd;
}

static void serve(struct slave *s, modbus_mapping_t *mapping) {
    struct pollfd polled[SLAVE_MASTERS_MAX + 1] = {{.fd = s->listener, .events = POLLIN}};
    int count = s->master_count;
    for (int i = 0; i < count; i++)
        polled[i + 1] = (struct pollfd){.fd = s->masters[i], .events = POLLIN};
    if (poll(polled, (nfds_t)count + 1, 100) <= 0)
        return;
    for (int i = count - 1; i >= 0; i--)
        if (polled[i + 1].revents)
            serve_master(s, i, mapping);
    if (polled[0].revents)
        accept_master(s);
}

// True: it is plugged in.
static bool plug_line(struct slave *s) {
    struct error err;
    if (faults_on(s->faults, FAULT_MODBUS, FAULT_UNPLUG, seconds_of(s)))
        slave_close(s);
    else if (!s->modbus && (s->path ? slave_open_terminal(s, s->path, &err)
                                    : slave_listen(s, s->address, &err)) != RESULT_OK)
        log_warning("mockup", "%s", err.text);
    if (!s->modbus)
        sleep_ms(10);
    return s->modbus;
}

void *slave_run(void *slave) {
    struct slave *s = slave;
    modbus_mapping_t *mapping = modbus_mapping_new(1, 1, REGISTERS, REGISTERS);
    CHECK(mapping);
    while (!atomic_load(s->stop))
        if (plug_line(s))
            serve(s, mapping);
    modbus_mapping_free(mapping);
    return NULL;
}
