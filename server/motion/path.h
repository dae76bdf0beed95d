// A line on a surface that an instrument's tip slides along.
#pragma once

#include "motion/move.h"

// Points, in the group's frame where they are of its surface, and their way from the start.
struct tip_path {
    int count, capacity;
    vec3 *points;
    double *ways;
};

void tip_path_add(struct tip_path *line, vec3 point);
void tip_path_fini(struct tip_path *line); // a zeroed line is fine

// The straight line between two points, put on the surface. The caller releases it with
// tip_path_fini.
void tip_path_between(struct tip_path *line, const struct query *surface, vec3 from, vec3 to);

// Whether the line leaves the surface somewhere; the error says where.
bool tip_path_has_jump(const struct tip_path *line, struct error *err);

// Shortens the line to its longest run without a jump whose points the shaft reaches past all
// bones. T: from the line's frame to the femur's.
void tip_path_keep_reached(struct tip_path *line, const struct plan *plan, const struct hand *hand,
                           pose T);

vec3 tip_path_on_surface(const struct query *surface, vec3 p);

// The tip goes along the line, which is in the femur's frame.
enum result tip_path_pass(struct plan *plan, struct hand *hand, const struct tip_path *line);

// The tip goes along the line, touching the group in every row. The line has two points or more.
enum result tip_path_slide(struct plan *plan, struct hand *hand, const struct case_group *group,
                           const struct query *surface, const struct tip_path *line);
