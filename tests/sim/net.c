#include "sim/net.h"

#include "base/check.h"
#include "base/clock.h"
#include "wire/wire.h"

#include <errno.h>
#include <netinet/in.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#define DESCRIPTORS 512
#define QUEUE 512
#define BOUND_PORT 5000

enum kind { FREE, WAKES, DATAGRAMS, OTHER };

struct datagram {
    int from;
    size_t size;
    uint8_t bytes[WIRE_DATAGRAM_MAX];
};

struct descriptor {
    enum kind kind;
    struct sim_process *process;
    uint64_t wakes;
    int port, peer; // 0: none yet
    bool refused;   // the last datagram met nobody
    struct datagram *queue[QUEUE];
    unsigned head, count;
};

static struct {
    struct descriptor all[DESCRIPTORS];
    struct random random;
    struct weather weather[SIM_STATIONS_MAX];
    struct net_counts counts;
    int next_port;
} net;

// ---- weather ------------------------------------------------------------------------------------

struct weather *net_weather(int station) {
    return &net.weather[station];
}

struct weather net_fair(int station) {
    return (struct weather){.delay_ns = (200 + 300 * station) * 1000, .jitter_ns = 150 * 1000};
}

struct net_counts net_counts(void) {
    return net.counts;
}

int64_t net_delay_ns(int station) {
    const struct weather *w = &net.weather[station];
    return w->delay_ns + (int64_t)(random_bits(&net.random) % (uint64_t)(w->jitter_ns + 1));
}

void net_begin(uint64_t seed) {
    memset(&net.counts, 0, sizeof net.counts);
    net.random = (struct random){seed};
    net.next_port = 20000;
    for (int i = 0; i < SIM_STATIONS_MAX; i++)
        net.weather[i] = net_fair(i);
}

static bool happens(double share) {
    return random_between(&net.random, 0, 1) < share;
}

// ---- descriptors --------------------------------------------------------------------------------

static struct descriptor *find(int fd) {
    CHECK(fd >= SIM_FD && fd < SIM_FD + DESCRIPTORS && net.all[fd - SIM_FD].kind != FREE);
    return &net.all[fd - SIM_FD];
}

static int open_one(enum kind kind) {
    int i = 0;
    while (i < DESCRIPTORS && net.all[i].kind != FREE)
        i++;
    CHECK(i < DESCRIPTORS);
    net.all[i] = (struct descriptor){.kind = kind, .process = sim_process()};
    return SIM_FD + i;
}

static void empty(struct descriptor *d) {
    for (; d->count; d->count--)
        free(d->queue[d->head++ % QUEUE]);
}

static void close_one(struct descriptor *d) {
    empty(d);
    d->kind = FREE;
    sim_wake(d);
}

void net_drop(struct sim_process *process) {
    for (int i = 0; i < DESCRIPTORS; i++)
        if (net.all[i].kind == DATAGRAMS && net.all[i].process == process) {
            empty(&net.all[i]);
            net.all[i].port = 0;
        }
}

int net_open_descriptors(void) {
    int count = 0;
    for (int i = 0; i < DESCRIPTORS; i++)
        count += net.all[i].kind != FREE;
    return count;
}

void net_end(void) {
    for (int i = 0; i < DESCRIPTORS; i++)
        if (net.all[i].kind != FREE)
            close_one(&net.all[i]);
}

static bool is_readable(const struct descriptor *d) {
    return d->kind == WAKES ? d->wakes > 0 : d->count > 0 || d->refused;
}

// ---- waiting ------------------------------------------------------------------------------------

// A thread that polls waits for its own list; who fills a descriptor looks for the lists with it.
struct waiting {
    struct waiting *next;
    const struct pollfd *fds;
    nfds_t count;
};

static struct waiting *waiting;

static void became_readable(const struct descriptor *d) {
    for (struct waiting *w = waiting; w; w = w->next)
        for (nfds_t i = 0; i < w->count; i++)
            if (w->fds[i].fd == SIM_FD + (int)(d - net.all))
                sim_wake(w);
}

static int look(struct pollfd *fds, nfds_t count) {
    int ready = 0;
    for (nfds_t i = 0; i < count; i++) {
        bool readable = fds[i].fd >= SIM_FD && is_readable(find(fds[i].fd));
        fds[i].revents = readable ? POLLIN : 0;
        ready += readable;
    }
    return ready;
}

static int wait_for(struct pollfd *fds, nfds_t count, int64_t for_ns) {
    int ready = look(fds, count);
    if (ready)
        return ready;
    struct waiting w = {waiting, fds, count};
    waiting = &w;
    sim_wait(&w, for_ns < 0 ? INT64_MAX : sim_now_ns() + for_ns);
    struct waiting **at = &waiting;
    while (*at != &w)
        at = &(*at)->next;
    *at = w.next;
    return look(fds, count);
}

int __wrap_poll(struct pollfd *fds, nfds_t count, int milliseconds);
int __wrap_poll(struct pollfd *fds, nfds_t count, int milliseconds) {
    return wait_for(fds, count, milliseconds < 0 ? -1 : milliseconds * NS_PER_MS);
}

int __wrap_ppoll(struct pollfd *fds, nfds_t count, const struct timespec *time,
                 const sigset_t *mask);
int __wrap_ppoll(struct pollfd *fds, nfds_t count, const struct timespec *time,
                 const sigset_t *mask) {
    (void)mask;
    return wait_for(fds, count, time ? time->tv_sec * NS_PER_S + time->tv_nsec : -1);
}

// ---- wakes --------------------------------------------------------------------------------------

int __wrap_eventfd(unsigned value, int flags);
int __wrap_eventfd(unsigned value, int flags) {
    (void)flags;
    int fd = open_one(WAKES);
    find(fd)->wakes = value;
    return fd;
}

ssize_t __real_read(int fd, void *out, size_t size);
ssize_t __wrap_read(int fd, void *out, size_t size);
ssize_t __wrap_read(int fd, void *out, size_t size) {
    if (fd < SIM_FD)
        return __real_read(fd, out, size);
    struct descriptor *d = find(fd);
    CHECK(d->kind == WAKES && size == sizeof d->wakes);
    if (!d->wakes) {
        errno = EAGAIN;
        return -1;
    }
    memcpy(out, &d->wakes, size);
    d->wakes = 0;
    return (ssize_t)size;
}

ssize_t disk_write(int fd, const void *bytes, size_t size);
ssize_t __wrap_write(int fd, const void *bytes, size_t size);
ssize_t __wrap_write(int fd, const void *bytes, size_t size) {
    if (fd < SIM_FD)
        return disk_write(fd, bytes, size);
    struct descriptor *d = find(fd);
    CHECK(d->kind == WAKES && size == sizeof d->wakes);
    d->wakes += *(const uint64_t *)bytes;
    became_readable(d);
    return (ssize_t)size;
}

int disk_close(int fd);
int __wrap_close(int fd);
int __wrap_close(int fd) {
    if (fd < SIM_FD)
        return disk_close(fd);
    close_one(find(fd));
    return 0;
}

// ---- datagrams ----------------------------------------------------------------------------------

static struct sockaddr_in address_of(int port) {
    return (struct sockaddr_in){.sin_family = AF_INET,
                                .sin_port = htons((uint16_t)port),
                                .sin_addr = {htonl(INADDR_LOOPBACK)}};
}

static int port_of(const struct sockaddr *address) {
    return ntohs(((const struct sockaddr_in *)address)->sin_port);
}

int __wrap_socket(int family, int type, int protocol);
int __wrap_socket(int family, int type, int protocol) {
    (void)family, (void)protocol;
    return open_one(type & SOCK_DGRAM ? DATAGRAMS : OTHER);
}

static struct descriptor *at_port(int port) {
    for (int i = 0; i < DESCRIPTORS; i++)
        if (net.all[i].kind == DATAGRAMS && net.all[i].port == port)
            return &net.all[i];
    return NULL;
}

int __wrap_bind(int fd, const struct sockaddr *address, socklen_t size);
int __wrap_bind(int fd, const struct sockaddr *address, socklen_t size) {
    (void)size;
    int port = port_of(address);
    find(fd)->port = port ? port : net.next_port++;
    return 0;
}

int __wrap_connect(int fd, const struct sockaddr *address, socklen_t size);
int __wrap_connect(int fd, const struct sockaddr *address, socklen_t size) {
    (void)size;
    find(fd)->port = net.next_port++;
    find(fd)->peer = port_of(address);
    return 0;
}

int __wrap_setsockopt(int fd, int level, int name, const void *value, socklen_t size);
int __wrap_setsockopt(int fd, int level, int name, const void *value, socklen_t size) {
    (void)fd, (void)level, (void)name, (void)value, (void)size;
    return 0;
}

static int tell(int port, struct sockaddr *out, socklen_t *size) {
    struct sockaddr_in address = address_of(port);
    memcpy(out, &address, sizeof address);
    *size = sizeof address;
    return 0;
}

int __wrap_getsockname(int fd, struct sockaddr *out, socklen_t *size);
int __wrap_getsockname(int fd, struct sockaddr *out, socklen_t *size) {
    return tell(find(fd)->port, out, size);
}

int __wrap_getpeername(int fd, struct sockaddr *out, socklen_t *size);
int __wrap_getpeername(int fd, struct sockaddr *out, socklen_t *size) {
    (void)fd; // of a control connection
    return tell(BOUND_PORT, out, size);
}

struct flight {
    int to;
    int station;
    enum direction direction;
    struct datagram *datagram;
};

static void arrive(void *user) {
    struct flight flight = *(struct flight *)user;
    free(user);
    struct descriptor *to = at_port(flight.to);
    bool cut = net.weather[flight.station].cut[flight.direction];
    struct descriptor *from = at_port(flight.datagram->from);
    if (!to && !cut && from && from->peer) { // the other machine says so
        from->refused = true;
        became_readable(from);
    }
    if (!to || cut || to->count == QUEUE) {
        net.counts.lost++;
        free(flight.datagram);
        return;
    }
    to->queue[(to->head + to->count++) % QUEUE] = flight.datagram;
    became_readable(to);
}

static void fly(int station, enum direction direction, int from, int to, const uint8_t *bytes,
                size_t size) {
    const struct weather *w = &net.weather[station];
    struct flight *flight = alloc(1, sizeof *flight);
    *flight = (struct flight){to, station, direction, alloc(1, sizeof *flight->datagram)};
    flight->datagram->from = from;
    flight->datagram->size = size;
    memcpy(flight->datagram->bytes, bytes, size);
    if (happens(w->corrupted)) {
        net.counts.corrupted++;
        flight->datagram->bytes[random_bits(&net.random) % size] ^=
            (uint8_t)(1 + random_bits(&net.random) % 255);
    }
    int64_t delay_ns = net_delay_ns(station);
    net.counts.late += delay_ns > 5 * NS_PER_MS;
    sim_at(sim_now_ns() + delay_ns, arrive, flight);
}

static int station_of_port(int port) {
    const struct descriptor *d = at_port(port);
    return d && d->process ? d->process->index : SIM_SERVER;
}

static void send_one(const struct descriptor *from, int to, const uint8_t *bytes, size_t size) {
    bool to_server = from->process->index != SIM_SERVER;
    int station = to_server ? from->process->index : station_of_port(to);
    if (station < 0 || !from->port || sim_is_dead())
        return; // nobody is there
    enum direction direction = to_server ? TO_SERVER : TO_STATION;
    net.counts.sent++;
    if (net.weather[station].cut[direction] || happens(net.weather[station].lost)) {
        net.counts.lost++;
        return;
    }
    fly(station, direction, from->port, to, bytes, size);
    if (happens(net.weather[station].doubled)) {
        net.counts.doubled++;
        fly(station, direction, from->port, to, bytes, size);
    }
}

ssize_t __wrap_send(int fd, const void *bytes, size_t size, int flags);
ssize_t __wrap_send(int fd, const void *bytes, size_t size, int flags) {
    (void)flags;
    struct descriptor *d = find(fd);
    if (d->refused) {
        d->refused = false;
        errno = ECONNREFUSED;
        return -1;
    }
    send_one(d, d->peer, bytes, size);
    return (ssize_t)size;
}

int __wrap_sendmmsg(int fd, struct mmsghdr *messages, unsigned count, int flags);
int __wrap_sendmmsg(int fd, struct mmsghdr *messages, unsigned count, int flags) {
    (void)flags;
    for (unsigned i = 0; i < count; i++)
        send_one(find(fd), port_of(messages[i].msg_hdr.msg_name),
                 messages[i].msg_hdr.msg_iov->iov_base, messages[i].msg_hdr.msg_iov->iov_len);
    return (int)count;
}

static struct datagram *take(struct descriptor *d) {
    if (!d->count) {
        errno = d->refused ? ECONNREFUSED : EAGAIN;
        d->refused = false;
        return NULL;
    }
    d->count--;
    return d->queue[d->head++ % QUEUE];
}

ssize_t __wrap_recv(int fd, void *out, size_t size, int flags);
ssize_t __wrap_recv(int fd, void *out, size_t size, int flags) {
    (void)flags;
    struct datagram *datagram = take(find(fd));
    if (!datagram)
        return -1;
    size_t taken = datagram->size < size ? datagram->size : size;
    memcpy(out, datagram->bytes, taken);
    free(datagram);
    return (ssize_t)taken;
}

int __wrap_recvmmsg(int fd, struct mmsghdr *messages, unsigned count, int flags,
                    struct timespec *timeout);
int __wrap_recvmmsg(int fd, struct mmsghdr *messages, unsigned count, int flags,
                    struct timespec *timeout) {
    (void)flags, (void)timeout;
    struct descriptor *d = find(fd);
    d->refused = false;
    unsigned done = 0;
    for (struct datagram *datagram; done < count && (datagram = take(d)); done++) {
        struct mmsghdr *message = &messages[done];
        tell(datagram->from, message->msg_hdr.msg_name, &message->msg_hdr.msg_namelen);
        memcpy(message->msg_hdr.msg_iov->iov_base, datagram->bytes, datagram->size);
        message->msg_len = (unsigned)datagram->size;
        message->msg_hdr.msg_flags = 0;
        free(datagram);
    }
    return (int)done;
}
