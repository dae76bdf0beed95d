// arthron-mockup: a knee on your desk. It speaks the protocols of the hardware and plays a file.

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/number.h"
#include "device/socket.h"
#include "slave.h"
#include "tracker_server.h"

#include <getopt.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const char help[] =
    "usage: arthron-mockup (--motion FILE | --recording FILE --tool NAME) [options]\n"
    "A knee on your desk: plays a file in a loop as the hardware of a mock-up would speak.\n"
    "\n"
    "  --motion FILE            motion file: joint, tools, handles\n"
    "  --recording FILE         recording of one tool, played as --tool NAME (probe, punch, ...)\n"
    "  --modbus-tcp HOST:PORT   be a Modbus TCP slave\n"
    "  --modbus-rtu PATH        be a Modbus RTU slave; PATH becomes a link to its serial line\n"
    "  --modbus-rate HZ         how often the registers change (200)\n"
    "  --slave N                the slave's number (1)\n"
    "  --tracker HOST:PORT      be an OpenIGTLink tracker\n"
    "  --message TYPE           TRANSFORM, TDATA, POSITION or QTDATA (TDATA)\n"
    "  --header-version N       1, 2 or 3 (2)\n"
    "  --rate HZ                tracker frames a second, interpolated (each row at its own time)\n"
    "  --T-tracker-mockup POSE  where the mock-up stands before the tracker\n"
    "  --T-tool-tip NAME=POSE   where a tool's tip is in the tool\n"
    "  --silent WHO:FROM:FOR    WHO (modbus or tracker) says nothing from FROM s on, for FOR s\n"
    "  --late-modbus MS:EVERY   every EVERYth Modbus reply comes MS late\n"
    "  --help, --version\n"
    "\n"
    "POSE is \"x y z qw qx qy qz\" in mm. PORT 0 takes a free one. Each line on stdout is ready "
    "for\n"
    "use when it appears: \"modbus-tcp HOST:PORT\", \"modbus-rtu PATH\", \"tracker HOST:PORT\".\n";

struct mockup {
    struct player player;
    atomic_bool stop;
    struct slave tcp, rtu;
    struct tracker_server tracker;
    const char *motion, *recording, *tcp_address, *rtu_path, *tracker_address;
    enum channel tool;
    int thread_count;
    pthread_t threads[3];
};

// ---- options
// -------------------------------------------------------------------------------------

static bool parse_whole(const char *text, int low, int high, int *out) {
    int64_t value;
    if (!number_int(text, low, high, &value))
        return false;
    *out = (int)value;
    return true;
}

static bool parse_message(const char *text, enum message_type *out) {
    static const char *const names[] = {"TRANSFORM", "TDATA", "POSITION", "QTDATA"};
    for (int i = 0; i < 4; i++)
        if (!strcmp(text, names[i])) {
            *out = (enum message_type)i;
            return true;
        }
    return false;
}

static bool parse_tip(struct mockup *m, const char *text) {
    char name[32];
    enum channel channel;
    const char *equals = strchr(text, '=');
    if (!equals || (size_t)(equals - text) >= sizeof name)
        return false;
    memcpy(name, text, (size_t)(equals - text));
    name[equals - text] = 0;
    return channel_from_name(name, &channel) &&
           number_pose(equals + 1, &m->tracker.T_tool_tip[channel]);
}

static bool parse_silence(struct mockup *m, const char *text) {
    char who[16], rest;
    struct silence silence;
    if (sscanf(text, "%15[a-z]:%lf:%lf%c", who, &silence.from_s, &silence.for_s, &rest) != 3 ||
        !(silence.from_s >= 0) || !(silence.for_s >= 0))
        return false;
    if (!strcmp(who, "tracker"))
        m->tracker.silence = silence;
    else if (!strcmp(who, "modbus"))
        m->tcp.silence = m->rtu.silence = silence;
    else
        return false;
    return true;
}

static bool parse_late(struct mockup *m, const char *text) {
    int ms, every;
    char rest;
    if (sscanf(text, "%d:%d%c", &ms, &every, &rest) != 2 || ms < 0 || ms > 10000 || every < 1)
        return false;
    m->tcp.late_ms = m->rtu.late_ms = ms;
    m->tcp.late_every = m->rtu.late_every = every;
    return true;
}

enum option_code {
    MOTION = 256,
    RECORDING,
    TOOL,
    MODBUS_TCP,
    MODBUS_RTU,
    MODBUS_RATE,
    SLAVE,
    TRACKER,
    MESSAGE,
    HEADER_VERSION,
    RATE,
    T_TRACKER_MOCKUP,
    T_TOOL_TIP,
    SILENT,
    LATE_MODBUS,
    HELP,
    VERSION
};

static const struct option options[] = {
    {"motion", required_argument, NULL, MOTION},
    {"recording", required_argument, NULL, RECORDING},
    {"tool", required_argument, NULL, TOOL},
    {"modbus-tcp", required_argument, NULL, MODBUS_TCP},
    {"modbus-rtu", required_argument, NULL, MODBUS_RTU},
    {"modbus-rate", required_argument, NULL, MODBUS_RATE},
    {"slave", required_argument, NULL, SLAVE},
    {"tracker", required_argument, NULL, TRACKER},
    {"message", required_argument, NULL, MESSAGE},
    {"header-version", required_argument, NULL, HEADER_VERSION},
    {"rate", required_argument, NULL, RATE},
    {"T-tracker-mockup", required_argument, NULL, T_TRACKER_MOCKUP},
    {"T-tool-tip", required_argument, NULL, T_TOOL_TIP},
    {"silent", required_argument, NULL, SILENT},
    {"late-modbus", required_argument, NULL, LATE_MODBUS},
    {"help", no_argument, NULL, HELP},
    {"version", no_argument, NULL, VERSION},
    {NULL, 0, NULL, 0},
};

static bool set_option(struct mockup *m, int code, const char *text) {
    switch (code) {
    case MOTION:
        m->motion = text;
        return true;
    case RECORDING:
        m->recording = text;
        return true;
    case TOOL:
        return channel_from_name(text, &m->tool) && m->tool != CHANNEL_JOINT;
    case MODBUS_TCP:
        m->tcp_address = text;
        return true;
    case MODBUS_RTU:
        m->rtu_path = text;
        return true;
    case MODBUS_RATE:
        return number_double(text, 1, 10000, &m->tcp.update_hz) &&
               number_double(text, 1, 10000, &m->rtu.update_hz);
    case SLAVE:
        return parse_whole(text, 1, 247, &m->tcp.number) &&
               parse_whole(text, 1, 247, &m->rtu.number);
    case TRACKER:
        m->tracker_address = text;
        return true;
    case MESSAGE:
        return parse_message(text, &m->tracker.type);
    case HEADER_VERSION:
        return parse_whole(text, 1, 3, &m->tracker.header_version);
    case RATE:
        return number_double(text, 1, 10000, &m->tracker.rate_hz);
    case T_TRACKER_MOCKUP:
        return number_pose(text, &m->tracker.T_tracker_mockup);
    case T_TOOL_TIP:
        return parse_tip(m, text);
    case SILENT:
        return parse_silence(m, text);
    case LATE_MODBUS:
        return parse_late(m, text);
    default:
        return false;
    }
}

_Noreturn static void end_with_usage(const char *text) {
    fprintf(stderr, "arthron-mockup: %s\nTry arthron-mockup --help\n", text);
    exit(2);
}

static void check_usage(const struct mockup *m) {
    if (!m->motion == !m->recording)
        end_with_usage("one of --motion and --recording is required");
    if (m->recording && m->tool == CHANNEL_COUNT)
        end_with_usage("--recording needs --tool");
    if (m->motion && m->tool != CHANNEL_COUNT)
        end_with_usage("--tool goes with --recording");
    if (!m->tcp_address && !m->rtu_path && !m->tracker_address)
        end_with_usage("nothing to be: --modbus-tcp, --modbus-rtu or --tracker");
}

static void parse_options(struct mockup *m, int argc, char **argv) {
    int code, index;
    while ((code = getopt_long(argc, argv, "", options, &index)) != -1) {
        char text[300];
        if (code == '?')
            end_with_usage("see above");
        if (code == HELP || code == VERSION) {
            fputs(code == HELP ? help : "arthron-mockup " ARTHRON_VERSION "\n", stdout);
            exit(0);
        }
        snprintf(text, sizeof text, "--%s: \"%.200s\" is not what it takes", options[index].name,
                 optarg);
        if (!set_option(m, code, optarg))
            end_with_usage(text);
    }
    if (optind < argc)
        end_with_usage("takes options only");
    check_usage(m);
}

// ---- running
// -------------------------------------------------------------------------------------

static void say_ready(const char *what, const char *address, uint16_t port) {
    const char *colon = strrchr(address, ':');
    if (port)
        printf("%s %.*s:%u\n", what, (int)(colon - address), address, port);
    else
        printf("%s %s\n", what, address);
}

static void start_thread(struct mockup *m, void *(*run)(void *), void *what) {
    CHECK(pthread_create(&m->threads[m->thread_count++], NULL, run, what) == 0);
}

static enum result start(struct mockup *m, struct error *err) {
    uint16_t port;
    enum result result = RESULT_OK;
    if (m->tcp_address && (result = slave_listen(&m->tcp, m->tcp_address, &port, err)) == RESULT_OK)
        say_ready("modbus-tcp", m->tcp_address, port);
    if (result == RESULT_OK && m->rtu_path &&
        (result = slave_open_terminal(&m->rtu, m->rtu_path, err)) == RESULT_OK)
        say_ready("modbus-rtu", m->rtu_path, 0);
    if (result == RESULT_OK && m->tracker_address &&
        (result = socket_listen(m->tracker_address, &m->tracker.listener, &port, err)) == RESULT_OK)
        say_ready("tracker", m->tracker_address, port);
    if (result != RESULT_OK)
        return result;
    m->player.start_ns = clock_now_ns();
    if (m->tcp_address)
        start_thread(m, slave_run, &m->tcp);
    if (m->rtu_path)
        start_thread(m, slave_run, &m->rtu);
    if (m->tracker_address)
        start_thread(m, tracker_server_run, &m->tracker);
    fflush(stdout);
    return result;
}

static void stop(struct mockup *m) {
    atomic_store(&m->stop, true);
    for (int i = 0; i < m->thread_count; i++)
        pthread_join(m->threads[i], NULL);
    if (m->tcp.line)
        slave_close(&m->tcp);
    if (m->rtu.line)
        slave_close(&m->rtu);
    if (m->tracker.listener >= 0)
        close(m->tracker.listener);
    recording_fini(&m->player.recording);
}

static enum result run(struct mockup *m, const sigset_t *endings, struct error *err) {
    int signal;
    enum result result =
        recording_read(m->motion ? m->motion : m->recording, m->tool, &m->player.recording, err);
    if (result == RESULT_OK)
        result = start(m, err);
    if (result == RESULT_OK)
        sigwait(endings, &signal);
    stop(m);
    return result;
}

int main(int argc, char **argv) {
    static struct mockup m = {.tool = CHANNEL_COUNT};
    struct slave slave = {.player = &m.player, .stop = &m.stop, .update_hz = 200, .number = 1};
    m.tcp = m.rtu = slave;
    m.tracker = (struct tracker_server){.player = &m.player,
                                        .stop = &m.stop,
                                        .type = MESSAGE_TDATA,
                                        .header_version = 2,
                                        .T_tracker_mockup = pose_identity(),
                                        .listener = -1};
    for (int i = 0; i < CHANNEL_COUNT; i++)
        m.tracker.T_tool_tip[i] = pose_identity();
    parse_options(&m, argc, argv);

    sigset_t endings;
    sigemptyset(&endings);
    sigaddset(&endings, SIGINT);
    sigaddset(&endings, SIGTERM);
    pthread_sigmask(SIG_BLOCK, &endings, NULL);
    struct error err;
    if (run(&m, &endings, &err) != RESULT_OK) {
        log_error("mockup", "%s", err.text);
        return 1;
    }
    return 0;
}
