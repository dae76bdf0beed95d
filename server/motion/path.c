#include "motion/path.h"

#include "base/check.h"

#include <stdlib.h>

static const double path_step = 0.1, path_jump = 0.5; // mm

void tip_path_add(struct tip_path *line, vec3 point) {
    if (line->count == line->capacity) {
        line->capacity = 2 * line->capacity + 64;
        line->points = alloc_resize(line->points, (size_t)line->capacity, sizeof *line->points);
        line->ways = alloc_resize(line->ways, (size_t)line->capacity, sizeof *line->ways);
    }
    int last = line->count - 1;
    line->points[line->count] = point;
    line->ways[line->count++] =
        last < 0 ? 0 : line->ways[last] + vec3_distance(line->points[last], point);
}

void tip_path_fini(struct tip_path *line) {
    free(line->points);
    free(line->ways);
    *line = (struct tip_path){0};
}

vec3 tip_path_on_surface(const struct query *surface, vec3 p) {
    struct closest closest;
    bool found = query_closest(surface, p, INFINITY, MESH_NONE, &closest);
    CHECK(found);
    return closest.point;
}

void tip_path_between(struct tip_path *line, const struct query *surface, vec3 from, vec3 to) {
    *line = (struct tip_path){0};
    from = tip_path_on_surface(surface, from);
    to = tip_path_on_surface(surface, to);
    int count = (int)ceil(vec3_distance(from, to) / path_step) + 2;
    for (int i = 0; i < count; i++)
        tip_path_add(line,
                     tip_path_on_surface(surface, vec3_lerp(from, to, (double)i / (count - 1))));
}

static bool jumps_to(const struct tip_path *line, int i) {
    return i > 0 && vec3_distance(line->points[i - 1], line->points[i]) > path_jump;
}

bool tip_path_has_jump(const struct tip_path *line, struct error *err) {
    int i = 1;
    while (i < line->count && !jumps_to(line, i))
        i++;
    if (i >= line->count)
        return false;
    vec3 p = line->points[i];
    fail(err, RESULT_INVALID, "the line leaves the surface near %.1f %.1f %.1f", p.x, p.y, p.z);
    return true;
}

void tip_path_keep_reached(struct tip_path *line, const struct plan *plan, const struct hand *hand,
                           pose T) {
    int longest = 0, best = 0, first = 0, count = line->count;
    for (int i = 0; i < count; i++) {
        if (jumps_to(line, i))
            first = i;
        if (!plan_is_clear(plan, hand, pose_apply(T, line->points[i])))
            first = i + 1;
        if (i + 1 - first > longest) {
            longest = i + 1 - first;
            best = first;
        }
    }
    line->count = 0;
    for (int i = 0; i < longest; i++)
        tip_path_add(line, line->points[best + i]);
}

static vec3 tip_path_at(const struct tip_path *line, double way) {
    int i = 1;
    while (i + 1 < line->count && line->ways[i] < way)
        i++;
    double span = line->ways[i] - line->ways[i - 1];
    double t = span > 0 ? (way - line->ways[i - 1]) / span : 0;
    return vec3_lerp(line->points[i - 1], line->points[i], fmin(fmax(t, 0), 1));
}

enum result tip_path_pass(struct plan *plan, struct hand *hand, const struct tip_path *line) {
    double way = line->ways[line->count - 1];
    int rows = plan_rows(plan, way, plan->script->speed_mm_s);
    for (int i = 0; i <= rows; i++) {
        hand->tip = tip_path_at(line, way * plan_progress(i, rows));
        if (plan_add_row(plan, NULL) != RESULT_OK)
            return RESULT_INVALID;
    }
    return RESULT_OK;
}

enum result tip_path_slide(struct plan *plan, struct hand *hand, const struct case_group *group,
                           const struct query *surface, const struct tip_path *line) {
    CHECK(line->count >= 2);
    pose T = plan_body_pose(plan, group->body);
    double way = line->ways[line->count - 1];
    int rows = plan_rows(plan, way, plan->script->speed_mm_s);
    for (int i = 0; i <= rows; i++) {
        vec3 p = tip_path_on_surface(surface, tip_path_at(line, way * plan_progress(i, rows)));
        hand->tip = pose_apply(T, p);
        if (plan_add_row(plan, group) != RESULT_OK)
            return RESULT_INVALID;
    }
    return RESULT_OK;
}
