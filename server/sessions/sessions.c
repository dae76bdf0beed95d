#include "sessions/sessions.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "runtime/reply.h"
#include "sessions/attempt_rows.h"
#include "sessions/closing.h"
#include "sessions/commands.h"
#include "sessions/fork.h"
#include "sessions/manager.h"
#include "sessions/moving.h"
#include "sessions/own.h"
#include "sessions/resume.h"
#include "sessions/session_list.h"
#include "sessions/sharing.h"
#include "sessions/station_handler.h"
#include "trace/trace.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define RETENTION_NOTICE_S 600 // after a start: for who mistyped [server] keep_days

// ---- what is served -----------------------------------------------------------------------------

static enum result load_case(struct sessions *s, int index, struct error *err) {
    const struct session_case *entry = &s->config.cases[index];
    struct knee_case *knee = NULL;
    enum result result = case_load_checked(entry->dir, s->config.check_case, &knee, err);
    if (result == RESULT_OK) {
        result = scene_create(&knee, &s->scenes[index], err);
        case_destroy(&knee);
    }
    if (result != RESULT_OK) {
        fail_in(err, result, "case %s: ", entry->name);
        log_error("sessions", "%s; no session opens on it", err->text);
        return result;
    }
    log_info("sessions", "case %s from %s", entry->name, entry->dir);
    return RESULT_OK;
}

// An empty scene stands for a case that cannot be read. No session opens on it.
static void stand_in(struct sessions *s, int index) {
    const char *name = s->config.cases[index].name;
    struct knee_case *knee = case_create(case_name_is_valid(name) ? name : "refused", "");
    enum result result = scene_create(&knee, &s->scenes[index], NULL);
    CHECK(result == RESULT_OK);
}

// One case that cannot be read keeps its own stations out, and no others. If none can be read, the
// server does not start.
static enum result load_cases(struct sessions *s, struct error *err) {
    uint64_t hashes[SESSIONS_CASES_MAX];
    struct error *refused = alloc(SESSIONS_CASES_MAX, sizeof *refused);
    enum result result = RESULT_OK;
    int loaded = 0;
    for (int i = 0; i < s->config.case_count && !sessions_are_ending(s); i++) {
        result = load_case(s, i, &refused[i]);
        loaded += result == RESULT_OK;
        if (result != RESULT_OK)
            stand_in(s, i);
        hashes[i] = scene_case(s->scenes[i])->hash;
    }
    if (sessions_are_ending(s))
        result = fail(err, RESULT_TIMEOUT, "the server ends while it starts");
    else if (s->config.case_count && !loaded)
        result = fail(err, result, "%s", refused[s->config.case_count - 1].text);
    else
        result = RESULT_OK;
    if (result == RESULT_OK)
        s->grades = grades_create(&s->config, hashes, refused);
    free(refused);
    return result;
}

static enum result open_slots(struct sessions *s, struct error *err) {
    for (int i = 0; i < s->config.station_count; i++) {
        const struct session_station *station = &s->config.stations[i];
        int scene = sessions_find_case(&s->config, station->case_name);
        if (scene < 0)
            return fail(err, RESULT_INVALID, "station %s: there is no case %s", station->name,
                        station->case_name);
        station_slot_init(&s->slots[i], scene, station->trainee);
    }
    return RESULT_OK;
}

// ---- what it needs ------------------------------------------------------------------------------

static enum result make_traces_dir(const struct sessions *s, struct error *err) {
    const char *dir = s->config.traces_dir;
    if ((mkdir(dir, 0700) && errno != EEXIST) || access(dir, W_OK | X_OK))
        return fail(err, RESULT_IO, "%s: %s", dir, strerror(errno));
    return RESULT_OK;
}

static enum result load_signer(struct sessions *s, struct error *err) {
    enum result result = signer_create(s->config.keys_dir, &s->signer, err);
    if (result != RESULT_OK)
        return result;
    s->trace_signer.sign = signer_sign;
    s->trace_signer.context = s->signer;
    return RESULT_OK;
}

static enum result start_runtime(struct sessions *s, struct error *err) {
    struct runtime_config config = {
        .address = s->config.address,
        .udp_port = s->config.udp_port,
        .workers = sessions_worker_count(&s->config),
        .wait_s = s->config.wait_s,
        .hold_ns = s->config.settings.hold_ns,
        .touch_reach_mm = s->config.settings.field.radius_mm,
        .station_count = s->config.station_count,
        .stations = s->served,
        .control = &s->control,
        .serve_until_ns = sharing_serves_until(s),
        .keep_at_once = s->sharing != NULL,
        .kept = s->sharing ? sharing_kept : NULL,
        .notify = manager_notify,
        .user = s,
    };
    for (int i = 0; i < s->config.station_count; i++) {
        const struct session_station *station = &s->config.stations[i];
        s->served[i].name = station->name;
        s->served[i].start_by_command = station->start_by_command;
        memcpy(s->served[i].contact_buttons, station->contact_buttons,
               sizeof station->contact_buttons);
    }
    return runtime_create(&config, &s->runtime, err);
}

static enum result open_connections(struct sessions *s, struct error *err) {
    const struct sessions_config *config = &s->config;
    struct control_config control = {
        .address = config->address[0] ? config->address : NULL,
        .port = config->port,
        .stations = config->station_count,
        .authority_dir = config->keys_dir,
        .software = "arthron-server " ARTHRON_VERSION,
        .hello_timeout_ns = 5 * NS_PER_S,
    };
    struct control_handler handler = station_handler(s);
    enum result result = control_create(&control, &handler, &s->control, err);
    if (result != RESULT_OK)
        return result;
    struct console_handler console = {s, sessions_command, sessions_metrics};
    return console_create(config->socket, &console, &s->console, err);
}

// ---- begin --------------------------------------------------------------------------------------

// For the recorder: the scenes stay until it has stopped.
static const struct scene *find_scene(void *user, uint64_t case_hash) {
    const struct sessions *s = user;
    for (int i = 0; i < s->config.case_count; i++)
        if (scene_case(s->scenes[i])->hash == case_hash)
            return s->scenes[i];
    return NULL;
}

static void start_recorder(struct sessions *s) {
    char authority[SESSIONS_PATH_MAX + 16];
    snprintf(authority, sizeof authority, "%s/authority.pem", s->config.keys_dir);
    const struct recorder_config config = {
        .records = s->config.records,
        .traces_dir = s->config.traces_dir,
        .authority = authority,
        .find = find_scene,
        .read_attempts = attempt_rows_read,
        .user = s,
        .signer = s->trace_signer,
        .attempt_written = s->config.attempt_written,
        .attempt_user = s->config.attempt_user,
    };
    s->recorder = recorder_start(&config);
}

static void write_traces(void *user) {
    (void)user;
    trace_write_last();
}

static void write_audit(void *user) {
    const struct sessions *s = user;
    if (s->recorder)
        recorder_write_last(s->recorder);
}

// What another server judged may not be known here.
static bool knows_others(void *user) {
    const struct cluster *cluster = sessions_cluster(user);
    return !cluster || cluster_is_connected(cluster);
}

// The traces that go on are locked before the recorder looks for those that do not.
static void begin_sessions(struct sessions *s) {
    resume_open_traces(s);
    if (s->config.records[0])
        start_recorder(s);
    s->retention = retention_start(
        &(struct retention_config){.records = s->config.records,
                                   .traces_dir = s->config.traces_dir,
                                   .keep_days = s->config.keep_days,
                                   .keep_bytes = (uint64_t)s->config.keep_gb * 1000000000,
                                   .notice_s = RETENTION_NOTICE_S,
                                   .may_remove = knows_others,
                                   .user = s});
    resume_attach(s);
    closing_start(s);
    manager_start(s);
}

static enum result prepare(struct sessions *s, struct error *err) {
    s->tasks = library_read(s->config.tasks_dir);
    s->sites = site_pool_create();
    enum result result = make_traces_dir(s, err);
    if (result == RESULT_OK)
        result = claim_create(s->config.records, s->config.traces_dir, &s->claim, err);
    if (result == RESULT_OK)
        result = load_signer(s, err);
    if (result == RESULT_OK)
        result = load_cases(s, err);
    if (result == RESULT_OK)
        result = moving_create(s, err);
    if (result == RESULT_OK)
        result = start_runtime(s, err);
    if (result != RESULT_OK)
        return result;
    fork_clear(s->config.traces_dir);
    own_traces_read(s);
    result = resume_replay(s, err);
    return sessions_are_ending(s) ? fail(err, RESULT_TIMEOUT, "the server ends while it starts")
                                  : result;
}

static void copy_config(struct sessions *s, const struct sessions_config *config) {
    size_t count = (size_t)config->station_count;
    s->config = *config;
    s->config.stations = alloc(count, sizeof *s->config.stations);
    if (count)
        memcpy(s->config.stations, config->stations, count * sizeof *config->stations);
    s->slots = alloc(count, sizeof *s->slots);
    s->served = alloc(count, sizeof *s->served);
    s->station_of = alloc((size_t)control_peers(config->station_count), sizeof *s->station_of);
}

enum result sessions_create(const struct sessions_config *config, const atomic_bool *cancelled,
                            struct sessions **out_sessions, struct error *err) {
    struct sessions *s = alloc(1, sizeof *s);
    copy_config(s, config);
    s->cancelled = cancelled;
    need_before_end(write_traces, s);
    need_before_end(write_audit, s);
    manager_create(s);
    enum result result = open_slots(s, err);
    if (result == RESULT_OK)
        result = prepare(s, err);
    if (result == RESULT_OK)
        result = open_connections(s, err);
    if (result == RESULT_OK)
        begin_sessions(s);
    else
        sessions_destroy(&s);
    *out_sessions = s;
    return result;
}

// ---- end ----------------------------------------------------------------------------------------

void sessions_break_off(struct sessions *s) {
    atomic_store(&s->ending, true);
    for (int i = 0; i < s->config.station_count; i++)
        station_slot_break_off(&s->slots[i]);
}

static void release_all(struct sessions *s) {
    resume_release(s);
    runtime_destroy(&s->runtime);
    grades_destroy(&s->grades);
    library_destroy(&s->tasks);
    site_pool_destroy(&s->sites);
    for (int i = 0; i < s->config.case_count; i++)
        scene_destroy(&s->scenes[i]);
    for (int i = 0; i < s->config.station_count; i++)
        station_slot_fini(&s->slots[i]);
    signer_destroy(&s->signer);
    claim_destroy(&s->claim);
    own_traces_free(s);
    free(s->slots);
    free(s->served);
    free(s->station_of);
    free(s->config.stations);
    free(s);
}

// Console and manager first, so that no session begins; then the workers, who end theirs and tell
// the stations; then the control connections; then the sessions that the workers gave back, and
// what becomes of them in the records; then what other servers learn of these.
static void end_sessions(struct sessions **sessions, bool hand_over) {
    struct sessions *s = *sessions;
    sessions_break_off(s);
    retention_stop(&s->retention);
    closing_stop(s);
    if (s->console)
        console_destroy(&s->console);
    if (hand_over)
        moving_all(s);
    manager_stop(s);
    runtime_stop(s->runtime, hand_over);
    if (s->control)
        control_destroy(&s->control);
    moving_end(s);
    manager_destroy(s);
    sharing_leave(s);
    recorder_stop(&s->recorder);
    sharing_destroy(s);
    need_before_end(NULL, NULL);
    release_all(s);
    *sessions = NULL;
}

void sessions_destroy(struct sessions **sessions) {
    end_sessions(sessions, false);
}

void sessions_hand_over(struct sessions **sessions) {
    end_sessions(sessions, true);
}

// ---- what others ask ----------------------------------------------------------------------------

void sessions_command(void *sessions, const char *actor, const arthron_Command *command,
                      arthron_CommandReply *out_reply) {
    commands_run(sessions, actor, command, out_reply);
}

bool sessions_metrics_of(struct sessions *s, int station, uint64_t session,
                         arthron_Metrics *out_metrics) {
    struct live_metrics *metrics = alloc(1, sizeof *metrics);
    runtime_metrics(s->runtime, station, metrics);
    bool is_of_it = metrics->session && metrics->session == session;
    if (is_of_it)
        reply_metrics(&metrics->metrics, scene_case(metrics->scene), out_metrics);
    free(metrics);
    return is_of_it;
}

bool sessions_metrics(void *sessions, const char *station, arthron_Metrics *out_metrics) {
    struct sessions *s = sessions;
    int index = sessions_find_station(&s->config, station);
    if (index < 0)
        return false;
    struct station_status status;
    station_slot_status(&s->slots[index], &status);
    sessions_metrics_of(s, index, status.about.serial, out_metrics);
    return true;
}

void sessions_status(struct sessions *s, int station, struct station_status *out_status) {
    station_slot_status(&s->slots[station], out_status);
}

void sessions_info(struct sessions *s, int station, arthron_SessionInfo *out_info) {
    session_info(s, station, out_info);
}

int sessions_whose(const struct sessions *s, struct cluster_peer *out, int max,
                   int *out_served_by) {
    return sharing_whose(s, out, max, out_served_by);
}

bool sessions_remarks(struct sessions *s, int station, uint64_t session, uint64_t told,
                      const uint64_t told_each[REMARKS_MAX], struct kept_remark *out, int room,
                      int *out_count, uint64_t *out_revision) {
    struct station_slot *slot = &s->slots[station];
    const struct remarks *remarks = &slot->remarks;
    bool all = true;
    *out_count = 0;
    pthread_mutex_lock(&slot->lock);
    *out_revision = remarks->revision;
    bool is_new = remarks->session == session && remarks->revision != told;
    for (int i = 0; is_new && all && i < remarks->count; i++) {
        if (remarks->all[i].revision == told_each[i])
            continue;
        all = *out_count < room;
        if (all)
            out[(*out_count)++] = remarks->all[i];
    }
    pthread_mutex_unlock(&slot->lock);
    return all;
}

int sessions_markers(struct sessions *s, int station, uint64_t session, uint64_t *told,
                     struct marker *out, int room) {
    struct station_slot *slot = &s->slots[station];
    pthread_mutex_lock(&slot->lock);
    int count =
        slot->markers.session == session ? marker_list_get(&slot->markers, told, out, room) : 0;
    pthread_mutex_unlock(&slot->lock);
    return count;
}

const struct sessions_config *sessions_config(const struct sessions *s) {
    return &s->config;
}

const struct scene *sessions_scene(const struct sessions *s, int index) {
    return s->scenes[index];
}

bool sessions_case_is_broken(const struct sessions *s, int index, struct error *why) {
    return grades_are_broken(s->grades, index, why);
}

const struct task_library *sessions_tasks(const struct sessions *s) {
    return s->tasks;
}

struct cluster *sessions_cluster(const struct sessions *s) {
    return s->sharing ? s->sharing->cluster : NULL;
}

struct runtime *sessions_runtime(struct sessions *s) {
    return s->runtime;
}

void sessions_figures(const struct sessions *s, struct sessions_figures *out) {
    *out = (struct sessions_figures){.control = control_counts(s->control),
                                     .control_round_ns = control_round_ns(s->control),
                                     .retention = retention_figures(s->retention),
                                     .records_waiting = recorder_waiting(s->recorder),
                                     .are_ending = sessions_are_ending(s)};
}
