// A client of an OpenIGTLink server: any tracker that PLUS, 3D Slicer or a vendor serves.
//
//   address           host:port; required
//   tool.CHANNEL      the tool's OpenIGTLink name; at least one
//   tip.CHANNEL       T_tool_tip (bones: where the bone's frame lies in the marker's)
//   T_mockup_tracker  where the tracker's frame lies in the mock-up's
//   stamps            no: the tracker's time stamps mean nothing; yes
//   request           what it is asked to send (device/igtl_request.h): auto, TDATA, QTDATA,
//                     TRANSFORM, POSITION or none; auto
//   request_ms        the shortest time between two messages that are asked for, 1 to 1000; 5
//   coordinates       name of the coordinate system that is asked for; empty
//   device            name of the device whose TDATA or QTDATA is meant; any
//
// A sample is T_mockup_tracker · T_tracker_tool · T_tool_tip, at the time that its message's stamp
// tells (device/stamp.h), or, without stamps, when its bytes came. The stamps tell too which
// message is late, and whether a tool's pose is only said again. OpenIGTLink's library leaves the
// stamp of a message uninitialized that its sender does not stamp: it stands still at any value.

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "device/drivers.h"
#include "device/igtl.h"
#include "device/igtl_request.h"
#include "device/options.h"
#include "device/socket.h"
#include "device/stamp.h"

#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

static const int connect_timeout_ms = 1000;
static const double still_mm = 0.001; // what one pose in two types of message may differ by

struct tracker {
    char address[OPTION_TEXT_MAX];
    char tools[CHANNEL_COUNT][IGTL_NAME_SIZE]; // empty: not tracked
    pose T_mockup_tracker, T_tool_tip[CHANNEL_COUNT];
    bool uses_stamps;
    bool is_unstamped; // this connection: what its messages have for a stamp stands still
    struct igtl_request request;
    bool denied;         // it said no to the newest request
    int unknown_version; // that was told; 0: none
    int status;          // that it told last
    char status_text[IGTL_STATUS_SIZE];
    struct stamp_clock clock;
    struct tracker_newest {
        int64_t stamp_ns, arrival_ns; // stamp_ns 0: none
        vec3 position;
    } newest[CHANNEL_COUNT]; // poses that were used
    int fd;
    struct igtl_stream stream;
    struct igtl_message message;
};

static enum result configure_tools(struct tracker *d, const struct device_config *config,
                                   struct device_outputs *outputs, struct error *err) {
    for (int i = 0; i < CHANNEL_COUNT; i++) {
        char key[64];
        snprintf(key, sizeof key, "tool.%s", channel_name((enum channel)i));
        const char *name = option_text(config, key);
        if (!name)
            continue;
        if (i == CHANNEL_JOINT)
            return option_fail(config, key, err, RESULT_INVALID, "the joint is not a tool");
        if (!*name || strlen(name) >= IGTL_NAME_SIZE)
            return option_fail(config, key, err, RESULT_INVALID, "a name has 1 to %d bytes",
                               IGTL_NAME_SIZE - 1);
        strcpy(d->tools[i], name);
        strcpy(d->request.tools[d->request.tool_count++], name);
        outputs_add(outputs, (enum channel)i, SAMPLE_POSE);
    }
    if (!outputs->count)
        return option_fail(config, "tool.CHANNEL", err, RESULT_MISSING, "is required");
    return RESULT_OK;
}

static enum result configure_request(struct igtl_request *request,
                                     const struct device_config *config, struct error *err) {
    const char *kind = option_text(config, "request");
    const char *coordinates = option_text(config, "coordinates");
    const char *device = option_text(config, "device");
    const char *names[IGTL_REQUEST_KIND_COUNT + 1] = {NULL};
    int at = 0;
    for (int i = 0; i < IGTL_REQUEST_KIND_COUNT; i++)
        names[i] = igtl_request_name((enum igtl_request_kind)i);
    while (kind && at < IGTL_REQUEST_KIND_COUNT && strcmp(kind, names[at]))
        at++;
    if (at == IGTL_REQUEST_KIND_COUNT)
        return option_fail_name(config, "request", err, "unknown kind of request", kind, names);
    request->kind = (enum igtl_request_kind)at;
    if (coordinates && strlen(coordinates) >= sizeof request->coordinates)
        return option_fail(config, "coordinates", err, RESULT_LIMIT, "a name has at most %zu bytes",
                           sizeof request->coordinates - 1);
    strcpy(request->coordinates, coordinates ? coordinates : "");
    if (device && strlen(device) >= sizeof request->device)
        return option_fail(config, "device", err, RESULT_LIMIT, "a name has at most %zu bytes",
                           sizeof request->device - 1);
    strcpy(request->device, device ? device : "");
    return option_integer(config, "request_ms", 1, 1000, 5, &request->interval_ms, err);
}

static enum result configure(struct tracker *d, const struct device_config *config,
                             struct device_outputs *outputs, struct error *err) {
    static const char *const keys[] = {"address", "tool.",   "tip.",       "T_mockup_tracker",
                                       "stamps",  "request", "request_ms", "coordinates",
                                       "device",  NULL};
    char host[SOCKET_HOST_MAX], port[SOCKET_PORT_MAX];
    struct error why;
    enum result result = options_check(config, keys, err);
    if (result == RESULT_OK)
        result = option_required(config, "address", d->address, err);
    if (result == RESULT_OK && socket_split(d->address, host, port, &why) != RESULT_OK)
        result = option_fail(config, "address", err, RESULT_INVALID, "%s", why.text);
    if (result == RESULT_OK)
        result = option_pose(config, "T_mockup_tracker", &d->T_mockup_tracker, err);
    if (result == RESULT_OK)
        result = option_poses(config, "tip", d->T_tool_tip, err);
    if (result == RESULT_OK)
        result = option_switch(config, "stamps", true, &d->uses_stamps, err);
    if (result == RESULT_OK)
        result = configure_request(&d->request, config, err);
    if (result == RESULT_OK)
        result = configure_tools(d, config, outputs, err);
    return result;
}

static enum result tracker_create(const struct device_config *config, void **out_device,
                                  struct device_outputs *out_outputs, struct error *err) {
    struct tracker *d = alloc(1, sizeof *d);
    enum result result = configure(d, config, out_outputs, err);
    if (result == RESULT_OK)
        *out_device = d;
    else
        free(d);
    return result;
}

static enum result tracker_open(void *device, struct error *err) {
    struct tracker *d = device;
    igtl_stream_init(&d->stream);
    d->clock = (struct stamp_clock){0};
    memset(d->newest, 0, sizeof d->newest);
    d->denied = d->is_unstamped = false;
    d->unknown_version = 0;
    d->status = IGTL_STATUS_OK;
    igtl_request_begin(&d->request, clock_now_ns());
    return socket_connect(d->address, connect_timeout_ms, &d->fd, err);
}

// The newest pose of a channel in one reading is the one that counts.
static void add_sample(struct device_reading *reading, enum channel channel, int64_t time_ns,
                       pose T_mockup_body) {
    int at = 0;
    while (at < reading->count && reading->samples[at].channel != channel)
        at++;
    reading->count += at == reading->count;
    reading->samples[at] = (struct sample){.channel = channel,
                                           .kind = SAMPLE_POSE,
                                           .time_ns = time_ns,
                                           .T_mockup_body = T_mockup_body};
}

static bool has_stamp(const struct tracker *d) {
    return d->uses_stamps && !d->is_unstamped && d->message.stamp_ns;
}

// Has a tool moved since its newest pose, which came long ago and has the same stamp?
static bool moves_under_one_stamp(const struct tracker *d, int64_t time_ns) {
    for (int i = 0; i < d->message.count; i++)
        for (int c = 0; c < CHANNEL_COUNT; c++) {
            const struct tracker_newest *newest = &d->newest[c];
            vec3 position = d->message.tools[i].T_tracker_tool.translation;
            if (!strcmp(d->message.tools[i].name, d->tools[c]) &&
                newest->stamp_ns == d->message.stamp_ns &&
                time_ns - newest->arrival_ns > STAMP_LATE_NS &&
                vec3_distance(position, newest->position) > still_mm)
                return true;
        }
    return false;
}

static bool is_stamp_used(const struct tracker *d) {
    for (int c = 0; c < CHANNEL_COUNT; c++)
        if (d->newest[c].stamp_ns == d->message.stamp_ns)
            return true;
    return false;
}

static enum result tell_late(const struct tracker *d, struct error *err) {
    long long ms = d->clock.lateness_ns / NS_PER_MS;
    if (is_stamp_used(d))
        return fail(err, RESULT_FORMAT, "its time stamps have stood still for %lld ms", ms);
    return fail(err, RESULT_FORMAT, "a message came %lld ms late", ms);
}

static enum result check_stamp(struct tracker *d, int64_t time_ns, struct error *err) {
    if (has_stamp(d) && moves_under_one_stamp(d, time_ns)) {
        log_warning("tracker", "%s: ignores its time stamps: they stand still while a tool moves",
                    d->address);
        d->is_unstamped = true;
    }
    if (!has_stamp(d))
        return RESULT_OK;
    enum stamp_verdict verdict = stamp_judge(&d->clock, d->message.stamp_ns, time_ns);
    switch (verdict) {
    case STAMP_LATE:
        return tell_late(d, err);
    case STAMP_AHEAD:
        return fail(err, RESULT_FORMAT, "its clock went ahead by %lld ms",
                    (long long)(-d->clock.lateness_ns / NS_PER_MS));
    case STAMP_ANEW:
        return fail(err, RESULT_FORMAT, "its clock was set back, or all its messages are late now");
    default:
        return RESULT_OK;
    }
}

static void take_tool(struct tracker *d, enum channel channel, pose T_tracker_tool,
                      int64_t arrival_ns, int64_t time_ns, struct device_reading *reading) {
    struct tracker_newest *newest = &d->newest[channel];
    if (has_stamp(d) && d->message.stamp_ns == newest->stamp_ns)
        return; // said again
    *newest = (struct tracker_newest){d->message.stamp_ns, arrival_ns, T_tracker_tool.translation};
    pose T_mockup_tool = pose_compose(d->T_mockup_tracker, T_tracker_tool);
    add_sample(reading, channel, time_ns, pose_compose(T_mockup_tool, d->T_tool_tip[channel]));
}

static void take_message(struct tracker *d, int64_t arrival_ns, struct device_reading *reading) {
    int64_t time_ns =
        has_stamp(d) ? stamp_time(&d->clock, d->message.stamp_ns, arrival_ns) : arrival_ns;
    reading->malformed += d->message.refused;
    for (int i = 0; i < d->message.count; i++)
        for (int c = 0; c < CHANNEL_COUNT; c++)
            if (!strcmp(d->message.tools[i].name, d->tools[c]))
                take_tool(d, (enum channel)c, d->message.tools[i].T_tracker_tool, arrival_ns,
                          time_ns, reading);
}

// TDATA and QTDATA; TRANSFORM and POSITION have the tool's name for a device.
static bool is_of_another_device(const struct tracker *d) {
    return d->message.names_tools && d->request.device[0] &&
           strcmp(d->message.device, d->request.device) != 0;
}

// Once for each version and connection.
static enum result check_version(struct tracker *d, struct error *err) {
    int version = d->message.version;
    if ((version >= 1 && version <= IGTL_NEWEST_VERSION) || version == d->unknown_version)
        return RESULT_OK;
    d->unknown_version = version;
    return fail(err, RESULT_FORMAT,
                "%s: sends messages of OpenIGTLink version %d, of which only 1 to %d are known",
                d->address, version, IGTL_NEWEST_VERSION);
}

static void take_status(struct tracker *d) {
    bool is_new =
        d->status != d->message.status || strcmp(d->status_text, d->message.status_text) != 0;
    d->status = d->message.status;
    strcpy(d->status_text, d->message.status_text);
    if (is_new && d->status != IGTL_STATUS_OK)
        log_warning("tracker", "%s: says status %d: %s", d->address, d->status, d->status_text);
}

static enum result take_bytes(struct tracker *d, const uint8_t *bytes, size_t size,
                              struct device_reading *reading, struct error *err) {
    int64_t time_ns = clock_now_ns();
    enum result result = RESULT_OK;
    while (size) {
        enum igtl_event event;
        size_t taken = igtl_stream_feed(&d->stream, bytes, size, &event, &d->message, err);
        bytes += taken;
        size -= taken;
        if (event == IGTL_BROKEN)
            return fail_in(err, RESULT_CLOSED, "%s: ", d->address);
        if (event != IGTL_NOTHING && event != IGTL_REFUSED)
            igtl_request_heard(&d->request, d->message.version);
        if (event == IGTL_SKIPPED && check_version(d, err) != RESULT_OK)
            result = RESULT_FORMAT;
        if (event == IGTL_POSES && is_of_another_device(d))
            event = IGTL_SKIPPED;
        if (event == IGTL_POSES && check_stamp(d, time_ns, err) != RESULT_OK)
            event = IGTL_REFUSED;
        if (event == IGTL_POSES) {
            igtl_request_answered(&d->request, time_ns);
            take_message(d, time_ns, reading);
        }
        d->denied |= event == IGTL_DENIED;
        if (event == IGTL_STATUS)
            take_status(d);
        reading->skipped += event == IGTL_SKIPPED || event == IGTL_STATUS;
        reading->malformed += event == IGTL_REFUSED;
        if (event == IGTL_REFUSED)
            result = fail_in(err, RESULT_FORMAT, "%s: ", d->address);
    }
    return result;
}

// A few bytes, of which the socket's buffer has room at any time.
static void send_request(struct tracker *d) {
    uint8_t bytes[IGTL_REQUEST_BYTES_MAX];
    size_t size = igtl_request_next(&d->request, clock_now_ns(), bytes);
    if (!size)
        return;
    d->denied = false;
    if (send(d->fd, bytes, size, MSG_NOSIGNAL) < 0)
        log_debug("tracker", "%s: %s", d->address, strerror(errno)); // tracker_poll notices it too
}

static enum result tell_silence(const struct tracker *d, struct error *err) {
    if (d->unknown_version)
        return fail(err, RESULT_TIMEOUT, "%s: the tracker sends nothing but version %d", d->address,
                    d->unknown_version);
    if (d->status != IGTL_STATUS_OK)
        return fail(err, RESULT_TIMEOUT, "%s: the tracker sends nothing; it says status %d: %s",
                    d->address, d->status, d->status_text);
    if (!d->request.count)
        return fail(err, RESULT_TIMEOUT, "%s: the tracker sends nothing", d->address);
    return fail(err, RESULT_TIMEOUT, "%s: the tracker sends nothing; it %s %s", d->address,
                d->denied ? "refused a request for" : "was asked for",
                igtl_request_name(d->request.asked));
}

static enum result tracker_poll(void *device, struct device_reading *reading, struct error *err) {
    struct tracker *d = device;
    uint8_t bytes[16384];
    send_request(d);
    struct pollfd ready = {.fd = d->fd, .events = POLLIN};
    int64_t due_ns = d->request.due_ns - clock_now_ns();
    bool asks_soon = d->request.kind != IGTL_REQUEST_NONE && due_ns >= 0 && due_ns < POLL_MAX_NS;
    struct timespec wait = {0, asks_soon ? due_ns : POLL_MAX_NS};
    if (ppoll(&ready, 1, &wait, NULL) == 0)
        return asks_soon ? RESULT_OK : tell_silence(d, err);
    ssize_t size = recv(d->fd, bytes, sizeof bytes, 0);
    if (size > 0)
        return take_bytes(d, bytes, (size_t)size, reading, err);
    if (size < 0 && (errno == EINTR || errno == EAGAIN))
        return RESULT_OK;
    return fail(err, RESULT_CLOSED, "%s: %s", d->address,
                size ? strerror(errno) : "closed the connection");
}

static void tracker_close(void *device) {
    struct tracker *d = device;
    close(d->fd);
}

const struct device_driver tracker_driver = {
    "tracker", tracker_create, tracker_open, tracker_poll, tracker_close, free,
};
