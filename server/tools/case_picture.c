#include "base/number.h"
#include "case_commands.h"
#include "report/anatomy.h"

#include <getopt.h>
#include <stdio.h>
#include <string.h>

#define WIDTH 640
#define HEIGHT 480

static const char picture_help[] =
    "Usage: arthron-case picture DIR --out FILE.png [OPTION...]\n"
    "\n"
    "Draws a case: the patient's bones, menisci and ligaments, and on the menisci the tear\n"
    "(dark red), damaged tissue (orange) and the planned resection (yellow). 640x480 pixels.\n"
    "\n"
    "  --out FILE         write the picture here (PNG)\n"
    "  --view VIEW        front (default), back, medial, lateral or top\n"
    "  --flexion DEGREES  0 to 140 (default: 0)\n"
    "  --groups A,B,...   the groups to show (default: all but the skin; from the top only the\n"
    "                     tibia and the menisci)\n";

struct settings {
    const char *out, *groups;
    struct anatomy_view view;
};

static enum result choose(struct knee_case *knee, struct settings *settings, struct error *err) {
    char name[CASE_NAME_MAX];
    if (!settings->groups) {
        anatomy_choose(knee, settings->view.view, settings->view.shown);
        return RESULT_OK;
    }
    for (const char *at = settings->groups;; at++) {
        size_t length = strcspn(at, ",");
        snprintf(name, sizeof name, "%.*s", (int)length, at);
        const struct case_group *group = case_group(knee, name);
        if (!group || length >= sizeof name)
            return fail(err, RESULT_MISSING, "no such group: \"%s\"", name);
        settings->view.shown[group - knee->groups] = true;
        at += length;
        if (!*at)
            return RESULT_OK;
    }
}

static enum result draw(const char *dir, struct settings *settings, struct error *err) {
    struct knee_case *knee;
    enum result result = case_load(dir, NULL, &knee, err);
    if (result != RESULT_OK)
        return result;
    struct picture picture = {0};
    result = choose(knee, settings, err);
    if (result == RESULT_OK)
        result = anatomy_picture(knee, &settings->view, WIDTH, HEIGHT, &picture, err);
    if (result == RESULT_OK)
        result = picture_write(&picture, settings->out, err);
    picture_fini(&picture);
    case_destroy(&knee);
    return result;
}

static bool parse_option(int option, struct settings *settings) {
    switch (option) {
    case 'o':
        settings->out = optarg;
        return true;
    case 'v':
        return true;
    case 'f':
        return number_double(optarg, 0, 140, &settings->view.flexion_deg);
    default:
        settings->groups = optarg;
        return true;
    }
}

int command_picture(int argc, char **argv) {
    static const struct option options[] = {
        {"out", required_argument, NULL, 'o'},     {"view", required_argument, NULL, 'v'},
        {"flexion", required_argument, NULL, 'f'}, {"groups", required_argument, NULL, 'g'},
        {"help", no_argument, NULL, 'h'},          {0},
    };
    static const char *const views[] = {"front", "back", "medial", "lateral", "top", NULL};
    struct settings settings = {0};
    struct error err;
    int option, index = 0;
    while ((option = getopt_long(argc, argv, "", options, &index)) != -1) {
        if (option == 'h') {
            fputs(picture_help, stdout);
            return EXIT_OK;
        }
        if (option == '?')
            return EXIT_USAGE;
        if (option == 'v' && !viewpoint_from_name(optarg, &settings.view.view))
            return unknown_choice("picture", "--view", optarg, views);
        if (!parse_option(option, &settings))
            return usage_error("picture", "--%s %s: must be from 0 to 140", options[index].name,
                               optarg);
    }
    if (optind + 1 != argc)
        return usage_error("picture", "one case folder is needed");
    if (!settings.out)
        return usage_error("picture", "--out is needed");
    return draw(argv[optind], &settings, &err) == RESULT_OK ? EXIT_OK : failed("picture", &err);
}
