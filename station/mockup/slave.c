#include "slave.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "device/socket.h"

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
    REGISTERS
};

static const uint32_t patience_us = 5000; // with half a request, while other masters wait
static const uint8_t unknown_function = 0x41;
static const double closed_opening = 0.05; // the punch's end switch closes below it
static const double running_opening = 0.5; // the shaver's button is down from it on

// ---- registers ----------------------------------------------------------------------------------

static uint16_t hundredths(double value) {
    double steps = fmax(INT16_MIN, fmin(INT16_MAX, round(100 * value)));
    return (uint16_t)(int16_t)steps;
}

static void set_joint(const struct recording *r, double t, uint16_t *registers) {
    struct joint_angles a = recording_joint_at(r, t);
    registers[FLEXION] = hundredths(a.flexion_deg);
    registers[VARUS] = hundredths(a.varus_deg);
    registers[INTERNAL] = hundredths(a.internal_deg);
    registers[SHIFT] = hundredths(a.shift_mm);
    registers[DRAWER] = hundredths(a.drawer_mm);
    registers[DISTRACTION] = hundredths(a.distraction_mm);
}

static void set_registers(const struct slave *s, double seconds, uint16_t *registers) {
    const struct recording *r = &s->player->recording;
    double updates = floor(seconds * s->update_hz);
    double t = player_file_time(s->player, updates / s->update_hz);
    registers[SEQUENCE] = (uint16_t)(int64_t)updates;
    if (r->joints)
        set_joint(r, t, registers);
    for (int i = 0; i < r->tool_count; i++) {
        double opening = recording_tool_at(r, i, t).opening;
        if (r->tools[i].has_opening && r->tools[i].channel == CHANNEL_PUNCH) {
            registers[OPENING] = (uint16_t)round(10000 * opening);
            registers[BUTTONS] = opening < closed_opening;
        }
        if (r->tools[i].has_opening && r->tools[i].channel == CHANNEL_SHAVER)
            registers[SHAVER_BUTTONS] = opening >= running_opening;
    }
}

// Jump and noise of the joint's values; the register that stands for "no value".
static void spoil_registers(struct slave *s, double seconds, uint16_t *registers) {
    const struct fault *jump = faults_strike(s->faults, FAULT_MODBUS, FAULT_JUMP, seconds);
    const struct fault *noise = faults_strike(s->faults, FAULT_MODBUS, FAULT_NOISE, seconds);
    if (jump)
        registers[FLEXION] = hundredths((int16_t)registers[FLEXION] / 100.0 + jump->value);
    for (int i = FLEXION; i <= DISTRACTION && noise; i++)
        registers[i] = hundredths((int16_t)registers[i] / 100.0 + noise->value * faults_noise());
    if (faults_strike(s->faults, FAULT_MODBUS, FAULT_NAN, seconds))
        for (int i = FLEXION; i <= OPENING; i++)
            registers[i] = 0x8000;
}

// ---- lines --------------------------------------------------------------------------------------

static void prepare_modbus(struct slave *s) {
    CHECK(s->modbus);
    CHECK(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, s->capture) == 0);
    modbus_set_slave(s->modbus, s->number);
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

// What libmodbus answers, as bytes.
static size_t encode_reply(struct slave *s, const uint8_t *request, int length,
                           modbus_mapping_t *mapping, uint8_t *out) {
    modbus_set_socket(s->modbus, s->capture[0]);
    if (modbus_reply(s->modbus, request, length, mapping) <= 0)
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
    set_registers(s, time, mapping->tab_registers);
    spoil_registers(s, seconds, mapping->tab_registers);
    if (faults_strike(s->faults, FAULT_MODBUS, FAULT_WRONG_SLAVE, seconds)) {
        request[function - 1]++;
        memset(mapping->tab_registers, 0, REGISTERS * sizeof(uint16_t));
    }
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

static void serve_master(struct slave *s, int i, modbus_mapping_t *mapping) {
    uint8_t request[MODBUS_MAX_ADU_LENGTH];
    bool tcp = s->listener >= 0;
    modbus_set_socket(s->modbus, s->masters[i]);
    int length = modbus_receive(s->modbus, request);
    if (length > 0 && (!tcp || header_is_honest(request, length))) {
        reply(s, i, request, length, mapping);
    } else if (length && tcp) {
        drop_master(s, i);
    } else if (length < 0) {
        modbus_flush(s->modbus);
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
static bool plug(struct slave *s) {
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
    modbus_mapping_t *mapping = modbus_mapping_new(0, 0, REGISTERS, 0);
    CHECK(mapping);
    while (!atomic_load(s->stop))
        if (plug(s))
            serve(s, mapping);
    modbus_mapping_free(mapping);
    return NULL;
}
