// What the files of warp.c share.
#pragma once

#include "warp/warp.h"

#define TOUCH_MM 1e-6

// Bodies under a surface: where they are, and where their corrections put them.
struct stance {
    pose physical, virtual, other; // other: the virtual one of what a ligament bridges to
    bool is_corrected, is_bridge;  // else the virtual one, and the other one, are as the first
};

struct stance stance_of(const struct warp_scene *scene, int surface);

// Δ of a point x of the surface that is displaced by u, both in the body's frame.
vec3 delta_of(const struct stance *stance, double other, vec3 x, vec3 u);

// How x, u and the other bone's share change with y, in the body's frame.
struct changes {
    mat3 slide, change;
    vec3 other;
};

mat3 delta_gradient_of(const struct stance *stance, double other, vec3 target,
                       const struct changes *changes);

// 0 up to `begin`, 1 from begin + width on, continuously differentiable.
double smoothstep(double d, double begin, double width, double *out_slope);

// A number that depends on y.
struct slanted {
    double value;
    vec3 gradient;
};

// The skin s that a gap g leaves: s (u − u²/4), u = g/(gap_over_skin s), and s itself from u = 2
// on.
double skin_in(double s, double gap, double gap_over_skin, double *out_by_gap);

// φ(d) for a skin s, and its derivatives.
double thin(double d, double s, double *out_by_d, double *out_by_s);

// ---- warp/integral.c ----

// Whether a correction moves the body: none does in a healthy knee.
bool is_corrected(const struct warp_scene *scene, int body);

// What the integral tells instead of the closest point, of y = p in the body's frame. False where
// Δ stays the closest point's.
bool integral_look(const struct warp_surface *surface, const struct stance *stance, vec3 p,
                   vec3 closest, struct warp_contact *contact);

// R_k of a body's surfaces at y.
double integral_reach(const struct warp_scene *scene, const struct field *field, int body, vec3 y);

// The blend of contacts, at least one.
void integral_blend(const struct warp_scene *scene, const struct field *field, vec3 y,
                    const struct warp_contact *contacts, int count, struct warp *out);
