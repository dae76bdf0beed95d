#include "tracker_server.h"

#include "base/clock.h"
#include "base/log.h"
#include "drivers/socket.h"

#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

enum { CLIENTS_MAX = 16 };
static const int newer_version = 9;
static const int64_t longest_wait_ns = 100 * NS_PER_MS; // to notice *stop

struct clients {
    int count;
    struct client list[CLIENTS_MAX];
};

// What is played next.
struct cursor {
    int64_t round, tick;
    int row;
    double jitter; // of its message, 0 to 1
};

static int64_t due_ns(const struct tracker_server *s, const struct cursor *c) {
    if (s->rate_hz > 0)
        return s->player->start_ns + (int64_t)((double)c->tick / s->rate_hz * NS_PER_S);
    return player_row_ns(s->player, c->round, c->row);
}

static void advance(const struct tracker_server *s, struct cursor *c) {
    c->tick++;
    c->jitter = faults_share();
    if (++c->row < s->player->recording.row_count)
        return;
    c->row = 0;
    c->round++;
}

// `seconds` is the time that is told about; `due` when it is told.
static struct recording_state state_of(const struct tracker_server *s, const struct cursor *c,
                                       int tool, double due, double seconds) {
    const struct recording *r = &s->player->recording;
    if (s->rate_hz > 0 || seconds != due)
        return recording_tool_at(r, tool, player_file_time(s->player, seconds));
    return r->tools[tool].states[c->row];
}

// T_tracker_tool = T_tracker_mockup · T_mockup_tip · T_tip_tool. A tool that is not valid is not
// seen.
static int visible_tools(const struct tracker_server *s, const struct cursor *c, double due,
                         double seconds, struct tracked_tool *out) {
    int count = 0;
    for (int i = 0; i < s->player->recording.tool_count; i++) {
        enum channel channel = s->player->recording.tools[i].channel;
        struct recording_state state = state_of(s, c, i, due, seconds);
        if (!state.valid)
            continue;
        pose T_tracker_tip = pose_compose(s->T_tracker_mockup, state.pose);
        out[count].name = channel_name(channel);
        out[count].missing = false;
        out[count++].T_tracker_tool =
            pose_compose(T_tracker_tip, pose_inverse(s->T_tool_tip[channel]));
    }
    return count;
}

static const struct fault *strike_tracker(const struct tracker_server *s, enum fault_what what,
                                          double seconds) {
    return faults_strike(s->faults, FAULT_TRACKER, what, seconds);
}

static void spoil_tools(const struct tracker_server *s, double seconds, struct tracked_tool *tools,
                        int count) {
    const struct fault *jump = strike_tracker(s, FAULT_JUMP, seconds);
    const struct fault *noise = strike_tracker(s, FAULT_NOISE, seconds);
    const struct fault *nan = strike_tracker(s, FAULT_NAN, seconds);
    bool missing = strike_tracker(s, FAULT_MISSING, seconds);
    for (int i = 0; i < count; i++) {
        vec3 *p = &tools[i].T_tracker_tool.translation;
        if (jump)
            p->x += jump->value;
        if (noise) {
            vec3 off = {faults_noise(), faults_noise(), faults_noise()};
            *p = vec3_add_scaled(*p, noise->value, off);
        }
        if (nan)
            p->x = NAN;
        if (missing)
            tools[i] = (struct tracked_tool){tools[i].name, pose_identity(), true};
    }
}

// The tracker's clock when it measured what it tells.
static int64_t stamp_ns(const struct tracker_server *s, double due, double seconds) {
    const struct fault *step = faults_on(s->faults, FAULT_TRACKER, FAULT_CLOCK_STEP, due);
    const struct fault *drift = faults_on(s->faults, FAULT_TRACKER, FAULT_CLOCK_DRIFT, due);
    double off = (step ? step->value : 0) + (drift ? drift->value * (due - drift->at_s) : 0);
    int64_t utc_of_start_ns = clock_utc_ns() - (clock_now_ns() - s->player->start_ns);
    return utc_of_start_ns + (int64_t)((seconds + off) * NS_PER_S);
}

static void drop(struct clients *clients, int i) {
    close(clients->list[i].fd);
    clients->list[i] = clients->list[--clients->count];
}

static bool wants(const struct tracker_server *s, const struct client *client,
                  enum message_type type) {
    return !s->when_asked || (client->asked && client->type == type &&
                              clock_now_ns() - client->sent_ns >= client->interval_ns);
}

static void send_to_all(const struct tracker_server *s, struct clients *clients,
                        enum message_type type, const uint8_t *bytes, size_t size) {
    for (int i = clients->count - 1; i >= 0; i--) {
        struct client *client = &clients->list[i];
        if (!wants(s, client, type))
            continue;
        client->sent_ns = clock_now_ns();
        client->asked &= !client->once;
        if (!client_send(client, bytes, size))
            drop(clients, i);
    }
}

// To all who get a stream.
static void play_forces(const struct tracker_server *s, const struct cursor *c, double due,
                        double seconds, int version, struct clients *clients) {
    const struct recording *r = &s->player->recording;
    for (int i = 0; i < r->tool_count; i++) {
        char device[32];
        uint8_t bytes[ENCODE_ANSWER_MAX];
        if (!r->tools[i].has_force)
            continue;
        double newtons = state_of(s, c, i, due, seconds).force_n;
        snprintf(device, sizeof device, "%sForce", channel_name(r->tools[i].channel));
        size_t size = encode_force(version, stamp_ns(s, due, seconds), device,
                                   strike_tracker(s, FAULT_NAN, due) ? NAN : newtons, bytes);
        size = faults_spoil(s->faults, FAULT_TRACKER, due, bytes, size);
        for (int k = clients->count - 1; k >= 0; k--) {
            const struct client *client = &clients->list[k];
            if ((!s->when_asked || (client->asked && !client->once)) &&
                !client_send(client, bytes, size))
                drop(clients, k);
        }
    }
}

static void play(const struct tracker_server *s, const struct cursor *c, struct clients *clients) {
    struct tracked_tool tools[CHANNEL_COUNT];
    uint8_t bytes[ENCODE_BYTES_MAX];
    double due = player_seconds(s->player, due_ns(s, c));
    double seconds = faults_time(s->faults, FAULT_TRACKER, due);
    int version = strike_tracker(s, FAULT_NEWER_VERSION, due) ? newer_version : s->header_version;
    if (strike_tracker(s, FAULT_DROPOUT, due))
        return;
    play_forces(s, c, due, seconds, version, clients);
    int count = visible_tools(s, c, due, seconds, tools);
    if (!count)
        return;
    spoil_tools(s, due, tools, count);
    bool streams = s->type == MESSAGE_TDATA || s->type == MESSAGE_QTDATA;
    for (int t = MESSAGE_TRANSFORM; t <= MESSAGE_QTDATA; t++) {
        enum message_type type = (enum message_type)t;
        bool is_either = streams && (type == MESSAGE_TDATA || type == MESSAGE_QTDATA);
        if (type != s->type && !(s->when_asked && is_either))
            continue;
        size_t size = encode_tools(type, version, stamp_ns(s, due, seconds), tools, count, bytes);
        size = faults_spoil(s->faults, FAULT_TRACKER, due, bytes, size);
        send_to_all(s, clients, type, bytes, size);
    }
}

static void accept_client(const struct tracker_server *s, struct clients *clients) {
    int fd = accept4(s->listener, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (fd >= 0 && clients->count == CLIENTS_MAX)
        close(fd);
    else if (fd >= 0)
        clients->list[clients->count++] =
            (struct client){.fd = fd, .offers = s->type, .version = s->header_version};
}

// Without --when-asked only that clients go is of interest.
static void listen_to(const struct tracker_server *s, struct clients *clients, int i) {
    uint8_t ignored[4096];
    int fd = clients->list[i].fd;
    if (s->when_asked) {
        if (!client_read(&clients->list[i]))
            drop(clients, i);
        return;
    }
    ssize_t size = recv(fd, ignored, sizeof ignored, 0);
    if (size == 0 || (size < 0 && errno != EAGAIN && errno != EINTR))
        drop(clients, i);
}

static void wait_for_clients(const struct tracker_server *s, struct clients *clients,
                             int64_t until_ns) {
    struct pollfd polled[CLIENTS_MAX + 1] = {{.fd = s->listener, .events = POLLIN}};
    int count = clients->count;
    for (int i = 0; i < count; i++)
        polled[i + 1] = (struct pollfd){.fd = clients->list[i].fd, .events = POLLIN};
    int64_t wait_ns = until_ns - clock_now_ns();
    wait_ns = wait_ns < 0 ? 0 : wait_ns > longest_wait_ns ? longest_wait_ns : wait_ns;
    struct timespec wait = {0, wait_ns};
    if (ppoll(polled, (nfds_t)count + 1, &wait, NULL) <= 0)
        return;
    for (int i = count - 1; i >= 0; i--)
        if (polled[i + 1].revents)
            listen_to(s, clients, i);
    if (polled[0].revents)
        accept_client(s, clients);
}

enum result tracker_server_listen(struct tracker_server *s, const char *address,
                                  struct error *err) {
    uint16_t port;
    enum result result = socket_listen(address, &s->listener, &port, err);
    int host = result == RESULT_OK ? (int)(strrchr(address, ':') - address) : 0;
    if (result == RESULT_OK && address != s->address)
        snprintf(s->address, sizeof s->address, "%.*s:%u", host, address, port);
    return result;
}

static void plug_server(struct tracker_server *s, struct clients *clients) {
    struct error err;
    double seconds = player_seconds(s->player, clock_now_ns());
    if (!faults_on(s->faults, FAULT_TRACKER, FAULT_UNPLUG, seconds)) {
        if (s->listener < 0 && tracker_server_listen(s, s->address, &err) != RESULT_OK)
            log_warning("mockup", "%s", err.text);
        return;
    }
    while (clients->count)
        drop(clients, 0);
    if (s->listener >= 0)
        close(s->listener);
    s->listener = -1;
}

static int64_t sent_ns(const struct tracker_server *s, const struct cursor *c) {
    double seconds = player_seconds(s->player, clock_now_ns());
    const struct fault *late = faults_on(s->faults, FAULT_TRACKER, FAULT_LATE, seconds);
    const struct fault *jitter = faults_on(s->faults, FAULT_TRACKER, FAULT_JITTER, seconds);
    double ms = (late ? late->value : 0) + (jitter ? jitter->value * c->jitter : 0);
    return due_ns(s, c) + (int64_t)(ms * NS_PER_MS);
}

void *tracker_server_run(void *tracker_server) {
    struct tracker_server *s = tracker_server;
    struct clients clients = {0};
    struct cursor cursor = {0};
    while (!atomic_load(s->stop)) {
        plug_server(s, &clients);
        wait_for_clients(s, &clients, sent_ns(s, &cursor));
        for (; sent_ns(s, &cursor) <= clock_now_ns(); advance(s, &cursor))
            play(s, &cursor, &clients);
    }
    while (clients.count)
        drop(&clients, 0);
    return NULL;
}
