#include "drivers/modbus_line.h"

#include "base/check.h"
#include "base/clock.h"
#include "drivers/device.h"
#include "drivers/drivers.h"
#include "drivers/options.h"
#include "drivers/socket.h"

#include <errno.h>
#include <limits.h>
#include <linux/serial.h>
#include <poll.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <time.h>

enum { SLAVE_NUMBERS = 256 };

enum { BITS_OF_A_BYTE = 11 }; // with start, parity and stop

static const int64_t shortest_silence_ns = 20 * NS_PER_MS;
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
    bool is_unfinished;                  // a reply still comes that nobody waits for
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
    pthread_condattr_t monotonic;
    pthread_condattr_init(&monotonic);
    pthread_condattr_setclock(&monotonic, CLOCK_MONOTONIC);
    pthread_cond_init(&line->turn_ended, &monotonic);
    pthread_condattr_destroy(&monotonic);
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

// False: it has not come by then, and is kept for the next call.
static bool take_turn(struct modbus_line *line, struct modbus_user *user, int64_t until_ns) {
    struct timespec until = {until_ns / NS_PER_S, until_ns % NS_PER_S};
    bool timed_out = false;
    pthread_mutex_lock(&line->lock);
    if (!user->waits)
        user->ticket = line->next_ticket++;
    user->waits = true;
    while (line->serving != user->ticket && !timed_out)
        timed_out = pthread_cond_timedwait(&line->turn_ended, &line->lock, &until) == ETIMEDOUT;
    bool is_served = line->serving == user->ticket;
    pthread_mutex_unlock(&line->lock);
    return is_served;
}

static void give_turn(struct modbus_line *line, struct modbus_user *user) {
    line->ended_ns = clock_now_ns();
    user->waits = user->has_asked = false;
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

// Throws away what still comes. False: more may come. (A line that is gone is silent.)
static bool falls_silent(const struct modbus_line *line) {
    struct pollfd ready = {.fd = modbus_get_socket(line->connection.modbus), .events = POLLIN};
    int64_t silence_ns = 5 * line->connection.byte_ns;
    if (silence_ns < shortest_silence_ns)
        silence_ns = shortest_silence_ns;
    modbus_flush(line->connection.modbus);
    return poll(&ready, 1, (int)(silence_ns / NS_PER_MS) + 1) == 0 ||
           (ready.revents & (POLLERR | POLLHUP | POLLNVAL));
}

// A reply that does not end is heard to its end on a serial line; over TCP the connection is
// closed, since the next message's beginning would never be found.
static void finish(struct modbus_line *line, int code) {
    line->is_unfinished = code == MODBUS_UNFINISHED && line->is_serial;
    if (modbus_is_gone(code) || (code == MODBUS_UNFINISHED && !line->is_serial))
        disconnect(line);
}

static int send_on_line(struct modbus_line *line, struct modbus_user *user,
                        const struct modbus_request *request) {
    if (line->is_serial)
        keep_apart(line);
    if (line->is_unfinished && !falls_silent(line))
        return MODBUS_BUSY;
    line->connection.is_shared = is_shared(line);
    if (!clear_line(line, request->slave))
        return MODBUS_JUNK;
    line->is_unfinished = false;
    user->has_asked = true;
    user->sent_ns = clock_now_ns();
    return modbus_send(&line->connection, request, &user->deadline_ns);
}

static int ask_line(struct modbus_line *line, struct modbus_user *user,
                    const struct modbus_request *request, int64_t until_ns, uint16_t *out_registers,
                    int64_t *out_time_ns) {
    if (!line->connection.modbus || line->connection_number != user->connection)
        return ENOTCONN;
    int code = user->has_asked ? 0 : send_on_line(line, user, request);
    if (!code)
        code = modbus_receive_reply(&line->connection, request, user->deadline_ns, until_ns,
                                    out_registers);
    *out_time_ns = user->sent_ns + (clock_now_ns() - user->sent_ns) / 2;
    if (user->has_asked && code != MODBUS_PENDING)
        finish(line, code);
    return code;
}

int modbus_line_ask(struct modbus_line *line, struct modbus_user *user,
                    const struct modbus_request *request, uint16_t *out_registers,
                    int64_t *out_time_ns) {
    int64_t until_ns = clock_now_ns() + POLL_MAX_NS;
    if (!take_turn(line, user, until_ns))
        return MODBUS_PENDING;
    int code = ask_line(line, user, request, until_ns, out_registers, out_time_ns);
    if (code == MODBUS_PENDING)
        return code;
    if (!code || modbus_is_answer(code)) {
        pthread_mutex_lock(&line->lock);
        line->answered_ns = clock_now_ns();
        pthread_mutex_unlock(&line->lock);
    }
    give_turn(line, user);
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

// USB adapters hold short replies back for 16 ms, unless they are asked not to. Not all can be.
static void ask_for_low_latency(int fd) {
    struct serial_struct serial;
    if (ioctl(fd, TIOCGSERIAL, &serial))
        return;
    serial.flags |= ASYNC_LOW_LATENCY;
    ioctl(fd, TIOCSSERIAL, &serial);
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
    line->connection = (struct modbus_connection){
        modbus, line->is_serial, .echo = line->echo,
        .byte_ns = line->is_serial ? BITS_OF_A_BYTE * NS_PER_S / line->baud : 0};
    line->is_unfinished = false;
    if (line->is_serial && flock(modbus_get_socket(modbus), LOCK_EX | LOCK_NB)) {
        disconnect(line);
        return fail(
            err, RESULT_REFUSED,
            "%s: another program uses it, or another device of the config under another name",
            line->name);
    }
    if (line->is_serial)
        ask_for_low_latency(modbus_get_socket(modbus));
    modbus_flush(modbus);
    line->connection_number++;
    return RESULT_OK;
}

enum result modbus_line_open(struct modbus_line *line, struct modbus_user *user,
                             struct error *err) {
    take_turn(line, user, INT64_MAX);
    enum result result = line->connection.modbus ? RESULT_OK : connect_line(line, err);
    line->openers += result == RESULT_OK;
    user->connection = line->connection_number;
    give_turn(line, user);
    return result;
}

// A line on which nobody answers any more is closed for all: to open it again may help.
void modbus_line_close(struct modbus_line *line, struct modbus_user *user) {
    take_turn(line, user, INT64_MAX);
    bool silent = !modbus_line_answered_since(line, clock_now_ns() - longest_silence_ns);
    if (--line->openers == 0 || silent)
        disconnect(line);
    give_turn(line, user);
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
