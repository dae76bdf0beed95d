#include "tools/probe.h"

#include "base/argument.h"
#include "base/check.h"
#include "base/log.h"
#include "base/number.h"
#include "tools/tools.h"

#include <getopt.h>
#include <stdlib.h>

#define LINES_MAX 16

static const char probe_help[] =
    "Usage: arthron-station probe [--modbus LINE ...] [--tracker HOST:PORT ...] [--json]\n"
    "\n"
    "Lists devices with live values and prints a config for them. Complete that config and save "
    "it.\n"
    "HID devices need no option: all that are plugged in are listed.\n"
    "\n"
    "  -m, --modbus LINE        HOST:PORT, or a serial line as /dev/ttyUSB0, whose settings are "
    "tried\n"
    "  -n, --slaves N           tries slaves 1 to N; 1, on a serial line 4\n"
    "  -t, --tracker HOST:PORT  an OpenIGTLink server; listens to it for two seconds\n"
    "  -j, --json               print JSON: values, and the config as a text\n"
    "      --help               show this\n";

static const char probe_command[] = "arthron-station probe";

struct probe_arguments {
    int modbus_count, tracker_count, slaves; // slaves 0: as suits the line
    const char *modbus[LINES_MAX], *trackers[LINES_MAX];
    bool json;
};

struct found {
    json_t *modbus, *trackers, *hid;
    FILE *config;
    char *text;
    size_t size;
    int failures;
};

static void note(struct found *found, enum result result, const struct error *err) {
    if (result == RESULT_OK)
        return;
    log_warning("probe", "%s", err->text);
    found->failures++;
}

static void probe_all(const struct probe_arguments *a, struct found *found) {
    struct error err;
    fputs("; Proposed by arthron-station probe.\n"
          "[station]\nname = room-1\nserver = server.example.org:4810\nkeys = keys\n"
          "calibration = calibration.ini\n",
          found->config);
    for (int i = 0; i < a->modbus_count; i++) {
        int slaves = a->slaves ? a->slaves : a->modbus[i][0] == '/' ? 4 : 1;
        note(found, probe_modbus(a->modbus[i], slaves, found->config, found->modbus, &err), &err);
    }
    for (int i = 0; i < a->tracker_count; i++)
        note(found, probe_tracker(a->trackers[i], 2, found->config, found->trackers, &err), &err);
    probe_hid(found->config, found->hid);
}

static int run_probe(const struct probe_arguments *arguments) {
    struct found found = {.modbus = json_array(), .trackers = json_array(), .hid = json_array()};
    found.config = open_memstream(&found.text, &found.size);
    CHECK(found.config);
    probe_all(arguments, &found);
    fclose(found.config);
    json_t *whole = json_pack("{s:o, s:o, s:o, s:s}", "modbus", found.modbus, "trackers",
                              found.trackers, "hid", found.hid, "config", found.text);
    if (arguments->json) {
        json_dumpf(whole, stdout, JSON_COMPACT);
        putchar('\n');
    } else {
        fputs(found.text, stdout);
    }
    json_decref(whole);
    free(found.text);
    return found.failures ? 1 : 0;
}

// False: refused, and said why.
static bool take_probe_option(int option, struct probe_arguments *out) {
    int64_t slaves;
    switch (option) {
    case 'm':
        if (out->modbus_count == LINES_MAX)
            return !argument_wrong(probe_command, "--modbus: at most %d lines", LINES_MAX);
        out->modbus[out->modbus_count++] = optarg;
        return true;
    case 't':
        if (out->tracker_count == LINES_MAX)
            return !argument_wrong(probe_command, "--tracker: at most %d trackers", LINES_MAX);
        out->trackers[out->tracker_count++] = optarg;
        return true;
    case 'n':
        if (!number_int(optarg, 1, 247, &slaves))
            return !argument_wrong(probe_command, "--slaves %s: must be from 1 to 247", optarg);
        out->slaves = (int)slaves;
        return true;
    case 'j':
        out->json = true;
        return true;
    default:
        return !argument_help(probe_command);
    }
}

int tool_probe(int argc, char **argv) {
    static const struct option options[] = {
        {"modbus", required_argument, NULL, 'm'},  {"slaves", required_argument, NULL, 'n'},
        {"tracker", required_argument, NULL, 't'}, {"json", no_argument, NULL, 'j'},
        {"help", no_argument, NULL, 'h'},          {0},
    };
    struct probe_arguments arguments = {0};
    bool good = true;
    for (int o; good && (o = getopt_long(argc, argv, "m:n:t:j", options, NULL)) != -1;) {
        if (o == 'h') {
            fputs(probe_help, stdout);
            return 0;
        }
        good = take_probe_option(o, &arguments);
    }
    if (!good)
        return 2;
    if (optind != argc)
        return argument_wrong(probe_command, "takes no %s", argv[optind]);
    return run_probe(&arguments);
}
