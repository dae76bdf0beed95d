// A client of an OpenIGTLink server: any tracker that PLUS, 3D Slicer or a vendor serves.
//
//   address           host:port; required
//   tool.CHANNEL      the tool's OpenIGTLink name; at least one, or a force.CHANNEL
//   tip.CHANNEL       T_tool_tip (bones: where the bone's frame lies in the marker's)
//   T_mockup_tracker  where the tracker's frame lies in the mock-up's
//   unit              mm, or m: what the tracker's lengths are; mm
//   stamps            no: the tracker's time stamps mean nothing; yes
//   request           what it is asked to send (igtl/request.h): auto, TDATA, QTDATA,
//                     TRANSFORM, POSITION or none; auto
//   request_ms        the shortest time between two messages that are asked for, 0 to 1000; 5
//   coordinates       name of the coordinate system that is asked for; empty
//   device            name of the device whose TDATA or QTDATA is meant; any
//   force.CHANNEL, elements.CHANNEL, scale.CHANNEL, zero.CHANNEL  drivers/tracker_force.h
//
// A sample is T_mockup_tracker · T_tracker_tool · T_tool_tip, at the time that its message's stamp
// tells (drivers/stamp.h), or, without stamps, when its bytes came. The stamps tell too which
// message is late, and whether a tool's pose is only said again. OpenIGTLink's library leaves the
// stamp of a message uninitialized that its sender does not stamp: it stands still at any value.

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "drivers/drivers.h"
#include "drivers/options.h"
#include "drivers/socket.h"
#include "drivers/stamp.h"
#include "drivers/tracker_config.h"
#include "drivers/tracker_force.h"
#include "drivers/tracker_heard.h"
#include "drivers/tracker_marker.h"
#include "igtl/metadata.h"
#include "igtl/request.h"
#include "igtl/stream.h"

#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

static const int connect_timeout_ms = 1000;
static const double still_mm = 0.001, still_deg = 0.01; // one pose in two types of message
static const int64_t name_patience_ns = 2 * NS_PER_S;   // before a missing tool is told of
static const int64_t longest_told_ns = 60 * NS_PER_S;   // what is later is no delay
static const int near_poses = 100;
static const double near_mm = 5; // where all tools of a tracker in metres seem to be

struct tracker {
    char address[OPTION_TEXT_MAX];
    struct tracker_tools tools;
    pose T_mockup_tracker, T_tool_tip[CHANNEL_COUNT];
    double unit_mm;
    bool uses_stamps;
    bool is_unstamped; // this connection: what its messages have for a stamp is no clock
    struct stamp_trial trial;
    struct igtl_request request;
    bool denied;         // it said no to the newest request
    int unknown_version; // that was told; 0: none
    int status;          // that it told last
    char status_text[IGTL_STATUS_SIZE];
    uint32_t told; // bit i: status i was logged
    struct tracker_heard heard;
    bool names_told;
    int poses; // of this connection, all near the tracker; -1: one was far
    struct stamp_clock clock;
    struct tracker_force forces[CHANNEL_COUNT];
    struct tracker_markers markers;
    struct tracker_newest {
        int64_t stamp_ns, arrival_ns; // stamp_ns 0: none
        pose T_tracker_tool;
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
        if (!*name || strlen(name) >= IGTL_TOOL_SIZE)
            return option_fail(config, key, err, RESULT_INVALID, "a name has 1 to %d bytes",
                               IGTL_TOOL_SIZE - 1);
        strcpy(d->tools.names[i], name);
        strcpy(d->request.tools[d->request.tool_count++].name, name);
        outputs_add(outputs, (enum channel)i, SAMPLE_POSE);
    }
    enum result result = tracker_force_configure(config, d->forces, outputs, err);
    if (result == RESULT_OK)
        result = tracker_markers_configure(config, &d->markers, err);
    if (result == RESULT_OK && !outputs->count && !d->markers.count)
        return option_fail(config, "tool.CHANNEL", err, RESULT_MISSING,
                           "is required, or force.CHANNEL, or marker.NAME");
    return result;
}

static enum result configure_tracker(struct tracker *d, const struct device_config *config,
                                     struct device_outputs *outputs, struct error *err) {
    static const char *const keys[] = {"address",     "tool.",    "tip.",    "T_mockup_tracker",
                                       "stamps",      "device",   "request", "request_ms",
                                       "coordinates", "force.",   "zero.",   "elements.",
                                       "scale.",      "marker.*", "unit",    NULL};
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
        result = tracker_configure_unit(&d->unit_mm, config, err);
    if (result == RESULT_OK)
        result = tracker_configure_request(&d->request, config, err);
    if (result == RESULT_OK)
        result = configure_tools(d, config, outputs, err);
    return result;
}

static enum result tracker_create(const struct device_config *config, void **out_device,
                                  struct device_outputs *out_outputs, struct error *err) {
    struct tracker *d = alloc(1, sizeof *d);
    enum result result = configure_tracker(d, config, out_outputs, err);
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
    d->trial = (struct stamp_trial){0};
    memset(d->newest, 0, sizeof d->newest);
    memset(d->tools.meant, 0, sizeof d->tools.meant);
    tracker_force_begin(d->forces);
    tracker_markers_begin(&d->markers);
    d->denied = d->is_unstamped = d->names_told = false;
    d->unknown_version = d->poses = 0;
    d->status = IGTL_STATUS_OK;
    d->told = 0;
    enum result result = socket_connect(d->address, connect_timeout_ms, &d->fd, err);
    d->heard = (struct tracker_heard){.begin_ns = clock_now_ns()};
    igtl_request_begin(&d->request, clock_now_ns());
    return result;
}

// ---- names --------------------------------------------------------------------------------------

// Once for each connection.
static void tell_names(struct tracker *d, int64_t now_ns) {
    char names[128];
    if (d->names_told || now_ns - d->heard.begin_ns < name_patience_ns || !d->heard.count)
        return;
    d->names_told = true;
    heard_names(&d->heard, names);
    for (int c = 0; c < CHANNEL_COUNT; c++)
        if (d->tools.names[c][0] && !d->newest[c].arrival_ns)
            log_warning("tracker", "%s: sends no tool \"%s\" (%s), but %s", d->address,
                        d->tools.names[c], channel_name((enum channel)c), names);
}

// ---- stamps -------------------------------------------------------------------------------------

static bool has_stamp(const struct tracker *d) {
    return d->uses_stamps && !d->is_unstamped && d->message.stamp_ns;
}

static bool has_moved(pose a, pose b) {
    return vec3_distance(a.translation, b.translation) > still_mm ||
           quat_angle(a.rotation, b.rotation) > still_deg * RAD_PER_DEG;
}

// Has a tool moved since its newest pose, which came long ago and has the same stamp?
static bool moves_under_one_stamp(struct tracker *d, int64_t time_ns) {
    for (int i = 0; i < d->message.count; i++)
        for (int c = 0; c < CHANNEL_COUNT; c++) {
            const struct tracker_newest *newest = &d->newest[c];
            const struct igtl_tool *tool = &d->message.tools[i];
            if (newest->stamp_ns == d->message.stamp_ns && !tool->unseen &&
                time_ns - newest->arrival_ns > STAMP_LATE_NS &&
                tracker_tool_is(&d->tools, (enum channel)c, tool->name) &&
                has_moved(tool->T_tracker_tool, newest->T_tracker_tool))
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
    if (d->clock.lateness_ns > longest_told_ns)
        return fail(err, RESULT_FORMAT, "its time stamps are no clock");
    if (is_stamp_used(d))
        return fail(err, RESULT_FORMAT, "its time stamps have stood still for %lld ms", ms);
    return fail(err, RESULT_FORMAT, "a message came %lld ms late", ms);
}

static void ignore_stamps(struct tracker *d, const char *why) {
    log_warning("tracker", "%s: ignores its time stamps: %s", d->address, why);
    d->is_unstamped = true;
}

static enum result tell_ahead(const struct tracker *d, struct error *err) {
    if (-d->clock.lateness_ns > longest_told_ns)
        return fail(err, RESULT_FORMAT, "its time stamps are no clock");
    return fail(err, RESULT_FORMAT, "its clock went ahead by %lld ms",
                (long long)(-d->clock.lateness_ns / NS_PER_MS));
}

static enum result check_pose_stamp(struct tracker *d, int64_t time_ns, struct error *err) {
    if (has_stamp(d) && moves_under_one_stamp(d, time_ns))
        ignore_stamps(d, "they stand still while a tool moves");
    if (!has_stamp(d))
        return RESULT_OK;
    enum stamp_verdict verdict = stamp_judge(&d->clock, d->message.stamp_ns, time_ns);
    if (stamp_is_no_clock(&d->trial, verdict, time_ns)) {
        ignore_stamps(d, "most are late or ahead, although the messages come regularly");
        return RESULT_OK;
    }
    switch (verdict) {
    case STAMP_LATE:
        return tell_late(d, err);
    case STAMP_AHEAD:
        return tell_ahead(d, err);
    case STAMP_ANEW:
        return fail(err, RESULT_FORMAT, "its clock was set back, or all its messages are late now");
    default:
        return RESULT_OK;
    }
}

// ---- messages -----------------------------------------------------------------------------------

static void judge_unit(struct tracker *d, vec3 position) {
    if (d->poses < 0)
        return;
    d->poses = vec3_length(position) < near_mm ? d->poses + 1 : -1;
    if (d->poses == near_poses && d->unit_mm == 1)
        log_warning("tracker",
                    "%s: all tools lie within %g mm of its origin: does it send metres (unit = m)?",
                    d->address, near_mm);
}

static void put_lost(enum channel channel, int64_t time_ns, struct device_reading *reading) {
    const struct sample lost = {.channel = channel,
                                .kind = SAMPLE_POSE,
                                .validity = VALIDITY_LOST,
                                .time_ns = time_ns,
                                .T_mockup_body = pose_identity()};
    reading_put(reading, &lost);
}

static void take_tool(struct tracker *d, enum channel channel, const struct igtl_tool *tool,
                      int64_t arrival_ns, int64_t time_ns, struct device_reading *reading) {
    struct tracker_newest *newest = &d->newest[channel];
    pose T_tracker_tool = tool->T_tracker_tool;
    if (tool->unseen) {
        put_lost(channel, time_ns, reading);
        return;
    }
    if (has_stamp(d) && d->message.stamp_ns == newest->stamp_ns)
        return; // said again
    *newest = (struct tracker_newest){d->message.stamp_ns, arrival_ns, T_tracker_tool};
    judge_unit(d, T_tracker_tool.translation);
    T_tracker_tool.translation = vec3_scale(d->unit_mm, T_tracker_tool.translation);
    pose T_mockup_tool = pose_compose(d->T_mockup_tracker, T_tracker_tool);
    const struct sample sample = {.channel = channel,
                                  .kind = SAMPLE_POSE,
                                  .time_ns = time_ns,
                                  .T_mockup_body =
                                      pose_compose(T_mockup_tool, d->T_tool_tip[channel])};
    reading_put(reading, &sample);
}

static void take_message(struct tracker *d, int64_t arrival_ns, struct device_reading *reading) {
    int64_t time_ns =
        has_stamp(d) ? stamp_time(&d->clock, d->message.stamp_ns, arrival_ns) : arrival_ns;
    int known = 0;
    for (int i = 0; i < d->message.count; i++) {
        const struct igtl_tool *tool = &d->message.tools[i];
        bool ours = false;
        for (int c = 0; c < CHANNEL_COUNT; c++)
            if (tracker_tool_is(&d->tools, (enum channel)c, tool->name)) {
                take_tool(d, (enum channel)c, tool, arrival_ns, time_ns, reading);
                ours = true;
            }
        if (!ours)
            heard_tool(&d->heard, tool->name, arrival_ns);
        known += ours;
    }
    reading->malformed += d->message.refused;
    if (known)
        heard_value(&d->heard, arrival_ns);
    tell_names(d, arrival_ns);
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

// Logged once for each status and connection: its text may have a number that counts.
static void take_tracker_status(struct tracker *d) {
    uint32_t bit = 1U << (d->message.status & 31);
    bool is_new = !(d->told & bit);
    d->status = d->message.status;
    strcpy(d->status_text, d->message.status_text);
    d->told |= bit;
    if (is_new && d->status != IGTL_STATUS_OK)
        log_warning("tracker", "%s: says status %d: %s", d->address, d->status, d->status_text);
}

// What is left to do with the message.
static enum igtl_event take_sensor(struct tracker *d, int64_t time_ns,
                                   struct device_reading *reading, struct error *err) {
    bool is_ours;
    enum result result =
        tracker_force_take(d->forces, d->uses_stamps, &d->message, time_ns, reading, &is_ours, err);
    if (is_ours)
        heard_value(&d->heard, time_ns);
    if (is_ours && !d->request.tool_count) // no poses are wanted
        igtl_request_answered(&d->request, &d->message, time_ns);
    return result != RESULT_OK ? IGTL_REFUSED : is_ours ? IGTL_NOTHING : IGTL_SKIPPED;
}

// The same.
static enum igtl_event take_string(struct tracker *d, int64_t time_ns,
                                   struct device_reading *reading) {
    if (!tracker_markers_take(&d->markers, d->uses_stamps, &d->message, time_ns, reading))
        return IGTL_SKIPPED;
    reading->heard = true;
    if (!d->request.tool_count) // no poses are wanted
        igtl_request_answered(&d->request, &d->message, time_ns);
    return IGTL_NOTHING;
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
        if (event == IGTL_SENSOR)
            event = take_sensor(d, time_ns, reading, err);
        if (event == IGTL_STRING)
            event = take_string(d, time_ns, reading);
        if (event == IGTL_POSES && is_of_another_device(d))
            event = IGTL_SKIPPED;
        if (event == IGTL_POSES && check_pose_stamp(d, time_ns, err) != RESULT_OK)
            event = IGTL_REFUSED;
        if (event == IGTL_POSES) {
            igtl_request_answered(&d->request, &d->message, time_ns);
            take_message(d, time_ns, reading);
        }
        d->denied |= event == IGTL_DENIED;
        if (event == IGTL_STATUS)
            take_tracker_status(d);
        if (event == IGTL_SKIPPED)
            heard_message(&d->heard, d->message.type, time_ns);
        reading->skipped += event == IGTL_SKIPPED || event == IGTL_STATUS;
        reading->malformed += event == IGTL_REFUSED;
        if (event == IGTL_REFUSED)
            result = fail_in(err, RESULT_FORMAT, "%s: ", d->address);
    }
    return result;
}

// A part of a request would spoil all that follow.
static enum result send_tracker_request(struct tracker *d, struct error *err) {
    uint8_t bytes[IGTL_REQUEST_BYTES_MAX];
    size_t size = igtl_request_next(&d->request, clock_now_ns(), bytes);
    if (!size)
        return RESULT_OK;
    d->denied = false;
    ssize_t sent = send(d->fd, bytes, size, MSG_NOSIGNAL);
    if (sent >= 0 && sent < (ssize_t)size)
        return fail(err, RESULT_CLOSED, "%s: does not read what it is asked", d->address);
    if (sent < 0)
        log_debug("tracker", "%s: %s", d->address, strerror(errno)); // tracker_poll notices it too
    return RESULT_OK;
}

static enum result tell_silence(const struct tracker *d, struct error *err) {
    if (d->unknown_version)
        return fail(err, RESULT_TIMEOUT,
                    "%s: the tracker sends nothing but version %d, of which only 1 to %d are known",
                    d->address, d->unknown_version, IGTL_NEWEST_VERSION);
    if (d->status != IGTL_STATUS_OK)
        return fail(err, RESULT_TIMEOUT, "%s: the tracker sends nothing; it says status %d: %s",
                    d->address, d->status, d->status_text);
    if (heard_tell(&d->heard, clock_now_ns(), err) != RESULT_OK)
        return fail_in(err, RESULT_TIMEOUT, "%s: the tracker ", d->address);
    if (!d->request.count)
        return fail(err, RESULT_TIMEOUT, "%s: the tracker sends nothing", d->address);
    return fail(err, RESULT_TIMEOUT, "%s: the tracker sends nothing; it %s %s", d->address,
                d->denied ? "refused a request for" : "was asked for",
                igtl_request_name(d->request.asked));
}

static enum result tracker_poll(void *device, struct device_reading *reading, struct error *err) {
    struct tracker *d = device;
    uint8_t bytes[16384];
    if (send_tracker_request(d, err) != RESULT_OK)
        return RESULT_CLOSED;
    struct pollfd ready = {.fd = d->fd, .events = POLLIN};
    int64_t now_ns = clock_now_ns(), due_ns = igtl_request_due_ns(&d->request, now_ns);
    int64_t wait_ns = due_ns > now_ns + POLL_MAX_NS ? POLL_MAX_NS : due_ns - now_ns;
    struct timespec wait = {0, wait_ns > 0 ? wait_ns : 0};
    if (ppoll(&ready, 1, &wait, NULL) == 0)
        return heard_is_silent(&d->heard, clock_now_ns()) ? tell_silence(d, err) : RESULT_OK;
    ssize_t size = recv(d->fd, bytes, sizeof bytes, 0);
    if (size > 0) {
        enum result result = take_bytes(d, bytes, (size_t)size, reading, err);
        bool silent = result == RESULT_OK && heard_is_silent(&d->heard, clock_now_ns());
        return silent ? tell_silence(d, err) : result;
    }
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
