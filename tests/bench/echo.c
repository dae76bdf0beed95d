#include "echo.h"

#include "base/check.h"
#include "base/clock.h"
#include "wire/wire.h"

#include <arpa/inet.h>
#include <errno.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#define BATCH 32 // that of the server

struct batch {
    struct mmsghdr headers[BATCH];
    struct iovec parts[BATCH];
    struct sockaddr_in addresses[BATCH];
    uint8_t data[BATCH][WIRE_DATAGRAM_MAX];
};

static const uint8_t key[SEAL_KEY_SIZE], iv[SEAL_IV_SIZE];

static struct seal *make_seal(enum seal_direction direction, int caller) {
    return seal_create(direction, 0, (uint32_t)caller + 1, key, iv);
}

// ---- the child ----------------------------------------------------------------------------------

struct lane {
    struct seal *to_server, *to_station;
};

static void prepare(struct batch *batch) {
    for (int i = 0; i < BATCH; i++) {
        batch->parts[i] = (struct iovec){batch->data[i], WIRE_DATAGRAM_MAX};
        batch->headers[i].msg_hdr = (struct msghdr){.msg_name = &batch->addresses[i],
                                                    .msg_namelen = sizeof batch->addresses[i],
                                                    .msg_iov = &batch->parts[i],
                                                    .msg_iovlen = 1};
    }
}

static bool seal_again(struct lane *lanes, int count, uint8_t *data, size_t *size) {
    uint8_t message[WIRE_DATAGRAM_MAX];
    struct seal_header clear;
    uint64_t sequence;
    size_t used;
    if (!seal_peek(data, *size, &clear) || clear.connection > (uint32_t)count ||
        !seal_open(lanes[clear.connection - 1].to_server, data, *size, message, &used, &sequence))
        return false;
    *size = seal_seal(lanes[clear.connection - 1].to_station, message, used, data);
    return true;
}

static void answer(int fd, struct lane *lanes, int count, struct batch *batch) {
    prepare(batch);
    int received = recvmmsg(fd, batch->headers, BATCH, MSG_DONTWAIT, NULL), kept = 0;
    for (int i = 0; i < received; i++) {
        size_t size = batch->headers[i].msg_len;
        if (lanes && !seal_again(lanes, count, batch->data[i], &size))
            continue;
        batch->headers[i].msg_hdr.msg_iov->iov_len = size;
        batch->headers[kept++].msg_hdr = batch->headers[i].msg_hdr;
    }
    for (int done = 0, sent; done < kept; done += sent)
        if ((sent = sendmmsg(fd, batch->headers + done, (unsigned)(kept - done), MSG_DONTWAIT)) <=
            0)
            return;
}

static void serve(int fd, int count, bool sealed, int cpu) {
    static struct batch batch;
    struct lane *lanes = sealed ? alloc((size_t)count, sizeof *lanes) : NULL;
    cpu_set_t set;
    CPU_ZERO(&set);
    CPU_SET((size_t)cpu, &set);
    sched_setaffinity(0, sizeof set, &set);
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    for (int i = 0; lanes && i < count; i++)
        lanes[i] = (struct lane){make_seal(SEAL_TO_SERVER, i), make_seal(SEAL_TO_STATION, i)};
    for (struct pollfd waits = {fd, POLLIN, 0};;) {
        poll(&waits, 1, -1);
        answer(fd, lanes, count, &batch);
    }
}

// ---- the callers --------------------------------------------------------------------------------

static int open_socket(struct sockaddr_in *address, bool server) {
    socklen_t size = sizeof *address;
    int fd = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0), room = 4 << 20;
    if (fd < 0)
        return -1;
    if (server)
        setsockopt(fd, SOL_SOCKET, SO_RCVBUFFORCE, &room, sizeof room);
    if (!(server ? bind(fd, (struct sockaddr *)address, size)
                 : connect(fd, (struct sockaddr *)address, size)) &&
        (!server || !getsockname(fd, (struct sockaddr *)address, &size)))
        return fd;
    close(fd);
    return -1;
}

static void make_callers(struct echo *echo, struct sockaddr_in *address, bool sealed) {
    echo->callers = alloc((size_t)echo->count, sizeof *echo->callers);
    for (int i = 0; i < echo->count; i++) {
        echo->callers[i] = (struct caller){.fd = open_socket(address, false), .echoes = true};
        NEED(echo->callers[i].fd >= 0, "descriptor");
        if (sealed) {
            echo->callers[i].to_server = make_seal(SEAL_TO_SERVER, i);
            echo->callers[i].to_station = make_seal(SEAL_TO_STATION, i);
        }
    }
}

enum result echo_start(int callers, bool sealed, int cpu, struct echo *echo, struct error *err) {
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    *echo = (struct echo){.count = callers};
    int fd = open_socket(&address, true);
    if (fd < 0)
        return fail(err, RESULT_IO, "a socket for the echo: %s", strerror(errno));
    echo->pid = fork();
    if (!echo->pid)
        serve(fd, callers, sealed, cpu);
    close(fd);
    make_callers(echo, &address, sealed);
    return RESULT_OK;
}

void echo_end(struct echo *echo) {
    for (int i = 0; i < echo->count && echo->callers; i++) {
        close(echo->callers[i].fd);
        seal_destroy(&echo->callers[i].to_server);
        seal_destroy(&echo->callers[i].to_station);
    }
    free(echo->callers);
    if (echo->pid > 0) {
        kill(echo->pid, SIGKILL);
        waitpid(echo->pid, NULL, 0);
    }
    *echo = (struct echo){0};
}

int64_t echo_ns(const struct echo *echo) {
    clockid_t clock;
    struct timespec time = {0};
    if (!clock_getcpuclockid(echo->pid, &clock))
        clock_gettime(clock, &time);
    return time.tv_sec * NS_PER_S + time.tv_nsec;
}
