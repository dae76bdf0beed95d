// The fit of a rigid instrument to its points' targets: the sums of avatar.h. For avatar.c only.
#pragma once

#include "warp/avatar.h"

#define FIT_SOFT_MM 0.05   // ε
#define FIT_WHOLE 0.5      // τ
#define FIT_KEEP_OUT 100   // μ, 1/mm
#define FIT_MARGIN_MM 0.02 // m

struct axis {
    vec3 u, e[2];  // the tip's z, and its x and y
    vec3 aside;    // from the tip to the given portal
    double portal; // P along u, from the tip
};

struct fit_point {
    vec3 arm;     // from the tip to the point
    double along; // a: from P along u,
    vec3 beside;  // and across it
    double radius;
    double heard, heard_slope; // h, and over its way past the portal
    struct warp warp;
    int count;
    struct warp_contact contacts[WARP_SURFACES_MAX];
};

struct fit {
    struct axis axis;
    double radius_mm;          // R
    double shown, shown_slope; // H, and over the tip's way past the portal
    int count;
    struct fit_point points[AVATAR_POINTS_MAX];
};

struct fit_weight {
    double value, slope; // ω, dω/dg
};

struct fit_weight fit_weigh(const struct fit *fit, const struct fit_point *point,
                            const struct warp_contact *contact);

// v along e, and s; and their slopes as in struct avatar, but along e as it turns with the hand.
// All 0 where no point is in reach of a surface.
void fit_find(const struct fit *fit, double out_q[3], double out_slope[3][6]);
