#include "commands/session_answer.h"
#include "step/session.h"

#include <inttypes.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>

static json_t *calibration_to_json(const arthron_SessionInfo *info) {
    const arthron_Calibration *c = &info->calibration;
    if (!info->has_calibration)
        return json_null();
    return json_pack("{s:I, s:f, s:f, s:s}", "utc_s", (json_int_t)c->utc_s, "residual_mm",
                     c->residual_mm, "residual_deg", c->residual_deg, "problem",
                     info->calibration_problem);
}

static json_t *drift_to_json(const arthron_SessionInfo *info) {
    return info->touches ? json_real(info->drift_mm) : json_null();
}

static json_t *zones_to_json(const float zones[9]) {
    json_t *array = json_array();
    for (int i = 0; i < 9; i++)
        json_array_append_new(array, json_real((double)zones[i]));
    return array;
}

static json_t *resection_to_json(const arthron_Resection *r) {
    char hash[17];
    snprintf(hash, sizeof hash, "%016" PRIx64, r->mesh_hash);
    return json_pack(
        "{s:s, s:I, s:I, s:I, s:I, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:f, "
        "s:o, s:o, s:o, s:s, s:f, s:f}",
        "group", r->group, "mesh_number", (json_int_t)r->mesh_number, "cuts", (json_int_t)r->cuts,
        "cuts_refused", (json_int_t)r->cuts_refused, "pieces", (json_int_t)r->pieces, "volume_mm3",
        r->volume_mm3, "removed_mm3", r->removed_mm3, "pieces_mm3", r->pieces_mm3, "warped_mm3",
        r->warped_mm3, "left_mm3", r->left_mm3, "distance_mm", r->distance_mm, "planned_mm3",
        r->planned_mm3, "over_mm3", r->over_mm3, "under_mm3", r->under_mm3, "damage_mm3",
        r->damage_mm3, "rim_mm", r->rim_mm, "step_mm", r->step_mm, "whole_zone_mm3",
        zones_to_json(r->whole_zone_mm3), "removed_zone_mm3", zones_to_json(r->removed_zone_mm3),
        "budget_zone_mm3", zones_to_json(r->budget_zone_mm3), "mesh_hash", hash,
        "touched_unseen_mm3", r->touched_unseen_mm3, "seen_untouched_mm3", r->seen_untouched_mm3);
}

// Of a certificate; 0: unknown.
static json_t *end_to_json(int64_t until_utc_s) {
    return until_utc_s ? json_integer(until_utc_s) : json_null();
}

static json_t *slowed_to_json(const arthron_SessionInfo *info) {
    static const char *const names[] = {"frames", "mesh_asks", "messages"}; // the lowest bit first
    json_t *array = json_array();
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (info->slowed >> i & 1)
            json_array_append_new(array, json_string(names[i]));
    return array;
}

static json_t *info_to_json(const arthron_SessionInfo *info) {
    char id[33];
    for (int i = 0; i < 16; i++)
        snprintf(id + 2 * i, 3, "%02x", info->id[i]);
    return json_pack(
        "{s:s, s:s, s:s, s:s, s:b, s:f, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:f, s:f, s:s, s:o, "
        "s:I, s:o, s:s, s:I, s:b, s:s, s:s, s:o, s:o, s:f, s:b, s:s}",
        "station", info->station, "id", id, "case", info->case_name, "state",
        session_state_name((enum session_state)info->state), "connected", info->connected,
        "start_utc_s", (double)info->start_utc_ns / 1e9, "steps", (json_int_t)info->steps,
        "frames_lost", (json_int_t)info->frames_lost, "frames_late", (json_int_t)info->frames_late,
        "frames_old", (json_int_t)info->frames_old, "frames_early", (json_int_t)info->frames_early,
        "frames_invalid", (json_int_t)info->frames_invalid, "frames_excess",
        (json_int_t)info->frames_excess, "rtt_us", info->rtt_p50_us, "clock_uncertainty_us",
        info->clock_uncertainty_us, "trace", info->trace, "calibration", calibration_to_json(info),
        "touches", (json_int_t)info->touches, "drift_mm", drift_to_json(info), "case_grade",
        info->case_grade, "trace_missing", (json_int_t)info->trace_missing, "trace_failing",
        info->trace_failing, "trainee", info->trainee, "next_trainee", info->next_trainee,
        "certificate_until_utc_s", end_to_json(info->certificate_until_utc_s), "slowed",
        slowed_to_json(info), "clock_step_s", (double)info->clock_step_ns / 1e9, "unprotected",
        info->unprotected, "server", info->server);
}

static json_t *refused_to_json(const arthron_Refused *r) {
    return json_pack("{s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:I}", "strangers",
                     (json_int_t)r->strangers, "forged", (json_int_t)r->forged, "replayed",
                     (json_int_t)r->replayed, "malformed", (json_int_t)r->malformed, "too_long",
                     (json_int_t)r->too_long, "certificates", (json_int_t)r->certificates,
                     "control_malformed", (json_int_t)r->control_malformed, "control_unknown",
                     (json_int_t)r->control_unknown, "replies_dropped",
                     (json_int_t)r->replies_dropped);
}

static json_t *joint_to_json(const arthron_JointReading *reading) {
    const arthron_Joint *j = &reading->joint;
    const arthron_Pose *p = &reading->pose;
    return json_pack("{s:I, s:s, s:f, s:f, s:f, s:f, s:f, s:f, s:[f, f, f, f, f, f, f]}", "step",
                     (json_int_t)reading->step, "validity",
                     validity_name((enum validity)reading->validity), "flexion_deg", j->flexion_deg,
                     "varus_deg", j->varus_deg, "internal_deg", j->internal_deg, "shift_mm",
                     j->shift_mm, "drawer_mm", j->drawer_mm, "distraction_mm", j->distraction_mm,
                     "T_femur_tibia", p->x, p->y, p->z, p->qw, p->qx, p->qy, p->qz);
}

static json_t *undone_to_json(const arthron_Undone *undone) {
    return json_pack("{s:I, s:f}", "cuts", (json_int_t)undone->cuts, "volume_mm3",
                     undone->volume_mm3);
}

static json_t *metric_to_json(const arthron_Metric *m) {
    return json_pack("{s:s, s:s, s:s, s:I, s:o, s:b}", "name", m->name, "subject", m->subject,
                     "unit", m->unit, "version", (json_int_t)m->version, "value",
                     isfinite(m->value) ? json_real(m->value) : json_null(), "below_floor",
                     m->below_floor);
}

void session_print_json(const struct session_answer *answer) {
    const arthron_CommandReply *reply = &answer->reply;
    json_t *sessions = json_array();
    for (size_t i = 0; i < answer->session_count; i++)
        json_array_append_new(sessions, info_to_json(&answer->sessions[i]));
    json_t *whole =
        json_pack("{s:b, s:s, s:o}", "ok", reply->ok, "text", reply->text, "sessions", sessions);
    json_t *resections = json_array();
    for (pb_size_t i = 0; i < reply->resections_count; i++)
        json_array_append_new(resections, resection_to_json(&reply->resections[i]));
    json_object_set_new(whole, "resections", resections);
    json_t *metrics = json_array();
    for (pb_size_t i = 0; i < answer->metrics.metrics_count; i++)
        json_array_append_new(metrics, metric_to_json(&answer->metrics.metrics[i]));
    json_object_set_new(whole, "metrics", metrics);
    if (reply->has_undone)
        json_object_set_new(whole, "undone", undone_to_json(&reply->undone));
    if (reply->has_joint)
        json_object_set_new(whole, "joint", joint_to_json(&reply->joint));
    if (reply->has_refused)
        json_object_set_new(whole, "refused", refused_to_json(&reply->refused));
    if (reply->certificate_until_utc_s)
        json_object_set_new(whole, "certificate_until_utc_s",
                            json_integer(reply->certificate_until_utc_s));
    json_dumpf(whole, stdout, JSON_COMPACT);
    putchar('\n');
    json_decref(whole);
}
