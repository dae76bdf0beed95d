#include "metrics/view.h"

#include <string.h>

bool view_shows(const struct view_optic *optic, pose scope, vec3 tip) {
    vec3 axis = optic_axis(optic, scope);
    vec3 way = vec3_sub(tip, scope.translation);
    double distance = vec3_length(way);
    return distance <= VIEW_REACH_MM &&
           vec3_dot(way, axis) >= cos(0.5 * optic->field_deg * RAD_PER_DEG) * distance;
}

void search_init(struct search *s) {
    memset(s, 0, sizeof *s);
}

static void search_begin(struct search *s, int64_t time_ns) {
    s->searching = true;
    s->began_ns = time_ns;
}

static void search_end(struct search *s) {
    int64_t taken_ns = s->changed_ns - s->began_ns;
    if (s->found++ == 0)
        s->first_ns = taken_ns;
    s->all_ns += taken_ns;
    s->searching = false;
}

void search_step(struct search *s, int64_t time_ns, bool there, bool in_view) {
    if (there && !s->there)
        search_begin(s, time_ns);
    if (!there)
        s->searching = false;
    if (there != s->there || in_view != s->in_view)
        s->changed_ns = time_ns;
    s->there = there;
    s->in_view = in_view;
    if (!there)
        return;
    int64_t since_ns = time_ns - s->changed_ns;
    if (s->searching && in_view && since_ns >= VIEW_FOUND_NS)
        search_end(s);
    if (!s->searching && !in_view && since_ns >= VIEW_LOST_NS)
        search_begin(s, s->changed_ns);
}

double search_first_s(const struct search *s) {
    return s->found ? 1e-9 * (double)s->first_ns : NAN;
}

double search_mean_s(const struct search *s) {
    return s->found ? 1e-9 * (double)s->all_ns / s->found : NAN;
}
