#include "task/tell.h"
#include "trace/player.h"
#include "trace_commands.h"

#include <stdio.h>

static const char help[] =
    "Usage: arthron-trace judge FILE --task TASK [--case DIR] [--json]\n"
    "\n"
    "Judges a recorded session by a task: goals, errors, time, verdict. The attempt begins with "
    "the\n"
    "session. TASK is an INI file (cases/tasks/probe-in-order.ini).\n"
    "\n"
    "  --task TASK   the task\n"
    "  --case DIR    the case (default: the trace's case)\n"
    "  --json        print one object\n"
    "\n"
    "Exit status: 0 passed, 1 not passed or the trace is not whole, 2 wrong arguments.\n";

struct judging {
    const struct site *site;
    struct attempt attempt;
};

static bool on_step(void *user, const struct trace_record *record) {
    struct judging *judging = user;
    if (record->input.kind == INPUT_RESET)
        attempt_init(&judging->attempt);
    attempt_step(&judging->attempt, judging->site, &record->output);
    return true;
}

static enum result play(struct trace_reader *reader, const struct site *site,
                        struct attempt *out_attempt, struct error *why) {
    struct judging judging = {.site = site};
    struct trace_player player = {.user = &judging, .step = on_step, .progress = show_progress};
    attempt_init(&judging.attempt);
    enum result end = trace_play(reader, &player, why);
    attempt_leave(&judging.attempt);
    *out_attempt = judging.attempt;
    return end;
}

static int judge(const char *file, const char *task_file, const char *case_dir, bool json) {
    struct task task;
    struct trace_reader *reader = NULL;
    struct scene *scene = NULL;
    struct site *site = NULL;
    struct attempt attempt;
    struct error err = {""};
    enum result end = RESULT_OK, result = task_load(task_file, &task, &err);
    if (result == RESULT_OK)
        result = trace_reader_create(file, &reader, &err);
    if (result == RESULT_OK)
        result = load_scene(reader, case_dir, &scene, &err);
    if (result == RESULT_OK) {
        const struct trace_header *header = trace_reader_header(reader);
        result =
            site_create(&task, scene, &header->settings.instruments, &header->optic, &site, &err);
    }
    if (result == RESULT_OK)
        end = play(reader, site, &attempt, &err);
    site_destroy(&site);
    scene_destroy(&scene);
    trace_reader_destroy(&reader);
    if (result != RESULT_OK)
        return failed("judge", &err);
    (json ? tell_json : tell_text)(&task, &attempt, end == RESULT_CLOSED ? "" : err.text);
    bool passed = end == RESULT_CLOSED && attempt_verdict(&attempt, &task) == VERDICT_PASSED;
    return passed ? EXIT_GOOD : EXIT_FAULT;
}

int command_judge(int argc, char **argv) {
    static const struct option options[] = {{"task", required_argument, NULL, 't'},
                                            {"case", required_argument, NULL, 'c'},
                                            {"json", no_argument, NULL, 'j'},
                                            {"help", no_argument, NULL, 'h'},
                                            {NULL, 0, NULL, 0}};
    const char *file, *task = NULL, *case_dir = NULL;
    bool json = false;
    for (int c; (c = getopt_long(argc, argv, "", options, NULL)) != -1;) {
        if (c == 'h')
            return fputs(help, stdout) < 0;
        if (c == 't')
            task = optarg;
        else if (c == 'c')
            case_dir = optarg;
        else if (c == 'j')
            json = true;
        else
            return usage_error(argv[0], "unknown option");
    }
    if (take_file(argc, argv, &file) != EXIT_GOOD)
        return EXIT_USAGE;
    if (!task)
        return usage_error(argv[0], "--task is needed");
    return judge(file, task, case_dir, json);
}
