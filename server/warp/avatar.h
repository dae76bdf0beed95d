// The warp of a whole instrument: a rigid motion that takes each point of its body as nearly as one
// can to where the space warp takes it, and keeps it out of the virtual surfaces (Spillmann,
// Tuchschmid, Harders, section 6). The instrument goes through a portal, a hole in the skin, in
// which it turns and slides.
//
// The tip's frame has its origin in the tip and z along the shaft, away from the handle. The axis
// is the line along z. The portal P is the axis's point nearest to the given place, for skin gives
// way. With u along the axis, a_i from P to the body's point p_i, and v across u:
//
//     p_i' = P + Q (a_i + s u),  Q the shortest turn of u into (u + v)/|u + v|;  δ_i = p_i' − p_i
//
//     minimise  Σ_i h_i Σ_k ω_ik (τ |δ_i − H W_i|² + off_ik²) + μ h_i min(c_ik, 0)²
//     off = n·(δ − H Δ),  c = off + max(g − m, 0),  ω = 1/(g + ε) − 1/(R + ε)
//
// over the surfaces k within R of p_i: n, Δ, W of warp.h, g the gap from the surface to the body,
// R and the gap less by the point's radius. c < 0: the body would be nearer than m to the virtual
// surface, and nearer than to the physical one; on which side does not matter. h_i and H go from 0
// to 1 while p_i, and the tip, are from 5 to 15 mm past the portal. So points outside or in the
// skin do not count, and an instrument that only begins to enter is not moved. τ = 0.5, ε = 0.05
// mm, μ = 100/mm, m = 0.02 mm.
//
// Millimetres; the world is the mock-up. Deterministic: the same arguments give the same bits.
// Allocates nothing.
#pragma once

#include "base/extrapolation.h"
#include "warp/warp.h"

#define AVATAR_POINTS_MAX 16

struct avatar_point {
    vec3 at;          // in the tip's frame; beside the axis as well
    double radius_mm; // of the body around it
};

// The instrument.
struct avatar_body {
    enum avatar_mode mode;
    const struct avatar_point *points; // the first is the tip, at the origin
    int point_count;                   // 1 to AVATAR_POINTS_MAX
};

struct avatar_memory {
    struct warp_memory points[AVATAR_POINTS_MAX];
};

void avatar_memory_init(struct avatar_memory *memory);

struct avatar {
    pose T_world_warped; // of the tip's frame
    // In the world. Its trust radius for tip: the space warp's; else the least over points, of it
    // and of twice the point's gap, but 0.1.
    struct avatar_extrapolation extrapolation;
    struct warp tip;                      // the space warp of the tip alone
    vec3 displacement[AVATAR_POINTS_MAX]; // of each point of the body
    // As far as surfaces are flat, over all that is looked at (`tip`: the tip), 0 where it is not:
    double
        penetration_mm; // how much deeper a point is in a virtual surface than in the physical one
    double tip_gap_mm; // how much farther the tip is from the nearest surface, on its normal: above
                       // 0 it hovers, below 0 it has come nearer
};

// T_world_tip and portal: finite.
void avatar_warp(const struct warp_scene *scene, const struct field *field,
                 const struct avatar_body *body, vec3 portal, pose T_world_tip,
                 struct avatar_memory *memory, struct avatar *out_avatar);
