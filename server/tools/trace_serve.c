#include "base/argument.h"
#include "base/clock.h"
#include "base/instrument.h"
#include "base/number.h"
#include "igtl/names.h"
#include "trace_commands.h"
#include "trace_serve_session.h"

#include <inttypes.h>
#include <jansson.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

static const char serve_help[] =
    "Usage: arthron-trace serve FILE [--listen ADDRESS] [--port N] [--speed X] [--loop]\n"
    "                                [--rate HZ] [--case DIR] [--json]\n"
    "\n"
    "Plays a session to programs that speak OpenIGTLink, as 3D Slicer, PLUS and pyigtl, at the\n"
    "pace at which it was recorded. They see what they would have seen of the station: poses as\n"
    "TRANSFORM, TDATA or QTDATA, the menisci as POLYDATA after each cut, the session's state as\n"
    "STATUS; events, attempts at tasks, remarks and markers as STRING (docs/OPENIGTLINK.md).\n"
    "Time stamps are those of the session.\n"
    "\n"
    "  --listen ADDRESS  an address of this machine (127.0.0.1). Whoever reaches it can read the\n"
    "                    session: there is neither a password nor encryption\n"
    "  --port N          a TCP port; 0: any free one (18944)\n"
    "  --speed X         X times as fast, 0.01 to 100 (1)\n"
    "  --rate HZ         at most so many sets of poses a second, 1 to 2000, for a client that\n"
    "                    does not ask otherwise (every one); 3D Slicer is well served by 60\n"
    "  --loop            begin again at the end, with time stamps that go on\n"
    "  --case DIR        the folder of the case, if it has moved. Without the case the menisci\n"
    "                    are left out, and the goals and errors of attempts\n"
    "  --json            print at the end what was served\n"
    "\n"
    "The session begins when the first client has connected. SIGTERM or Ctrl-C ends it. With "
    "--speed\n"
    "a program that cannot read as fast skips to the newest poses.\n"
    "\n"
    "  arthron-trace serve s.trace                          for programs on this machine\n"
    "  arthron-trace serve s.trace --loop --speed 0.5       again and again, half as fast\n"
    "  arthron-trace serve s.trace --listen 192.168.7.2     for programs in that network\n"
    "\n"
    "Exits 1 if the trace is not whole; everything that can be read was served.\n";

#define LONGEST_S 1e9 // of a session: what a trace says of its times may be anything

struct serving {
    struct export_request request;
    struct igtl_server_config config;
    double speed;
    bool loops, json;
    struct igtl_server *server;
    struct served_session *session;
    sigset_t ends; // signals, which nothing but sigtimedwait takes
    int64_t begun_ns;
    bool ended;
};

static bool waits(struct serving *s, int64_t left_ns) {
    struct timespec left = {left_ns / NS_PER_S, left_ns % NS_PER_S};
    s->ended |= sigtimedwait(&s->ends, NULL, &left) > 0;
    return !s->ended;
}

// A step that is late is due, too: then this looks for a signal only.
static bool wait_for_step(void *user, double seconds) {
    struct serving *s = user;
    double due_s = fmin(seconds / s->speed, LONGEST_S);
    int64_t due_ns = s->begun_ns + (int64_t)(due_s * (double)NS_PER_S);
    int64_t left_ns = due_ns - clock_now_ns();
    show_progress((uint64_t)(seconds * 1e3),
                  (uint64_t)(served_session_seconds(s->session) * 1e3) + 1);
    return waits(s, left_ns > 0 ? left_ns : 0);
}

static void print_counts(const struct serving *s, int port) {
    struct served_counts counts = served_session_counts(s->session);
    json_t *out =
        json_pack("{s:i, s:I, s:I, s:I, s:I}", "port", port, "rounds", (json_int_t)counts.rounds,
                  "pose_sets", (json_int_t)counts.sets, "strings", (json_int_t)counts.strings,
                  "meshes", (json_int_t)counts.meshes);
    json_dumpf(out, stdout, JSON_INDENT(2));
    putchar('\n');
    json_decref(out);
}

static enum result play_trace(struct serving *s, struct error *err) {
    enum result result = RESULT_OK;
    served_session_show(s->session, s->server);
    while (!igtl_server_clients(s->server) && waits(s, 20 * NS_PER_MS))
        ;
    do {
        s->begun_ns = clock_now_ns();
        if (!s->ended)
            result = served_session_play(s->session, s->server, wait_for_step, s, err);
    } while (s->loops && !s->ended && result == RESULT_OK);
    return result;
}

static enum result serve(struct serving *s, struct error *err) {
    enum result result = igtl_server_create(&s->config, &s->server, err);
    if (result != RESULT_OK)
        return result;
    int port = igtl_server_port(s->server);
    fprintf(stderr, "arthron-trace serve: %s, %.1f s, at %s port %d; waits for a client\n",
            served_session_header(s->session)->station, served_session_seconds(s->session),
            s->config.address, port);
    result = play_trace(s, err);
    igtl_server_destroy(&s->server);
    if (s->json)
        print_counts(s, port);
    return result == RESULT_OK ? served_session_end(s->session, err) : result;
}

static enum result load(struct serving *s, const char *case_dir, struct scene **out_scene,
                        struct error *err) {
    struct trace_reader *reader;
    enum result result = trace_reader_create(s->request.trace, &reader, err);
    if (result != RESULT_OK)
        return result;
    instruments_name_channels(&trace_reader_header(reader)->settings.instruments);
    result = load_scene_if_there("serve", reader, case_dir, "the menisci", out_scene, err);
    trace_reader_destroy(&reader);
    s->request.scene = *out_scene;
    if (result == RESULT_OK)
        result = served_session_create(&s->request, &s->session, err);
    s->request.progress = NULL; // of reading; from here on of the session's time
    return result;
}

static int run_serve(struct serving *s, const char *case_dir) {
    struct scene *scene = NULL;
    struct error err;
    enum result result = load(s, case_dir, &scene, &err);
    if (result == RESULT_OK) {
        sigemptyset(&s->ends);
        sigaddset(&s->ends, SIGTERM);
        sigaddset(&s->ends, SIGINT);
        pthread_sigmask(SIG_BLOCK, &s->ends, NULL);
        signal(SIGPIPE, SIG_IGN);
        result = serve(s, &err);
    }
    served_session_destroy(&s->session);
    scene_destroy(&scene);
    return result == RESULT_OK ? EXIT_GOOD : failed("serve", &err);
}

static bool parse_serve_option(int option, struct serving *s, const char **out_case_dir) {
    int64_t port;
    switch (option) {
    case 'a':
        return snprintf(s->config.address, sizeof s->config.address, "%s", optarg) <
               (int)sizeof s->config.address;
    case 'p':
        if (!number_int(optarg, 0, 65535, &port))
            return false;
        s->config.port = (int)port;
        return true;
    case 's':
        return number_double(optarg, 0.01, 100, &s->speed);
    case 'r':
        return number_double(optarg, 1, 2000, &s->config.rate_hz);
    case 'c':
        *out_case_dir = optarg;
        return true;
    default:
        s->loops |= option == 'l';
        s->json |= option == 'j';
        return option == 'l' || option == 'j';
    }
}

int command_serve(int argc, char **argv) {
    static const struct option options[] = {{"listen", required_argument, NULL, 'a'},
                                            {"port", required_argument, NULL, 'p'},
                                            {"speed", required_argument, NULL, 's'},
                                            {"case", required_argument, NULL, 'c'},
                                            {"rate", required_argument, NULL, 'r'},
                                            {"loop", no_argument, NULL, 'l'},
                                            {"json", no_argument, NULL, 'j'},
                                            {"help", no_argument, NULL, 'h'},
                                            {NULL, 0, NULL, 0}};
    struct serving s = {
        .request = {.from_s = -INFINITY, .to_s = INFINITY, .progress = show_progress},
        .config = {.address = "127.0.0.1", .port = IGTL_PORT, .device = IGTL_DEVICE},
        .speed = 1};
    const char *case_dir = NULL;
    for (int c; (c = getopt_long(argc, argv, "", options, NULL)) != -1;) {
        if (c == 'h')
            return fputs(serve_help, stdout) < 0;
        if (c == '?')
            return argument_help("arthron-trace serve");
        if (!parse_serve_option(c, &s, &case_dir))
            return usage_error(argv[0], "'%s' is out of range", optarg);
    }
    if (take_file(argc, argv, &s.request.trace) != EXIT_GOOD)
        return EXIT_USAGE;
    return run_serve(&s, case_dir);
}
