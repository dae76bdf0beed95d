// The static space warp of one contact point: a displacement for every point of space that equals,
// on each surface, what takes the physical surface S to the virtual one S'
// (Spillmann, Tuchschmid, Harders, Eq. 1 to 3; with the closed-form derivative).
//
// Surfaces are static meshes in the frame of the body that they belong to. A query point is moved
// into that frame; nothing is rebuilt when a bone moves. Millimetres; the world is the mock-up.
//
//     x       closest point of surface k to y, at distance d_k
//     Δ_k   = M_k · B_k · (x + displacement(x)) − B_k · x
//     W(y)  = Σ ω_k Δ_k / (Σ ω_k + ω_0)
//
// A point on exactly one surface (d_k <= 1e-6) gets that surface's Δ, exactly; on several, the mean
// of theirs. Deterministic: the same arguments give the same bits. Allocates nothing.
//
// With a contact skin s, weights take d for φ(d): 0 up to s, (d − s)²/(2s) up to 2s, then d − 1.5
// s. Touch stays touch under a tracker's noise of s. Where the two nearest surfaces leave a gap g =
// d1 + d2 below 52 s, the skin is thinner, under g/26, because a skin makes the field in a gap
// steeper.
//
// The integral field takes D = √(π/M) of warp/surface_integral.h for d, and Δ of its x̃ and ũ:
//
//     e    = |x̃ − y|/D             1 off a plane, 0 between two sheets
//     m    = |M_k y − y|,  b = 1/(1 + m²/m0²),  m0 = R/15;  b is 1 where nothing is corrected
//     R_k  = √(R² + m²): a surface that goes far by its body's correction reaches far, too, so
//            that space does not fold off it
//     ω    = (1 + 2 b (1 − e²)₊²) (1/D − 1/R_k)₊ χ(d/R_k),  χ from 1 at 0.7 to 0 at 1
//     D'   = min(1/(ω + 1/R_k), (1 + m0²/m²) d)
//     ω_k  = 1/φ(D') − 1/φ(R_k)
//     ω_0' = ω_0 R/R_k (1 + b) / (1 + b R Σ ω_k/15),  b and R_k of the largest m
//
// Its gap is of the two smallest D', and skins are under g/40. At d_k <= 1e-6 it is as the others.
#pragma once

#include "base/pose.h"
#include "mesh/query.h"
#include "warp/surface_integral.h"
#include "warp/surface_mean.h"

#define WARP_SURFACES_MAX 32

enum field_kind {
    FIELD_GAUSSIAN, // ω = exp(−d²/(2σ)), σ = min d: Eq. 3 as printed; depends on the unit
    FIELD_INVERSE_DISTANCE, // ω = (R − d)₊/(R d), ω_0 a constant: free of units
    FIELD_SMOOTH,   // the same, with the mean Δ of warp/surface_mean.h for surfaces that have one:
                    // no jumps where the closest point jumps
    FIELD_INTEGRAL, // weights and Δ by warp/surface_integral.h, without what gives way. New
                    // sessions have it; the others are for comparison, and for older traces
    FIELD_COUNT
};

// "gaussian", "inverse-distance", "smooth", "integral"
const char *field_name(enum field_kind kind);
bool field_from_name(const char *name, enum field_kind *out_kind);

struct field {
    enum field_kind kind;
    double unit_mm;           // gaussian: the unit in which Eq. 3 is read; 10 gives the paper's
    double radius_mm;         // the others: R, about how far a surface has weight: field_reach
    double background_per_mm; // the others: ω_0, so that the warp fades in open space
    double skin_mm;           // the others: s
    double strength;          // 0 no warp .. 1 the whole: scales every Δ
};

// 10 mm; R = 15 mm, ω_0 = 1/R, s = 0, 1. Off a surface that is alone the warp then fades evenly,
// and space does not fold before that is displaced by R.
struct field field_default(enum field_kind kind);

struct warp_surface {
    const struct mesh *mesh;
    const struct query *query;
    const float *displacement; // 3 * vertex_count, mm: S' − S; NULL for 0
    int body;                  // index into the poses of the scene
    // A ligament that bridges two bones: how much of each vertex follows the other bone's
    // correction, 0 to 1: M = (1 − share) M_body + share M_other. NULL: nothing; it has no mean.
    const float *other_share;
    int other_body;
    // Of this displacement, for the smooth field; NULL: the closest point's Δ. Near the surface it
    // hands over to that: from max(R/240, s), and over R/120.
    const struct surface_mean *mean;
    // Of this displacement, for the integral field; NULL: a plane through the closest point. Where
    // there is another bone's share Δ is the closest point's, and the weight is the integral's.
    const struct surface_integral *integral;
    bool gives_way; // as the knee's skin: no surface of the integral field
};

// Whether the surface is one of the field's: any, but what gives way in the integral field.
bool field_takes(const struct field *field, const struct warp_surface *surface);

struct warp_scene {
    const struct warp_surface *surfaces;
    int surface_count;        // at most WARP_SURFACES_MAX
    const pose *T_world_body; // B: one for each body
    const pose *correction;   // M: one for each body, in the world; NULL for the identity
};

// From how far a surface has weight anywhere in the box, in the world. Not for the gaussian field,
// whose reach has no end.
double field_reach(const struct warp_scene *scene, const struct field *field, struct box box);

// The last answers of one query point, from which the next search starts. It changes how long a
// call takes, never its result.
struct warp_memory {
    uint32_t triangle[WARP_SURFACES_MAX];
    struct query_near near[WARP_SURFACES_MAX];
};

void warp_memory_init(struct warp_memory *memory);

struct warp {
    vec3 displacement;      // W(y), mm, in the world
    mat3 gradient;          // ∂W/∂y, in the world; on a surface, towards its outside
    double trust_radius_mm; // how far W(y) + gradient · step may be used: d1 + d2 of the two
                            // nearest surfaces, clamped to 0.5 .. 2
    int nearest;            // surface with the smallest distance, -1 where none is in reach
    double nearest_mm;      // its distance, INFINITY where none is in reach
};

// y in the world, finite.
void warp_point(const struct warp_scene *scene, const struct field *field, vec3 y,
                struct warp_memory *memory, struct warp *out_warp);

// One surface within reach of y, in the world.
struct warp_contact {
    int surface;
    double distance;     // d_k, mm
    vec3 normal;         // unit, from x to y; of x's triangle where d_k <= 1e-6
    vec3 delta;          // Δ_k
    mat3 delta_gradient; // ∂Δ_k/∂y
    mat3 slide; // ∂x/∂y: a projection onto the face or edge that x is on, 0 in a corner
    struct warp_sight {
        double weight, open;           // M; e²
        vec3 weight_slope, open_slope; // by y, in the world
    } sight;                           // for the integral field
};

// warp_point, and the surfaces that its answer is a blend of, in their order; how many.
int warp_contacts(const struct warp_scene *scene, const struct field *field, vec3 y,
                  struct warp_memory *memory, struct warp *out_warp,
                  struct warp_contact out_contacts[WARP_SURFACES_MAX]);

// Where the closest point of one surface goes: Δ_k of the header's formula, whatever the
// strength, for tests and meters.
vec3 warp_of_contact(const struct warp_scene *scene, int surface, const struct closest *contact);
