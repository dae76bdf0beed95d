#include "link/link.h"

#include "base/check.h"
#include "base/log.h"
#include "link/link_parts.h"

#include <errno.h>
#include <openssl/rand.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#define FRAMES_QUEUED 16
#define ARRIVALS_QUEUED 256

// ---- the caller's side --------------------------------------------------------------------------

// A new connection starts afresh: other keys, another server perhaps.
static void follow_connection(struct link *link) {
    struct sender *sender = &link->sender;
    uint64_t connect = atomic_load(&link->connects);
    if (sender->connect == connect)
        return;
    sender->connect = connect;
    sender->path = (struct path){0};
    udp_close(&sender->udp);
    memset(sender->waiting, 0, sizeof sender->waiting);
    sender->told_left_out = false;
}

// Counts a reply once, and only to a frame that was sent.
static bool is_awaited(struct link *link, const arthron_Reply *reply) {
    uint64_t *waiting = &link->sender.waiting[reply->frame_number % FRAMES_REMEMBERED];
    if (!reply->frame_number || *waiting != reply->frame_number)
        return false;
    *waiting = 0;
    atomic_fetch_add(&link->replies, 1);
    return true;
}

// Takes what the control connection brought; true at the first reply.
static bool take_arrivals(struct link *link, arthron_Reply *out_reply) {
    struct sender *sender = &link->sender;
    struct arrival arrival;
    follow_connection(link);
    while (ring_pop(link->arrivals, &arrival)) {
        if (arrival.connect != sender->connect)
            continue;
        if (arrival.is_keys) {
            udp_take_keys(&sender->udp, &arrival.server, &arrival.keys);
        } else if (is_awaited(link, &arrival.reply)) {
            *out_reply = arrival.reply;
            return true;
        }
    }
    return false;
}

static bool push_to_control(struct link *link, const arthron_Control *message) {
    if (!control_push(link->frames, message))
        return false;
    lws_cancel_service(link->control.context);
    return true;
}

// Only who gets the datagrams of this address knows the challenge.
static void confirm_path(struct link *link, uint64_t challenge) {
    arthron_Control message = {.which_message = arthron_Control_udp_path_tag};
    if (!challenge || challenge == link->sender.challenge)
        return;
    message.message.udp_path.challenge = challenge;
    if (push_to_control(link, &message))
        link->sender.challenge = challenge;
}

static bool take_datagram(struct link *link, arthron_Reply *out_reply) {
    struct sender *sender = &link->sender;
    while (udp_receive(&sender->udp, out_reply)) {
        int64_t now_ns = clock_now_ns();
        confirm_path(link, out_reply->path_challenge);
        path_answered(&sender->path, out_reply->frame_time_ns, now_ns);
        atomic_store(&link->datagram_ns, now_ns);
        if (is_awaited(link, out_reply))
            return true;
    }
    return false;
}

static void wait_for_either(struct link *link, int64_t nanoseconds) {
    struct pollfd fds[] = {
        {.fd = link->arrival_fd, .events = POLLIN},
        {.fd = link->sender.udp.fd, .events = POLLIN},
    };
    struct timespec timeout = {nanoseconds / NS_PER_S, nanoseconds % NS_PER_S};
    uint64_t signals;
    if (ppoll(fds, 2, &timeout, NULL) > 0 && fds[0].revents)
        while (read(link->arrival_fd, &signals, sizeof signals) < 0 && errno == EINTR)
            ;
}

bool link_wait(struct link *link, int64_t until_ns, arthron_Reply *out_reply) {
    int64_t before_ns = INT64_MAX;
    for (;;) {
        if (take_arrivals(link, out_reply) || take_datagram(link, out_reply))
            return true;
        int64_t left_ns = until_ns - clock_now_ns();
        if (left_ns <= 0 || left_ns > before_ns) // or the clock went back
            return false;
        before_ns = left_ns;
        wait_for_either(link, left_ns);
    }
}

static bool send_in_control(struct link *link, const arthron_Frame *frame) {
    arthron_Control message = {.which_message = arthron_Control_frame_tag};
    message.message.frame = *frame;
    return push_to_control(link, &message);
}

static enum udp_sent send_by_datagram(struct link *link, const arthron_Frame *frame) {
    enum udp_sent sent = udp_send(&link->sender.udp, frame);
    if (sent == UDP_REFUSED)
        path_refused(&link->sender.path, clock_now_ns());
    return sent;
}

static bool send_frame(struct link *link, const arthron_Frame *frame) {
    struct sender *sender = &link->sender;
    struct frame_route route = {.control = true};
    enum udp_sent sent = UDP_REFUSED;
    if (sender->udp.fd >= 0)
        route = path_next(&sender->path, clock_now_ns());
    atomic_store(&link->path, sender->path.datagrams ? LINK_DATAGRAM : LINK_CONTROL);
    if (route.datagram)
        sent = send_by_datagram(link, frame);
    if (!route.control && sent != UDP_REFUSED)
        return sent == UDP_SENT;
    // What one way took has been sent: its number must never be another frame's.
    return send_in_control(link, frame) || sent == UDP_SENT;
}

// ---- hello --------------------------------------------------------------------------------------

static void describe(const struct link_config *config, arthron_Hello *hello) {
    strcpy(hello->capabilities[hello->capabilities_count++], "instruments");
    for (int i = INSTRUMENTS_USUAL; i < config->instruments.count; i++)
        wire_instrument_from(&config->instruments, i,
                             &hello->instruments[hello->instruments_count++]);
}

void link_introduce(const struct link *link, arthron_Hello *hello) {
    const struct link_config *config = &link->config;
    hello->version_min = WIRE_VERSION_MIN;
    hello->version_max = WIRE_VERSION_MAX;
    if (config->datagrams)
        strcpy(hello->capabilities[hello->capabilities_count++], "datagrams");
    if (config->meshes)
        strcpy(hello->capabilities[hello->capabilities_count++], "meshes");
    strcpy(hello->capabilities[hello->capabilities_count++], "path");
    strcpy(hello->capabilities[hello->capabilities_count++], "markers");
    strcpy(hello->capabilities[hello->capabilities_count++], "force");
    describe(config, hello);
    snprintf(hello->station, sizeof hello->station, "%s", config->station);
    snprintf(hello->software, sizeof hello->software, "%s", config->software);
    hello->devices_count = (pb_size_t)config->device_count;
    memcpy(hello->devices, config->devices, sizeof hello->devices);
    hello->connection = link->id;
    hello->visit = config->visit;
    hello->has_calibration = config->calibrated;
    hello->calibration = config->calibration;
}

static void take_descriptions(struct link *link, bool taken) {
    atomic_store(&link->described, taken);
    if (link->config.instruments.count > INSTRUMENTS_USUAL && !taken)
        log_warning("link", "the server knows no described instruments: they are left out");
}

static void take_markers(struct link *link, bool taken) {
    link->control.markers = taken;
    if (taken || link->config.visit)
        return;
    marker_queue_refuse(&link->markers);
    if (link->config.markers)
        log_warning("link", "the server is too old to take markers: they are not recorded");
}

static bool names(const arthron_Welcome *welcome, const char *capability) {
    for (int i = 0; i < welcome->capabilities_count; i++)
        if (!strcmp(welcome->capabilities[i], capability))
            return true;
    return false;
}

void link_agree(struct link *link, const arthron_Welcome *welcome) {
    link->control.meshes = link->config.meshes && names(welcome, "meshes");
    link->control.path = names(welcome, "path");
    take_descriptions(link, names(welcome, "instruments"));
    atomic_store(&link->forces, names(welcome, "force"));
    take_markers(link, names(welcome, "markers"));
}

// ---- frames -------------------------------------------------------------------------------------

static void leave_out(struct link *link, arthron_Frame *frame) {
    bool forces = atomic_load(&link->forces);
    bool all = wire_frame_reduce(frame, atomic_load(&link->described), forces);
    if (!all && !forces && !link->sender.told_left_out) {
        log_warning("link",
                    "the server takes no forces and at most %d channels: others are left out",
                    WIRE_SAMPLES_WITHOUT_FORCE);
        link->sender.told_left_out = true;
    }
}

bool link_send(struct link *link, const struct frame *frame) {
    arthron_Frame message;
    CHECK(frame->number);
    if (!atomic_load(&link->ready))
        return false;
    follow_connection(link);
    wire_frame_from(frame, &message);
    leave_out(link, &message);
    if (!send_frame(link, &message))
        return false;
    link->sender.waiting[frame->number % FRAMES_REMEMBERED] = frame->number;
    atomic_fetch_add(&link->frames_sent, 1);
    return true;
}

// ---- markers ------------------------------------------------------------------------------------

bool link_next_marker(struct link *link, arthron_Control *out_message) {
    struct marker marker;
    if (!link->control.markers || !marker_queue_next(&link->markers, &marker))
        return false;
    *out_message = (arthron_Control){.which_message = arthron_Control_marker_tag,
                                     .message.marker = wire_marker_from(&marker)};
    return true;
}

bool link_mark(struct link *link, const struct marker *marker) {
    if (!marker_queue_put(&link->markers, marker))
        return false;
    lws_cancel_service(link->control.context);
    return true;
}

// ---- any thread ---------------------------------------------------------------------------------

void link_get_status(struct link *link, struct link_status *out_status) {
    pthread_mutex_lock(&link->lock);
    *out_status = link->status;
    pthread_mutex_unlock(&link->lock);
    out_status->path =
        atomic_load(&link->ready) ? (enum link_path)atomic_load(&link->path) : LINK_DOWN;
    out_status->server_until_utc_s = atomic_load(&link->trust.server_until_s);
    out_status->connects = atomic_load(&link->connects);
    out_status->frames_sent = atomic_load(&link->frames_sent);
    out_status->replies = atomic_load(&link->replies);
    out_status->unknown_messages = atomic_load(&link->unknown_messages);
}

bool link_get_session(struct link *link, uint64_t *seen, struct link_session *out_session) {
    uint64_t changes = atomic_load(&link->session_changes);
    if (*seen == changes)
        return false;
    pthread_mutex_lock(&link->lock);
    *out_session = link->session;
    pthread_mutex_unlock(&link->lock);
    *seen = changes;
    return true;
}

void link_keep_attempt(struct link *link, const arthron_AttemptState *attempt) {
    pthread_mutex_lock(&link->lock);
    link->attempt = *attempt;
    pthread_mutex_unlock(&link->lock);
    atomic_fetch_add(&link->attempt_changes, 1);
}

bool link_get_attempt(struct link *link, uint64_t *seen, arthron_AttemptState *out_attempt) {
    uint64_t changes = atomic_load(&link->attempt_changes);
    if (*seen == changes)
        return false;
    pthread_mutex_lock(&link->lock);
    *out_attempt = link->attempt;
    pthread_mutex_unlock(&link->lock);
    *seen = changes;
    return true;
}

int link_get_tissues(struct link *link, struct link_tissue out_tissues[WIRE_MESH_GROUPS_MAX]) {
    return meshes_get(link->meshes, out_tissues);
}

bool link_copy_tissue(struct link *link, const char *group, struct tissue *out_tissue) {
    return meshes_copy(link->meshes, group, out_tissue);
}

// ---- life ---------------------------------------------------------------------------------------

static void release(struct link *link) {
    control_fini(link);
    trust_fini(&link->trust);
    udp_close(&link->sender.udp);
    meshes_destroy(&link->meshes);
    marker_queue_fini(&link->markers);
    ring_destroy(&link->frames);
    ring_destroy(&link->arrivals);
    close(link->arrival_fd);
    pthread_mutex_destroy(&link->lock);
    free((char *)link->config.keys_dir);
    free((char *)link->config.station);
    free((char *)link->config.software);
    free(link);
}

static struct link *prepare_link(const struct link_config *config) {
    struct link *link = alloc(1, sizeof *link);
    link->config = *config;
    link->config.keys_dir = alloc_text(config->keys_dir);
    link->config.station = alloc_text(config->station);
    link->config.software = alloc_text(config->software);
    link->meshes = meshes_create(config->meshes_changed, config->meshes_user);
    marker_queue_init(&link->markers);
    link->frames = ring_create(FRAMES_QUEUED, sizeof(struct control_message));
    link->arrivals = ring_create(ARRIVALS_QUEUED, sizeof(struct arrival));
    link->arrival_fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    NEED(link->arrival_fd >= 0, "descriptor");
    NEED(RAND_bytes((unsigned char *)&link->id, sizeof link->id) == 1, "random bytes");
    pthread_mutex_init(&link->lock, NULL);
    atomic_store(&link->path, LINK_CONTROL);
    udp_init(&link->sender.udp);
    return link;
}

static bool may_renew(void *user, struct server_address *out_server) {
    struct link *link = user;
    pthread_mutex_lock(&link->lock);
    bool welcomed = link->status.welcomed;
    *out_server = link->status.server;
    pthread_mutex_unlock(&link->lock);
    return welcomed;
}

static void note_change(void *user) {
    atomic_store(&((struct link *)user)->keys_changed, true);
}

static void *serve(void *link) {
    control_serve(link);
    return NULL;
}

enum result link_create(const struct link_config *config, struct link **out_link,
                        struct error *err) {
    struct link *link = prepare_link(config);
    enum result result = trust_init(&link->trust, config->keys_dir, err);
    for (int i = 0; i < config->server_count && result == RESULT_OK; i++)
        result = trust_expect(&link->trust, config->servers[i].host, err);
    if (result == RESULT_OK)
        result = control_init(link, err);
    if (result != RESULT_OK) {
        release(link);
        *out_link = NULL;
        return result;
    }
    const struct renewal_handler handler = {link, may_renew, note_change};
    if (!config->visit)
        link->renewal = renewal_create(&link->config, &handler);
    NEED(pthread_create(&link->thread, NULL, serve, link) == 0, "thread");
    *out_link = link;
    return RESULT_OK;
}

void link_destroy(struct link **link) {
    renewal_destroy(&(*link)->renewal);
    atomic_store(&(*link)->stopping, true);
    lws_cancel_service((*link)->control.context);
    pthread_join((*link)->thread, NULL);
    release(*link);
    *link = NULL;
}
