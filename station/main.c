#include "base/log.h"
#include "base/number.h"
#include "link/link.h"
#include "loop/loop.h"

#include <getopt.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>

#define OVERRIDES_MAX 32

static const char help[] =
    "Usage: arthron-station run --config FILE [--set SECTION.KEY=VALUE ...] [--live] [--json]\n"
    "       arthron-station enrol HOST:PORT CODE --name STATION --keys DIR\n"
    "\n"
    "Reads a mock-up's devices and sends what they say to the server.\n"
    "\n"
    "run    until SIGTERM or SIGINT\n"
    "  -c, --config FILE            the config (docs/CONFIG.md)\n"
    "  -s, --set SECTION.KEY=VALUE  a value instead of the config's\n"
    "  -t, --seconds N              end after N seconds\n"
    "  -l, --live                   a line each second: poses, round trip, warp, lost\n"
    "  -j, --json                   at the end one line of JSON\n"
    "  -v, --verbose                log more\n"
    "enrol  gets a certificate with a code of `arthron-server keys enrol`\n"
    "  -n, --name STATION           the station's name, as the code was made for\n"
    "  -k, --keys DIR               where key and certificate go\n"
    "\n"
    "      --help                   show this\n"
    "      --version                show the version\n";

struct arguments {
    const char *config, *name, *keys;
    struct setting_override overrides[OVERRIDES_MAX];
    int override_count;
    struct loop_options loop;
};

static volatile sig_atomic_t stop;

static void on_signal(int signal_number) {
    (void)signal_number;
    stop = 1;
}

// 'h', 'V': shown, end with 0; '?': wrong; 0: go on.
static int parse(int argc, char **argv, struct arguments *out) {
    static const struct option options[] = {
        {"config", required_argument, NULL, 'c'},
        {"set", required_argument, NULL, 's'},
        {"seconds", required_argument, NULL, 't'},
        {"live", no_argument, NULL, 'l'},
        {"json", no_argument, NULL, 'j'},
        {"verbose", no_argument, NULL, 'v'},
        {"name", required_argument, NULL, 'n'},
        {"keys", required_argument, NULL, 'k'},
        {"help", no_argument, NULL, 'h'},
        {"version", no_argument, NULL, 'V'},
        {0},
    };
    for (int o; (o = getopt_long(argc, argv, "c:s:t:ljvn:k:", options, NULL)) != -1;) {
        bool good = true;
        switch (o) {
        case 'c':
            out->config = optarg;
            break;
        case 's':
            good = out->override_count < OVERRIDES_MAX &&
                   setting_split(optarg, &out->overrides[out->override_count++]);
            break;
        case 't':
            good = number_double(optarg, 0.001, 1e9, &out->loop.seconds);
            break;
        case 'l':
            out->loop.live = true;
            break;
        case 'j':
            out->loop.json = true;
            break;
        case 'v':
            log_set_level(LOG_DEBUG);
            break;
        case 'n':
            out->name = optarg;
            break;
        case 'k':
            out->keys = optarg;
            break;
        default:
            return o;
        }
        if (!good)
            return '?';
    }
    return 0;
}

static int run(const struct arguments *arguments) {
    struct station_config *config;
    struct error err;
    if (station_config_load(arguments->config, arguments->overrides, arguments->override_count,
                            &config, &err) != RESULT_OK) {
        log_error("station", "%s", err.text);
        return 2;
    }
    struct sigaction action = {.sa_handler = on_signal};
    sigaction(SIGTERM, &action, NULL);
    sigaction(SIGINT, &action, NULL);
    signal(SIGPIPE, SIG_IGN);
    enum result result = loop_run(config, &arguments->loop, &stop, &err);
    station_config_destroy(&config);
    if (result == RESULT_OK)
        return 0;
    log_error("station", "%s", err.text);
    return result == RESULT_INVALID ? 2 : 1;
}

static int enrol(const struct arguments *arguments, const char *server, const char *code) {
    char host[256];
    int port;
    struct error err;
    if (!station_parse_server(server, host, sizeof host, &port)) {
        log_error("station", "%s is not HOST:PORT", server);
        return 2;
    }
    if (link_enrol(host, port, code, arguments->name, arguments->keys, &err) != RESULT_OK) {
        log_error("station", "%s", err.text);
        return 1;
    }
    log_info("station", "%s is enrolled; its key is in %s", arguments->name, arguments->keys);
    return 0;
}

int main(int argc, char **argv) {
    struct arguments arguments = {0};
    int problem = parse(argc, argv, &arguments);
    char **rest = argv + optind;
    int count = argc - optind;
    if (problem == 'h') {
        fputs(help, stdout);
        return 0;
    }
    if (problem == 'V') {
        puts("arthron-station " ARTHRON_VERSION);
        return 0;
    }
    if (!problem && count == 1 && !strcmp(rest[0], "run") && arguments.config)
        return run(&arguments);
    if (!problem && count == 3 && !strcmp(rest[0], "enrol") && arguments.name && arguments.keys)
        return enrol(&arguments, rest[1], rest[2]);
    fputs(help, stderr);
    return 2;
}
