// A line on a surface that an instrument's tip slides along.
#pragma once

#include "case/motion_move.h"

// Points, in the group's frame where they are of its surface, and their way from the start.
struct line {
    int count, capacity;
    vec3 *points;
    double *ways;
};

void line_add(struct line *line, vec3 point);
void line_fini(struct line *line); // a zeroed line is fine

// The straight line between two points, put on the surface. RESULT_INVALID where it leaves it. The
// caller releases it with line_fini, after an error too.
enum result line_between(struct line *line, const struct query *surface, vec3 from, vec3 to,
                         struct error *err);

vec3 line_on_surface(const struct query *surface, vec3 p);

// The tip goes along the line, which is in the femur's frame.
enum result line_pass(struct plan *plan, struct hand *hand, const struct line *line);

// The tip goes along the line, touching the group in every row. The line has two points or more.
enum result line_slide(struct plan *plan, struct hand *hand, const struct case_group *group,
                       const struct query *surface, const struct line *line);
