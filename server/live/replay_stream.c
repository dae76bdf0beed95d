#include "live/replay_stream.h"

#include "base/check.h"
#include "runtime/mismatch_feed.h"
#include "runtime/reply.h"
#include "runtime/tissue_delta.h"
#include "store/store.h"
#include "trace/catalogue.h"
#include "trace/player.h"
#include "trace/rerun.h"
#include "trace/state_session.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct replay_stream {
    struct sessions *sessions;
    const arthron_Watch *watch;
    const struct replay_sink *sink;
    bool gone; // the sink
    struct trace_reader *reader;
    struct trace_header header;
    const struct scene *scene;
    const char *case_name;
    uint32_t station; // of its station, where that is still one of the server's; else 0
    bool own_case;
    bool gap;            // steps are missing: what is run again would be another session
    struct rerun *rerun; // NULL: nothing has to be
    struct snapshot_maker moments;
    int64_t due_ns, period_ns;
    struct mesh_feed *feeds[TISSUES_MAX];
    struct mesh_cursor cursors[TISSUES_MAX];
    struct mismatch_feed mismatch;
    bool shows_meshes; // from the first step on
    bool landed;       // a job landed at this step: its moment is sent at any rate
    struct metrics metrics;
    enum result begun; // from the state of a later part
    struct error refused;
    int progress; // in hundredths
};

// ---- which --------------------------------------------------------------------------------------

struct session_row {
    char trace[SESSIONS_PATH_MAX], server[SERVER_NAME_SIZE];
};

static void take_row(void *user, const struct store_cell *cells, int count) {
    struct session_row *row = user;
    for (int i = 0; i < count; i++) {
        if (cells[i].kind != STORE_TEXT)
            continue;
        if (!strcmp(cells[i].column, "trace"))
            snprintf(row->trace, sizeof row->trace, "%s", cells[i].text);
        if (!strcmp(cells[i].column, "server"))
            snprintf(row->server, sizeof row->server, "%s", cells[i].text);
    }
}

static void read_row(const char *records, const char *session, struct session_row *out) {
    struct store *store;
    *out = (struct session_row){0};
    if (!records[0] || store_open(records, STORE_THERE, "server", &store, NULL) != RESULT_OK)
        return;
    store_rows(store, LIST_SESSIONS, session, take_row, out, NULL);
    store_close(&store);
}

static bool find_in_records(const char *records, const char *session,
                            char out_path[SESSIONS_PATH_MAX]) {
    struct session_row row;
    read_row(records, session, &row);
    memcpy(out_path, row.trace, SESSIONS_PATH_MAX);
    return out_path[0] && catalogue_is_of(out_path, session);
}

static enum result find_trace(const struct sessions *sessions, const char *session,
                              char out_path[SESSIONS_PATH_MAX], struct error *err) {
    const struct sessions_config *config = sessions_config(sessions);
    if (!trace_is_id(session))
        return fail(err, RESULT_INVALID, "%s is no session's id", session);
    if (catalogue_find(config->traces_dir, session, out_path, SESSIONS_PATH_MAX, NULL) ==
            RESULT_OK ||
        find_in_records(config->records, session, out_path))
        return RESULT_OK;
    return fail(err, RESULT_MISSING, "the trace of session %s is missing", session);
}

bool replay_stream_is_here(const struct sessions *sessions, const arthron_Watch *watch,
                           char out_server[SERVER_NAME_SIZE]) {
    const struct sessions_config *config = sessions_config(sessions);
    char path[SESSIONS_PATH_MAX];
    struct session_row row;
    read_row(config->records, watch->session, &row);
    bool is_elsewhere = row.server[0] && strcmp(row.server, config->cluster.jet.name) != 0;
    snprintf(out_server, SERVER_NAME_SIZE, "%s", is_elsewhere ? row.server : "");
    return !is_elsewhere && find_trace(sessions, watch->session, path, NULL) == RESULT_OK;
}

static enum result find_case(struct replay_stream *f, struct error *err) {
    const struct sessions_config *config = sessions_config(f->sessions);
    const char *wanted = f->watch->case_name;
    int own = -1, index = -1;
    for (int i = config->case_count - 1; i >= 0; i--)
        if (scene_case(sessions_scene(f->sessions, i))->hash == f->header.case_hash)
            own = i;
    index = wanted[0] ? sessions_find_case(config, wanted) : own;
    f->own_case =
        index >= 0 && scene_case(sessions_scene(f->sessions, index))->hash == f->header.case_hash;
    if (index < 0 && wanted[0])
        return fail(err, RESULT_MISSING, "there is no case %s", wanted);
    if (index < 0)
        return fail(err, RESULT_MISSING, "this server has not the session's case %s",
                    f->header.case_name);
    f->scene = sessions_scene(f->sessions, index);
    if (f->own_case)
        trace_reader_bind(f->reader, f->scene);
    f->case_name = config->cases[index].name;
    return RESULT_OK;
}

// ---- to the sink ------------------------------------------------------------------------------

static arthron_Live *begin_item(struct replay_stream *f, pb_size_t kind) {
    *f->sink->item = (arthron_Live){.which_message = kind};
    return f->sink->item;
}

static void say(struct replay_stream *f) {
    f->gone = f->gone || !f->sink->say(f->sink->user, f->sink->item);
}

static void say_session(struct replay_stream *f, const char *path) {
    arthron_LiveSession *out = &begin_item(f, arthron_Live_session_tag)->message.session;
    int64_t last_ns;
    out->station_number = f->station;
    out->recorded = true;
    memcpy(out->id, f->header.session_id, sizeof out->id);
    snprintf(out->station, sizeof out->station, "%s", f->header.station);
    if (!f->sink->blind)
        snprintf(out->trainee, sizeof out->trainee, "%s", f->header.trainee);
    snprintf(out->case_name, sizeof out->case_name, "%s", f->case_name);
    snprintf(out->own_case, sizeof out->own_case, "%s",
             f->own_case ? f->case_name : f->header.case_name);
    out->case_hash = scene_case(f->scene)->hash;
    out->start_utc_ns = f->header.start_utc_ns;
    wire_session_instruments_from(&f->header.settings.instruments, out);
    reply_groups(scene_case(f->scene), out);
    out->strength = (float)f->header.settings.field.strength;
    out->optic_deg = (float)f->header.optic.tilt_deg;
    out->optic_view_deg = (float)f->header.optic.field_deg;
    if (trace_last_time(path, &last_ns, NULL) == RESULT_OK)
        out->length_ns = last_ns - f->header.start_ns;
    say(f);
}

static void say_trouble(struct replay_stream *f, arthron_Trouble_Kind kind, arthron_Why_Code code,
                        const char *text) {
    arthron_Trouble *out = &begin_item(f, arthron_Live_trouble_tag)->message.trouble;
    out->kind = kind;
    out->has_why = true;
    reply_why(code, NULL, &out->why);
    snprintf(out->text, sizeof out->text, "%.255s", text);
    say(f);
}

static void say_moment(struct replay_stream *f, bool whatever) {
    const struct step_snapshot *now = &f->moments.now;
    if (!whatever && now->since_ns < f->due_ns)
        return;
    f->due_ns = (now->since_ns / f->period_ns + 1) * f->period_ns;
    snapshot_to_wire(now, f->station, &begin_item(f, arthron_Live_moment_tag)->message.moment);
    say(f);
}

static void say_progress(struct replay_stream *f, bool done) {
    double size = (double)trace_reader_size(f->reader);
    double share = done || size <= 0 ? 1 : (double)trace_reader_offset(f->reader) / size;
    share = share > 1 ? 1 : share;
    if (!done && (int)(100 * share) == f->progress)
        return;
    f->progress = (int)(100 * share);
    arthron_ReplayProgress *out = &begin_item(f, arthron_Live_progress_tag)->message.progress;
    *out = (arthron_ReplayProgress){(float)share, done};
    say(f);
}

static void say_resection(struct replay_stream *f, int tissue,
                          const struct tissue_figures *figures) {
    const struct mesh_feed *feed = f->feeds[tissue];
    int group = scene_tissue_group(f->scene, tissue);
    reply_resection(figures, scene_case(f->scene)->groups[group].name,
                    feed ? mesh_feed_tissue(feed)->hash : 0,
                    &begin_item(f, arthron_Live_resection_tag)->message.resection);
    say(f);
}

// ---- meshes -------------------------------------------------------------------------------------

// The connection to a page loses nothing, so the page has all meshes that were sent.
static void say_mesh(struct replay_stream *f, int tissue) {
    struct mesh_payload *payload;
    while (!f->gone && (payload = mesh_feed_next(f->feeds[tissue], &f->cursors[tissue]))) {
        const struct tissue *now = mesh_feed_tissue(f->feeds[tissue]);
        arthron_MeshState ack = {.number = now->number, .hash = now->hash};
        if (f->watch->mismatch)
            payload = mismatch_feed_add(&f->mismatch, rerun_operation(f->rerun), tissue, payload);
        f->gone = !f->sink->say_mesh(f->sink->user, payload);
        mesh_cursor_ack(&f->cursors[tissue], &ack);
        mesh_payload_release(&payload);
    }
}

static void say_first_meshes(struct replay_stream *f) {
    const struct operation *operation = rerun_operation(f->rerun);
    f->shows_meshes = true;
    for (int i = 0; i < scene_tissue_count(f->scene) && !f->gone; i++) {
        const struct tissue_figures *figures = operation_figures(operation, i);
        int group = scene_tissue_group(f->scene, i);
        struct mesh_delta whole;
        tissue_delta_whole(operation_mesh(operation, i), &whole);
        whole.number = figures->mesh_number;
        f->cursors[i].asked = true;
        if (mesh_feed_create(scene_case(f->scene)->groups[group].name, &whole, &f->feeds[i],
                             NULL) == RESULT_OK)
            say_mesh(f, i);
        mesh_delta_fini(&whole);
        say_resection(f, i, figures);
    }
}

static void push_change(struct replay_stream *f, const struct job_result *result) {
    struct mesh_feed **feed = &f->feeds[result->tissue];
    const struct cut_mesh *mesh = operation_mesh(rerun_operation(f->rerun), result->tissue);
    struct mesh_delta delta;
    if (!*feed || mesh_feed_tissue(*feed)->number == result->figures.mesh_number)
        return;
    if (result->change.made_count) {
        tissue_delta_of_change(mesh, &result->change, &delta);
    } else {
        tissue_delta_between(mesh_feed_tissue(*feed), mesh, &delta);
        tissue_delta_add_pieces(&result->change, &delta);
    }
    if (mesh_feed_push(*feed, &delta, NULL) == RESULT_OK)
        say_mesh(f, result->tissue);
    else
        mesh_feed_destroy(feed);
    mesh_delta_fini(&delta);
}

// Out of the rerun, after the step at which it landed.
static void on_landing(void *user, const struct job_result *result) {
    struct replay_stream *f = user;
    if (!f->shows_meshes || result->outcome == JOB_NOTHING)
        return;
    f->landed = true;
    push_change(f, result);
    say_resection(f, result->tissue, &result->figures);
}

// ---- steps --------------------------------------------------------------------------------------

// On its own case the recorded output is sent, not the one that this server would compute.
static void run_step(struct replay_stream *f, const struct trace_record *record,
                     struct session_output *output) {
    struct landed landed;
    if (f->rerun && !f->gap && f->own_case)
        rerun_step(f->rerun, record, output);
    else if (f->rerun && !f->gap)
        rerun_step_freely(f->rerun, record, output, &landed);
    if (f->own_case && record->type == TRACE_STEP)
        *output = record->output;
    output->step = record->output.step; // elsewhere a cut may land in a step more
}

static void show_step(struct replay_stream *f, const struct trace_record *record) {
    static _Thread_local struct session_output output;
    if (record->type == TRACE_STEP && f->rerun && f->watch->meshes && !f->shows_meshes)
        say_first_meshes(f);
    if (f->gap && !f->own_case)
        return;
    run_step(f, record, &output);
    if (record->type != TRACE_STEP) {
        metrics_pass(&f->metrics, record->input.kind, &record->output.landed,
                     record->output.job.kind == JOB_UNDO);
        return;
    }
    bool landed = output.landed.job && output.landed.outcome != JOB_NOTHING;
    if (landed && (!f->shows_meshes || f->gap))
        say_resection(f, output.landed.tissue, &output.landed.figures);
    metrics_step(&f->metrics, &record->input, &output);
    snapshot_step(&f->moments, &output);
    snapshot_forces(&f->moments, &f->metrics);
    say_moment(f, landed || f->landed || output.events & EVENT_STATE);
    f->landed = false;
}

static void show_remark(struct replay_stream *f, const struct remark *remark) {
    remark_to_wire(remark, f->header.start_ns,
                   &begin_item(f, arthron_Live_remark_tag)->message.remark);
    say(f);
}

static void show_marker(struct replay_stream *f, const struct marker *marker) {
    arthron_Marker *out = &begin_item(f, arthron_Live_marker_tag)->message.marker;
    *out = wire_marker_from(marker);
    out->time_ns -= f->header.start_ns;
    say(f);
}

static void show_gap(struct replay_stream *f) {
    if (!f->gap && f->own_case)
        say_trouble(f, arthron_Trouble_Kind_NOTE, arthron_Why_Code_STEPS_MISSING,
                    "steps are missing in its trace: the meshes stay as they were before");
    else if (!f->gap)
        say_trouble(f, arthron_Trouble_Kind_NOTE, arthron_Why_Code_STEPS_MISSING_ELSEWHERE,
                    "steps are missing in its trace: on another case it ends here");
    f->gap = true;
}

static bool on_step(void *user, const struct trace_record *record) {
    show_step(user, record);
    return true;
}

static bool on_state(void *user, const struct trace_state *state) {
    struct replay_stream *f = user;
    struct kept kept = state_section(state, STATE_METRICS);
    enum result result = RESULT_OK;
    if (!metrics_take_over(&f->metrics, &kept))
        result = fail(&f->refused, RESULT_VERSION,
                      "another version of this program kept the state with which it begins");
    else if (f->rerun && !f->own_case)
        result = fail(&f->refused, RESULT_REFUSED,
                      "it begins with a state, which is of its own case alone");
    else if (f->rerun)
        result = rerun_take_over(f->rerun, state, &f->refused);
    f->begun = result;
    return result == RESULT_OK;
}

static bool on_gap(void *user, uint64_t missing) {
    (void)missing;
    show_gap(user);
    return true;
}

static bool on_resume(void *user, int64_t utc_ns) {
    struct replay_stream *f = user;
    (void)utc_ns;
    metrics_interrupt(&f->metrics);
    return true;
}

static bool on_remark(void *user, const struct remark *remark) {
    show_remark(user, remark);
    return true;
}

static bool on_marker(void *user, const struct marker *marker) {
    show_marker(user, marker);
    return true;
}

// Before each record: how far it has come. False once nobody looks any more.
static bool on_record(void *user, const struct trace_record *record) {
    struct replay_stream *f = user;
    (void)record;
    say_progress(f, false);
    return !f->gone;
}

// A session that goes on, or whose server was killed, has no end.
static void show_end(struct replay_stream *f, enum result end, const struct error *why) {
    if (end != RESULT_CLOSED && end != RESULT_MISSING)
        say_trouble(f, arthron_Trouble_Kind_FAILED, arthron_Why_Code_UNSAID,
                    error_without_folder(why->text));
    reply_metrics(&f->metrics, scene_case(f->scene),
                  &begin_item(f, arthron_Live_metrics_tag)->message.metrics);
    say(f);
    say_progress(f, true);
}

static enum result show(struct replay_stream *f, const char *path) {
    struct trace_player player = {.user = f,
                                  .record = on_record,
                                  .step = on_step,
                                  .past = on_step,
                                  .taken = on_step,
                                  .state = on_state,
                                  .gap = on_gap,
                                  .resume = on_resume,
                                  .remark = on_remark,
                                  .marker = on_marker};
    struct error why;
    say_session(f, path);
    snapshot_begin(&f->moments, 0, f->header.start_ns);
    metrics_init(&f->metrics, &f->header.settings.instruments, f->header.optic);
    if (f->watch->meshes || !f->own_case) {
        f->rerun = rerun_create(f->scene, &f->header.settings);
        rerun_watch(f->rerun, on_landing, f);
    }
    enum result end = f->gone ? RESULT_OK : trace_play(f->reader, &player, &why);
    if (f->begun != RESULT_OK) {
        end = f->begun;
        why = f->refused;
    }
    if (!f->gone)
        show_end(f, end, &why);
    for (int i = 0; i < TISSUES_MAX; i++)
        mesh_feed_destroy(&f->feeds[i]);
    mismatch_feed_fini(&f->mismatch);
    rerun_destroy(&f->rerun);
    return f->gone ? RESULT_CLOSED : RESULT_OK;
}

enum result replay_stream_run(struct sessions *sessions, const arthron_Watch *watch,
                              const struct replay_sink *sink, struct error *err) {
    char path[SESSIONS_PATH_MAX];
    struct replay_stream *f = alloc(1, sizeof *f);
    *f = (struct replay_stream){.sessions = sessions, .watch = watch, .sink = sink, .progress = -1};
    f->period_ns = snapshot_period_ns(watch);
    enum result result = find_trace(sessions, watch->session, path, err);
    if (result == RESULT_OK)
        result = trace_reader_create(path, &f->reader, err);
    if (result == RESULT_OK) {
        f->header = *trace_reader_header(f->reader);
        int station = sessions_find_station(sessions_config(sessions), f->header.station);
        f->station = station < 0 ? 0 : (uint32_t)station;
        result = find_case(f, err);
        if (result == RESULT_OK)
            result = show(f, path);
        trace_reader_destroy(&f->reader);
    }
    free(f);
    return result;
}
