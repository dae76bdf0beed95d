// The zones of a meniscus, a C seen from above: where its arc begins and ends, and where its inner
// margin and its rim lie in each direction from the C's centre. Millimetres, radians.
#pragma once

#include "quality/view.h"

#define ZONE_RAYS 720

struct zones {
    struct plan_view view;   // origin: the centre of the circle that fits the C best, half way up
    double start;            // the angle from the first axis to the arc's anterior end
    double arc;              // from there to its posterior end; negative where it runs clockwise
    double inner[ZONE_RAYS]; // radii of the margins at angle 2π i / ZONE_RAYS, smoothed
    double outer[ZONE_RAYS];
};

// The mesh is closed and has some area in plan.
void zones_of(const struct mesh *mesh, vec3 up, vec3 anterior, struct zones *out_zones);

// Where a point in plan lies: from 0 at the anterior end of the arc to 1 at the posterior one; from
// 0 at the inner margin to 1 at the rim. Off the C it is beyond 0 or 1.
struct zone_place {
    double along, across;
};

struct zone_place zones_place(const struct zones *zones, double x, double y);

double zones_angle(const struct zones *zones, double along);
double zones_rim(const struct zones *zones, double angle); // its radius

int zones_third(double share); // 0, 1 or 2
