// arthron-bench resume: how long a server that was killed needs until a session goes on. An hour of
// a session is synthesised, with the states that a server keeps, and resumed by the server's code.
#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "bench.h"
#include "folder.h"
#include "generate/generate.h"
#include "runtime/keeping.h"
#include "runtime/kept_session.h"
#include "sessions/parts.h"
#include "sessions/restore.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>

#define RESOLUTION_MM 1.2 // 20,000 triangles a meniscus
#define HOUR_S 3600
#define QUICK_S 600
#define HZ 100
#define CUT_EVERY_S 10
#define LANDS_AFTER 3 // frames
#define AHEAD_BYTES ((uint64_t)1 << 20)
#define PLACES 48
#define DEEPER_MM 0.6 // in each round of all places
static const struct timespec moment = {.tv_nsec = NS_PER_MS};

struct played_hour {
    const struct scene *scene;
    char trace[FOLDER_MAX + 32];
    struct session_runtime runtime;
    struct keeping keeping;
    struct session_output out;
    struct job_result *pending;
    int lands_in; // frames
    uint64_t awaited;
    pose places[PLACES];
    // What it came to:
    uint64_t cuts, states, jobs;
    size_t state_bytes;
    int64_t capture_ns, operation_ns; // of all states
};

static int64_t thread_ns(void) {
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return t.tv_sec * NS_PER_S + t.tv_nsec;
}

// ---- a hand that bites along the inner margin ---------------------------------------------------

static vec3 maxcut_of(const struct case_group *group, uint32_t vertex) {
    const float *to = group->maxcut + 3 * (size_t)vertex;
    return (vec3){(double)to[0], (double)to[1], 0};
}

// Vertices that a whole resection moves farthest, well apart from each other.
static void choose_places(struct played_hour *h) {
    const struct case_group *group = &scene_case(h->scene)->groups[scene_tissue_group(h->scene, 0)];
    bool *used = alloc(group->mesh.vertex_count, sizeof *used);
    for (int i = 0; i < PLACES; i++) {
        uint32_t best = 0;
        double farthest = -1;
        for (uint32_t v = 0; v < group->mesh.vertex_count; v++) {
            double length = vec3_length(maxcut_of(group, v));
            best = !used[v] && length > farthest ? v : best;
            farthest = !used[v] ? fmax(farthest, length) : farthest;
        }
        vec3 at = mesh_vertex(&group->mesh, best), up = {0, 0, 1};
        vec3 outward = vec3_unit_or(maxcut_of(group, best), (vec3){1, 0, 0});
        vec3 x = vec3_cross(up, outward);
        mat3 axes = {{{x.x, up.x, outward.x}, {x.y, up.y, outward.y}, {x.z, up.z, outward.z}}};
        h->places[i] = (pose){quat_from_mat3(axes), vec3_add(at, (vec3){0, 0, -0.5})};
        for (uint32_t v = 0; v < group->mesh.vertex_count; v++)
            used[v] |= vec3_distance(at, mesh_vertex(&group->mesh, v)) < 0.8;
    }
    free(used);
}

static void add(struct session_input *input, enum channel channel, pose T, double opening) {
    struct frame *frame = &input->frame;
    frame->samples[frame->count++] = (struct sample){
        .channel = channel, .kind = SAMPLE_POSE, .time_ns = input->time_ns, .T_mockup_body = T};
    if (opening >= 0)
        frame->samples[frame->count++] = (struct sample){.channel = channel,
                                                         .kind = SAMPLE_HANDLE,
                                                         .time_ns = input->time_ns,
                                                         .handle = {.opening = opening}};
}

// The jaw closes by a quarter, once in CUT_EVERY_S; the probe circles about the margin.
static struct session_input frame_at(const struct played_hour *h, uint64_t i) {
    struct session_input input = {.kind = INPUT_FRAME,
                                  .time_ns = (int64_t)(i + 1) * (NS_PER_S / HZ)};
    uint64_t bite = i / (CUT_EVERY_S * HZ);
    double s = (double)(i % (CUT_EVERY_S * HZ)) / HZ, angle = 0.7 * (double)i / HZ;
    pose punch = h->places[bite % PLACES];
    vec3 along = quat_rotate(punch.rotation, (vec3){0, 0, 1});
    punch.translation =
        vec3_add_scaled(punch.translation, 1.5 + DEEPER_MM * (double)(bite / PLACES), along);
    pose probe = {quat_identity(),
                  vec3_add(h->places[0].translation, (vec3){4 * cos(angle), 4 * sin(angle), 2})};
    input.frame = (struct frame){.number = i + 1, .time_ns = input.time_ns};
    add(&input, CHANNEL_PUNCH, punch, s < 5 ? 0.5 : fmax(0.25, 0.5 - (s - 5)));
    add(&input, CHANNEL_PROBE, probe, -1);
    return input;
}

// ---- the session, as a server runs and keeps it -------------------------------------------------

// Steps in virtual time come faster than any disk takes them.
static void wait_for_disk(struct played_hour *h) {
    if (trace_position(h->runtime.trace) - h->awaited < AHEAD_BYTES)
        return;
    while (!trace_is_on_disk(h->runtime.trace, h->awaited))
        nanosleep(&moment, NULL);
    h->awaited = trace_position(h->runtime.trace);
}

static void keep(struct played_hour *h, uint64_t end) {
    struct trace_state state = {.output_hash = h->out.hash};
    uint8_t *memory = alloc(KEPT_SESSION_MAX, 1);
    struct kept session = kept_into(memory, KEPT_SESSION_MAX), operation = kept_growing();
    int64_t begin_ns = thread_ns();
    trace_place_behind(h->runtime.trace, end, &h->out, &state.place);
    kept_session_write(&h->runtime, &h->out.job, &session);
    int64_t captured_ns = thread_ns();
    operation_keep(h->runtime.operation, &operation);
    h->capture_ns += captured_ns - begin_ns;
    h->operation_ns += thread_ns() - captured_ns;
    kept_session_join(&session, &operation, &state);
    struct error err;
    enum result result = RESULT_MISSING;
    while ((result = trace_state_write(h->trace, &state, &err)) == RESULT_MISSING)
        nanosleep(&moment, NULL);
    CHECK(result == RESULT_OK);
    h->states++;
    h->state_bytes = state.size;
    keeping_begin(&h->keeping, h->out.time_ns, state.size);
    free(state.content);
    free(operation.data);
    free(memory);
}

// Returns whether the state is due; with `keeps` it is then kept.
static bool step(struct played_hour *h, const struct session_input *input, bool keeps) {
    struct session_runtime *r = &h->runtime;
    session_step(r->session, input, &h->out);
    CHECK(trace_append(r->trace, input, &h->out));
    uint64_t end = trace_position(r->trace);
    metrics_step(&r->metrics.metrics, input, &h->out);
    snapshot_step(&r->snapshots, &h->out);
    h->cuts += (h->out.events & EVENT_CUT) != 0;
    h->jobs += h->out.landed.job != 0;
    bool due = keeping_is_due(&h->keeping, &h->out) && session_can_be_kept(r->session, &h->out.job);
    if (due && keeps)
        keep(h, end);
    if (h->out.job.id) {
        CHECK(!h->pending);
        h->pending = operation_run(r->operation, &h->out.job);
        h->lands_in = LANDS_AFTER;
    }
    wait_for_disk(h);
    return due;
}

static bool land(struct played_hour *h, int64_t time_ns, bool keeps) {
    struct job_result *result = h->pending;
    if (!result || h->lands_in-- > 0)
        return false;
    h->pending = NULL;
    bool due =
        step(h,
             &(struct session_input){
                 .kind = INPUT_JOB, .time_ns = time_ns, .job = result->job, .result = result},
             keeps);
    job_result_destroy(&result);
    return due;
}

static struct trace_header header_of(const struct scene *scene) {
    struct trace_header header = {.version = TRACE_VERSION,
                                  .case_hash = scene_case(scene)->hash,
                                  .settings = session_settings_default(),
                                  .optic = view_optic_usual(),
                                  .loose_count = scene_case(scene)->loose_count};
    header.session_id[0] = 1;
    snprintf(header.case_name, sizeof header.case_name, "%s", scene_case(scene)->name);
    trace_header_set_machine(&header);
    return header;
}

// At least so long; it ends just before its state would be kept again, which is the worst.
static enum result play(struct played_hour *h, int64_t lasts_s, struct error *err) {
    struct trace_header header = header_of(h->scene);
    struct session_runtime *r = &h->runtime;
    enum result result = trace_writer_create(h->trace, &header, NULL, NULL, &r->trace, err);
    if (result != RESULT_OK)
        return result;
    choose_places(h);
    r->session = session_create(h->scene, &header.settings);
    r->operation = operation_create(h->scene, header.settings.rules, &header.settings.instruments);
    metrics_init(&r->metrics.metrics, &header.settings.instruments, header.optic);
    snapshot_begin(&r->snapshots, 1, 0);
    keeping_begin(&h->keeping, 0, 0);
    step(h, &(struct session_input){.kind = INPUT_START}, true);
    bool due = false;
    for (uint64_t i = 0; !due; i++) {
        bool keeps = i < (uint64_t)lasts_s * HZ;
        struct session_input input = frame_at(h, i);
        due = land(h, input.time_ns, keeps) && !keeps;
        due = (!due && step(h, &input, keeps) && !keeps) || due;
    }
    job_result_destroy(&h->pending);
    session_destroy(&r->session);
    operation_destroy(&r->operation);
    trace_writer_leave(&r->trace);
    return RESULT_OK;
}

// ---- resuming it --------------------------------------------------------------------------------

struct resumed_hour {
    double cpu_s, wall_s;
    uint64_t steps, from;
};

static enum result resume(const struct sessions *sessions, const char *trace,
                          struct resumed_hour *out, struct error *err) {
    struct restored restored;
    int64_t cpu_ns = thread_ns(), wall_ns = clock_now_ns();
    enum result result = restore_run(sessions, trace, NULL, &restored, err);
    out->cpu_s = (double)(thread_ns() - cpu_ns) / NS_PER_S;
    out->wall_s = (double)(clock_now_ns() - wall_ns) / NS_PER_S;
    out->steps = restored.place.step;
    out->from = restored.kept_step;
    bool goes_on = restored.session;
    restore_fini(&restored);
    return result == RESULT_MISSING && goes_on ? RESULT_OK : result;
}

static enum result pass_over(const char *trace, double *out_s, struct error *err) {
    struct trace_reader *reader;
    struct trace_record record;
    struct trace_state state;
    int64_t begin_ns = thread_ns();
    enum result result = trace_state_read(trace, &state, err);
    if (result != RESULT_OK)
        return result;
    result = trace_reader_create(trace, &reader, err);
    if (result == RESULT_OK) {
        result = trace_reader_skim(reader, &state.place, state.output_hash, err);
        while (result == RESULT_OK && trace_reader_offset(reader) < state.place.offset)
            result = trace_read(reader, &record, err);
        trace_reader_destroy(&reader);
    }
    free(state.content);
    *out_s = (double)(thread_ns() - begin_ns) / NS_PER_S;
    return result;
}

static void report_state(const struct played_hour *h, struct report *report) {
    struct stat trace = {0};
    stat(h->trace, &trace);
    report_figure(report, (double)trace.st_size, "bytes", "trace");
    report_figure(report, (double)h->cuts, "1", "cuts");
    report_figure(report, (double)h->states, "1", "states kept");
    report_figure(report, (double)h->state_bytes, "bytes", "the last state");
    report_figure(report, 1e-3 * (double)h->capture_ns / (double)h->states, "us",
                  "worker's part of a state");
    report_figure(report, 1e-6 * (double)h->operation_ns / (double)h->states, "ms",
                  "cut worker's part of a state");
}

static enum result measure(const struct sessions *sessions, const struct played_hour *h,
                           int64_t lasts_s, struct report *report, struct error *err) {
    struct resumed_hour kept, whole;
    double passed_s, hours = (double)lasts_s / HOUR_S;
    enum result result = resume(sessions, h->trace, &kept, err);
    if (result == RESULT_OK)
        result = pass_over(h->trace, &passed_s, err);
    trace_state_remove(h->trace);
    if (result == RESULT_OK)
        result = resume(sessions, h->trace, &whole, err);
    if (result != RESULT_OK)
        return result;
    // What does not grow with the trace counts once.
    report_mark(report, "resume_s_per_recorded_hour", kept.cpu_s - passed_s + passed_s / hours, "s",
                0.5, BETTER_LOW);
    report_figure(report, kept.cpu_s, "s", "resumed/processor");
    report_figure(report, kept.wall_s, "s", "resumed/clock");
    report_figure(report, passed_s, "s", "resumed/steps passed over");
    report_figure(report, (double)(kept.steps - kept.from), "1", "resumed/steps run again");
    report_figure(report, (double)kept.steps, "1", "steps");
    report_figure(report, whole.cpu_s / hours, "s", "without a state, an hour");
    return RESULT_OK;
}

// ---- all ----------------------------------------------------------------------------------------

static enum result make_case(const char *dir, struct scene **out_scene, struct error *err) {
    struct recipe recipe;
    struct knee_case *knee = NULL;
    struct case_limits limits = case_limits_default();
    enum result result = recipe_load(CASES "/healthy", &recipe, err);
    recipe.resolution_mm = RESOLUTION_MM;
    if (result == RESULT_OK)
        result = generate_knee(&recipe, &knee, err);
    if (result == RESULT_OK)
        result = case_save(knee, dir, err);
    case_destroy(&knee);
    if (result == RESULT_OK)
        result = case_load(dir, &limits, &knee, err);
    return result == RESULT_OK ? scene_create(&knee, out_scene, err) : result;
}

static enum result run_all(const char *folder, int64_t lasts_s, struct report *report,
                           struct error *err) {
    static const atomic_bool never;
    static const struct error none;
    struct played_hour *h = alloc(1, sizeof *h);
    struct sessions *s = alloc(1, sizeof *s);
    s->cancelled = &never;
    s->config.case_count = 1;
    snprintf(s->config.cases[0].dir, sizeof s->config.cases[0].dir, "%s/case", folder);
    snprintf(h->trace, sizeof h->trace, "%s/hour.trace", folder);
    enum result result = make_case(s->config.cases[0].dir, &s->scenes[0], err);
    if (result == RESULT_OK) {
        h->scene = s->scenes[0];
        s->grades = grades_create(&s->config, &scene_case(h->scene)->hash, &none);
        result = play(h, lasts_s, err);
    }
    if (result == RESULT_OK) {
        report_state(h, report);
        result = measure(s, h, lasts_s, report, err);
    }
    grades_destroy(&s->grades);
    scene_destroy(&s->scenes[0]);
    free(s);
    free(h);
    return result;
}

enum result bench_resume(const struct bench_options *options, struct report *report,
                         struct error *err) {
    char folder[FOLDER_MAX];
    log_set_level(LOG_WARNING);
    folder_make(folder);
    if (options->quick)
        report_text(report, "length", "10 minutes; what grows with the trace is counted six times");
    enum result result = run_all(folder, options->quick ? QUICK_S : HOUR_S, report, err);
    folder_remove(folder);
    return result;
}
