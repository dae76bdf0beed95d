#include "base/argument.h"
#include "base/log.h"
#include "base/number.h"
#include "loop/loop.h"
#include "tools/tools.h"

#include <getopt.h>
#include <signal.h>
#include <stdio.h>

#define OVERRIDES_MAX 32

static const char run_help[] =
    "Usage: arthron-station run --config FILE [--set SECTION.KEY=VALUE ...] [--live] [--json]\n"
    "\n"
    "Reads the mock-up's devices and sends their values to the server, until SIGTERM or SIGINT.\n"
    "\n"
    "  -c, --config FILE            the config (docs/CONFIG.md)\n"
    "  -s, --set SECTION.KEY=VALUE  replaces a value of the config\n"
    "  -t, --seconds N              ends after N seconds\n"
    "  -l, --live                   prints a line each second: poses, round trip, warp, "
    "unanswered\n"
    "                               poses\n"
    "  -j, --json                   prints one line of JSON at the end\n"
    "  -v, --verbose                logs more\n"
    "      --help                   show this\n";

struct run_arguments {
    const char *config;
    struct setting_override overrides[OVERRIDES_MAX];
    int override_count;
    struct loop_options loop;
};

static const char run_command[] = "arthron-station run";

static volatile sig_atomic_t stop;

static void on_signal(int signal_number) {
    (void)signal_number;
    stop = 1;
}

// False: refused, and said why.
static bool take_run_option(struct run_arguments *out, int option) {
    switch (option) {
    case 'c':
        out->config = optarg;
        return true;
    case 's':
        if (out->override_count == OVERRIDES_MAX)
            return !argument_wrong(run_command, "--set: at most %d values", OVERRIDES_MAX);
        return setting_split(optarg, &out->overrides[out->override_count++]) ||
               !argument_wrong(run_command, "--set %s: must be SECTION.KEY=VALUE", optarg);
    case 't':
        return number_double(optarg, 0.001, 1e9, &out->loop.seconds) ||
               !argument_wrong(run_command, "--seconds %s: must be from 0.001 to 1e9", optarg);
    case 'l':
        out->loop.live = true;
        return true;
    case 'j':
        out->loop.json = true;
        return true;
    case 'v':
        log_set_level(LOG_DEBUG);
        return true;
    default:
        return !argument_help(run_command);
    }
}

static enum result load(const struct run_arguments *arguments, struct station_config **out_config,
                        struct error *err) {
    enum result result = station_config_load(arguments->config, arguments->overrides,
                                             arguments->override_count, out_config, err);
    if (result != RESULT_OK)
        return result;
    result = station_config_calibrate(*out_config, err);
    if (result != RESULT_OK)
        station_config_destroy(out_config);
    return result;
}

static int run_station(const struct run_arguments *arguments) {
    struct station_config *config;
    struct error err;
    if (load(arguments, &config, &err) != RESULT_OK) {
        log_error("station", "%s", err.text);
        return 2;
    }
    struct sigaction action = {.sa_handler = on_signal};
    sigaction(SIGTERM, &action, NULL);
    sigaction(SIGINT, &action, NULL);
    signal(SIGPIPE, SIG_IGN);
    log_limit_lines();
    enum result result = loop_run(config, &arguments->loop, &stop, &err);
    station_config_destroy(&config);
    if (result == RESULT_OK)
        return 0;
    log_error("station", "%s", err.text);
    return result == RESULT_INVALID ? 2 : 1;
}

int tool_run(int argc, char **argv) {
    static const struct option options[] = {
        {"config", required_argument, NULL, 'c'},  {"set", required_argument, NULL, 's'},
        {"seconds", required_argument, NULL, 't'}, {"live", no_argument, NULL, 'l'},
        {"json", no_argument, NULL, 'j'},          {"verbose", no_argument, NULL, 'v'},
        {"help", no_argument, NULL, 'h'},          {0},
    };
    struct run_arguments arguments = {0};
    for (int o; (o = getopt_long(argc, argv, "c:s:t:ljv", options, NULL)) != -1;) {
        if (o == 'h') {
            fputs(run_help, stdout);
            return 0;
        }
        if (!take_run_option(&arguments, o))
            return 2;
    }
    if (optind != argc)
        return argument_wrong(run_command, "takes no %s", argv[optind]);
    if (!arguments.config)
        return argument_wrong(run_command, "--config is required");
    return run_station(&arguments);
}
