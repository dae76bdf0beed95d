#include "tracker_server.h"

#include "base/clock.h"

#include <errno.h>
#include <poll.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

enum { CLIENTS_MAX = 16 };
static const int64_t longest_wait_ns = 100 * NS_PER_MS; // to notice *stop

struct clients {
    int count;
    int fds[CLIENTS_MAX];
};

// What is played next.
struct cursor {
    int64_t round, tick;
    int row;
};

static int64_t due_ns(const struct tracker_server *s, const struct cursor *c) {
    if (s->rate_hz > 0)
        return s->player->start_ns + (int64_t)((double)c->tick / s->rate_hz * NS_PER_S);
    return player_row_ns(s->player, c->round, c->row);
}

static void advance(const struct tracker_server *s, struct cursor *c) {
    c->tick++;
    if (++c->row < s->player->recording.row_count)
        return;
    c->row = 0;
    c->round++;
}

static struct recording_state state_of(const struct tracker_server *s, const struct cursor *c,
                                       int tool) {
    const struct player *p = s->player;
    if (s->rate_hz > 0)
        return recording_tool_at(&p->recording, tool,
                                 player_file_time(p, (double)c->tick / s->rate_hz));
    return p->recording.tools[tool].states[c->row];
}

// T_tracker_tool = T_tracker_mockup · T_mockup_tip · T_tip_tool. A tool that is not valid is not
// seen.
static int visible_tools(const struct tracker_server *s, const struct cursor *c,
                         struct tracked_tool *out) {
    int count = 0;
    for (int i = 0; i < s->player->recording.tool_count; i++) {
        enum channel channel = s->player->recording.tools[i].channel;
        struct recording_state state = state_of(s, c, i);
        if (!state.valid)
            continue;
        pose T_tracker_tip = pose_compose(s->T_tracker_mockup, state.pose);
        out[count].name = channel_name(channel);
        out[count++].T_tracker_tool =
            pose_compose(T_tracker_tip, pose_inverse(s->T_tool_tip[channel]));
    }
    return count;
}

static void drop(struct clients *clients, int i) {
    close(clients->fds[i]);
    clients->fds[i] = clients->fds[--clients->count];
}

static void send_to_all(struct clients *clients, const uint8_t *bytes, size_t size) {
    for (int i = clients->count - 1; i >= 0; i--)
        if (send(clients->fds[i], bytes, size, MSG_NOSIGNAL) != (ssize_t)size)
            drop(clients, i);
}

static void play(const struct tracker_server *s, const struct cursor *c, struct clients *clients) {
    struct tracked_tool tools[CHANNEL_COUNT];
    uint8_t bytes[ENCODE_BYTES_MAX];
    int count = visible_tools(s, c, tools);
    if (count && !player_is_silent(s->player, &s->silence, clock_now_ns()))
        send_to_all(clients, bytes,
                    encode_tools(s->type, s->header_version, clock_utc_ns(), tools, count, bytes));
}

static void accept_client(const struct tracker_server *s, struct clients *clients) {
    int fd = accept4(s->listener, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (fd >= 0 && clients->count == CLIENTS_MAX)
        close(fd);
    else if (fd >= 0)
        clients->fds[clients->count++] = fd;
}

// What clients say is of no interest, but that they go is.
static void listen_to(struct clients *clients, int i) {
    uint8_t ignored[4096];
    ssize_t size = recv(clients->fds[i], ignored, sizeof ignored, 0);
    if (size == 0 || (size < 0 && errno != EAGAIN && errno != EINTR))
        drop(clients, i);
}

static void wait_for_clients(const struct tracker_server *s, struct clients *clients,
                             int64_t until_ns) {
    struct pollfd polled[CLIENTS_MAX + 1] = {{.fd = s->listener, .events = POLLIN}};
    int count = clients->count;
    for (int i = 0; i < count; i++)
        polled[i + 1] = (struct pollfd){.fd = clients->fds[i], .events = POLLIN};
    int64_t wait_ns = until_ns - clock_now_ns();
    wait_ns = wait_ns < 0 ? 0 : wait_ns > longest_wait_ns ? longest_wait_ns : wait_ns;
    struct timespec wait = {0, wait_ns};
    if (ppoll(polled, (nfds_t)count + 1, &wait, NULL) <= 0)
        return;
    for (int i = count - 1; i >= 0; i--)
        if (polled[i + 1].revents)
            listen_to(clients, i);
    if (polled[0].revents)
        accept_client(s, clients);
}

void *tracker_server_run(void *tracker_server) {
    const struct tracker_server *s = tracker_server;
    struct clients clients = {0};
    struct cursor cursor = {0};
    while (!atomic_load(s->stop)) {
        wait_for_clients(s, &clients, due_ns(s, &cursor));
        for (; due_ns(s, &cursor) <= clock_now_ns(); advance(s, &cursor))
            play(s, &cursor, &clients);
    }
    while (clients.count)
        drop(&clients, 0);
    return NULL;
}
