#include "slave.h"

#include "base/check.h"
#include "base/clock.h"
#include "device/socket.h"

#include <errno.h>
#include <fcntl.h>
#include <modbus.h>
#include <poll.h>
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
    REGISTERS
};

static const uint32_t patience_us = 5000;  // with half a request, while other masters wait
static const double closed_opening = 0.05; // the handle's end switch closes below it

// ---- registers
// -----------------------------------------------------------------------------------

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

static void set_registers(const struct slave *s, int64_t now_ns, uint16_t *registers) {
    const struct recording *r = &s->player->recording;
    double updates = floor(player_seconds(s->player, now_ns) * s->update_hz);
    double t = player_file_time(s->player, updates / s->update_hz);
    registers[SEQUENCE] = (uint16_t)(int64_t)updates;
    if (r->joints)
        set_joint(r, t, registers);
    for (int i = 0; i < r->tool_count; i++)
        if (r->tools[i].channel == CHANNEL_PUNCH && r->tools[i].has_opening) {
            double opening = recording_tool_at(r, i, t).opening;
            registers[OPENING] = (uint16_t)round(10000 * opening);
            registers[BUTTONS] = opening < closed_opening;
        }
}

// ---- lines
// ---------------------------------------------------------------------------------------

enum result slave_listen(struct slave *s, const char *address, uint16_t *out_port,
                         struct error *err) {
    s->line = modbus_new_tcp(NULL, 0); // only a reader and writer of frames: we own the sockets
    CHECK(s->line);
    s->other_end = -1;
    return socket_listen(address, &s->listener, out_port, err);
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
    s->line = modbus_new_rtu(name, 115200, 'N', 8, 1);
    CHECK(s->line);
    s->listener = -1;
    s->masters[0] = fd;
    s->master_count = 1;
    enum result result = replace_link(name, path, err);
    s->link = result == RESULT_OK ? path : NULL;
    return result;
}

void slave_close(struct slave *s) {
    if (s->listener >= 0)
        close(s->listener);
    if (s->other_end >= 0)
        close(s->other_end);
    for (int i = 0; i < s->master_count; i++)
        close(s->masters[i]);
    if (s->link)
        unlink(s->link);
    if (s->line)
        modbus_free(s->line);
}

// ---- serving
// -------------------------------------------------------------------------------------

static void sleep_ms(int ms) {
    struct timespec time = {ms / 1000, ms % 1000 * NS_PER_MS};
    nanosleep(&time, NULL);
}

static void reply(struct slave *s, const uint8_t *request, int length, modbus_mapping_t *mapping) {
    if (player_is_silent(s->player, &s->silence, clock_now_ns()))
        return;
    set_registers(s, clock_now_ns(), mapping->tab_registers);
    if (s->late_every && ++s->replies % (uint64_t)s->late_every == 0)
        sleep_ms(s->late_ms);
    modbus_reply(s->line, request, length, mapping);
}

static void serve_master(struct slave *s, int i, modbus_mapping_t *mapping) {
    uint8_t request[MODBUS_MAX_ADU_LENGTH];
    modbus_set_socket(s->line, s->masters[i]);
    int length = modbus_receive(s->line, request);
    if (length > 0) {
        reply(s, request, length, mapping);
    } else if (length < 0 && s->listener >= 0) {
        close(s->masters[i]);
        s->masters[i] = s->masters[--s->master_count];
    } else if (length < 0) {
        modbus_flush(s->line);
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

void *slave_run(void *slave) {
    struct slave *s = slave;
    modbus_mapping_t *mapping = modbus_mapping_new(0, 0, REGISTERS, 0);
    CHECK(mapping);
    modbus_set_slave(s->line, s->number);
    modbus_set_byte_timeout(s->line, 0, patience_us);
    // The pause that libmodbus makes, with all masters waiting, after a request that is none.
    modbus_set_response_timeout(s->line, 0, patience_us);
    while (!atomic_load(s->stop))
        serve(s, mapping);
    modbus_mapping_free(mapping);
    return NULL;
}
