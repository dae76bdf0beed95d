// unoptimized FILE CASE: replays a trace by the kernels as a debug build has them. Prints the
// verdict; exits 0 where every bit is the same.
#include "trace/replay.h"

#include <stdio.h>

extern const char trace_build[];
const char trace_build[] = "unoptimized";

static enum result replay(const char *file, const char *case_dir, struct replay_report *report,
                          struct error *err) {
    struct trace_reader *reader;
    struct knee_case *knee = NULL;
    struct scene *scene = NULL;
    enum result result = trace_reader_create(file, &reader, err);
    if (result != RESULT_OK)
        return result;
    result = case_load(case_dir, NULL, &knee, err);
    if (result == RESULT_OK)
        result = scene_create(&knee, &scene, err);
    if (result == RESULT_OK)
        result = trace_replay(reader, scene, NULL, NULL, report, err);
    case_destroy(&knee);
    scene_destroy(&scene);
    trace_reader_destroy(&reader);
    return result;
}

int main(int argc, char **argv) {
    struct replay_report report;
    struct error err = {"unoptimized FILE CASE"};
    if (argc != 3 || replay(argv[1], argv[2], &report, &err) != RESULT_OK) {
        fprintf(stderr, "%s\n", err.text);
        return 2;
    }
    printf("%s, %d of %d steps differ\n", replay_verdict_name(report.verdict),
           (int)report.different, (int)report.steps);
    if (report.different)
        printf("first in step %d: %s was %s, now %s\n", (int)report.first.step, report.first.field,
               report.first.recorded, report.first.replayed);
    return report.verdict == REPLAY_IDENTICAL && report.end == RESULT_CLOSED ? 0 : 1;
}
