#include "commands/watched.h"

#include "base/clock.h"
#include "net/authority.h"
#include "store/store.h"
#include "watch/exposition.h"

#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/statvfs.h>

#define SILENT_NS (5 * NS_PER_S)
#define ROOM_LEAST (256 << 20) // bytes

// ---- whether it lives and is ready --------------------------------------------------------------

static bool is_silent(int64_t last_ns) {
    return clock_now_ns() - last_ns > SILENT_NS;
}

bool watched_lives(void *watched, char why[API_WHY_MAX]) {
    const struct watched *w = watched;
    struct sessions_figures figures;
    sessions_figures(w->sessions, &figures);
    const char *fault = is_silent(figures.control_round_ns) ? "the loop of stations does not answer"
                        : is_silent(runtime_looked_ns(sessions_runtime(w->sessions)))
                            ? "nobody watches the workers"
                            : NULL;
    if (fault)
        snprintf(why, API_WHY_MAX, "%s", fault);
    return !fault;
}

static bool may_serve(const struct watched *w) {
    const struct cluster *cluster = sessions_cluster(w->sessions);
    return !cluster || clock_now_ns() < atomic_load(cluster_serves_until(cluster));
}

static bool records_open(const struct sessions_config *config) {
    struct store *store;
    enum result result = store_open(config->records, STORE_THERE, "server", &store, NULL);
    store_close(&store);
    return result == RESULT_OK;
}

static bool has_room(const struct sessions_config *config) {
    struct statvfs disk;
    return !statvfs(config->traces_dir, &disk) && disk.f_bavail * disk.f_frsize >= ROOM_LEAST;
}

bool watched_is_ready(void *watched, char why[API_WHY_MAX]) {
    const struct watched *w = watched;
    const struct sessions_config *config = sessions_config(w->sessions);
    struct sessions_figures figures;
    sessions_figures(w->sessions, &figures);
    if (!watched_lives(watched, why))
        return false;
    const char *fault = figures.are_ending      ? "the server ends"
                        : !may_serve(w)         ? "the lease is over"
                        : !records_open(config) ? "the records cannot be opened"
                        : !has_room(config)     ? "the disk of the traces has no room"
                                                : NULL;
    if (fault)
        snprintf(why, API_WHY_MAX, "%s", fault);
    return !fault;
}

// ---- stations and their sessions ----------------------------------------------------------------

static const char *station_label(const struct watched *w, int station) {
    return sessions_config(w->sessions)->stations[station].name;
}

// A name that no certificate can have may be no UTF-8.
static bool is_told(const struct watched *w, int station) {
    return authority_name_is_valid(station_label(w, station));
}

static void write_sessions(struct exposition *e, const struct watched *w) {
    static const char *const states[] = {"waiting", "running", "paused"};
    int in_state[4] = {0}, connected = 0, unprotected = 0, failing = 0;
    int count = sessions_config(w->sessions)->station_count;
    arthron_SessionInfo info;
    for (int i = 0; i < count; i++) {
        sessions_info(w->sessions, i, &info);
        in_state[info.state]++;
        connected += info.connected;
        unprotected += info.unprotected;
        failing += info.trace_failing && info.state != arthron_SessionState_CLOSED;
    }
    exposition_begin(e, "arthron_sessions", FIGURE_GAUGE, NULL, "Open sessions by their state.");
    for (int i = 0; i < 3; i++)
        exposition_value(e, "state", states[i], in_state[i]);
    exposition_one(e, "arthron_sessions_unprotected", FIGURE_GAUGE, NULL,
                   "Sessions that no other server could go on with.", unprotected);
    exposition_one(e, "arthron_sessions_trace_failing", FIGURE_GAUGE, NULL,
                   "Open sessions whose trace cannot be written.", failing);
    exposition_one(e, "arthron_stations", FIGURE_GAUGE, NULL, "Stations of the config.", count);
    exposition_one(e, "arthron_stations_connected", FIGURE_GAUGE, NULL,
                   "Stations that are connected to this server.", connected);
}

static void write_frames(struct exposition *e, const struct watched *w) {
    static const struct {
        const char *name, *help;
    } fates[FATE_COUNT] = {
        [FATE_TAKEN] = {"taken", "Poses of a station that made a step."},
        [FATE_LOST] = {"lost", "Poses of a station that never came."},
        [FATE_LATE] = {"late", "Poses of a station behind a newer one."},
        [FATE_OLD] = {"old", "Poses of a station that came twice or too late."},
        [FATE_EARLY] = {"early", "Poses of a station without a session or a known clock."},
        [FATE_INVALID] = {"invalid", "Poses of a station with values out of range."},
        [FATE_EXCESS] = {"excess", "Poses of a station beyond its share."},
    };
    struct runtime *runtime = sessions_runtime(w->sessions);
    char name[64];
    for (int fate = 0; fate < FATE_COUNT; fate++) {
        snprintf(name, sizeof name, "arthron_poses_%s", fates[fate].name);
        exposition_begin(e, name, FIGURE_COUNTER, NULL, fates[fate].help);
        for (int i = 0; i < sessions_config(w->sessions)->station_count; i++)
            if (is_told(w, i))
                exposition_value(e, "station", station_label(w, i),
                                 (double)atomic_load(&runtime_counts(runtime, i)->fates[fate]));
    }
}

// ---- work ---------------------------------------------------------------------------------------

static void write_latency(struct exposition *e, const char *name, const char *help,
                          const struct latency_figures *figures) {
    exposition_begin(e, name, FIGURE_HISTOGRAM, "seconds", help);
    exposition_latency(e, figures);
}

static void write_cuts(struct exposition *e, const struct runtime_figures *f) {
    exposition_one(e, "arthron_cuts_asked", FIGURE_COUNTER, NULL, "Cuts that sessions asked for.",
                   (double)f->cuts_asked);
    exposition_begin(e, "arthron_cuts_landed", FIGURE_COUNTER, NULL,
                     "Cuts whose result became part of a session, by their outcome.");
    for (int i = 0; i < JOB_OUTCOME_COUNT; i++)
        exposition_value(e, "outcome", job_outcome_name((enum job_outcome)i),
                         (double)f->cuts_landed[i]);
}

static void write_work(struct exposition *e, const struct watched *w,
                       const struct sessions_figures *figures) {
    struct runtime_figures f;
    runtime_figures(sessions_runtime(w->sessions), &f);
    write_latency(e, "arthron_step_seconds", "A step of a session: bones, warp, instruments.",
                  &f.steps);
    write_latency(e, "arthron_answer_seconds", "From the receipt of a pose to its answer.",
                  &f.answers);
    write_latency(e, "arthron_cut_seconds", "A cut, beside the steps.", &f.cuts);
    write_cuts(e, &f);
    exposition_begin(e, "arthron_queue_length", FIGURE_GAUGE, NULL, "What waits for a thread.");
    exposition_value(e, "queue", "worker", (double)f.requests_waiting);
    exposition_value(e, "queue", "manager", (double)f.notices_waiting);
    exposition_value(e, "queue", "cuts", (double)f.jobs_waiting);
    exposition_value(e, "queue", "meshes", (double)f.mesh_requests_waiting);
    exposition_value(e, "queue", "recorder", figures->records_waiting);
}

// ---- network ------------------------------------------------------------------------------------

static void write_refused(struct exposition *e, const struct watched *w,
                          const struct control_counts *control) {
    struct socket_counts s = runtime_socket_counts(sessions_runtime(w->sessions));
    const struct {
        const char *why;
        uint64_t count;
    } datagrams[] = {{"stranger", s.strangers},
                     {"forged", s.forged},
                     {"replayed", s.replayed},
                     {"malformed", s.malformed},
                     {"too_long", s.too_long}};
    exposition_begin(e, "arthron_datagrams_refused", FIGURE_COUNTER, NULL,
                     "Datagrams that were dropped, by the reason.");
    for (size_t i = 0; i < sizeof datagrams / sizeof *datagrams; i++)
        exposition_value(e, "reason", datagrams[i].why, (double)datagrams[i].count);
    exposition_begin(e, "arthron_peers_refused", FIGURE_COUNTER, NULL,
                     "Connections of stations that were refused or shut, by the reason.");
    exposition_value(e, "reason", "certificate", (double)control->refused_certificates);
    exposition_value(e, "reason", "malformed", (double)control->malformed_messages);
    exposition_value(e, "reason", "crowd", (double)control->shut);
    exposition_one(e, "arthron_replies_dropped", FIGURE_COUNTER, NULL,
                   "Answers that a station's connection had no room for.",
                   (double)control->replies_dropped);
}

static void write_web(struct exposition *e, const struct watched *w, const struct web_counts *web) {
    static const char *const classes[] = {NULL, "1xx", "2xx", "3xx", "4xx", "5xx"};
    exposition_begin(e, "arthron_http_answers", FIGURE_COUNTER, NULL,
                     "Answers to requests of browsers and programs, by the class of their status.");
    for (int i = 1; i < 6; i++)
        exposition_value(e, "class", classes[i], (double)web->answers[i]);
    exposition_one(e, "arthron_http_connections", FIGURE_GAUGE, NULL,
                   "Connections of browsers and programs.", web->connections);
    exposition_one(e, "arthron_pages_connected", FIGURE_GAUGE, NULL,
                   "Pages that follow sessions (/live).", web->pages);
    exposition_one(e, "arthron_sign_ins_failed", FIGURE_COUNTER, NULL,
                   "Wrong passwords, codes and links.", (double)api_wrong_sign_ins(w->api));
}

static void write_cluster(struct exposition *e, const struct watched *w) {
    const struct cluster *cluster = sessions_cluster(w->sessions);
    if (!cluster)
        return;
    int64_t left_ns = atomic_load(cluster_serves_until(cluster)) - clock_now_ns();
    exposition_one(e, "arthron_nats_connected", FIGURE_GAUGE, NULL,
                   "1 if NATS is connected, else 0.", cluster_is_connected(cluster));
    exposition_one(e, "arthron_lease_left_seconds", FIGURE_GAUGE, "seconds",
                   "How long this server may still serve unasked.",
                   left_ns > 0 ? (double)left_ns / 1e9 : 0);
}

static void write_retention(struct exposition *e, const struct watched *w,
                            const struct retention_figures *r) {
    const struct sessions_config *config = sessions_config(w->sessions);
    if (!config->keep_days && !config->keep_gb)
        return;
    exposition_one(e, "arthron_traces_bytes", FIGURE_GAUGE, "bytes", "All files of traces.",
                   (double)r->traces_bytes);
    exposition_one(e, "arthron_sessions_due", FIGURE_GAUGE, NULL,
                   "Recorded sessions that are removed next.", (double)r->due);
    exposition_one(e, "arthron_sessions_removed", FIGURE_COUNTER, NULL,
                   "Recorded sessions that were removed because they are kept no longer.",
                   (double)r->removed);
}

// ---- disk and certificates ----------------------------------------------------------------------

static double size_of(const char *path) {
    struct stat status;
    return stat(path, &status) ? 0 : (double)status.st_size;
}

static void write_disk(struct exposition *e, const struct watched *w) {
    const struct sessions_config *config = sessions_config(w->sessions);
    struct statvfs disk = {0};
    char wal[SESSIONS_PATH_MAX + 8];
    statvfs(config->traces_dir, &disk);
    snprintf(wal, sizeof wal, "%s-wal", config->records);
    exposition_one(e, "arthron_traces_disk_free_bytes", FIGURE_GAUGE, "bytes",
                   "What the disk of the traces has left for this server.",
                   (double)disk.f_bavail * (double)disk.f_frsize);
    exposition_one(e, "arthron_traces_disk_size_bytes", FIGURE_GAUGE, "bytes",
                   "The disk of the traces.", (double)disk.f_blocks * (double)disk.f_frsize);
    exposition_one(e, "arthron_records_bytes", FIGURE_GAUGE, "bytes",
                   "The records, with the log beside them.",
                   size_of(config->records) + size_of(wal));
}

static void write_certificates(struct exposition *e, const struct watched *w, int64_t web_until_s) {
    const char *keys = sessions_config(w->sessions)->keys_dir;
    const struct {
        const char *name;
        int64_t until_s;
    } ends[] = {{"authority", authority_certificate_end(keys, "authority.pem")},
                {"server", authority_certificate_end(keys, "server.pem")},
                {"web", web_until_s}};
    exposition_begin(e, "arthron_certificate_left_seconds", FIGURE_GAUGE, "seconds",
                     "Until a certificate ends; below 0 behind its end.");
    for (size_t i = 0; i < sizeof ends / sizeof *ends; i++)
        if (ends[i].until_s)
            exposition_value(e, "certificate", ends[i].name,
                             (double)ends[i].until_s - (double)clock_utc_ns() / 1e9);
}

// ---- all ----------------------------------------------------------------------------------------

void watched_write(void *watched, bool openmetrics, FILE *file) {
    const struct watched *w = watched;
    struct exposition e = {.file = file, .openmetrics = openmetrics};
    struct sessions_figures figures;
    struct web_counts web = web_counts(*w->web);
    sessions_figures(w->sessions, &figures);
    exposition_begin(&e, "arthron_build", FIGURE_INFO, NULL, "The version of this server.");
    exposition_value(&e, "version", ARTHRON_VERSION, 1);
    exposition_one(&e, "arthron_uptime_seconds", FIGURE_GAUGE, "seconds",
                   "Since the server takes stations and pages.",
                   (double)(clock_now_ns() - w->started_ns) / 1e9);
    write_sessions(&e, w);
    write_frames(&e, w);
    write_work(&e, w, &figures);
    write_refused(&e, w, &figures.control);
    write_web(&e, w, &web);
    write_cluster(&e, w);
    write_disk(&e, w);
    write_retention(&e, w, &figures.retention);
    write_certificates(&e, w, web.certificate_until_s);
    exposition_end(&e);
}
