#include "device/modbus_line.h"

#include "base/check.h"
#include "base/clock.h"
#include "device/device.h"
#include "device/options.h"
#include "device/socket.h"

#include <errno.h>
#include <limits.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <time.h>

enum { SLAVE_NUMBERS = 248 };

static const int byte_timeout_ms = 20;
static const int64_t longest_silence_ns = 2 * NS_PER_S;

struct modbus_line {
    struct modbus_line *next;
    char name[OPTION_TEXT_MAX]; // as the first device calls it
    char path[PATH_MAX];        // of a serial line: what the name led to when it was joined
    char device[DEVICE_NAME_MAX];
    bool is_serial, echo;
    int baud, stop_bits;
    char parity;
    int users; // under lines_lock

    pthread_mutex_t lock;
    pthread_cond_t turn_ended;
    uint64_t next_ticket, serving;         // under the lock
    int64_t answered_ns;                   // too
    int64_t quiet_until_ns[SLAVE_NUMBERS]; // too

    // Of the device whose turn it is.
    struct modbus_connection connection; // modbus NULL: closed
    uint64_t connection_number;          // counts them
    int openers;
    int64_t ended_ns;
};

static pthread_mutex_t lines_lock = PTHREAD_MUTEX_INITIALIZER;
static struct modbus_line *lines;

// ---- who shares it ------------------------------------------------------------------------------

static struct modbus_line *new_line(const struct modbus_line_settings *s, const char *name,
                                    const char *path) {
    struct modbus_line *line = alloc(1, sizeof *line);
    line->is_serial = s->serial[0];
    snprintf(line->name, sizeof line->name, "%s", name);
    snprintf(line->path, sizeof line->path, "%s", path);
    snprintf(line->device, sizeof line->device, "%s", s->device);
    line->baud = s->baud;
    line->parity = s->parity;
    line->stop_bits = s->stop_bits;
    line->echo = s->echo;
    line->users = 1;
    pthread_mutex_init(&line->lock, NULL);
    pthread_cond_init(&line->turn_ended, NULL);
    line->next = lines;
    lines = line;
    return line;
}

static enum result share(struct modbus_line *line, const struct modbus_line_settings *s,
                         struct error *err) {
    if (line->baud != s->baud || line->parity != s->parity || line->stop_bits != s->stop_bits ||
        line->echo != s->echo)
        return fail(
            err, RESULT_INVALID,
            "[device %s] and [device %s] share %s: baud, parity, stop_bits and echo must be the "
            "same",
            line->device, s->device, line->name);
    line->users++;
    return RESULT_OK;
}

enum result modbus_line_join(const struct modbus_line_settings *s, struct modbus_line **out_line,
                             struct error *err) {
    const char *name = s->serial[0] ? s->serial : s->address;
    char path[PATH_MAX];
    if (!s->serial[0] || !realpath(name, path))
        snprintf(path, sizeof path, "%s", name); // an address, or not plugged in yet
    pthread_mutex_lock(&lines_lock);
    struct modbus_line *line = lines;
    while (line && strcmp(line->path, path) && strcmp(line->name, name))
        line = line->next;
    enum result result = line ? share(line, s, err) : RESULT_OK;
    if (!line)
        line = new_line(s, name, path);
    pthread_mutex_unlock(&lines_lock);
    if (result == RESULT_OK)
        *out_line = line;
    return result;
}

void modbus_line_leave(struct modbus_line **line_of_caller) {
    struct modbus_line *line = *line_of_caller, **link = &lines;
    *line_of_caller = NULL;
    pthread_mutex_lock(&lines_lock);
    bool last = --line->users == 0;
    while (last && *link != line)
        link = &(*link)->next;
    if (last)
        *link = line->next;
    pthread_mutex_unlock(&lines_lock);
    if (!last)
        return;
    CHECK(!line->openers);
    pthread_cond_destroy(&line->turn_ended);
    pthread_mutex_destroy(&line->lock);
    free(line);
}

static bool is_shared(const struct modbus_line *line) {
    pthread_mutex_lock(&lines_lock);
    bool shared = line->users > 1;
    pthread_mutex_unlock(&lines_lock);
    return shared;
}

// ---- turns --------------------------------------------------------------------------------------

static void take_turn(struct modbus_line *line) {
    pthread_mutex_lock(&line->lock);
    uint64_t ticket = line->next_ticket++;
    while (line->serving != ticket)
        pthread_cond_wait(&line->turn_ended, &line->lock);
    pthread_mutex_unlock(&line->lock);
}

static void give_turn(struct modbus_line *line) {
    line->ended_ns = clock_now_ns();
    pthread_mutex_lock(&line->lock);
    line->serving++;
    pthread_cond_broadcast(&line->turn_ended);
    pthread_mutex_unlock(&line->lock);
}

static void disconnect(struct modbus_line *line) {
    if (!line->connection.modbus)
        return;
    modbus_close(line->connection.modbus);
    modbus_free(line->connection.modbus);
    line->connection.modbus = NULL;
}

void modbus_line_leave_alone(struct modbus_line *line, int slave, int64_t until_ns) {
    pthread_mutex_lock(&line->lock);
    line->quiet_until_ns[slave] = until_ns;
    pthread_mutex_unlock(&line->lock);
}

int64_t modbus_line_quiet_until(struct modbus_line *line, int slave) {
    pthread_mutex_lock(&line->lock);
    int64_t until_ns = line->quiet_until_ns[slave];
    pthread_mutex_unlock(&line->lock);
    return until_ns;
}

// ---- asking -------------------------------------------------------------------------------------

// Slaves tell one message from the next by a silence of 3.5 characters of 11 bits, and of 1.75 ms
// where the line is fast.
static void keep_apart(const struct modbus_line *line) {
    int64_t characters_ns = (int64_t)(3.5 * 11 / line->baud * NS_PER_S);
    int64_t shortest_ns = 1750000;
    int64_t at_ns = line->ended_ns + (characters_ns > shortest_ns ? characters_ns : shortest_ns);
    struct timespec at = {at_ns / NS_PER_S, at_ns % NS_PER_S};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL);
}

static bool bytes_wait(const struct modbus_line *line) {
    int count = 0;
    return ioctl(modbus_get_socket(line->connection.modbus), FIONREAD, &count) == 0 && count > 0;
}

// Bytes that wait before a request are a late reply of this slave, or of another one of the line;
// this one's have come in where it was left alone. False: nobody can have sent them.
static bool clear_line(struct modbus_line *line, int slave) {
    bool was_left_alone = modbus_line_quiet_until(line, slave);
    modbus_line_leave_alone(line, slave, 0);
    if (!was_left_alone && !bytes_wait(line))
        return true;
    modbus_flush(line->connection.modbus);
    return was_left_alone || line->connection.is_shared;
}

static int ask(struct modbus_line *line, const struct modbus_request *request,
               uint16_t *out_registers, int64_t *out_time_ns) {
    if (line->is_serial)
        keep_apart(line);
    line->connection.is_shared = is_shared(line);
    if (!clear_line(line, request->slave))
        return MODBUS_JUNK;
    int64_t sent_ns = clock_now_ns();
    int code = modbus_exchange(&line->connection, request, out_registers);
    *out_time_ns = sent_ns + (clock_now_ns() - sent_ns) / 2;
    if (modbus_is_gone(code))
        disconnect(line);
    return code;
}

int modbus_line_ask(struct modbus_line *line, uint64_t connection,
                    const struct modbus_request *request, uint16_t *out_registers,
                    int64_t *out_time_ns) {
    take_turn(line);
    bool open = line->connection.modbus && line->connection_number == connection;
    int code = open ? ask(line, request, out_registers, out_time_ns) : ENOTCONN;
    if (!code || modbus_is_answer(code)) {
        pthread_mutex_lock(&line->lock);
        line->answered_ns = clock_now_ns();
        pthread_mutex_unlock(&line->lock);
    }
    give_turn(line);
    return code;
}

// ---- opening ------------------------------------------------------------------------------------

static modbus_t *new_modbus(const struct modbus_line *line) {
    char host[SOCKET_HOST_MAX], port[SOCKET_PORT_MAX];
    if (line->is_serial)
        return modbus_new_rtu(line->name, line->baud, line->parity, 8, line->stop_bits);
    CHECK(socket_split(line->name, host, port, NULL) == RESULT_OK);
    return modbus_new_tcp_pi(host, port);
}

static enum result connect_line(struct modbus_line *line, struct error *err) {
    modbus_t *modbus = new_modbus(line);
    if (!modbus)
        return fail(err, RESULT_IO, "%s: %s", line->name, modbus_strerror(errno));
    modbus_set_response_timeout(modbus, 1, 0); // of connecting
    if (modbus_connect(modbus)) {
        int code = errno;
        modbus_free(modbus);
        return fail(err, RESULT_CLOSED, "%s: %s", line->name, modbus_strerror(code));
    }
    line->connection = (struct modbus_connection){modbus, line->is_serial, .echo = line->echo};
    if (line->is_serial && flock(modbus_get_socket(modbus), LOCK_EX | LOCK_NB)) {
        disconnect(line);
        return fail(
            err, RESULT_REFUSED,
            "%s: another program uses it, or another device of the config under another name",
            line->name);
    }
    modbus_set_byte_timeout(modbus, 0, (uint32_t)byte_timeout_ms * 1000);
    modbus_flush(modbus);
    line->connection_number++;
    return RESULT_OK;
}

enum result modbus_line_open(struct modbus_line *line, uint64_t *out_connection,
                             struct error *err) {
    take_turn(line);
    enum result result = line->connection.modbus ? RESULT_OK : connect_line(line, err);
    line->openers += result == RESULT_OK;
    *out_connection = line->connection_number;
    give_turn(line);
    return result;
}

// A line on which nobody answers any more is closed for all: to open it again may help.
void modbus_line_close(struct modbus_line *line) {
    take_turn(line);
    bool silent = !modbus_line_answered_since(line, clock_now_ns() - longest_silence_ns);
    if (--line->openers == 0 || silent)
        disconnect(line);
    give_turn(line);
}

const char *modbus_line_name(const struct modbus_line *line) {
    return line->name;
}

bool modbus_line_answered_since(struct modbus_line *line, int64_t time_ns) {
    pthread_mutex_lock(&line->lock);
    bool answered = line->answered_ns > time_ns;
    pthread_mutex_unlock(&line->lock);
    return answered;
}
