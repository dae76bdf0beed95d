#include "case_commands.h"
#include "generate/maxcut.h"

#include <getopt.h>
#include <stdio.h>
#include <string.h>

static const char maxcut_help[] =
    "Usage: arthron-case maxcut DIR [--group NAME...] [--rim MM] [--out DIR]\n"
    "\n"
    "Makes the morph `maxcut` of menisci anew: the shape that the greatest resection leaves.\n"
    "The inner margin moves towards the capsule. The roots of the horns stay whole.\n"
    "\n"
    "  --group NAME     a cuttable group that is C-shaped from above (default: the menisci)\n"
    "  --rim MM         width of the rim that stays, 2 to 8 (default: 3.5). It gets wider where "
    "the\n"
    "                   meniscus is hollow at its rim\n"
    "  --out DIR        write the case here (default: DIR)\n";

struct maxcut_request {
    const char *dir, *out;
    double rim_mm;
    const char *groups[CASE_GROUPS_MAX];
    int group_count;
};

static enum result resect(struct knee_case *knee, const char *name, double rim_mm,
                          struct error *err) {
    struct case_group *group = case_group(knee, name);
    struct maxcut_report report;
    if (!group)
        return fail(err, RESULT_MISSING, "the case has no group %s", name);
    pose T_body_joint =
        group->body == BODY_TIBIA ? knee->joint.T_tibia_joint : knee->joint.T_femur_joint;
    enum result result = maxcut_make(group, T_body_joint, rim_mm, err);
    if (result == RESULT_OK)
        result = maxcut_inspect(group, &report, err);
    if (result == RESULT_OK)
        printf("%s: %.0f mm3, of which %.0f may go\n", name, report.whole_mm3,
               report.whole_mm3 - report.least_mm3);
    return result;
}

static enum result run_maxcut(struct knee_case *knee, const struct maxcut_request *request,
                              struct error *err) {
    enum result result = RESULT_OK;
    for (int i = 0; i < request->group_count && result == RESULT_OK; i++)
        result = resect(knee, request->groups[i], request->rim_mm, err);
    return result == RESULT_OK ? case_save(knee, request->out, err) : result;
}

static void take_menisci(struct knee_case *knee, struct maxcut_request *request) {
    for (int i = 0; i < knee->group_count; i++)
        if (knee->groups[i].tissue.kind == TISSUE_MENISCUS)
            request->groups[request->group_count++] = knee->groups[i].name;
}

static int load_and_run(struct maxcut_request *request) {
    struct knee_case *knee;
    struct error err;
    if (case_load(request->dir, NULL, &knee, &err) != RESULT_OK)
        return failed("maxcut", &err);
    if (request->group_count == 0)
        take_menisci(knee, request);
    enum result result = request->group_count > 0
                             ? run_maxcut(knee, request, &err)
                             : fail(&err, RESULT_MISSING, "the case has no menisci");
    case_destroy(&knee);
    return result == RESULT_OK ? EXIT_OK : failed("maxcut", &err);
}

int command_maxcut(int argc, char **argv) {
    static const struct option options[] = {{"group", required_argument, NULL, 'g'},
                                            {"rim", required_argument, NULL, 'r'},
                                            {"out", required_argument, NULL, 'o'},
                                            {"help", no_argument, NULL, 'h'},
                                            {0}};
    struct maxcut_request request = {.rim_mm = MAXCUT_RIM_MM};
    int option;
    while ((option = getopt_long(argc, argv, "", options, NULL)) != -1) {
        switch (option) {
        case 'h':
            fputs(maxcut_help, stdout);
            return EXIT_OK;
        case 'g':
            if (request.group_count == CASE_GROUPS_MAX)
                return usage_error("maxcut", "more than %d times --group", CASE_GROUPS_MAX);
            request.groups[request.group_count++] = optarg;
            break;
        case 'r':
            if (!parse_numbers(optarg, &request.rim_mm, 1) ||
                request.rim_mm < MAXCUT_RIM_LEAST_MM || request.rim_mm > MAXCUT_RIM_MOST_MM)
                return usage_error("maxcut", "--rim %s: not a number from 2 to 8", optarg);
            break;
        case 'o':
            request.out = optarg;
            break;
        default:
            return EXIT_USAGE;
        }
    }
    if (optind + 1 != argc)
        return usage_error("maxcut", "one case folder is needed");
    request.dir = argv[optind];
    if (!request.out)
        request.out = request.dir;
    return load_and_run(&request);
}
