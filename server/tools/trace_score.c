#include "metrics/subject.h"
#include "review/page.h"
#include "trace/player.h"
#include "trace/state_session.h"
#include "trace_commands.h"

#include <inttypes.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static const char score_help[] =
    "Usage: arthron-trace score FILE [--json] [--case DIR] [--optic DEG] [--field DEG]\n"
    "\n"
    "Computes the metrics of a session from its steps: time, paths of the instruments in the "
    "hand's\n"
    "space and as seen, economy, smoothness, contacts by tissue and depth, view and "
    "triangulation,\n"
    "both hands together, resection, and how noticeable the warp was. docs/METRICS.md defines "
    "each\n"
    "metric. Every figure has a unit and a version. A figure in brackets (below_floor) is too "
    "small\n"
    "to be trusted.\n"
    "\n"
    "  --case DIR    the case, for the names of its groups (default: the trace's case; without it\n"
    "                groups have numbers)\n"
    "  --optic DEG   tilt of the scope's optic, 0 to 90 (default: the trace's)\n"
    "  --field DEG   the optic's full angle of view, 1 to 179 (default: the trace's)\n"
    "  --json        print one JSON object\n"
    "\n"
    "Exits 1 if the trace is not whole or steps are missing. All readable steps are scored.\n";

struct score_request {
    const char *file, *case_dir;
    bool json;
    double tilt_deg, field_deg; // NAN: as the trace says
};

struct score {
    const struct trace_header *header;
    struct metrics metrics;
    const struct knee_case *knee; // NULL: groups have no names,
    struct error unnamed;         // and why
    uint64_t missing;
    bool is_known; // what was before this part
    enum result end;
    struct error why;
};

// ---- reading ------------------------------------------------------------------------------------

static bool on_score_step(void *user, const struct trace_record *record) {
    struct score *s = user;
    metrics_step(&s->metrics, &record->input, &record->output);
    return true;
}

// Of the server before: jobs and commands, and the metrics before those.
static bool on_elsewhere(void *user, const struct trace_record *record) {
    struct score *s = user;
    metrics_pass(&s->metrics, record->input.kind, &record->output.landed,
                 record->output.job.kind == JOB_UNDO);
    return true;
}

static bool on_score_state(void *user, const struct trace_state *state) {
    struct score *s = user;
    struct kept kept = state_section(state, STATE_METRICS);
    s->is_known = metrics_take_over(&s->metrics, &kept);
    return s->is_known;
}

static bool on_resume(void *user, int64_t utc_ns) {
    struct score *s = user;
    (void)utc_ns;
    metrics_interrupt(&s->metrics);
    return true;
}

static bool on_score_gap(void *user, uint64_t missing) {
    struct score *s = user;
    s->missing += missing;
    return true;
}

static void read_steps(struct trace_reader *reader, struct score *s) {
    struct trace_player player = {.user = s,
                                  .step = on_score_step,
                                  .past = on_elsewhere,
                                  .taken = on_elsewhere,
                                  .state = on_score_state,
                                  .resume = on_resume,
                                  .gap = on_score_gap,
                                  .progress = show_progress};
    s->is_known = true;
    s->end = trace_play(reader, &player, &s->why);
    if (!s->is_known)
        s->end = fail(&s->why, RESULT_VERSION,
                      "another version of this program kept what the server before had measured");
}

// ---- JSON ---------------------------------------------------------------------------------------

struct listing {
    const struct score *score;
    json_t *all;
};

static void add_labels(const struct score *s, const struct metric_value *v, json_t *object) {
    char text[SUBJECT_MAX];
    if (v->owner)
        json_object_set_new(object, v->instrument >= 0 ? "instrument" : "bone",
                            json_string(v->owner));
    if (v->group >= 0) {
        subject_group(s->knee, v->group, text);
        json_object_set_new(object, "group", json_string(text));
    }
    if (v->depth >= 0)
        json_object_set_new(object, "from_mm", json_real(touch_depth_mm[v->depth]));
    if (v->tissue >= 0) {
        subject_tissue(s->knee, v->tissue, text);
        json_object_set_new(object, "tissue", json_string(text));
    }
    if (v->along >= 0) {
        subject_zone(v, text);
        json_object_set_new(object, "zone", json_string(text));
    }
}

static void add_figure(void *context, const struct metric_value *v) {
    struct listing *listing = context;
    const struct metric_kind *kind = &metric_kinds[v->metric];
    json_t *object = json_pack("{s:s, s:s, s:i, s:o, s:s, s:b}", "name", kind->name, "unit",
                               kind->unit, "version", kind->version, "value",
                               isfinite(v->value) ? json_real(v->value) : json_null(), "floor",
                               kind->floor, "below_floor", v->below_floor);
    add_labels(listing->score, v, object);
    json_array_append_new(listing->all, object);
}

static void print_score_json(const struct score *s) {
    struct listing listing = {s, json_array()};
    char id[33];
    for (size_t i = 0; i < sizeof s->header->session_id; i++)
        snprintf(id + 2 * i, 3, "%02x", s->header->session_id[i]);
    metrics_each(&s->metrics, s->knee, add_figure, &listing);
    json_t *root = json_pack("{s:s, s:b, s:I, s:s, s:{s:f, s:f}, s:o}", "session", id, "whole",
                             s->end == RESULT_CLOSED, "missing", (json_int_t)s->missing, "end",
                             s->end == RESULT_CLOSED ? "" : s->why.text, "optic", "tilt_deg",
                             s->metrics.optic.tilt_deg, "field_deg", s->metrics.optic.field_deg,
                             "metrics", listing.all);
    json_dumpf(root, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(17));
    putchar('\n');
    json_decref(root);
}

// ---- text ---------------------------------------------------------------------------------------

static void print_figure(void *context, const struct metric_value *v) {
    const struct score *s = context;
    const struct metric_kind *kind = &metric_kinds[v->metric];
    char about[SUBJECT_MAX], value[48] = "-";
    if (v->depth >= 0 && v->value == 0)
        return; // nearly all are
    subject_text(s->knee, v, about);
    if (isfinite(v->value))
        snprintf(value, sizeof value, v->below_floor ? "(%.4g)" : "%.4g", v->value);
    printf("%-20s v%d %12s %-5s %s\n", kind->name, kind->version, value, kind->unit, about);
}

static void print_score_text(const struct score *s) {
    if (!s->knee)
        printf("groups have no names: %s\n", s->unnamed.text);
    printf("optic %g degrees, field %g degrees\n", s->metrics.optic.tilt_deg,
           s->metrics.optic.field_deg);
    metrics_each(&s->metrics, s->knee, print_figure, (void *)s);
    if (s->missing)
        printf("missing     %" PRIu64 " steps\n", s->missing);
    if (s->end != RESULT_CLOSED)
        printf("not whole   %s\n", s->why.text);
}

// ---- the command --------------------------------------------------------------------------------

static struct view_optic optic_of(const struct score_request *request,
                                  const struct trace_header *header) {
    struct view_optic optic = header->optic;
    if (!isnan(request->tilt_deg))
        optic.tilt_deg = request->tilt_deg;
    if (!isnan(request->field_deg))
        optic.field_deg = request->field_deg;
    return optic;
}

static int score(const struct score_request *request) {
    struct trace_reader *reader;
    struct error err = {""};
    if (trace_reader_create(request->file, &reader, &err) != RESULT_OK)
        return failed("score", &err);
    struct knee_case *knee = review_case(trace_reader_header(reader), request->case_dir, &err);
    if (!knee && request->case_dir) {
        trace_reader_destroy(&reader);
        return failed("score", &err);
    }
    struct score s = {.header = trace_reader_header(reader), .knee = knee, .unnamed = err};
    metrics_init(&s.metrics, &s.header->settings.instruments, optic_of(request, s.header));
    read_steps(reader, &s);
    if (request->json)
        print_score_json(&s);
    else
        print_score_text(&s);
    trace_reader_destroy(&reader);
    case_destroy(&knee);
    return s.end == RESULT_CLOSED && !s.missing ? EXIT_GOOD : EXIT_FAULT;
}

static bool parse_degrees(const char *text, double least, double most, double *out) {
    char *end;
    *out = strtod(text, &end);
    return end != text && *end == '\0' && *out >= least && *out <= most;
}

int command_score(int argc, char **argv) {
    static const struct option options[] = {
        {"json", no_argument, NULL, 'j'},        {"case", required_argument, NULL, 'c'},
        {"optic", required_argument, NULL, 'o'}, {"field", required_argument, NULL, 'f'},
        {"help", no_argument, NULL, 'h'},        {NULL, 0, NULL, 0}};
    struct score_request request = {.tilt_deg = NAN, .field_deg = NAN};
    for (int c; (c = getopt_long(argc, argv, "", options, NULL)) != -1;) {
        if (c == 'h')
            return fputs(score_help, stdout) < 0;
        if (c == 'j')
            request.json = true;
        else if (c == 'c')
            request.case_dir = optarg;
        else if (c != 'o' && c != 'f')
            return usage_error(argv[0], "unknown option");
        else if (c == 'o' && !parse_degrees(optarg, 0, 90, &request.tilt_deg))
            return usage_error(argv[0], "'%s': --optic takes 0 to 90 degrees", optarg);
        else if (c == 'f' && !parse_degrees(optarg, 1, 179, &request.field_deg))
            return usage_error(argv[0], "'%s': --field takes 1 to 179 degrees", optarg);
    }
    if (take_file(argc, argv, &request.file) != EXIT_GOOD)
        return EXIT_USAGE;
    return score(&request);
}
