#include "case_commands.h"
#include "rehearsal/rehearsal.h"
#include "task/tell.h"

#include <errno.h>
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char task_help[] =
    "Usage: arthron-case task check FILE --case DIR [OPTION...]\n"
    "\n"
    "Says whether a task can be done on a case: an expert's hands are planned from its goals,\n"
    "play in a session, and are judged as a trainee is. FILE is an INI file\n"
    "(cases/tasks/probe-in-order.ini); cases/README.md explains its keys.\n"
    "\n"
    "  --case DIR       the case\n"
    "  --novice SEED    play a novice's hands instead: slower, trembling, with detours\n"
    "  --motion FILE    write the motion of the hands here (CSV); arthron-mockup plays it\n"
    "  --json           print one object\n"
    "\n"
    "Exit status: 0 the hands pass, 1 they do not, 2 wrong arguments.\n";

struct task_request {
    const char *file, *dir, *motion;
    enum rehearsal_hands hands;
    long long seed;
    bool json;
};

static void progress(int done, int all) {
    fprintf(stderr, "arthron-case task: %d of %d goals\n", done, all);
}

// ---- the command --------------------------------------------------------------------------------

static int check(const struct task_request *request) {
    struct task task;
    struct knee_case *knee = NULL;
    struct scene *scene = NULL;
    struct rehearsal rehearsal = {.goal = -1};
    struct error err = {""};
    enum result result = task_load(request->file, &task, &err);
    if (result == RESULT_OK)
        result = rehearsal_load(request->dir, &knee, &scene, &err);
    if (result == RESULT_OK)
        result =
            rehearse(&task, knee, scene, request->hands, request->seed, progress, &rehearsal, &err);
    if (result == RESULT_OK && rehearsal.goal < 0)
        err.text[0] = '\0';
    if (result == RESULT_OK)
        (request->json ? tell_json : tell_text)(&task, &rehearsal.attempt, err.text);
    if (result == RESULT_OK && request->motion)
        result = write_motion(&rehearsal.motion, request->motion, &err);
    bool passed = attempt_verdict(&rehearsal.attempt, &task) == VERDICT_PASSED;
    rehearsal_fini(&rehearsal);
    scene_destroy(&scene);
    case_destroy(&knee);
    if (result != RESULT_OK)
        return failed("task", &err);
    return passed ? EXIT_OK : EXIT_FAULT;
}

static bool parse_seed(const char *text, long long *out_seed) {
    char *end;
    errno = 0;
    *out_seed = strtoll(text, &end, 10);
    return end != text && *end == '\0' && !errno && *out_seed >= 0 && *out_seed <= UINT32_MAX;
}

int command_task(int argc, char **argv) {
    static const struct option options[] = {
        {"case", required_argument, NULL, 'c'},   {"novice", required_argument, NULL, 'n'},
        {"motion", required_argument, NULL, 'm'}, {"json", no_argument, NULL, 'j'},
        {"help", no_argument, NULL, 'h'},         {0}};
    struct task_request request = {.hands = HANDS_EXPERT};
    for (int c; (c = getopt_long(argc, argv, "", options, NULL)) != -1;) {
        if (c == 'h')
            return fputs(task_help, stdout) < 0;
        if (c == 'c')
            request.dir = optarg;
        else if (c == 'm')
            request.motion = optarg;
        else if (c == 'j')
            request.json = true;
        else if (c != 'n')
            return EXIT_USAGE;
        else if (!parse_seed(optarg, &request.seed))
            return usage_error("task", "'%s': --novice takes a whole number from 0 to %u", optarg,
                               UINT32_MAX);
        else
            request.hands = HANDS_NOVICE;
    }
    if (optind + 2 != argc || strcmp(argv[optind], "check"))
        return usage_error("task", "'check' and one task are needed");
    if (!request.dir)
        return usage_error("task", "--case is needed");
    request.file = argv[optind + 1];
    return check(&request);
}
