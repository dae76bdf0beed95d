#include "case_commands.h"
#include "generate/deform.h"

#include <getopt.h>
#include <stdio.h>
#include <string.h>

#define CAVITIES_MAX 16

static const char deform_help[] =
    "Usage: arthron-case deform DIR --group NAME... --cavity X,Y,Z,RADIUS,DEPTH... --out DIR\n"
    "\n"
    "Adds cavities to the morph `warp`, which maps the mock-up's surface to the patient's.\n"
    "\n"
    "  --group NAME     the group to hollow out, with all its parts. The same map moves further\n"
    "                   groups: a meniscus sinks with its tibia\n"
    "  --cavity X,Y,Z,RADIUS,DEPTH\n"
    "                   in mm, in the frame of the femur at rest. The middle is the vertex of the\n"
    "                   first group that is nearest to X,Y,Z. It moves by DEPTH against the "
    "normal\n"
    "                   of the surface. Nothing moves beyond RADIUS, and between lies a smooth "
    "bump.\n"
    "                   DEPTH is at most half of RADIUS. Several cavities add up.\n"
    "  --out DIR        write the case here; it may be the same folder\n";

struct deform_request {
    const char *out;
    const char *groups[CASE_GROUPS_MAX];
    int group_count;
    struct deform_cavity cavities[CAVITIES_MAX];
    int cavity_count;
};

static bool parse_cavity(const char *text, struct deform_cavity *out_cavity) {
    double v[5];
    if (!parse_numbers(text, v, 5))
        return false;
    *out_cavity = (struct deform_cavity){{v[0], v[1], v[2]}, v[3], v[4]};
    return true;
}

static enum result deform(struct knee_case *knee, const struct deform_request *request,
                          struct error *err) {
    struct case_group *groups[CASE_GROUPS_MAX];
    for (int i = 0; i < request->group_count; i++) {
        groups[i] = case_group(knee, request->groups[i]);
        if (!groups[i])
            return fail(err, RESULT_MISSING, "--group %s: the case has no such group",
                        request->groups[i]);
    }
    for (int i = 0; i < request->cavity_count; i++) {
        struct deform_cavity cavity = request->cavities[i];
        cavity.refines = knee->has_scan;
        enum result result = deform_cavity_add(groups, request->group_count, &cavity, err);
        if (result != RESULT_OK)
            return result;
    }
    return case_save(knee, request->out, err);
}

static int run_deform(const char *dir, const struct deform_request *request) {
    struct knee_case *knee;
    struct error err;
    if (case_load(dir, NULL, &knee, &err) != RESULT_OK)
        return failed("deform", &err);
    enum result result = deform(knee, request, &err);
    case_destroy(&knee);
    return result == RESULT_OK ? EXIT_OK : failed("deform", &err);
}

int command_deform(int argc, char **argv) {
    static const struct option options[] = {{"group", required_argument, NULL, 'g'},
                                            {"cavity", required_argument, NULL, 'c'},
                                            {"out", required_argument, NULL, 'o'},
                                            {"help", no_argument, NULL, 'h'},
                                            {0}};
    struct deform_request request = {0};
    int option;
    while ((option = getopt_long(argc, argv, "", options, NULL)) != -1) {
        switch (option) {
        case 'h':
            fputs(deform_help, stdout);
            return EXIT_OK;
        case 'g':
            if (request.group_count == CASE_GROUPS_MAX)
                return usage_error("deform", "more than %d times --group", CASE_GROUPS_MAX);
            for (int i = 0; i < request.group_count; i++)
                if (strcmp(request.groups[i], optarg) == 0)
                    return usage_error("deform", "--group %s: given twice", optarg);
            request.groups[request.group_count++] = optarg;
            break;
        case 'c':
            if (request.cavity_count == CAVITIES_MAX)
                return usage_error("deform", "more than %d times --cavity", CAVITIES_MAX);
            if (!parse_cavity(optarg, &request.cavities[request.cavity_count++]))
                return usage_error("deform", "--cavity %s: not X,Y,Z,RADIUS,DEPTH", optarg);
            break;
        case 'o':
            request.out = optarg;
            break;
        default:
            return EXIT_USAGE;
        }
    }
    if (optind + 1 != argc)
        return usage_error("deform", "one case folder is needed");
    if (!request.group_count || !request.cavity_count || !request.out)
        return usage_error("deform", "--group, --cavity and --out are needed");
    return run_deform(argv[optind], &request);
}
