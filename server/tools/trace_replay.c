#include "base/clock.h"
#include "trace/replay.h"
#include "trace_commands.h"

#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>

static const char help[] =
    "Usage: arthron-trace replay FILE [--case DIR] [--json]\n"
    "\n"
    "Runs the session again from its recorded inputs and compares every field of every step.\n"
    "The case is the one that the trace names, or DIR; another case is refused by its hash.\n"
    "On the same build, libc and CPU level nothing may differ; elsewhere warped poses may by\n"
    "1e-6 mm, states and events may not. Steps after a gap cannot be compared.\n"
    "Exits 1 where the session differs, or where not all recorded steps could be compared.\n";

// A server that was killed leaves a trace without an end: all of it is compared.
static bool all_compared(const struct replay_report *r) {
    return r->left_out == 0 && (r->end == RESULT_CLOSED || r->end == RESULT_MISSING);
}

static json_t *number_or_null(double value) {
    return isfinite(value) ? json_real(value) : json_null();
}

static void print_json(const struct replay_report *r, double real_time) {
    json_t *root = json_pack(
        "{s:s, s:I, s:I, s:I, s:o, s:b, s:b, s:b, s:b, s:o, s:s}", "verdict",
        replay_verdict_name(r->verdict), "steps", (json_int_t)r->steps, "different",
        (json_int_t)r->different, "left_out", (json_int_t)r->left_out, "largest_mm",
        number_or_null(r->largest_mm), "same_events", r->same_events, "same_build", r->same_build,
        "same_libc", r->same_libc, "same_cpu", r->same_cpu, "times_real_time",
        number_or_null(real_time), "end", r->end == RESULT_CLOSED ? "" : r->why.text);
    if (r->different)
        json_object_set_new(root, "first",
                            json_pack("{s:I, s:s, s:s, s:s}", "step", (json_int_t)r->first.step,
                                      "field", r->first.field, "recorded", r->first.recorded,
                                      "replayed", r->first.replayed));
    json_dumpf(root, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(12));
    putchar('\n');
    json_decref(root);
}

static void print_text(const struct replay_report *r, double real_time) {
    printf("%s: %" PRIu64 " of %" PRIu64 " steps differ\n", replay_verdict_name(r->verdict),
           r->different, r->steps);
    if (r->different)
        printf("first in step %" PRIu64 ": %s was %s, now %s\nwarped poses by up to %g mm, %s "
               "states and events\n",
               r->first.step, r->first.field, r->first.recorded, r->first.replayed, r->largest_mm,
               r->same_events ? "the same" : "other");
    printf("build %s, libc %s, CPU %s\n", r->same_build ? "the same" : "another",
           r->same_libc ? "the same" : "another", r->same_cpu ? "the same" : "another");
    if (r->left_out)
        printf("%" PRIu64 " steps after a gap could not be compared\n", r->left_out);
    if (r->end != RESULT_CLOSED)
        printf("not whole: %s\n", r->why.text);
    printf("%.0f times as fast as real time\n", real_time);
}

static int replay(const char *file, const char *case_dir, bool json) {
    struct error err;
    struct trace_reader *reader;
    struct scene *scene = NULL;
    struct replay_report report;
    if (trace_reader_create(file, &reader, &err) != RESULT_OK)
        return failed("replay", &err);
    enum result result = load_scene(reader, case_dir, &scene, &err);
    int64_t begin_ns = clock_now_ns();
    if (result == RESULT_OK)
        result = trace_replay(reader, scene, NULL, show_progress, &report, &err);
    int64_t taken_ns = clock_now_ns() - begin_ns;
    scene_destroy(&scene);
    trace_reader_destroy(&reader);
    if (result != RESULT_OK)
        return failed("replay", &err);
    (json ? print_json : print_text)(&report, (double)report.session_ns / (double)taken_ns);
    return report.verdict != REPLAY_DIFFERENT && all_compared(&report) ? EXIT_GOOD : EXIT_FAULT;
}

int command_replay(int argc, char **argv) {
    static const struct option options[] = {{"case", required_argument, NULL, 'c'},
                                            {"json", no_argument, NULL, 'j'},
                                            {"help", no_argument, NULL, 'h'},
                                            {NULL, 0, NULL, 0}};
    bool json = false;
    const char *case_dir = NULL;
    for (int c; (c = getopt_long(argc, argv, "", options, NULL)) != -1;)
        switch (c) {
        case 'c':
            case_dir = optarg;
            break;
        case 'j':
            json = true;
            break;
        case 'h':
            return fputs(help, stdout) < 0;
        default:
            return usage_error(argv[0], "unknown option");
        }
    const char *file;
    if (take_file(argc, argv, &file) != EXIT_GOOD)
        return EXIT_USAGE;
    return replay(file, case_dir, json);
}
