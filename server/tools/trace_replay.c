#include "base/clock.h"
#include "trace/replay.h"
#include "trace_commands.h"
#include "trace_trial.h"

#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char replay_help[] =
    "Usage: arthron-trace replay FILE [OPTIONS] [--json]\n"
    "\n"
    "Runs the session again from its recorded inputs and compares every field of every step. With\n"
    "the same build, libc and CPU level all fields must be equal. Otherwise warped poses may "
    "differ\n"
    "by 1e-6 mm, but states and events must be equal. Steps after a gap cannot be compared.\n"
    "After a cut the steps feel the recorded touched surface, whatever the match of this build\n"
    "finds. A touched surface that differs is reported; from the same build it is a fault.\n"
    "\n"
    "  --case DIR       the folder of the case, if it has moved\n"
    "  --from S --to S  compare only the steps from S to S seconds after the start\n"
    "\n"
    "Exits 1 if the session differs, or if not all recorded steps could be compared.\n"
    "\n"
    "Other settings run the same hands again, without a comparison of every field:\n"
    "\n"
    "  --case DIR       another case\n"
    "  --field KIND     integral, or for comparison smooth, inverse-distance or gaussian\n"
    "  --avatar MODE    tip, points or rigid\n"
    "  --strength X     of the warp, 0 to 1\n"
    "\n"
    "This prints how far the shown instruments move, and how much is shown, touched and cut, each\n"
    "as recorded and with the other settings. A cut lands when the recorded one did, or half a\n"
    "second after the session asked for it. Exits 1 if the trace could not be read to its end.\n";

struct replay_request {
    const char *file, *case_dir, *field, *avatar, *strength;
    double from_s, to_s; // NAN: not asked for
    bool json;
};

// A server that was killed leaves a trace without an end: all of it is compared.
static bool all_compared(const struct replay_report *r) {
    return r->left_out == 0 && (r->end == RESULT_CLOSED || r->end == RESULT_MISSING);
}

static json_t *number_or_null(double value) {
    return isfinite(value) ? json_real(value) : json_null();
}

static bool differs_in_digits(const struct replay_report *r) {
    return r->same_events && r->largest_mm <= REPLAY_TOLERANCE_MM &&
           r->touches.largest_mm <= REPLAY_TOLERANCE_MM;
}

// Where the mathematics is another one the last bits may differ.
static const char *reason(const struct replay_report *r) {
    if (!r->different && !r->touches.different)
        return "";
    if (r->digits && differs_in_digits(r))
        return r->digits;
    if (!r->same_build)
        return "another build recorded it";
    if (!r->same_libc)
        return "it was recorded with another C library";
    if (!r->same_cpu)
        return "it was recorded on another CPU";
    return "the same build, C library and CPU recorded it: the trace was changed, or the program "
           "is at fault";
}

static void print_replay_json(const struct replay_report *r, double real_time) {
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
    json_object_set_new(root, "touches",
                        json_pack("{s:I, s:I, s:f}", "compared", (json_int_t)r->touches.landed,
                                  "different", (json_int_t)r->touches.different, "largest_mm",
                                  r->touches.largest_mm));
    if (r->touches.different)
        json_object_update_new(json_object_get(root, "touches"),
                               json_pack("{s:I, s:I}", "first_step",
                                         (json_int_t)r->touches.first_step, "first_job",
                                         (json_int_t)r->touches.first_job));
    json_object_set_new(root, "taken",
                        json_pack("{s:I, s:I}", "compared", (json_int_t)r->taken, "different",
                                  (json_int_t)r->taken_otherwise));
    json_object_set_new(root, "rules", json_integer(r->rules));
    json_object_set_new(root, "reason", json_string(reason(r)));
    json_dumpf(root, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(12));
    putchar('\n');
    json_decref(root);
}

static void print_touches(const struct rerun_touches *touches) {
    if (touches->different)
        printf("the match of this build finds another touched surface at %" PRIu64 " of %" PRIu64
               " jobs, by up to %g mm, first in step %" PRIu64 " for job %" PRIu64
               "; the steps felt the recorded one\n",
               touches->different, touches->landed, touches->largest_mm, touches->first_step,
               touches->first_job);
    else if (touches->landed)
        printf("touched surface: the same after each of %" PRIu64 " jobs\n", touches->landed);
}

static void print_taken(const struct replay_report *r) {
    if (r->taken_otherwise)
        printf("%" PRIu64 " of %" PRIu64
               " jobs of the server before land otherwise here, the first of them is job %" PRIu64
               "\n",
               r->taken_otherwise, r->taken, r->first_otherwise);
    else if (r->taken)
        printf("%" PRIu64 " jobs of the server before land as they did there\n", r->taken);
}

static void print_replay_text(const struct replay_report *r, double real_time) {
    printf("%s: %" PRIu64 " of %" PRIu64 " steps differ\n", replay_verdict_name(r->verdict),
           r->different, r->steps);
    if (r->different)
        printf("first in step %" PRIu64
               ": %s was %s, now %s\nreason: %s\nwarped poses differ by up to "
               "%g mm, %s states and events\n",
               r->first.step, r->first.field, r->first.recorded, r->first.replayed, reason(r),
               r->largest_mm, r->same_events ? "the same" : "other");
    else if (r->touches.different)
        printf("reason: %s\n", reason(r));
    print_touches(&r->touches);
    print_taken(r);
    printf("rules %d; build %s, libc %s, CPU %s\n", r->rules,
           r->same_build ? "the same" : "another", r->same_libc ? "the same" : "another",
           r->same_cpu ? "the same" : "another");
    if (r->left_out)
        printf("%" PRIu64 " steps after a gap could not be compared\n", r->left_out);
    if (r->end != RESULT_CLOSED)
        printf("not whole: %s\n", r->why.text);
    printf("%.0f times as fast as real time\n", real_time);
}

static bool avatar_from_name(const char *name, enum avatar_mode *out) {
    for (int i = 0; i < AVATAR_MODE_COUNT; i++)
        if (!strcmp(name, avatar_mode_name((enum avatar_mode)i))) {
            *out = (enum avatar_mode)i;
            return true;
        }
    return false;
}

// False: a word or number is none. What was not asked for stays.
// What is wrong with them, or NULL.
static const char *take_settings(const struct replay_request *request,
                                 struct session_settings *settings) {
    char *end = "";
    if (request->strength)
        settings->field.strength = strtod(request->strength, &end);
    if (request->field && !field_from_name(request->field, &settings->field.kind))
        return "--field is integral, smooth, inverse-distance or gaussian";
    if (request->avatar && !avatar_from_name(request->avatar, &settings->avatar))
        return "--avatar is tip, points or rigid";
    if (*end || !(settings->field.strength >= 0 && settings->field.strength <= 1))
        return "--strength is 0 to 1";
    return NULL;
}

static int64_t time_or(double seconds, int64_t otherwise_ns) {
    return isnan(seconds) ? otherwise_ns : (int64_t)(seconds * NS_PER_S);
}

static double real_time(int64_t session_ns, int64_t begin_ns) {
    return (double)session_ns / (double)(clock_now_ns() - begin_ns);
}

static int compare(const struct replay_request *request, struct trace_reader *reader,
                   const struct scene *scene) {
    struct replay_report report;
    struct error err;
    struct replay_span span = {time_or(request->from_s, 0), time_or(request->to_s, INT64_MAX)};
    int64_t begin_ns = clock_now_ns();
    if (trace_replay(reader, scene, &span, show_progress, &report, &err) != RESULT_OK)
        return failed("replay", &err);
    (request->json ? print_replay_json : print_replay_text)(&report,
                                                            real_time(report.session_ns, begin_ns));
    return report.verdict != REPLAY_DIFFERENT && all_compared(&report) ? EXIT_GOOD : EXIT_FAULT;
}

static int try_out(const struct replay_request *request, struct trace_reader *reader,
                   const struct scene *scene, const struct session_settings *settings) {
    struct trial_report report;
    struct error err;
    int64_t begin_ns = clock_now_ns();
    if (trace_trial(reader, scene, settings, show_progress, &report, &err) != RESULT_OK)
        return failed("replay", &err);
    (request->json ? trial_print_json : trial_print_text)(&report,
                                                          real_time(report.session_ns, begin_ns));
    return report.end == RESULT_CLOSED || report.end == RESULT_MISSING ? EXIT_GOOD : EXIT_FAULT;
}

static int replay(const struct replay_request *request) {
    struct error err;
    struct trace_reader *reader;
    struct scene *scene = NULL;
    if (trace_reader_create(request->file, &reader, &err) != RESULT_OK)
        return failed("replay", &err);
    const struct trace_header *header = trace_reader_header(reader);
    instruments_name_channels(&header->settings.instruments);
    struct session_settings settings = header->settings;
    bool other = request->field || request->avatar || request->strength;
    int code;
    const char *wrong = take_settings(request, &settings);
    if (wrong)
        code = usage_error("replay", "%s", wrong);
    else if (load_scene(reader, request->case_dir, &scene, &err) != RESULT_OK)
        code = failed("replay", &err);
    else if (other || (request->case_dir && scene_case(scene)->hash != header->case_hash))
        code = try_out(request, reader, scene, &settings);
    else
        code = compare(request, reader, scene);
    scene_destroy(&scene);
    trace_reader_destroy(&reader);
    return code;
}

static bool take_option(int option, struct replay_request *out) {
    switch (option) {
    case 'c':
        out->case_dir = optarg;
        return true;
    case 'f':
        out->field = optarg;
        return true;
    case 'a':
        out->avatar = optarg;
        return true;
    case 's':
        out->strength = optarg;
        return true;
    case 'F':
        return take_seconds(optarg, &out->from_s);
    case 'T':
        return take_seconds(optarg, &out->to_s);
    case 'j':
        out->json = true;
        return true;
    default:
        return false;
    }
}

int command_replay(int argc, char **argv) {
    static const struct option options[] = {{"case", required_argument, NULL, 'c'},
                                            {"from", required_argument, NULL, 'F'},
                                            {"to", required_argument, NULL, 'T'},
                                            {"field", required_argument, NULL, 'f'},
                                            {"avatar", required_argument, NULL, 'a'},
                                            {"strength", required_argument, NULL, 's'},
                                            {"json", no_argument, NULL, 'j'},
                                            {"help", no_argument, NULL, 'h'},
                                            {NULL, 0, NULL, 0}};
    struct replay_request request = {.from_s = NAN, .to_s = NAN};
    for (int c; (c = getopt_long(argc, argv, "", options, NULL)) != -1;) {
        if (c == 'h')
            return fputs(replay_help, stdout) < 0;
        if (!take_option(c, &request))
            return usage_error(argv[0], "unknown option, or a value that is no number of seconds");
    }
    if (take_file(argc, argv, &request.file) != EXIT_GOOD)
        return EXIT_USAGE;
    return replay(&request);
}
