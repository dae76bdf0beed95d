#include "base/check.h"
#include "base/clock.h"
#include "base/sample.h"
#include "drivers/socket.h"
#include "igtl/request.h"
#include "igtl/stream.h"
#include "tools/probe.h"

#include <ctype.h>
#include <errno.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#define CONNECT_MS 1000
#define POLL_MS 5
#define LONGEST_S 5.0 // until all requests were tried
#define REQUEST_MS 5  // as the driver's
#define NEAR_MM 5     // all tools of a tracker in metres seem to be so near
#define SENSORS_MAX 8
#define SENSOR_VALUES_SHOWN 6

struct seen {
    int count, skipped, refused;
    int unknown_version, status; // the newest; 0: none
    char status_text[IGTL_STATUS_SIZE];
    enum igtl_request_kind asked; // what brought the poses; NONE: they come by themselves
    int64_t first_ns;             // when the first pose came
    struct {
        char name[IGTL_TOOL_SIZE];
        int messages, unseen;
        pose T_tracker_tool; // the newest
    } tools[IGTL_TOOLS_MAX];
    int sensor_count;
    struct {
        char device[IGTL_DEVICE_SIZE];
        struct igtl_sensor newest;
    } sensors[SENSORS_MAX];
};

struct listening {
    struct igtl_stream stream;
    struct igtl_message message;
    struct igtl_request request;
    struct seen seen;
};

static void take_tool(struct seen *seen, const struct igtl_tool *tool) {
    int at = 0;
    while (at < seen->count && strcmp(seen->tools[at].name, tool->name))
        at++;
    if (at == IGTL_TOOLS_MAX)
        return;
    seen->count += at == seen->count;
    strcpy(seen->tools[at].name, tool->name);
    seen->tools[at].messages++;
    seen->tools[at].unseen += tool->unseen;
    if (!tool->unseen)
        seen->tools[at].T_tracker_tool = tool->T_tracker_tool;
}

static void take_sensor(struct seen *seen, const struct igtl_message *message) {
    int at = 0;
    while (at < seen->sensor_count && strcmp(seen->sensors[at].device, message->device))
        at++;
    if (at == SENSORS_MAX)
        return;
    seen->sensor_count += at == seen->sensor_count;
    strcpy(seen->sensors[at].device, message->device);
    seen->sensors[at].newest = message->sensor;
}

// False: the stream is beyond repair.
static bool take_bytes(struct listening *l, const uint8_t *bytes, size_t size) {
    while (size) {
        enum igtl_event event;
        struct error why;
        size_t taken = igtl_stream_feed(&l->stream, bytes, size, &event, &l->message, &why);
        bytes += taken;
        size -= taken;
        l->seen.skipped += event == IGTL_SKIPPED;
        if (event == IGTL_SKIPPED &&
            (l->message.version < 1 || l->message.version > IGTL_NEWEST_VERSION))
            l->seen.unknown_version = l->message.version;
        if (event == IGTL_STATUS) {
            l->seen.status = l->message.status;
            strcpy(l->seen.status_text, l->message.status_text);
        }
        if (event == IGTL_SENSOR)
            take_sensor(&l->seen, &l->message);
        l->seen.refused += event == IGTL_REFUSED;
        for (int i = 0; event == IGTL_POSES && i < l->message.count; i++)
            take_tool(&l->seen, &l->message.tools[i]);
        if (event == IGTL_POSES)
            igtl_request_answered(&l->request, &l->message, clock_now_ns());
        if (event != IGTL_NOTHING && event != IGTL_REFUSED)
            igtl_request_heard(&l->request, l->message.version);
        if (event == IGTL_BROKEN)
            return false;
    }
    return true;
}

static void listen_to(int fd, double seconds, struct listening *l) {
    int64_t end_ns = clock_now_ns() + (int64_t)(LONGEST_S * NS_PER_S);
    uint8_t bytes[16384], request_bytes[IGTL_REQUEST_BYTES_MAX];
    l->request = (struct igtl_request){.kind = IGTL_REQUEST_AUTO, .interval_ms = REQUEST_MS};
    l->seen.asked = IGTL_REQUEST_NONE;
    igtl_stream_init(&l->stream);
    igtl_request_begin(&l->request, clock_now_ns());
    for (int64_t now_ns; (now_ns = clock_now_ns()) < end_ns;) {
        struct pollfd ready = {.fd = fd, .events = POLLIN};
        size_t asked = igtl_request_next(&l->request, now_ns, request_bytes);
        if (asked && send(fd, request_bytes, asked, MSG_NOSIGNAL) < 0)
            return;
        if (poll(&ready, 1, POLL_MS) <= 0)
            continue;
        ssize_t size = recv(fd, bytes, sizeof bytes, 0);
        if (size < 0 && (errno == EINTR || errno == EAGAIN))
            continue;
        if (size <= 0 || !take_bytes(l, bytes, (size_t)size))
            return;
        if (l->seen.count && !l->seen.first_ns) {
            l->seen.first_ns = clock_now_ns();
            l->seen.asked = l->request.asked;
            end_ns = l->seen.first_ns + (int64_t)(seconds * NS_PER_S);
        }
    }
}

static bool is_channel(const char *name, char *out_channel, size_t size) {
    enum channel channel;
    snprintf(out_channel, size, "%s", name);
    for (char *c = out_channel; *c; c++)
        *c = (char)tolower((unsigned char)*c);
    return channel_from_name(out_channel, &channel) && channel != CHANNEL_JOINT;
}

// Names come from outside: what would break a line of the config is not repeated. False: it had
// such.
static bool make_printable(char *name) {
    bool whole = true;
    for (; *name; name++)
        if (!isprint((unsigned char)*name) || *name == ';') {
            *name = '?';
            whole = false;
        }
    return whole;
}

// Of a tracker whose lengths are in metres.
static bool are_all_near(const struct seen *seen) {
    bool near = seen->count > 0;
    for (int i = 0; i < seen->count; i++)
        near &= seen->tools[i].unseen < seen->tools[i].messages &&
                vec3_length(seen->tools[i].T_tracker_tool.translation) < NEAR_MM;
    return near;
}

static void report_tool(struct seen *seen, int i, double seconds, FILE *config, json_t *tools) {
    char channel[IGTL_TOOL_SIZE], *name = seen->tools[i].name;
    double rate_hz = seen->tools[i].messages / seconds;
    vec3 at = seen->tools[i].T_tracker_tool.translation;
    bool whole = make_printable(name);
    fprintf(config, "; %s: %.0f Hz, at %.1f %.1f %.1f mm%s\n", name, rate_hz, at.x, at.y, at.z,
            seen->tools[i].unseen == seen->tools[i].messages ? ", not in view" : "");
    if (!whole)
        fprintf(config, "; the config cannot have this name: rename the tool in the tracker\n");
    else if (is_channel(name, channel, sizeof channel))
        fprintf(config, "tool.%s = %s\n", channel, name);
    else
        fprintf(config, "; tool.CHANNEL = %s\n", name);
    json_array_append_new(tools, json_pack("{s:s, s:f, s:[f, f, f]}", "name", name, "rate_hz",
                                           rate_hz, "at_mm", at.x, at.y, at.z));
}

// Which of them is a force, and whose, nobody can tell but the technician.
static json_t *report_sensors(struct seen *seen, FILE *config) {
    json_t *sensors = json_array();
    for (int i = 0; i < seen->sensor_count; i++) {
        const struct igtl_sensor *s = &seen->sensors[i].newest;
        char *name = seen->sensors[i].device;
        double newtons = 1;
        struct error why;
        bool is_force = igtl_unit_newtons(s->unit, &newtons, &why) == RESULT_OK;
        json_t *values = json_array();
        make_printable(name);
        fprintf(config, "; %s: SENSOR with %d numbers:", name, s->count);
        for (int k = 0; k < s->count && k < SENSOR_VALUES_SHOWN; k++) {
            fprintf(config, " %.4g", newtons * s->values[k]);
            json_array_append_new(values, isfinite(s->values[k]) ? json_real(newtons * s->values[k])
                                                                 : json_null());
        }
        if (is_force)
            fprintf(config, " N\n; force.CHANNEL = %s\n", name);
        else
            fprintf(config, "; %s: for a force give scale.CHANNEL, the newtons of one\n", why.text);
        json_array_append_new(sensors, json_pack("{s:s, s:b, s:o}", "name", name, "is_force",
                                                 is_force, "values", values));
    }
    return sensors;
}

static void report_seen(const char *address, struct seen *seen, FILE *config, json_t *out) {
    double seconds = fmax(0.001, (double)(clock_now_ns() - seen->first_ns) / NS_PER_S);
    json_t *tools = json_array();
    fprintf(config, "\n; %s: %d other messages, %d malformed\n", address, seen->skipped,
            seen->refused);
    if (seen->unknown_version)
        fprintf(config, "; it sends OpenIGTLink version %d; 1 to %d are known\n",
                seen->unknown_version, IGTL_NEWEST_VERSION);
    if (seen->status > IGTL_STATUS_OK)
        fprintf(config, "; it says status %d: %s\n", seen->status, seen->status_text);
    fprintf(config, "[device tracker-%zu]\ndriver = tracker\naddress = %s\n",
            json_array_size(out) + 1, address);
    if (seen->count && seen->asked != IGTL_REQUEST_NONE)
        fprintf(config, "request = %s\n", igtl_request_name(seen->asked));
    if (are_all_near(seen))
        fprintf(config, "; all tools lie within %d mm: does it send metres?\n; unit = m\n",
                NEAR_MM);
    for (int i = 0; i < seen->count; i++)
        report_tool(seen, i, seconds, config, tools);
    json_array_append_new(out, json_pack("{s:s, s:o, s:o, s:i, s:i}", "address", address, "tools",
                                         tools, "sensors", report_sensors(seen, config), "skipped",
                                         seen->skipped, "malformed", seen->refused));
}

enum result probe_tracker(const char *address, double seconds, FILE *config, json_t *out,
                          struct error *err) {
    int fd;
    enum result result = socket_connect(address, CONNECT_MS, &fd, err);
    if (result != RESULT_OK)
        return fail_in(err, result, "cannot connect to ");
    struct listening *l = alloc(1, sizeof *l);
    listen_to(fd, seconds, l);
    close(fd);
    report_seen(address, &l->seen, config, out);
    if (!l->seen.count && !l->seen.sensor_count)
        result = fail(err, RESULT_TIMEOUT,
                      "%s: the tracker sent no pose within %.0f s. Bring a tool into its view",
                      address, LONGEST_S);
    free(l);
    return result;
}
