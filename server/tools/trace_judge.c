#include "judging/judging.h"
#include "task/tell.h"
#include "trace/player.h"
#include "trace_commands.h"

#include <jansson.h>
#include <stdio.h>

static const char judge_help[] =
    "Usage: arthron-trace judge FILE [--task TASK] [--case DIR] [--json]\n"
    "\n"
    "Judges a recorded session: goals, errors, time, verdict. Without --task, it judges each\n"
    "attempt that the trace holds, by the task that the trace holds, and says whether the verdict\n"
    "is the recorded one. With --task, one attempt begins with the session. TASK is an INI file\n"
    "(cases/tasks/probe-in-order.ini).\n"
    "\n"
    "  --task TASK   the task\n"
    "  --case DIR    the case (default: the trace's case)\n"
    "  --json        print one object; without --task, an array of them\n"
    "\n"
    "Exit status with --task: 0 passed, 1 not passed or the trace is not whole. Without: 0 each\n"
    "verdict is the recorded one, 1 one is not, or the trace is not whole. 2 wrong arguments.\n";

// ---- by a task ----------------------------------------------------------------------------------

struct by_task {
    const struct site *site;
    struct attempt attempt;
};

static bool on_judged_step(void *user, const struct trace_record *record) {
    struct by_task *judging = user;
    if (record->input.kind == INPUT_RESET)
        attempt_init(&judging->attempt);
    attempt_step(&judging->attempt, judging->site, &record->output);
    return true;
}

static enum result play_attempt(struct trace_reader *reader, const struct site *site,
                                struct attempt *out_attempt, struct error *why) {
    struct by_task judging = {.site = site};
    struct trace_player player = {
        .user = &judging, .step = on_judged_step, .progress = show_progress};
    attempt_init(&judging.attempt);
    enum result end = trace_play(reader, &player, why);
    attempt_leave(&judging.attempt, true);
    *out_attempt = judging.attempt;
    return end;
}

static int judge_by(const char *task_file, struct trace_reader *reader, const struct scene *scene,
                    bool json) {
    struct task task;
    struct site *site = NULL;
    struct attempt attempt;
    struct error err = {""};
    const struct trace_header *header = trace_reader_header(reader);
    enum result result = task_load(task_file, &task, &err);
    if (result == RESULT_OK)
        result =
            site_create(&task, scene, &header->settings.instruments, &header->optic, &site, &err);
    if (result != RESULT_OK)
        return failed("judge", &err);
    enum result end = play_attempt(reader, site, &attempt, &err);
    site_destroy(&site);
    (json ? tell_json : tell_text)(&task, &attempt, end == RESULT_CLOSED ? "" : err.text);
    bool passed = end == RESULT_CLOSED && attempt_verdict(&attempt, &task) == VERDICT_PASSED;
    return passed ? EXIT_GOOD : EXIT_FAULT;
}

// ---- what the trace holds -----------------------------------------------------------------------

struct held {
    json_t *all; // NULL: text
    int count, different;
};

// The task with the mark that the attempt was judged by.
static struct task marked(const struct judged_attempt *judged) {
    struct task task = judged->file->task;
    task.pass_time_s = judged->begun->pass_time_s;
    task.pass_errors = (int)judged->begun->pass_errors;
    return task;
}

static void add_json(struct held *held, const struct judged_attempt *judged, const char *recorded) {
    struct task task = marked(judged);
    json_t *one = tell_object(&task, &judged->attempt, "");
    json_object_update_new(one, json_pack("{s:i, s:s, s:s, s:I, s:I, s:i, s:s, s:b}", "number",
                                          (int)judged->begun->number, "purpose",
                                          attempt_purpose_name(judged->begun->purpose), "hand",
                                          attempt_hand_name(judged->begun->hand), "first_step",
                                          (json_int_t)judged->attempt.first_step, "last_step",
                                          (json_int_t)judged->attempt.last_step, "mark_version",
                                          (int)judged->begun->mark_version, "recorded", recorded,
                                          "same", judged->is_same));
    json_array_append_new(held->all, one);
}

static void print_one(const struct judged_attempt *judged, const char *recorded) {
    struct task task = marked(judged);
    printf("attempt %u, %s, scope in the %s hand, steps %llu to %llu; recorded: %s%s\n",
           judged->begun->number, attempt_purpose_name(judged->begun->purpose),
           attempt_hand_name(judged->begun->hand), (unsigned long long)judged->attempt.first_step,
           (unsigned long long)judged->attempt.last_step, recorded,
           judged->is_same ? "" : "; it is ANOTHER one here");
    tell_text(&task, &judged->attempt, "");
}

static void take(void *user, const struct judged_attempt *judged) {
    struct held *held = user;
    const char *recorded = judged->ended ? verdict_name(judged->ended->verdict) : "no end";
    held->count++;
    held->different += !judged->is_same;
    if (held->all)
        add_json(held, judged, recorded);
    else
        print_one(judged, recorded);
}

static int judge_held(struct trace_reader *reader, const struct scene *scene, bool json) {
    struct held held = {.all = json ? json_array() : NULL};
    struct attempt_taker taker = {.user = &held, .take = take, .progress = show_progress};
    struct error err = {""};
    enum result end = judge_trace(reader, scene, &taker, &err);
    if (json) {
        json_dumpf(held.all, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(6));
        putchar('\n');
        json_decref(held.all);
    } else if (!held.count) {
        puts("no attempt");
    }
    if (end != RESULT_CLOSED)
        return failed("judge", &err);
    return held.different ? EXIT_FAULT : EXIT_GOOD;
}

static int judge(const char *file, const char *task_file, const char *case_dir, bool json) {
    struct trace_reader *reader = NULL;
    struct scene *scene = NULL;
    struct error err;
    enum result result = trace_reader_create(file, &reader, &err);
    if (result == RESULT_OK)
        result = load_scene(reader, case_dir, &scene, &err);
    int code = result != RESULT_OK ? failed("judge", &err)
               : task_file         ? judge_by(task_file, reader, scene, json)
                                   : judge_held(reader, scene, json);
    scene_destroy(&scene);
    trace_reader_destroy(&reader);
    return code;
}

int command_judge(int argc, char **argv) {
    static const struct option options[] = {{"task", required_argument, NULL, 't'},
                                            {"case", required_argument, NULL, 'c'},
                                            {"json", no_argument, NULL, 'j'},
                                            {"help", no_argument, NULL, 'h'},
                                            {NULL, 0, NULL, 0}};
    const char *file = NULL, *task = NULL, *case_dir = NULL;
    bool json = false;
    for (int c; (c = getopt_long(argc, argv, "", options, NULL)) != -1;) {
        if (c == 'h')
            return fputs(judge_help, stdout) < 0;
        if (c == 't')
            task = optarg;
        else if (c == 'c')
            case_dir = optarg;
        else if (c == 'j')
            json = true;
        else
            return usage_error(argv[0], "unknown option");
    }
    return take_file(argc, argv, &file) == EXIT_GOOD ? judge(file, task, case_dir, json)
                                                     : EXIT_USAGE;
}
