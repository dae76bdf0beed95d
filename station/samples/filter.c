#include "samples/filter.h"

#include "base/clock.h"
#include "base/number.h"

#include <stdio.h>
#include <string.h>

static const char *const filter_names[FILTER_KIND_COUNT] = {"none", "one-euro"};

const char *filter_name(enum filter_kind kind) {
    return (unsigned)kind < FILTER_KIND_COUNT ? filter_names[kind] : "unknown";
}

bool filter_parse(const char *text, struct filter_settings *out) {
    char kind[16], min_cutoff[32], beta[32], dcutoff[32] = "1", rest;
    *out = (struct filter_settings){FILTER_NONE};
    if (!strcmp(text, filter_names[FILTER_NONE]))
        return true;
    int count = sscanf(text, "%15s %31s %31s %31s %c", kind, min_cutoff, beta, dcutoff, &rest);
    out->kind = FILTER_ONE_EURO;
    return (count == 3 || count == 4) && !strcmp(kind, filter_names[FILTER_ONE_EURO]) &&
           number_double(min_cutoff, 0.01, 1000, &out->min_cutoff_hz) &&
           number_double(beta, 0, 1000, &out->beta) &&
           number_double(dcutoff, 0.01, 1000, &out->dcutoff_hz);
}

void filter_init(struct filter *filter, const struct filter_settings *settings) {
    *filter = (struct filter){.settings = *settings};
}

// ---- one step of a low-pass ---------------------------------------------------------------------

static double lag_s(double cutoff_hz) {
    return 1 / (2 * M_PI * cutoff_hz);
}

// The share of the new value, a in x' + a (x - x').
static double share(double lag, double dt_s) {
    return dt_s / (dt_s + lag);
}

// How far the filtered value goes towards the new one, after the raw one made this step.
static double share_after(struct filter *f, vec3 *speed, vec3 step, double dt_s) {
    double derivative_share = share(lag_s(f->settings.dcutoff_hz), dt_s);
    *speed = vec3_lerp(*speed, vec3_scale(1 / dt_s, step), derivative_share);
    double lag = lag_s(f->settings.min_cutoff_hz + f->settings.beta * vec3_length(*speed));
    f->latency_s = fmax(f->latency_s, lag);
    return share(lag, dt_s);
}

// ---- lengths, angles, openings ------------------------------------------------------------------

static vec3 lengths_of(const struct sample *s) {
    if (s->kind == SAMPLE_POSE)
        return s->T_mockup_body.translation;
    return (vec3){s->joint.shift_mm, s->joint.drawer_mm, s->joint.distraction_mm};
}

static vec3 angles_of(const struct sample *s) {
    return (vec3){s->joint.flexion_deg, s->joint.varus_deg, s->joint.internal_deg};
}

// From a to b the shorter way: axis times degrees.
static vec3 turn_between(quat a, quat b) {
    quat d = quat_multiply(b, quat_conjugate(a));
    vec3 axis = {d.x, d.y, d.z};
    double turn_deg = quat_angle(a, b) * DEG_PER_RAD;
    return vec3_scale(d.w < 0 ? -turn_deg : turn_deg, vec3_unit_or(axis, (vec3){0}));
}

static vec3 follow_lengths(struct filter *f, const struct sample *s, double dt_s) {
    vec3 step = vec3_sub(lengths_of(s), lengths_of(&f->raw));
    double a = share_after(f, &f->speeds[0], step, dt_s);
    return vec3_lerp(lengths_of(&f->smoothed), lengths_of(s), a);
}

static void follow_pose(struct filter *f, struct sample *s, double dt_s) {
    quat raw = s->T_mockup_body.rotation;
    vec3 turn = turn_between(f->raw.T_mockup_body.rotation, raw);
    double a = share_after(f, &f->speeds[1], turn, dt_s);
    s->T_mockup_body.translation = follow_lengths(f, s, dt_s);
    s->T_mockup_body.rotation = quat_slerp(f->smoothed.T_mockup_body.rotation, raw, a);
}

static void follow_joint(struct filter *f, struct sample *s, double dt_s) {
    vec3 step = vec3_sub(angles_of(s), angles_of(&f->raw));
    double a = share_after(f, &f->speeds[1], step, dt_s);
    vec3 angles = vec3_lerp(angles_of(&f->smoothed), angles_of(s), a);
    vec3 lengths = follow_lengths(f, s, dt_s);
    s->joint = (struct joint_angles){angles.x, angles.y, angles.z, lengths.x, lengths.y, lengths.z};
}

static void follow_handle(struct filter *f, struct sample *s, double dt_s) {
    vec3 step = {100 * (s->handle.opening - f->raw.handle.opening)};
    double a = share_after(f, &f->speeds[1], step, dt_s), last = f->smoothed.handle.opening;
    s->handle.opening = last + a * (s->handle.opening - last);
}

static void follow_force(struct filter *f, struct sample *s, double dt_s) {
    vec3 step = {s->force_n - f->raw.force_n};
    double a = share_after(f, &f->speeds[1], step, dt_s), last = f->smoothed.force_n;
    s->force_n = last + a * (s->force_n - last);
}

void filter_apply(struct filter *f, struct sample *s) {
    if (f->settings.kind == FILTER_NONE)
        return;
    const struct sample raw = *s;
    double dt_s = (double)(s->time_ns - f->time_ns) / NS_PER_S;
    bool is_first = !f->time_ns || s->time_ns - f->time_ns > FILTER_MEMORY_NS;
    f->latency_s = 0;
    if (is_first)
        f->speeds[0] = f->speeds[1] = (vec3){0};
    else if (s->kind == SAMPLE_POSE)
        follow_pose(f, s, dt_s);
    else if (s->kind == SAMPLE_JOINT)
        follow_joint(f, s, dt_s);
    else if (s->kind == SAMPLE_HANDLE)
        follow_handle(f, s, dt_s);
    else
        follow_force(f, s, dt_s);
    s->filter = FILTER_ONE_EURO;
    s->filter_latency_us = (uint16_t)fmin(UINT16_MAX, round(1e6 * f->latency_s));
    f->time_ns = s->time_ns;
    f->raw = raw;
    f->smoothed = *s;
}
