#include "sessions/opening.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "sessions/attempts.h"
#include "sessions/audit.h"
#include "sessions/own.h"
#include "sessions/resources.h"
#include "sessions/sharing.h"
#include "trace/catalogue.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define OPENING_RETRY_NS (3 * NS_PER_S)

// ---- the trace ----------------------------------------------------------------------------------

void opening_header(const struct sessions *s, int station, const uint8_t id[16], int scene,
                    double strength, const char *trainee, struct trace_header *out) {
    const struct knee_case *knee = scene_case(s->scenes[scene]);
    *out = (struct trace_header){
        .version = TRACE_VERSION,
        .case_hash = knee->hash,
        .start_utc_ns = clock_utc_ns(),
        .start_ns = clock_now_ns(),
        .settings = s->config.settings,
        .optic = s->config.stations[station].optic,
        .loose_count = knee->loose_count,
    };
    memcpy(out->session_id, id, sizeof out->session_id);
    snprintf(out->station, sizeof out->station, "%s", station_name(s, station));
    snprintf(out->trainee, sizeof out->trainee, "%s", trainee);
    snprintf(out->case_name, sizeof out->case_name, "%s", knee->name);
    snprintf(out->case_dir, sizeof out->case_dir, "%s", s->config.cases[scene].dir);
    if (!isnan(strength))
        out->settings.field.strength = strength;
    trace_header_set_machine(out);
    sharing_header(s, station, out);
}

enum result opening_trace_path(const struct sessions *s, const struct trace_header *header,
                               char out_path[SESSIONS_PATH_MAX], struct error *err) {
    char name[TRACE_NAME_MAX];
    trace_name(header, name);
    int length = snprintf(out_path, SESSIONS_PATH_MAX, "%s/%s", s->config.traces_dir, name);
    if (length >= SESSIONS_PATH_MAX)
        return fail(err, RESULT_LIMIT, "%s: the path of the traces is too long",
                    s->config.traces_dir);
    return RESULT_OK;
}

// ---- opening ------------------------------------------------------------------------------------

void opening_about(struct sessions *s, const struct trace_header *header, int scene,
                   const char *trace, struct session_about *out) {
    *out = (struct session_about){
        .serial = atomic_fetch_add(&s->serials, 1) + 1,
        .scene = scene,
        .start_utc_ns = header->start_utc_ns,
        .start_ns = header->start_ns,
        .strength = header->settings.field.strength,
        .instruments = header->settings.instruments,
    };
    memcpy(out->id, header->session_id, sizeof out->id);
    snprintf(out->trainee, sizeof out->trainee, "%s", header->trainee);
    snprintf(out->trace, sizeof out->trace, "%s", trace);
}

struct hand_over {
    struct sessions *sessions;
    int station;
    struct session_runtime *session;
};

static void give_to_worker(void *user) {
    struct hand_over *h = user;
    runtime_attach(h->sessions->runtime, h->station, h->session);
}

void opening_hand_over(struct sessions *s, int station, const struct session_about *about,
                       struct session_runtime *session, struct remarks *said,
                       struct marker_list *marked) {
    struct hand_over handing = {s, station, session};
    station_slot_attached(&s->slots[station], about, session->state, said, marked, give_to_worker,
                          &handing);
}

void opening_attach(struct sessions *s, int station, struct open_session *session,
                    const struct trace_header *header, int scene, const char *trace) {
    struct session_runtime *runtime = &session->runtime;
    struct session_about about;
    opening_about(s, header, scene, trace, &about);
    runtime->serial = about.serial;
    memcpy(runtime->trace_file, about.trace, sizeof runtime->trace_file);
    snapshot_begin(&runtime->snapshots, about.serial, header->start_ns);
    runtime->metrics = (struct live_metrics){.session = about.serial, .scene = runtime->scene};
    metrics_init(&runtime->metrics.metrics, &header->settings.instruments, header->optic);
    session_row_begin(header, trace, &session->row);
    own_traces_note(s, trace);
    recorder_put(s->recorder, &session->row);
    audit_server(s, station, "open", session->row.id);
    log_info("sessions", "station %s: session on case %s, trace %s", station_name(s, station),
             scene_case(runtime->scene)->name, trace);
    opening_hand_over(s, station, &about, runtime, NULL, NULL);
}

// Where the config has the body of an instrument by its name, it wins over that by the place.
static void take_bodies(const struct sessions_config *c, struct session_settings *settings) {
    for (int i = INSTRUMENTS_USUAL; i < settings->instruments.count; i++)
        for (int k = 0; k < c->instrument_count; k++)
            if (!strcmp(c->instruments[k].name, settings->instruments.of[i].name))
                settings->bodies[i] = c->instruments[k].body;
}

static enum result open_session(struct sessions *s, int station, struct error *err) {
    struct station_status status;
    struct trace_header header;
    struct trace_writer *trace;
    char path[SESSIONS_PATH_MAX];
    station_slot_status(&s->slots[station], &status);
    opening_header(s, station, status.session_id, status.scene, status.strength, status.trainee,
                   &header);
    header.settings.instruments = status.instruments;
    take_bodies(&s->config, &header.settings);
    enum result result = resources_allow_session(err);
    if (result == RESULT_OK)
        result = opening_trace_path(s, &header, path, err);
    if (result == RESULT_OK)
        result = trace_writer_create(path, &header, &s->trace_signer, sharing_tap(s, station),
                                     &trace, err);
    if (result != RESULT_OK)
        return result;
    sharing_begun(s, station, &header, path, &(struct job){0}, &(struct lasting_records){0});
    struct open_session *session = alloc(1, sizeof *session);
    struct session_runtime *runtime = &session->runtime;
    runtime->trace = trace;
    runtime->scene = s->scenes[status.scene];
    runtime->session = session_create(runtime->scene, &header.settings);
    runtime->operation =
        operation_create(runtime->scene, header.settings.rules, &header.settings.instruments);
    opening_attach(s, station, session, &header, status.scene, path);
    return RESULT_OK;
}

static void tell_failure(struct sessions *s, int station, const struct error *err) {
    struct station_status status;
    arthron_Control message = {.which_message = arthron_Control_session_change_tag};
    arthron_SessionChange *change = &message.message.session_change;
    change->state = arthron_SessionState_CLOSED;
    snprintf(change->text, sizeof change->text, "no session: %.200s", err->text);
    station_slot_refused(&s->slots[station], change->text);
    station_slot_status(&s->slots[station], &status);
    if (status.connected)
        control_send(s->control, status.peer, &message);
    log_error("sessions", "station %s: no session: %s", station_name(s, station), err->text);
}

enum result opening_run(struct sessions *s, int station, struct error *err) {
    enum result result = open_session(s, station, err);
    if (result != RESULT_OK) {
        station_slot_failed(&s->slots[station], clock_now_ns() + OPENING_RETRY_NS);
        tell_failure(s, station, err);
    }
    return result;
}

// ---- release ------------------------------------------------------------------------------------

static void log_session_end(const struct sessions *s, int station, struct trace_status status) {
    const char *name = station_name(s, station);
    if (status.missing)
        log_error("sessions", "station %s: session ended, %llu of its records could not be written",
                  name, (unsigned long long)status.missing);
    else
        log_info("sessions", "station %s: session ended after %llu steps", name,
                 (unsigned long long)status.records);
}

static void record_end(struct sessions *s, struct store_session *row, struct trace_status status,
                       bool deserted) {
    row->state = deserted ? STATE_DESERTED : STATE_CLOSED;
    row->end_utc_ns = clock_utc_ns();
    row->steps = status.records;
    row->missing = status.missing;
    recorder_put(s->recorder, row);
}

static void close_trace(struct sessions *s, int station, struct open_session *session,
                        enum session_end end) {
    struct trace_writer **trace = &session->runtime.trace;
    struct trace_status status = trace_writer_status(*trace);
    log_session_end(s, station, status);
    trace_writer_destroy(trace);
    record_end(s, &session->row, status, end == END_DESERTED);
}

void opening_release(struct sessions *s, int station, struct session_runtime *ended,
                     enum session_end end) {
    struct open_session *session = (struct open_session *)ended;
    if (end == END_DESERTED) {
        log_warning("sessions", "station %s: no frame for %d s; its session ends",
                    station_name(s, station), s->config.wait_s);
        audit_server(s, station, "end", session->row.id);
    }
    if (end == END_HANDED_OVER && !s->sharing) {
        log_info("sessions", "station %s: its session stays open for the next server",
                 station_name(s, station));
        trace_writer_leave(&ended->trace);
    } else {
        close_trace(s, station, session, end);
    }
    if (end == END_HANDED_OVER)
        station_slot_set_state(&s->slots[station], ended->serial, SESSION_CLOSED);
    sharing_ended(s, station, ended->trace_file, end == END_HANDED_OVER);
    session_destroy(&ended->session);
    operation_destroy(&ended->operation);
    attempts_free(&ended->attempt);
    free(session);
}
