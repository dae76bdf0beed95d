#include "tools/calibrate.h"

#include "base/argument.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/number.h"
#include "tools/tools.h"

#include <getopt.h>
#include <stdio.h>
#include <string.h>

static const char calibrate_help[] =
    "Usage: arthron-station calibrate tip --config FILE --device NAME --channel CHANNEL\n"
    "                                 [--seconds N] [--json]\n"
    "       arthron-station calibrate landmarks --config FILE --device NAME --channel CHANNEL\n"
    "                                 --points FILE [--json]\n"
    "       arthron-station calibrate encoder --config FILE --device NAME --key KEY\n"
    "                                 --at VALUE,VALUE,... [--json]\n"
    "       arthron-station calibrate delay --config FILE --channel CHANNEL [--seconds N] "
    "[--json]\n"
    "\n"
    "Writes the result, with date and residual, into the file that the config names\n"
    "(calibration = FILE in [station]). It refuses a poor result, and then writes nothing.\n"
    "\n"
    "tip        where a tool's tip is: turn the tool about its tip\n"
    "landmarks  where the tracker stands: touch known points of the mock-up, one after the other\n"
    "encoder    zero and scale of a register: bring the joint to known values\n"
    "delay      how late a tracker is: fix the tool to the bone that moves, and move the joint\n"
    "\n"
    "  -c, --config FILE      the station's config\n"
    "  -d, --device NAME      [device NAME] of the config\n"
    "  -C, --channel CHANNEL  the tool\n"
    "  -t, --seconds N        how long to turn or move it; 20\n"
    "  -p, --points FILE      [landmarks] NAME = x y z: mm, in the mock-up's frame\n"
    "  -k, --key KEY          flexion, varus, internal, shift, drawer, distraction\n"
    "  -a, --at VALUES        at which values it is read: degrees, or mm\n"
    "  -j, --json             print JSON\n"
    "      --help             show this\n";

typedef enum result calibrate_part(struct station_config *config,
                                   const struct calibrate_arguments *arguments,
                                   struct calibration_entry *out, json_t *report,
                                   struct error *err);

static const struct {
    const char *name, *usage;
    enum calibration_kind kind;
    calibrate_part *run;
} parts[] = {
    {"tip", "tip --config FILE --device NAME --channel CHANNEL", CALIBRATION_TIP, calibrate_tip},
    {"landmarks", "landmarks --config FILE --device NAME --channel CHANNEL --points FILE",
     CALIBRATION_REGISTRATION, calibrate_landmarks},
    {"encoder", "encoder --config FILE --device NAME --key KEY --at VALUE,VALUE,...",
     CALIBRATION_ENCODER, calibrate_encoder},
    {"delay", "delay --config FILE --channel CHANNEL", CALIBRATION_DELAY, calibrate_delay},
};

enum { PART_COUNT = sizeof parts / sizeof *parts };

static const char calibrate_command[] = "arthron-station calibrate";

static bool take_values(char *text, struct calibrate_arguments *out) {
    char *rest;
    for (char *word = strtok_r(text, ",", &rest); word; word = strtok_r(NULL, ",", &rest))
        if (out->value_count == CALIBRATE_VALUES_MAX ||
            !number_double(word, -1000, 1000, &out->values[out->value_count++]))
            return false;
    return out->value_count > 0;
}

static bool take_channel(const char *text, enum channel *out) {
    const char *names[CHANNEL_COUNT + 1] = {NULL};
    if (channel_from_name(text, out) && *out != CHANNEL_JOINT)
        return true;
    for (int i = CHANNEL_JOINT + 1; i < CHANNEL_COUNT; i++)
        names[i - CHANNEL_JOINT - 1] = channel_name((enum channel)i);
    argument_unknown(calibrate_command, "--channel", text, names);
    return false;
}

// False: refused, and said why.
static bool take_calibrate_option(int option, struct calibrate_arguments *out) {
    switch (option) {
    case 'c':
        out->config = optarg;
        return true;
    case 'd':
        out->device = optarg;
        return true;
    case 'C':
        out->channel_name = optarg;
        return true;
    case 't':
        return number_double(optarg, 0.1, 600, &out->seconds) ||
               !argument_wrong(calibrate_command, "--seconds %s: must be from 0.1 to 600", optarg);
    case 'p':
        out->points = optarg;
        return true;
    case 'k':
        out->key = optarg;
        return true;
    case 'a':
        return take_values(optarg, out) ||
               !argument_wrong(calibrate_command,
                               "--at: must be numbers from -1000 to 1000, separated by commas");
    case 'j':
        out->json = true;
        return true;
    default:
        return !argument_help(calibrate_command);
    }
}

static bool is_complete(const struct calibrate_arguments *a, enum calibration_kind kind) {
    bool needed[CALIBRATION_KIND_COUNT] = {
        [CALIBRATION_TIP] = a->channel_name,
        [CALIBRATION_REGISTRATION] = a->channel_name && a->points,
        [CALIBRATION_ENCODER] = a->key && a->value_count,
        [CALIBRATION_DELAY] = a->channel_name,
    };
    return a->config && (a->device || kind == CALIBRATION_DELAY) && needed[kind];
}

static void print(const struct calibration_entry *entry, json_t *report, bool json) {
    bool in_degrees = calibration_is_angle(entry) || entry->kind == CALIBRATION_DELAY;
    const char *unit = in_degrees ? "degrees" : "mm";
    json_object_set_new(report, "residual", json_real(entry->residual));
    if (!json) {
        printf("%s%s%s: residual %.2f %s; %s\n", entry->device, entry->of[0] ? " " : "", entry->of,
               entry->residual, unit, entry->details);
        const char *name;
        json_t *residual;
        json_object_foreach(json_object_get(report, "landmarks_mm"), name, residual)
            printf("  %-24s %6.2f mm\n", name, json_real_value(residual));
        return;
    }
    json_dumpf(report, stdout, JSON_COMPACT);
    putchar('\n');
}

static enum result keep(struct station_config *config, struct calibration_entry *entry,
                        struct error *err) {
    entry->utc_s = clock_utc_ns() / NS_PER_S;
    if (!calibration_put(&config->calibration, entry))
        return fail(err, RESULT_LIMIT, "%s: the file has no room for another part",
                    config->calibration_path);
    return calibration_write(config->calibration_path, &config->calibration, err);
}

static enum result calibrate(struct station_config *config, int part,
                             const struct calibrate_arguments *arguments, struct error *err) {
    struct calibration_entry entry = {.kind = parts[part].kind};
    if (!config->calibration_path[0])
        return fail(err, RESULT_MISSING,
                    "%s: [station] names no file for the result. Add calibration = FILE",
                    arguments->config);
    if (arguments->device && !setting_text(arguments->device, entry.device, sizeof entry.device))
        return fail(err, RESULT_INVALID, "%s: a device cannot have this name", arguments->device);
    json_t *report = json_object();
    enum result result = calibration_can_write(config->calibration_path, err);
    if (result == RESULT_OK)
        result = parts[part].run(config, arguments, &entry, report, err);
    if (result == RESULT_OK)
        result = keep(config, &entry, err);
    if (entry.details[0]) // measured, if perhaps not well enough
        print(&entry, report, arguments->json);
    json_decref(report);
    return result;
}

// The config names the instruments that it describes.
static int run_part(int part, struct calibrate_arguments *arguments) {
    struct station_config *config;
    struct error err;
    if (station_config_load(arguments->config, NULL, 0, &config, &err) != RESULT_OK) {
        log_error("station", "%s", err.text);
        return 2;
    }
    if (arguments->channel_name && !take_channel(arguments->channel_name, &arguments->channel)) {
        station_config_destroy(&config);
        return 2;
    }
    enum result result = calibrate(config, part, arguments, &err);
    station_config_destroy(&config);
    if (result != RESULT_OK)
        log_error("station", "%s", err.text);
    return result == RESULT_OK ? 0 : 1;
}

static int find_and_run(char **words, int count, struct calibrate_arguments *arguments) {
    const char *names[PART_COUNT + 1] = {NULL};
    if (count != 1)
        return argument_wrong(calibrate_command,
                              "one of tip, landmarks, encoder and delay is needed");
    for (int i = 0; i < PART_COUNT; i++) {
        names[i] = parts[i].name;
        if (strcmp(words[0], parts[i].name) != 0)
            continue;
        return is_complete(arguments, parts[i].kind)
                   ? run_part(i, arguments)
                   : argument_wrong(calibrate_command, "usage: %s", parts[i].usage);
    }
    return argument_unknown(calibrate_command, "part", words[0], names);
}

int tool_calibrate(int argc, char **argv) {
    static const struct option options[] = {
        {"config", required_argument, NULL, 'c'},  {"device", required_argument, NULL, 'd'},
        {"channel", required_argument, NULL, 'C'}, {"seconds", required_argument, NULL, 't'},
        {"points", required_argument, NULL, 'p'},  {"key", required_argument, NULL, 'k'},
        {"at", required_argument, NULL, 'a'},      {"json", no_argument, NULL, 'j'},
        {"help", no_argument, NULL, 'h'},          {0},
    };
    struct calibrate_arguments arguments = {.channel = CHANNEL_COUNT, .seconds = 20};
    bool good = true;
    for (int o; good && (o = getopt_long(argc, argv, "c:d:C:t:p:k:a:j", options, NULL)) != -1;) {
        if (o == 'h') {
            fputs(calibrate_help, stdout);
            return 0;
        }
        good = take_calibrate_option(o, &arguments);
    }
    if (good && arguments.channel_name && !arguments.config)
        good = take_channel(arguments.channel_name, &arguments.channel);
    return good ? find_and_run(argv + optind, argc - optind, &arguments) : 2;
}
