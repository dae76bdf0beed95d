#include "metrics/travel.h"

#include <string.h>

void ruler_init(struct ruler *r, double mm) {
    memset(r, 0, sizeof *r);
    r->mm = mm;
}

double ruler_length(const struct ruler *r) {
    return r->marked_mm + (r->begun ? vec3_distance(r->last, r->mark) : 0);
}

void ruler_break(struct ruler *r) {
    r->marked_mm = ruler_length(r);
    r->begun = false;
}

// Where the way from a point inside the ruler's sphere to one outside leaves it.
static vec3 leaves(const struct ruler *r, vec3 inside, vec3 outside) {
    vec3 way = vec3_sub(outside, inside), from = vec3_sub(inside, r->mark);
    double a = vec3_dot(way, way), b = vec3_dot(way, from);
    double c = vec3_dot(from, from) - r->mm * r->mm;
    double t = (sqrt(fmax(b * b - a * c, 0)) - b) / a;
    return vec3_add_scaled(inside, fmin(fmax(t, 0), 1), way);
}

void ruler_add(struct ruler *r, vec3 point) {
    if (!r->begun) {
        r->begun = true;
        r->mark = r->last = point;
        return;
    }
    if (vec3_distance(point, r->mark) >= r->mm) {
        r->mark = leaves(r, r->last, point);
        r->marked_mm += r->mm;
        // From the mark on the rest is straight.
        vec3 rest = vec3_sub(point, r->mark);
        double length = vec3_length(rest), whole = floor(length / r->mm);
        if (whole > 0) {
            r->mark = vec3_add_scaled(r->mark, whole * r->mm / length, rest);
            r->marked_mm += whole * r->mm;
        }
    }
    r->last = point;
}

void travel_init(struct travel *t) {
    memset(t, 0, sizeof *t);
    ruler_init(&t->path, TRAVEL_RULER_MM);
    ruler_init(&t->economy, TRAVEL_LONG_RULER_MM);
}

static void add_jerk(struct travel *t, vec3 newest) {
    const vec3 *p = t->before;
    vec3 third = vec3_add_scaled(vec3_sub(newest, p[2]), -3, vec3_sub(p[0], p[1]));
    vec3 jerk = vec3_scale(SMOOTH_RATE_HZ * SMOOTH_RATE_HZ * SMOOTH_RATE_HZ, third);
    t->jerk_squared += vec3_dot(jerk, jerk);
    t->jerks++;
    t->largest_speed = fmax(t->largest_speed, t->speed);
}

void travel_add(struct travel *t, const struct smooth_point *point) {
    if (point->first) {
        ruler_break(&t->path);
        ruler_break(&t->economy);
        t->count = 0;
    }
    ruler_add(&t->path, point->position);
    ruler_add(&t->economy, point->position);
    t->speed = t->count ? SMOOTH_RATE_HZ * vec3_distance(point->position, t->before[0]) : 0;
    if (t->count == 3)
        add_jerk(t, point->position);
    memmove(t->before + 1, t->before, 2 * sizeof *t->before);
    t->before[0] = point->position;
    t->count += t->count < 3;
}

double travel_path_mm(const struct travel *t) {
    return ruler_length(&t->path);
}

double travel_economy(const struct travel *t) {
    double path = travel_path_mm(t);
    return path < TRAVEL_LONG_RULER_MM ? NAN : fmin(ruler_length(&t->economy) / path, 1);
}

double travel_ldlj(const struct travel *t) {
    double seconds = (double)t->jerks / SMOOTH_RATE_HZ;
    double jerk = t->jerk_squared / SMOOTH_RATE_HZ;
    double speed = t->largest_speed;
    return jerk > 0 && speed > 0 ? -log(seconds * seconds * seconds / (speed * speed) * jerk) : NAN;
}

double travel_jerk(const struct travel *t) {
    return t->jerks ? sqrt(t->jerk_squared / (double)t->jerks) : 0;
}

double travel_noise_jerk(double rate_hz) {
    return 258 * sqrt(100 / rate_hz);
}
