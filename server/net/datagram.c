#include "net/datagram.h"

#include "base/chance.h"
#include "base/check.h"
#include "base/clock.h"
#include "base/listen.h"

#include <errno.h>
#include <netdb.h>
#include <openssl/rand.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#define EPOCH_NS (3600 * NS_PER_S)
#define EPOCH_SEQUENCES ((1ull << 32) - (1ull << 20)) // well before a seal is exhausted
#define OLD_EPOCH_NS (5 * NS_PER_S)
#define CHALLENGE_PAUSE_NS (100 * NS_PER_MS)
#define RECEIVE_ROOM (4 << 20) // bytes: what comes while the worker waits for a processor

struct address {
    struct sockaddr_storage storage;
    socklen_t size; // 0: none
};

struct epoch {
    struct seal *to_server, *to_station; // NULL: there is no such epoch
    uint8_t number;
    int64_t start_ns;
    bool used; // a datagram came in it
    uint64_t newest;
};

struct datagram_connection {
    uint32_t id; // meaningful while epoch.to_server
    void *user;
    struct epoch epoch, old_epoch;
    int64_t old_until_ns;
    struct address present;   // of the newest datagram: where replies go
    struct address confirmed; // the last one that the station stood by
    struct address challenged;
    uint64_t challenge; // 0: none is open
    bool in_replies;    // how it goes to the station
    int64_t challenge_ns;
    int unconfirmed_left; // replies that may still go to addresses not confirmed
};

// A datagram of the last batch: what may be answered, once.
struct question {
    uint32_t connection;
    uint64_t frame_number;
    size_t size; // 0: answered
};

// One side of recvmmsg and sendmmsg.
struct datagram_batch {
    struct mmsghdr headers[DATAGRAM_BATCH];
    struct iovec parts[DATAGRAM_BATCH];
    struct address addresses[DATAGRAM_BATCH];
    uint8_t data[DATAGRAM_BATCH][WIRE_DATAGRAM_MAX];
};

struct datagram_endpoint {
    int fd, port;
    struct datagram_connection *connections; // by the lowest bits of their ids
    uint32_t mask;                           // of these bits
    struct question questions[DATAGRAM_BATCH];
    int question_count;
    struct datagram_batch in, out;
    int out_count;
    struct datagram_counts counts;
};

// ---- socket -------------------------------------------------------------------------------------

static int bind_one(const struct addrinfo *info) {
    int fd = socket(info->ai_family, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (fd < 0)
        return -1;
    int off = 0, room = RECEIVE_ROOM;
    // More than the system's limit needs a privilege.
    if (setsockopt(fd, SOL_SOCKET, SO_RCVBUFFORCE, &room, sizeof room))
        setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &room, sizeof room);
    if (info->ai_family == AF_INET6) // one socket for both families
        setsockopt(fd, IPPROTO_IPV6, IPV6_V6ONLY, &off, sizeof off);
    if (!bind(fd, info->ai_addr, info->ai_addrlen))
        return fd;
    int reason = errno;
    close(fd);
    errno = reason;
    return -1;
}

static int bind_family(const char *address, int port, int family) {
    char service[16];
    snprintf(service, sizeof service, "%d", port);
    struct addrinfo hints = {
        .ai_family = family, .ai_socktype = SOCK_DGRAM, .ai_flags = AI_PASSIVE | AI_NUMERICSERV};
    struct addrinfo *found = NULL;
    int fd = -1;
    errno = EADDRNOTAVAIL;
    if (getaddrinfo(address, service, &hints, &found))
        return -1;
    for (struct addrinfo *info = found; info && fd < 0; info = info->ai_next)
        fd = bind_one(info);
    freeaddrinfo(found);
    return fd;
}

static int bound_port(int fd) {
    struct sockaddr_storage storage;
    socklen_t size = sizeof storage;
    char service[16];
    int failed = getsockname(fd, (struct sockaddr *)&storage, &size) ||
                 getnameinfo((struct sockaddr *)&storage, size, NULL, 0, service, sizeof service,
                             NI_NUMERICSERV | NI_DGRAM);
    NEED(!failed, "memory");
    return atoi(service);
}

static void prepare(struct datagram_batch *batch) {
    for (int i = 0; i < DATAGRAM_BATCH; i++) {
        batch->parts[i] = (struct iovec){batch->data[i], WIRE_DATAGRAM_MAX};
        batch->headers[i].msg_hdr = (struct msghdr){
            .msg_name = &batch->addresses[i].storage,
            .msg_iov = &batch->parts[i],
            .msg_iovlen = 1,
        };
    }
}

enum result datagram_create(const char *address, int port, int connections,
                            struct datagram_endpoint **out_endpoint, struct error *err) {
    int fd = bind_family(address, port, address ? AF_UNSPEC : AF_INET6);
    if (fd < 0 && !address)
        fd = bind_family(address, port, AF_INET);
    if (fd < 0)
        return listen_failed("UDP", address, port, errno, err);
    struct datagram_endpoint *endpoint = alloc(1, sizeof *endpoint);
    endpoint->fd = fd;
    endpoint->port = bound_port(fd);
    while ((uint32_t)connections > endpoint->mask + 1)
        endpoint->mask = 2 * endpoint->mask + 1;
    endpoint->connections = alloc(endpoint->mask + 1ul, sizeof *endpoint->connections);
    prepare(&endpoint->in);
    prepare(&endpoint->out);
    *out_endpoint = endpoint;
    return RESULT_OK;
}

int datagram_fd(const struct datagram_endpoint *endpoint) {
    return endpoint->fd;
}

int datagram_port(const struct datagram_endpoint *endpoint) {
    return endpoint->port;
}

struct datagram_counts datagram_counts(const struct datagram_endpoint *endpoint) {
    return endpoint->counts;
}

// ---- connections and epochs ---------------------------------------------------------------------

static struct datagram_connection *find_connection(const struct datagram_endpoint *endpoint,
                                                   uint32_t id) {
    struct datagram_connection *c = &endpoint->connections[id & endpoint->mask];
    return c->epoch.to_server && c->id == id ? c : NULL;
}

static void epoch_end(struct epoch *epoch) {
    seal_destroy(&epoch->to_server);
    seal_destroy(&epoch->to_station);
    *epoch = (struct epoch){0};
}

static void random_bytes(void *data, int size) {
    int done = RAND_bytes(data, size);
    NEED(done == 1, "random bytes");
}

static void epoch_start(struct datagram_connection *c, uint8_t number, int64_t now_ns,
                        arthron_UdpKeys *keys) {
    random_bytes(keys->key_to_server, sizeof keys->key_to_server);
    random_bytes(keys->iv_to_server, sizeof keys->iv_to_server);
    random_bytes(keys->key_to_station, sizeof keys->key_to_station);
    random_bytes(keys->iv_to_station, sizeof keys->iv_to_station);
    c->epoch = (struct epoch){
        .to_server =
            seal_create(SEAL_TO_SERVER, number, c->id, keys->key_to_server, keys->iv_to_server),
        .to_station =
            seal_create(SEAL_TO_STATION, number, c->id, keys->key_to_station, keys->iv_to_station),
        .number = number,
        .start_ns = now_ns,
    };
}

uint32_t datagram_new_id(const struct datagram_endpoint *endpoint, int place) {
    uint32_t id = 0;
    CHECK(place >= 0 && (uint32_t)place <= endpoint->mask);
    while (!id) {
        chance_fill(&id, sizeof id);
        id = (id & ~endpoint->mask) | (uint32_t)place;
    }
    return id;
}

void datagram_new_epoch(struct datagram_endpoint *endpoint, uint32_t connection, void *user,
                        int64_t now_ns, arthron_UdpKeys *out_keys) {
    uint8_t number = 0;
    struct datagram_connection *c = find_connection(endpoint, connection);
    if (c) {
        number = (uint8_t)(c->epoch.number + 1);
        epoch_end(&c->old_epoch);
        c->old_epoch = c->epoch;
        c->old_until_ns = now_ns + OLD_EPOCH_NS;
    } else {
        c = &endpoint->connections[connection & endpoint->mask];
        CHECK(!c->epoch.to_server);
        *c = (struct datagram_connection){.id = connection,
                                          .unconfirmed_left = DATAGRAM_UNCONFIRMED_REPLIES};
    }
    c->user = user;
    *out_keys = (arthron_UdpKeys){
        .port = (uint32_t)endpoint->port, .connection = connection, .epoch = number};
    epoch_start(c, number, now_ns, out_keys);
}

bool datagram_epoch_is_old(const struct datagram_endpoint *endpoint, uint32_t connection,
                           int64_t now_ns) {
    const struct datagram_connection *c = find_connection(endpoint, connection);
    CHECK(c);
    return now_ns - c->epoch.start_ns >= EPOCH_NS || c->epoch.newest >= EPOCH_SEQUENCES;
}

void datagram_forget(struct datagram_endpoint *endpoint, uint32_t connection) {
    struct datagram_connection *c = find_connection(endpoint, connection);
    if (!c)
        return;
    epoch_end(&c->epoch);
    epoch_end(&c->old_epoch);
}

void datagram_destroy(struct datagram_endpoint **endpoint) {
    if (!*endpoint)
        return;
    for (uint32_t i = 0; i <= (*endpoint)->mask; i++) {
        epoch_end(&(*endpoint)->connections[i].epoch);
        epoch_end(&(*endpoint)->connections[i].old_epoch);
    }
    free((*endpoint)->connections);
    close((*endpoint)->fd);
    free(*endpoint);
    *endpoint = NULL;
}

static struct epoch *find_epoch(struct datagram_connection *c, uint8_t number, int64_t now_ns) {
    if (c->epoch.number == number)
        return &c->epoch;
    if (c->old_epoch.to_server && now_ns >= c->old_until_ns)
        epoch_end(&c->old_epoch);
    return c->old_epoch.to_server && c->old_epoch.number == number ? &c->old_epoch : NULL;
}

// The station has the keys of the epoch that it last used; those of a newer one may be on the way.
static struct epoch *reply_epoch(struct datagram_connection *c) {
    return c->epoch.used || !c->old_epoch.to_server ? &c->epoch : &c->old_epoch;
}

// ---- addresses ----------------------------------------------------------------------------------

static bool same_address(const struct address *a, const struct address *b) {
    return a->size == b->size && !memcmp(&a->storage, &b->storage, a->size);
}

// Notes a datagram that opened. Only the newest one of a connection says where the station is: an
// older one may have been held back and sent from elsewhere. Returns a challenge for a new address.
static uint64_t note_arrival(struct datagram_connection *c, struct epoch *epoch, uint64_t sequence,
                             const struct address *from, int64_t now_ns) {
    bool newest_of_epoch = !epoch->used || sequence > epoch->newest;
    bool newest = newest_of_epoch && (epoch == &c->epoch || !c->epoch.used);
    if (newest_of_epoch)
        epoch->newest = sequence;
    epoch->used = true;
    if (!newest)
        return 0;
    c->present = *from;
    bool asked = c->challenge && same_address(from, &c->challenged);
    bool too_soon = c->challenge_ns && now_ns - c->challenge_ns < CHALLENGE_PAUSE_NS;
    if (same_address(from, &c->confirmed) || asked || too_soon)
        return 0;
    c->challenged = *from;
    c->challenge_ns = now_ns;
    do
        random_bytes(&c->challenge, sizeof c->challenge);
    while (!c->challenge);
    return c->in_replies ? 0 : c->challenge;
}

void datagram_challenge_in_replies(struct datagram_endpoint *endpoint, uint32_t connection) {
    struct datagram_connection *c = find_connection(endpoint, connection);
    CHECK(c);
    c->in_replies = true;
}

void datagram_confirm(struct datagram_endpoint *endpoint, uint32_t connection, uint64_t challenge) {
    struct datagram_connection *c = find_connection(endpoint, connection);
    if (!c || !challenge || challenge != c->challenge)
        return;
    c->challenge = 0;
    c->confirmed = c->challenged;
    c->unconfirmed_left = DATAGRAM_UNCONFIRMED_REPLIES;
}

// ---- receiving ----------------------------------------------------------------------------------

struct opened {
    struct datagram_connection *connection;
    struct epoch *epoch;
    uint64_t sequence;
    uint8_t message[WIRE_DATAGRAM_MAX];
    size_t size;
};

// Counts and drops whatever is not a fresh datagram of a station of ours.
static bool open_datagram(struct datagram_endpoint *endpoint, const uint8_t *data, size_t size,
                          int64_t now_ns, struct opened *out) {
    struct seal_header clear;
    bool ours = seal_peek(data, size, &clear) && clear.direction == SEAL_TO_SERVER;
    out->connection = ours ? find_connection(endpoint, clear.connection) : NULL;
    out->epoch = out->connection ? find_epoch(out->connection, clear.epoch, now_ns) : NULL;
    if (!out->epoch) {
        endpoint->counts.strangers++;
        return false;
    }
    if (seal_has_seen(out->epoch->to_server, clear.sequence)) {
        endpoint->counts.replayed++;
        return false;
    }
    if (!seal_open(out->epoch->to_server, data, size, out->message, &out->size, &out->sequence)) {
        endpoint->counts.forged++;
        return false;
    }
    endpoint->counts.opened++;
    return true;
}

static bool take(struct datagram_endpoint *endpoint, int index, int64_t now_ns,
                 struct datagram_in *out) {
    struct mmsghdr *header = &endpoint->in.headers[index];
    struct address *from = &endpoint->in.addresses[index];
    from->size = header->msg_hdr.msg_namelen;
    size_t size = header->msg_hdr.msg_flags & MSG_TRUNC ? 0 : header->msg_len;
    struct opened opened;
    if (!open_datagram(endpoint, endpoint->in.data[index], size, now_ns, &opened))
        return false;
    enum result result = wire_read_frame(opened.message, opened.size, &out->frame, NULL);
    if (result != RESULT_OK && result != RESULT_INVALID) {
        endpoint->counts.malformed++;
        return false;
    }
    out->is_valid = result == RESULT_OK;
    out->connection = opened.connection->id;
    out->user = opened.connection->user;
    out->received_ns = now_ns;
    out->size = size;
    out->path_challenge =
        note_arrival(opened.connection, opened.epoch, opened.sequence, from, now_ns);
    return true;
}

int datagram_receive(struct datagram_endpoint *endpoint, struct datagram_in *out_frames) {
    struct datagram_batch *in = &endpoint->in;
    endpoint->question_count = 0;
    for (int i = 0; i < DATAGRAM_BATCH; i++)
        in->headers[i].msg_hdr.msg_namelen = sizeof in->addresses[i].storage;
    int received = recvmmsg(endpoint->fd, in->headers, DATAGRAM_BATCH, MSG_DONTWAIT, NULL);
    if (received <= 0)
        return 0;
    endpoint->counts.received += (uint64_t)received;
    int64_t now_ns = clock_now_ns();
    int count = 0;
    for (int i = 0; i < received; i++)
        if (take(endpoint, i, now_ns, &out_frames[count])) {
            const struct datagram_in *frame = &out_frames[count];
            endpoint->questions[count++] =
                (struct question){frame->connection, frame->frame.number, frame->size};
        }
    endpoint->question_count = count;
    return count;
}

// ---- replying -----------------------------------------------------------------------------------

static struct question *find_question(struct datagram_endpoint *endpoint, uint32_t connection,
                                      uint64_t frame_number) {
    for (int i = 0; i < endpoint->question_count; i++) {
        struct question *q = &endpoint->questions[i];
        if (q->size && q->connection == connection && q->frame_number == frame_number)
            return q;
    }
    return NULL;
}

static void queue(struct datagram_endpoint *endpoint, struct datagram_connection *c,
                  const uint8_t *message, size_t size) {
    if (endpoint->out_count == DATAGRAM_BATCH)
        datagram_flush(endpoint);
    int i = endpoint->out_count++;
    struct datagram_batch *out = &endpoint->out;
    out->parts[i].iov_len = seal_seal(reply_epoch(c)->to_station, message, size, out->data[i]);
    out->addresses[i] = c->present;
    out->headers[i].msg_hdr.msg_namelen = c->present.size;
}

enum { WHOLE, ONE_LOOSE, NO_FRAMES, NO_EVENTS, NO_LOOSE, NO_CHALLENGE };

static void leave_out(arthron_Reply *reply, int what) {
    switch (what) {
    case ONE_LOOSE:
        reply->loose_count = reply->loose_count > 0;
        break;
    case NO_FRAMES:
        reply->has_frames_lost = reply->has_frames_late = false;
        break;
    case NO_EVENTS:
        reply->event_counts_count = 0;
        break;
    case NO_LOOSE:
        reply->loose_count = 0;
        break;
    case NO_CHALLENGE:
        reply->path_challenge = 0;
        break;
    default:;
    }
}

// What makes it too long is left out, one after the other: the next reply has it too.
static enum result encode_within(const arthron_Reply *reply, uint64_t challenge, uint8_t *message,
                                 size_t limit, size_t *out_size) {
    if (!challenge && wire_encode_reply(reply, message, limit, out_size) == RESULT_OK)
        return RESULT_OK;
    arthron_Reply other = *reply;
    if (challenge)
        other.path_challenge = challenge;
    for (int what = WHOLE; what <= NO_CHALLENGE; what++) {
        leave_out(&other, what);
        if (wire_encode_reply(&other, message, limit, out_size) == RESULT_OK)
            return RESULT_OK;
    }
    return RESULT_LIMIT;
}

static uint64_t challenge_for(const struct datagram_connection *c) {
    return c->in_replies && c->challenge && same_address(&c->present, &c->challenged) ? c->challenge
                                                                                      : 0;
}

bool datagram_reply(struct datagram_endpoint *endpoint, uint32_t connection,
                    const arthron_Reply *reply) {
    struct datagram_connection *c = find_connection(endpoint, connection);
    struct question *question = find_question(endpoint, connection, reply->frame_number);
    if (!c || !question)
        return false;
    bool confirmed = same_address(&c->present, &c->confirmed);
    if (!confirmed && !c->unconfirmed_left)
        return false;
    uint8_t message[WIRE_DATAGRAM_MAX];
    size_t size;
    if (encode_within(reply, challenge_for(c), message, question->size - SEAL_OVERHEAD, &size) !=
        RESULT_OK) {
        endpoint->counts.too_long++;
        return false;
    }
    question->size = 0;
    c->unconfirmed_left -= !confirmed;
    queue(endpoint, c, message, size);
    return true;
}

void datagram_flush(struct datagram_endpoint *endpoint) {
    int done = 0;
    while (done < endpoint->out_count) {
        int sent = sendmmsg(endpoint->fd, &endpoint->out.headers[done],
                            (unsigned)(endpoint->out_count - done), MSG_DONTWAIT);
        if (sent > 0) {
            endpoint->counts.sent += (uint64_t)sent;
            done += sent;
        } else if (errno == EAGAIN) {
            break; // the socket is full: late poses are worth nothing
        } else if (errno != EINTR) {
            done++; // one that cannot be sent must not hold up the others
        }
    }
    endpoint->out_count = 0;
}
