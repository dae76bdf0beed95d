// arthron-mockup: an emulated knee mock-up. It plays a file in the protocols of the hardware.

#include "base/argument.h"
#include "base/check.h"
#include "base/clock.h"
#include "base/instrument.h"
#include "base/log.h"
#include "base/number.h"
#include "handle.h"
#include "handle_player.h"
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
    "Usage: arthron-mockup (--motion FILE | --recording FILE --tool NAME) [options]\n"
    "Emulates the hardware of a knee mock-up: plays a file in a loop, in the devices' protocols.\n"
    "\n"
    "  --motion FILE            motion file: joint, tools, handles\n"
    "  --recording FILE         recording of one tool, played as --tool NAME (probe, punch, ...)\n"
    "  --modbus-tcp HOST:PORT   be a Modbus TCP slave, or a gateway to --slaves\n"
    "  --modbus-rtu PATH        be Modbus RTU slaves; PATH becomes a link to their serial line\n"
    "  --line \"BAUD STOP\"       answer only on a line with this baud rate (9600 to 230400) and\n"
    "                           these stop bits (any)\n"
    "  --modbus-rate HZ         how often the registers change (200)\n"
    "  --slave N                the slave's number, or the first one's (1)\n"
    "  --slaves COUNT           how many slaves there are (1)\n"
    "  --order ORDER            of the bytes in registers: ABCD, CDAB, BADC, DCBA (ABCD)\n"
    "  --tracker HOST:PORT      be an OpenIGTLink tracker\n"
    "  --message TYPE           TRANSFORM, TDATA, POSITION or QTDATA (TDATA)\n"
    "  --when-asked             send only to clients that ask: TDATA or QTDATA from then on,\n"
    "                           TRANSFORM or POSITION once for each question\n"
    "  --header-version N       1, 2 or 3 (2)\n"
    "  --rate HZ                tracker frames a second, interpolated (each row at its own time)\n"
    "  --hid SERIAL             be an instrument handle (HID): the opening of the motion's punch\n"
    "                           or grasper; needs root\n"
    "  --hid-rate HZ            how often the handle reports (125)\n"
    "  --T-tracker-mockup POSE  where the mock-up stands before the tracker\n"
    "  --T-tool-tip NAME=POSE   where a tool's tip is in the tool\n"
    "  --faults FILE            what goes wrong, and when (station/mockup/README.md)\n"
    "  --help, --version\n"
    "\n"
    "POSE is \"x y z qw qx qy qz\" in mm. PORT 0 takes a free one. Each line on stdout is ready "
    "for\n"
    "use when it appears: \"modbus-tcp HOST:PORT\", \"modbus-rtu PATH\", \"tracker HOST:PORT\",\n"
    "\"hid VID:PID SERIAL\".\n";

struct mockup {
    struct player player;
    struct faults faults;
    atomic_bool stop;
    struct slave tcp, rtu;
    struct tracker_server tracker;
    struct handle_player hid;
    const char *motion, *recording, *tcp_address, *rtu_path, *tracker_address, *faults_path;
    enum channel tool;
    int thread_count;
    pthread_t threads[4];
};

// ---- options ------------------------------------------------------------------------------------

static bool parse_whole(const char *text, int low, int high, int *out) {
    int64_t value;
    if (!number_int(text, low, high, &value))
        return false;
    *out = (int)value;
    return true;
}

static const char *const message_names[] = {"TRANSFORM", "TDATA", "POSITION", "QTDATA", NULL};

static bool parse_message(const char *text, enum message_type *out) {
    for (int i = 0; message_names[i]; i++)
        if (!strcmp(text, message_names[i])) {
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

enum option_code {
    MOTION = 256,
    RECORDING,
    TOOL,
    MODBUS_TCP,
    MODBUS_RTU,
    MODBUS_RATE,
    SLAVE,
    SLAVES,
    LINE,
    ORDER,
    TRACKER,
    MESSAGE,
    WHEN_ASKED,
    HEADER_VERSION,
    RATE,
    HID,
    HID_RATE,
    T_TRACKER_MOCKUP,
    T_TOOL_TIP,
    FAULTS,
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
    {"slaves", required_argument, NULL, SLAVES},
    {"line", required_argument, NULL, LINE},
    {"order", required_argument, NULL, ORDER},
    {"tracker", required_argument, NULL, TRACKER},
    {"message", required_argument, NULL, MESSAGE},
    {"when-asked", no_argument, NULL, WHEN_ASKED},
    {"header-version", required_argument, NULL, HEADER_VERSION},
    {"rate", required_argument, NULL, RATE},
    {"hid", required_argument, NULL, HID},
    {"hid-rate", required_argument, NULL, HID_RATE},
    {"T-tracker-mockup", required_argument, NULL, T_TRACKER_MOCKUP},
    {"T-tool-tip", required_argument, NULL, T_TOOL_TIP},
    {"faults", required_argument, NULL, FAULTS},
    {"help", no_argument, NULL, HELP},
    {"version", no_argument, NULL, VERSION},
    {NULL, 0, NULL, 0},
};

static bool set_motion(struct mockup *m, int code, const char *text) {
    switch (code) {
    case MOTION:
        m->motion = text;
        return true;
    case RECORDING:
        m->recording = text;
        return true;
    case TOOL:
        return channel_from_name(text, &m->tool) && m->tool != CHANNEL_JOINT;
    case FAULTS:
        m->faults_path = text;
        return true;
    default:
        return false;
    }
}

// "19200 1"
static bool parse_line(const char *text, struct slave *slave) {
    char rest;
    return sscanf(text, "%d %d %c", &slave->baud, &slave->stop_bits, &rest) == 2 &&
           (slave->stop_bits == 1 || slave->stop_bits == 2) && slave_knows_baud(slave->baud);
}

static bool parse_order(const char *text, enum modbus_order *out) {
    for (int i = 0; i < MODBUS_ORDER_COUNT; i++)
        if (!strcmp(text, modbus_order_names[i])) {
            *out = (enum modbus_order)i;
            return true;
        }
    return false;
}

static bool set_slave(struct mockup *m, int code, const char *text) {
    switch (code) {
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
    case SLAVES:
        return parse_whole(text, 1, 247, &m->tcp.count) && parse_whole(text, 1, 247, &m->rtu.count);
    case LINE:
        return parse_line(text, &m->rtu);
    case ORDER:
        return parse_order(text, &m->tcp.order) && parse_order(text, &m->rtu.order);
    default:
        return false;
    }
}

static bool set_tracker(struct mockup *m, int code, const char *text) {
    switch (code) {
    case TRACKER:
        m->tracker_address = text;
        return true;
    case MESSAGE:
        return parse_message(text, &m->tracker.type);
    case WHEN_ASKED:
        m->tracker.when_asked = true;
        return true;
    case HEADER_VERSION:
        return parse_whole(text, 1, 3, &m->tracker.header_version);
    case RATE:
        return number_double(text, 1, 10000, &m->tracker.rate_hz);
    case T_TRACKER_MOCKUP:
        return number_pose(text, &m->tracker.T_tracker_mockup);
    case T_TOOL_TIP:
        return parse_tip(m, text);
    default:
        return false;
    }
}

static bool set_handle(struct mockup *m, int code, const char *text) {
    switch (code) {
    case HID:
        m->hid.serial = text;
        return *text && strlen(text) < 64;
    case HID_RATE:
        return number_double(text, 1, 10000, &m->hid.rate_hz);
    default:
        return false;
    }
}

static bool set_option(struct mockup *m, int code, const char *text) {
    return set_motion(m, code, text) || set_slave(m, code, text) || set_tracker(m, code, text) ||
           set_handle(m, code, text);
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
    if (m->tcp.number + m->tcp.count > 248)
        end_with_usage("--slave and --slaves: the last slave's number is above 247");
    if (m->motion && m->tool != CHANNEL_COUNT)
        end_with_usage("--tool goes with --recording");
    if (!m->tcp_address && !m->rtu_path && !m->tracker_address && !m->hid.serial)
        end_with_usage("one of --modbus-tcp, --modbus-rtu, --tracker and --hid is required");
}

_Noreturn static void end_with_unknown_tool(const char *text) {
    const char *names[CHANNEL_COUNT + 1] = {NULL};
    for (int i = CHANNEL_JOINT + 1; i < CHANNEL_COUNT; i++)
        names[i - CHANNEL_JOINT - 1] = channel_name((enum channel)i);
    exit(argument_unknown("arthron-mockup", "--tool", text, names));
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
                 optarg ? optarg : "");
        if (set_option(m, code, optarg))
            continue;
        if (code == MESSAGE)
            exit(argument_unknown("arthron-mockup", "--message", optarg, message_names));
        if (code == TOOL)
            end_with_unknown_tool(optarg);
        end_with_usage(text);
    }
    if (optind < argc)
        end_with_usage("takes options only");
    check_usage(m);
}

// ---- running ------------------------------------------------------------------------------------

static void start_thread(struct mockup *m, void *(*run)(void *), void *what) {
    NEED(pthread_create(&m->threads[m->thread_count++], NULL, run, what) == 0, "thread");
}

static enum result open_all(struct mockup *m, struct error *err) {
    enum result result = RESULT_OK;
    if (m->tcp_address && (result = slave_listen(&m->tcp, m->tcp_address, err)) == RESULT_OK)
        printf("modbus-tcp %s\n", m->tcp.address);
    if (result == RESULT_OK && m->rtu_path &&
        (result = slave_open_terminal(&m->rtu, m->rtu_path, err)) == RESULT_OK)
        printf("modbus-rtu %s\n", m->rtu_path);
    if (result == RESULT_OK && m->tracker_address &&
        (result = tracker_server_listen(&m->tracker, m->tracker_address, err)) == RESULT_OK)
        printf("tracker %s\n", m->tracker.address);
    if (result == RESULT_OK && m->hid.serial &&
        (result = handle_player_plug(&m->hid, err)) == RESULT_OK)
        printf("hid %04x:%04x %s\n", HANDLE_VID, HANDLE_PID, m->hid.serial);
    return result;
}

static void start(struct mockup *m) {
    m->player.start_ns = clock_now_ns();
    if (m->tcp_address)
        start_thread(m, slave_run, &m->tcp);
    if (m->rtu_path)
        start_thread(m, slave_run, &m->rtu);
    if (m->tracker_address)
        start_thread(m, tracker_server_run, &m->tracker);
    if (m->hid.serial)
        start_thread(m, handle_player_run, &m->hid);
    fflush(stdout);
}

static void stop(struct mockup *m) {
    atomic_store(&m->stop, true);
    for (int i = 0; i < m->thread_count; i++)
        pthread_join(m->threads[i], NULL);
    slave_close(&m->tcp);
    slave_close(&m->rtu);
    if (m->tracker.listener >= 0)
        close(m->tracker.listener);
    recording_fini(&m->player.recording);
}

// Tells of the faults' beginnings and ends until a signal comes.
static void wait_for(const struct mockup *m, const sigset_t *endings) {
    double told_s = -1;
    for (;;) {
        double now_s = player_seconds(&m->player, clock_now_ns());
        double wait_s = fmin(3600, faults_tell(&m->faults, told_s, now_s) - now_s);
        int64_t wait_ns = (int64_t)(wait_s * NS_PER_S);
        struct timespec wait = {wait_ns / NS_PER_S, wait_ns % NS_PER_S};
        told_s = now_s;
        if (sigtimedwait(endings, NULL, &wait) > 0)
            return;
    }
}

static enum result run(struct mockup *m, const sigset_t *endings, struct error *err) {
    enum result result =
        recording_read(m->motion ? m->motion : m->recording, m->tool, &m->player.recording, err);
    if (result == RESULT_OK && m->faults_path)
        result = faults_read(m->faults_path, &m->faults, err);
    if (result == RESULT_OK)
        result = open_all(m, err);
    if (result == RESULT_OK) {
        start(m);
        wait_for(m, endings);
    }
    stop(m);
    return result;
}

int main(int argc, char **argv) {
    static struct mockup m = {.tool = CHANNEL_COUNT};
    struct slave slave = {.player = &m.player,
                          .faults = &m.faults,
                          .stop = &m.stop,
                          .update_hz = 200,
                          .number = 1,
                          .count = 1};
    m.tcp = m.rtu = slave;
    m.tracker = (struct tracker_server){.player = &m.player,
                                        .faults = &m.faults,
                                        .stop = &m.stop,
                                        .type = MESSAGE_TDATA,
                                        .header_version = 2,
                                        .T_tracker_mockup = pose_identity(),
                                        .listener = -1};
    m.hid = (struct handle_player){
        .player = &m.player, .faults = &m.faults, .stop = &m.stop, .rate_hz = 125, .handle = -1};
    for (int i = 0; i < CHANNEL_COUNT; i++)
        m.tracker.T_tool_tip[i] = pose_identity();
    instruments_name_channels(instruments_of_hands());
    parse_options(&m, argc, argv);

    sigset_t endings;
    sigemptyset(&endings);
    sigaddset(&endings, SIGINT);
    sigaddset(&endings, SIGTERM);
    pthread_sigmask(SIG_BLOCK, &endings, NULL);
    signal(SIGPIPE, SIG_IGN); // a master that left
    struct error err;
    if (run(&m, &endings, &err) != RESULT_OK) {
        log_error("mockup", "%s", err.text);
        return 1;
    }
    return 0;
}
