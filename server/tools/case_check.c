#include "case/inspect.h"
#include "case_commands.h"

#include <getopt.h>
#include <jansson.h>
#include <stdio.h>

static const char help[] =
    "Usage: arthron-case check DIR [--json]\n"
    "\n"
    "Loads a case as a server does and looks at its structure, units and places: sizes of a knee,\n"
    "closed and oriented surfaces, displacements below 30 mm, portals on the skin, bones and\n"
    "menisci where side and frame say, what a whole resection leaves (maxcut) inside the meniscus\n"
    "and without folds, and how much may be cut. Exit status 1 where there is a fault; warnings\n"
    "and notes do not fail.\n";

static const char *level_name(enum finding_level level) {
    static const char *const names[] = {
        [FINDING_NOTE] = "note", [FINDING_WARNING] = "warning", [FINDING_FAULT] = "fault"};
    return names[level];
}

static int print_text(const char *dir, const struct inspection *inspection) {
    for (int i = 0; i < inspection->count; i++) {
        const struct finding *finding = &inspection->findings[i];
        printf("%s: %s: %s\n", level_name(finding->level), finding->where, finding->text);
    }
    printf("%s: %s\n", dir, inspection->faults ? "unfit" : "fit");
    return inspection->faults ? EXIT_FAULT : EXIT_OK;
}

static int print_json(const char *dir, const struct inspection *inspection) {
    json_t *findings = json_array();
    for (int i = 0; i < inspection->count; i++) {
        const struct finding *finding = &inspection->findings[i];
        json_array_append_new(findings,
                              json_pack("{s:s, s:s, s:s}", "level", level_name(finding->level),
                                        "where", finding->where, "text", finding->text));
    }
    json_t *root = json_pack("{s:s, s:b, s:i, s:o}", "case", dir, "fit", !inspection->faults,
                             "faults", inspection->faults, "findings", findings);
    int bad = root ? json_dumpf(root, stdout, JSON_INDENT(2)) : -1;
    json_decref(root);
    puts("");
    return bad || inspection->faults ? EXIT_FAULT : EXIT_OK;
}

// A case that cannot be loaded has one fault: why.
static void inspect_folder(const char *dir, struct inspection *out_inspection) {
    struct knee_case *knee;
    struct error err;
    if (case_load(dir, NULL, &knee, &err) != RESULT_OK) {
        *out_inspection = (struct inspection){.count = 1, .faults = 1};
        struct finding *finding = &out_inspection->findings[0];
        finding->level = FINDING_FAULT;
        snprintf(finding->where, sizeof finding->where, "files");
        snprintf(finding->text, sizeof finding->text, "%s", err.text);
        return;
    }
    inspect_case(knee, out_inspection);
    case_destroy(&knee);
}

int command_check(int argc, char **argv) {
    static const struct option options[] = {
        {"json", no_argument, NULL, 'j'}, {"help", no_argument, NULL, 'h'}, {0}};
    bool json = false;
    int option;
    while ((option = getopt_long(argc, argv, "", options, NULL)) != -1) {
        if (option == 'h') {
            fputs(help, stdout);
            return EXIT_OK;
        }
        if (option != 'j')
            return EXIT_USAGE;
        json = true;
    }
    if (optind + 1 != argc)
        return usage_error("check", "one folder, please");
    static struct inspection inspection;
    inspect_folder(argv[optind], &inspection);
    return json ? print_json(argv[optind], &inspection) : print_text(argv[optind], &inspection);
}
