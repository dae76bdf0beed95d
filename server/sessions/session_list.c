#include "sessions/session_list.h"

#include "base/clock.h"
#include "net/authority.h"
#include "runtime/reply.h"
#include "sessions/calibration.h"
#include "sessions/sharing.h"

#include <stdio.h>
#include <string.h>

#define TISSUES_WAIT_NS (5 * NS_PER_S)
#define LATELY_NS (60 * NS_PER_S)
#define WITHOUT_DATAGRAMS_NS (2 * NS_PER_S)

// ---- one line of the list -----------------------------------------------------------------------

static void tell_counts(const struct station_counts *counts, arthron_SessionInfo *out) {
    out->steps = atomic_load(&counts->steps);
    out->frames_lost = atomic_load(&counts->frames_lost);
    out->frames_late = atomic_load(&counts->frames_late);
    out->frames_old = atomic_load(&counts->frames_old);
    out->frames_early = atomic_load(&counts->frames_early);
    out->frames_invalid = atomic_load(&counts->frames_invalid);
    out->frames_excess = atomic_load(&counts->frames_excess);
    out->trace_missing = atomic_load(&counts->trace_missing);
    out->trace_failing = atomic_load(&counts->trace_failing);
    out->touches = atomic_load(&counts->touches);
    out->drift_mm = (double)atomic_load(&counts->drift_nm) / 1e6;
}

static void tell_lately(const struct station_counts *counts, int64_t now_ns,
                        arthron_SessionInfo *out) {
    int64_t stepped_ns = atomic_load(&counts->clock_stepped_ns);
    int64_t datagram_ns = atomic_load(&counts->datagram_ns);
    int64_t frame_ns = atomic_load(&counts->frame_ns);
    for (int i = 0; i < SLOWED_COUNT; i++) {
        int64_t slowed_ns = atomic_load(&counts->slowed_ns[i]);
        out->slowed |= (uint32_t)(slowed_ns && now_ns - slowed_ns < LATELY_NS) << i;
    }
    if (stepped_ns && now_ns - stepped_ns < LATELY_NS)
        out->clock_step_ns = atomic_load(&counts->clock_step_ns);
    out->without_datagrams = datagram_ns && frame_ns - datagram_ns > WITHOUT_DATAGRAMS_NS;
}

static void tell_station(struct sessions *s, const struct station_status *status,
                         arthron_SessionInfo *out) {
    out->connected = status->connected;
    out->rtt_p50_us = (double)status->rtt_ns / 1e3;
    out->clock_uncertainty_us = (double)status->clock_uncertainty_ns / 1e3;
    if (status->connected)
        out->certificate_until_utc_s = control_certificate_end(s->control, status->peer);
    out->has_calibration = status->calibrated;
    out->calibration = status->calibration;
    if (status->calibrated)
        calibration_judge(&status->calibration, &s->config, clock_utc_ns() / NS_PER_S,
                          out->calibration_problem, sizeof out->calibration_problem);
}

void session_info(struct sessions *s, int station, arthron_SessionInfo *out) {
    struct station_status status;
    station_slot_status(&s->slots[station], &status);
    memset(out, 0, sizeof *out);
    snprintf(out->station, sizeof out->station, "%s", station_name(s, station));
    snprintf(out->case_name, sizeof out->case_name, "%s", s->config.cases[status.scene].name);
    snprintf(out->case_grade, sizeof out->case_grade, "%s", grades_name(s->grades, status.scene));
    out->state = (arthron_SessionState)status.state;
    memcpy(out->id, status.session_id, sizeof out->id);
    out->start_utc_ns = status.about.start_utc_ns;
    snprintf(out->trace, sizeof out->trace, "%s", status.about.trace);
    snprintf(out->trainee, sizeof out->trainee, "%s", status.about.trainee);
    snprintf(out->next_trainee, sizeof out->next_trainee, "%s", status.trainee);
    tell_counts(runtime_counts(s->runtime, station), out);
    tell_lately(runtime_counts(s->runtime, station), clock_now_ns(), out);
    tell_station(s, &status, out);
    out->unprotected = status.phase == SLOT_ATTACHED && !sharing_protects(s, station);
    sharing_server(s, station, out->server, sizeof out->server);
}

// ---- one session --------------------------------------------------------------------------------

static void tell_joint(struct sessions *s, int station, const struct station_status *status,
                       arthron_CommandReply *reply) {
    struct step_snapshot snapshot;
    runtime_snapshot(s->runtime, station, &snapshot);
    reply->has_joint = status->phase != SLOT_EMPTY && snapshot.step > 0;
    if (!reply->has_joint)
        return;
    const pose *bodies = snapshot.T_mockup_body;
    pose T_femur_tibia = pose_compose(pose_inverse(bodies[BODY_FEMUR]), bodies[BODY_TIBIA]);
    reply->joint = (arthron_JointReading){
        .step = snapshot.step,
        .time_ns = snapshot.time_ns,
        .validity = (arthron_Validity)snapshot.joint_validity,
        .has_joint = true,
        .joint = wire_joint_from(&snapshot.joint),
        .has_pose = true,
        .pose = wire_pose_from(T_femur_tibia),
    };
}

static void tell_tissues(struct sessions *s, int station, const struct station_status *status,
                         arthron_CommandReply *reply) {
    struct tissue_report report;
    const struct scene *scene = s->scenes[status->scene];
    runtime_tissues(s->runtime, station, &report);
    if (!status->has_tissues || report.session != status->about.serial)
        report = (struct tissue_report){0};
    reply->resections_count = (pb_size_t)scene_tissue_count(scene);
    for (int i = 0; i < scene_tissue_count(scene); i++)
        reply_resection(&report.figures[i],
                        scene_case(scene)->groups[scene_tissue_group(scene, i)].name,
                        report.mesh_hashes[i], &reply->resections[i]);
}

void session_list_one(struct sessions *s, int station, arthron_CommandReply *reply) {
    struct station_status status;
    if (!station_slot_wait_tissues(&s->slots[station], clock_now_ns() + TISSUES_WAIT_NS)) {
        reply_refuse_as(reply, arthron_Why_Code_BUSY, station_name(s, station),
                        "station %s: its cut worker is too busy to answer",
                        station_name(s, station));
        return;
    }
    station_slot_status(&s->slots[station], &status);
    reply->ok = true;
    session_info(s, station, &reply->sessions[0]);
    reply->sessions_count = 1;
    tell_tissues(s, station, &status, reply);
    tell_joint(s, station, &status, reply);
}

// ---- all ----------------------------------------------------------------------------------------

static void tell_refused(struct sessions *s, arthron_Refused *out) {
    struct socket_counts sockets = runtime_socket_counts(s->runtime);
    struct control_counts control = control_counts(s->control);
    out->strangers = sockets.strangers;
    out->forged = sockets.forged;
    out->replayed = sockets.replayed;
    out->malformed = sockets.malformed;
    out->too_long = sockets.too_long;
    out->certificates = control.refused_certificates;
    out->control_malformed = control.malformed_messages;
    out->control_unknown = control.unknown_messages;
    out->replies_dropped = control.replies_dropped;
}

void session_list_all(struct sessions *s, uint32_t first, arthron_CommandReply *reply) {
    const uint32_t count = (uint32_t)s->config.station_count;
    const pb_size_t room = sizeof reply->sessions / sizeof *reply->sessions;
    struct authority_server server;
    authority_server(s->config.keys_dir, &server, NULL);
    reply->certificate_until_utc_s = server.until_utc_s;
    grades_refresh(s->grades);
    reply->has_refused = true;
    tell_refused(s, &reply->refused);
    uint32_t i = first;
    for (; i < count && reply->sessions_count < room; i++)
        session_info(s, (int)i, &reply->sessions[reply->sessions_count++]);
    reply->next = i < count ? i : 0;
    reply->ok = true;
}
