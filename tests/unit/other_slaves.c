#include "other_slaves.h"

#include "base/clock.h"
#include "test.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

enum { RTU_REQUEST = 8, TCP_REQUEST = 12, NO_ANSWER_MS = 150 };

static uint16_t crc_of(const uint8_t *bytes, int count) {
    uint16_t crc = 0xffff;
    for (int i = 0; i < count; i++) {
        crc ^= bytes[i];
        for (int bit = 0; bit < 8; bit++)
            crc = crc & 1 ? (uint16_t)(crc >> 1 ^ 0xa001) : (uint16_t)(crc >> 1);
    }
    return crc;
}

// `pdu` begins with the slave. Returns the size of its reply, without header and checksum.
static int answer(const struct other_slaves *s, const uint8_t *pdu, uint8_t *out) {
    int slave = pdu[0], first = pdu[2] << 8 | pdu[3], count = pdu[4] << 8 | pdu[5];
    bool inputs = pdu[1] == 4;
    memcpy(out, pdu, 2);
    if ((pdu[1] != 3 && !inputs) || (inputs && first + count > OTHER_INPUTS) || count > 125) {
        out[1] |= 0x80;
        out[2] = inputs ? 2 : 1;
        return 3;
    }
    out[2] = (uint8_t)(2 * count);
    for (int i = 0; i < count; i++) {
        int value = inputs ? s->inputs[first + i] : 1000 * slave + first + i;
        out[3 + 2 * i] = (uint8_t)(value >> 8);
        out[4 + 2 * i] = (uint8_t)value;
    }
    return 3 + 2 * count;
}

static int frame_rtu(struct other_slaves *s, const uint8_t *request, int asked, uint8_t *out) {
    int slave = request[0], size = answer(s, request, out);
    int every = atomic_load(&s->each[slave].spoil_every);
    uint16_t crc = crc_of(out, size);
    crc ^= (uint16_t)(every && asked % every == 0);
    out[size] = (uint8_t)crc;
    out[size + 1] = (uint8_t)(crc >> 8);
    return size + 2;
}

static int frame_tcp(const struct other_slaves *s, const uint8_t *request, uint8_t *out) {
    int size = answer(s, request + 6, out + 6);
    memcpy(out, request, 4);
    out[4] = 0;
    out[5] = (uint8_t)size;
    return size + 6;
}

static void put(struct other_slaves *s, const uint8_t *bytes, int size) {
    assert_int_equal(size, write(s->fd, bytes, (size_t)size));
}

// A gateway says after a while that a slave does not answer.
static void take_request(struct other_slaves *s, const uint8_t *request) {
    int slave = request[s->is_tcp ? 6 : 0], waiting = 0;
    struct other_late *late = &s->late[slave];
    assert_in_range(slave, 1, OTHER_SLAVES);
    int asked = atomic_fetch_add(&s->each[slave].asked, 1) + 1;
    bool silent = atomic_load(&s->each[slave].silent);
    int delay_ms = silent ? NO_ANSWER_MS : atomic_load(&s->each[slave].delay_ms);
    if (atomic_load(&s->echo))
        put(s, request, RTU_REQUEST);
    usleep(1000); // a slave takes its time
    if (ioctl(s->fd, FIONREAD, &waiting) == 0 && waiting)
        atomic_fetch_add(&s->collisions, 1);
    if (silent && !s->is_tcp)
        return;
    late->size =
        s->is_tcp ? frame_tcp(s, request, late->bytes) : frame_rtu(s, request, asked, late->bytes);
    if (silent) {
        late->bytes[7] |= 0x80;
        late->bytes[8] = 0x0b;
        late->bytes[5] = 3;
        late->size = 9;
    }
    late->sent = 0;
    late->due_ns = clock_now_ns() + delay_ms * NS_PER_MS;
}

static void send_due(struct other_slaves *s) {
    for (int i = 1; i <= OTHER_SLAVES; i++) {
        struct other_late *late = &s->late[i];
        if (!late->due_ns || clock_now_ns() < late->due_ns)
            continue;
        int drip_ms = atomic_load(&s->each[i].drip_ms), left = late->size - late->sent;
        int size = drip_ms ? 1 : left;
        put(s, late->bytes + late->sent, size);
        late->sent += size;
        late->due_ns = size == left ? 0 : clock_now_ns() + drip_ms * NS_PER_MS;
    }
}

static void *serve(void *argument) {
    struct other_slaves *s = argument;
    uint8_t request[TCP_REQUEST];
    int used = 0, size = s->is_tcp ? TCP_REQUEST : RTU_REQUEST;
    while (!atomic_load(&s->stop)) {
        struct pollfd ready[] = {{.fd = s->fd, .events = POLLIN},
                                 {.fd = s->listener, .events = POLLIN}};
        poll(ready, 2, 1);
        if (ready[1].revents) { // the newest connection is served
            close(s->fd);
            s->fd = accept(s->listener, NULL, NULL);
            atomic_fetch_add(&s->connections, 1);
            memset(s->late, 0, sizeof s->late);
            used = 0;
        } else if (ready[0].revents) {
            ssize_t count = read(s->fd, request + used, (size_t)(size - used));
            used += count > 0 ? (int)count : 0;
            if (count <= 0 && s->is_tcp) {
                close(s->fd);
                s->fd = -1;
            }
        }
        if (used == size) {
            used = 0;
            take_request(s, request);
        }
        if (s->fd >= 0)
            send_due(s);
    }
    return NULL;
}

static void begin(struct other_slaves *s) {
    memset(s, 0, sizeof *s);
    s->fd = s->other_end = s->listener = -1;
}

void other_slaves_start(struct other_slaves *s) {
    begin(s);
    s->fd = posix_openpt(O_RDWR | O_NOCTTY);
    assert_true(s->fd >= 0 && !grantpt(s->fd) && !unlockpt(s->fd));
    assert_int_equal(0, ptsname_r(s->fd, s->name, sizeof s->name));
    s->other_end = open(s->name, O_RDWR | O_NOCTTY);
    struct termios raw;
    tcgetattr(s->other_end, &raw);
    cfmakeraw(&raw);
    tcsetattr(s->other_end, TCSANOW, &raw);
    assert_int_equal(0, pthread_create(&s->thread, NULL, serve, s));
}

void other_slaves_start_gateway(struct other_slaves *s) {
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof at;
    begin(s);
    s->is_tcp = true;
    s->listener = socket(AF_INET, SOCK_STREAM, 0);
    assert_int_equal(0, bind(s->listener, (struct sockaddr *)&at, sizeof at));
    assert_int_equal(0, listen(s->listener, 8));
    assert_int_equal(0, getsockname(s->listener, (struct sockaddr *)&at, &size));
    snprintf(s->name, sizeof s->name, "127.0.0.1:%d", ntohs(at.sin_port));
    assert_int_equal(0, pthread_create(&s->thread, NULL, serve, s));
}

void other_slaves_stop(struct other_slaves *s) {
    atomic_store(&s->stop, true);
    pthread_join(s->thread, NULL);
    close(s->fd);
    close(s->other_end);
    close(s->listener);
}
