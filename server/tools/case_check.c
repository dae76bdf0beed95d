#include "base/clock.h"
#include "case_check_report.h"
#include "case_commands.h"
#include "check/verdict.h"

#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char check_help[] =
    "Usage: arthron-case check DIR [--quick] [--report FILE.html] [--dry-run] [--json]\n"
    "\n"
    "Grades a case before a trainee meets it: fit, fit with warnings, or unfit. A server\n"
    "refuses an unfit case. The check examines structure, units and places, what overlaps and\n"
    "what does not touch over flexion, sizes against anatomy's bounds, portals and landmarks.\n"
    "Then it walks the space that a tip can reach, at flexions from 0 to 120 degrees and in the\n"
    "key poses of torn ligaments. It finds where the field folds or jumps, its largest gain,\n"
    "whether a touch is felt where it is seen, and whether facing surfaces are displaced into\n"
    "each other. Between a tissue's surface and its maxcut, where cuts leave it, the surface\n"
    "must not cross itself, and folds are told. A check takes minutes, and says how many are "
    "left.\n"
    "\n"
    "  --quick        a grid of 1 mm instead of 0.5, at fewer poses\n"
    "  --report FILE  write a page with sections through the joint, coloured by gain\n"
    "  --dry-run      do not write check.json, which a server reads, into DIR\n"
    "  --json         print what check.json holds\n"
    "\n"
    "check.json holds the hash of the case's files. After a change of these files the case\n"
    "counts as not checked. The exit status is 1 where the case is unfit.\n";

#define PROGRESS_EVERY_NS (10 * NS_PER_S)
#define SHARE_TOLD 0.05 // of less the time that is left cannot be told

struct watch {
    int64_t begin_ns, next_ns;
};

struct wanted {
    struct check_settings settings;
    const char *dir, *report;
    bool quick, json, dry_run;
};

// A line now and then, of a check that takes long.
static void print_progress(void *context, const char *where, double share) {
    struct watch *p = context;
    int64_t now_ns = clock_now_ns();
    if (now_ns < p->next_ns || share >= 1)
        return;
    double left_s = (double)(now_ns - p->begin_ns) / NS_PER_S * (1 - share) / share;
    p->next_ns = now_ns + PROGRESS_EVERY_NS;
    fprintf(stderr, "arthron-case check: %.0f %% done", 100 * share);
    if (share > SHARE_TOLD)
        fprintf(stderr, ", about %.0f %s left", left_s < 90 ? left_s : left_s / 60,
                left_s < 90 ? "s" : "min");
    fprintf(stderr, " (%s)\n", where);
}

static void print_check(const char *dir, const struct case_check *check) {
    static const char *const levels[] = {
        [FINDING_NOTE] = "note", [FINDING_WARNING] = "warning", [FINDING_FAULT] = "fault"};
    for (int i = 0; i < check->findings.count; i++) {
        const struct check_finding *finding = &check->findings.findings[i];
        printf("%s: %s: %s\n", levels[finding->level], finding->where, finding->text);
    }
    if (check->findings.left_out)
        printf("and %d more\n", check->findings.left_out);
    printf("%s: %s\n", dir, grade_name(check->grade));
}

static void print(const struct wanted *wanted, const struct case_check *check, int64_t utc_s) {
    if (!wanted->json) {
        print_check(wanted->dir, check);
        return;
    }
    char *text = verdict_text(check, utc_s);
    puts(text);
    free(text);
}

// What was found stands, whether it can be kept or not.
static int keep(const struct wanted *wanted, const struct case_check *check,
                const struct scene *scene, int64_t utc_s) {
    struct error err;
    int status = check->grade == GRADE_UNFIT ? EXIT_FAULT : EXIT_OK;
    if (!wanted->dry_run && scene && verdict_save(check, utc_s, wanted->dir, &err) != RESULT_OK)
        fprintf(stderr, "arthron-case check: not kept for servers: %s\n", err.text);
    if (wanted->report && check_report(check, scene, wanted->report, &err) != RESULT_OK)
        status = failed("check", &err);
    return status;
}

static int check_folder(const struct wanted *wanted) {
    struct knee_case *knee;
    struct scene *scene = NULL;
    struct case_check *check;
    struct error err;
    if (case_load(wanted->dir, NULL, &knee, &err) != RESULT_OK)
        check = check_of_none(wanted->dir, &wanted->settings, &err);
    else if (check_case(&knee, &wanted->settings, &check, &scene, &err) != RESULT_OK)
        return failed("check", &err);
    int64_t utc_s = clock_utc_ns() / NS_PER_S;
    print(wanted, check, utc_s);
    int status = keep(wanted, check, scene, utc_s);
    scene_destroy(&scene);
    check_destroy(&check);
    return status;
}

int command_check(int argc, char **argv) {
    static const struct option options[] = {
        {"quick", no_argument, NULL, 'q'},   {"report", required_argument, NULL, 'r'},
        {"dry-run", no_argument, NULL, 'd'}, {"json", no_argument, NULL, 'j'},
        {"help", no_argument, NULL, 'h'},    {0}};
    struct wanted wanted = {0};
    int option;
    while ((option = getopt_long(argc, argv, "", options, NULL)) != -1) {
        if (option == 'h') {
            fputs(check_help, stdout);
            return EXIT_OK;
        }
        if (option == '?')
            return EXIT_USAGE;
        wanted.report = option == 'r' ? optarg : wanted.report;
        wanted.quick |= option == 'q';
        wanted.dry_run |= option == 'd';
        wanted.json |= option == 'j';
    }
    if (optind + 1 != argc)
        return usage_error("check", "one case folder is needed");
    wanted.dir = argv[optind];
    wanted.settings = check_settings_default(wanted.quick);
    struct watch watch = {clock_now_ns(), clock_now_ns() + PROGRESS_EVERY_NS};
    wanted.settings.progress = print_progress;
    wanted.settings.context = &watch;
    return check_folder(&wanted);
}
