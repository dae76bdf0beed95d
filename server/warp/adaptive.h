// The adaptive warp: a joint whose ligaments are torn opens further than the mock-up's
// (Spillmann, Tuchschmid, Harders, Eq. 4 to 7).
//
// In key poses A of the physical tibia, the virtual one is to appear in the target poses A'. From
// the present pose follows how far each ligament is put to the test, and from that a rigid
// correction M of the tibia. All poses are T_femur_tibia; a flexion is that of the joint's
// coordinates (base/joint.h). Twists are taken in the tibia's joint frame, near the joint's axis:
// about an origin far away a translation means nothing. Millimetres.
//
//     e     = log(A_r(f)⁻¹ A)         from the rest path A_r at the flexion f to the present pose
//     o_i   = e in a key pose of ligament i,    ξ_i = log(A⁻¹ A') there: the extra motion
//     s_i   = ⟨u_i, e⟩ / ⟨u_i, o_i⟩   ⟨ ⟩: rotations (rad), and translations over 57 mm
//     h(s)  = (25/8) s² for 0 <= s <= 1/5, straight with the slope 5/4 to s = 4/5,
//             1 − (25/8) (1 − s)² from there to 1; 0 for s <= 0, 1 for s >= 1
//     M     = A exp(Σ h(s_i) ξ_i) A⁻¹
//
// u_i is o_i without what it has in common with the other ligaments: of the directions that no key
// of another ligament has a part in, the nearest to o_i. u_i = o_i for one ligament, for directions
// at right angles (valgus and drawer), and for opposite ones (valgus and varus). So no ligament's
// key opens another. o, ξ, u and the rest path are monotone cubics over flexion, constant past
// their outer keys (warp/curve.h); M is continuously differentiable.
#pragma once

#include "base/joint.h"
#include "base/result.h"

#define ADAPTIVE_LIGAMENTS_MAX 8
#define ADAPTIVE_KEYS_MAX 32 // all ligaments together; also of the rest path
#define ADAPTIVE_KEY_GAP_DEG 1.0

// Eq. 7 as printed, for comparison: s = Σ exp(−α²/(2σ²)) over a ligament's keys, α = ∠(A, A_key),
// M = A exp(Σ s ξ) A⁻¹ over all keys. It warps at rest, and keys add up; no flexion is involved.
enum adaptive_kind {
    ADAPTIVE_HINGE,        // the above
    ADAPTIVE_PAPER,        // σ = ∠(rest pose at flexion 0, A_key), as printed
    ADAPTIVE_PAPER_NARROW, // σ = ∠(rest pose at the key's flexion, A_key): with one key, a spike
    ADAPTIVE_COUNT
};

// h above, or what sessions up to rules 3 had (step/settings.h): s² (3 − 2s), up to 3/2 steep. In
// `paper` neither.
enum adaptive_ramp { ADAPTIVE_RAMP_STRAIGHT, ADAPTIVE_RAMP_CUBIC };

const char *adaptive_name(enum adaptive_kind kind); // "hinge", "paper", "paper-narrow"
bool adaptive_from_name(const char *name, enum adaptive_kind *out_kind);

struct adaptive_key {
    int ligament;       // 0 to ADAPTIVE_LIGAMENTS_MAX - 1: a direction in which the joint gives way
    pose T_femur_tibia; // A: the physical tibia, this ligament held against its end, others at rest
    pose target;        // A': where the virtual tibia appears
};

struct adaptive_setup {
    enum adaptive_kind kind;
    struct joint_frame joint;
    int rest_count; // may be 0: the joint's other five coordinates are 0 at rest
    const pose *rest;
    int key_count; // may be 0: M is the identity
    const struct adaptive_key *keys;
};

// Immutable; shared by sessions.
struct adaptive;

// Copies all. Keys in any order, those of a ligament, and of the rest path, at least
// ADAPTIVE_KEY_GAP_DEG of flexion apart. RESULT_LIMIT: too many; RESULT_INVALID, naming the key or
// the ligament: not a pose, keys too close, a correction of more than 90 degrees, a ligament that
// nowhere leaves the rest path, or that opens in a direction that others make up.
enum result adaptive_create(const struct adaptive_setup *setup, struct adaptive **out_adaptive,
                            struct error *error);
void adaptive_destroy(struct adaptive **adaptive); // NULL inside is fine

struct adaptive_warp {
    pose correction; // M in the femur's frame: the virtual tibia is at M · T_femur_tibia;
                     // in the world it is B M B⁻¹ with B = T_world_femur
    double flexion_deg;
    double opening[ADAPTIVE_LIGAMENTS_MAX]; // s; 0 for a ligament without keys
    double share[ADAPTIVE_LIGAMENTS_MAX];   // h(s), what is given of the extra motion; s in `paper`
};

// T_femur_tibia: valid. Allocates nothing; the same arguments give the same bits.
void adaptive_at(const struct adaptive *adaptive, enum adaptive_ramp ramp, pose T_femur_tibia,
                 struct adaptive_warp *out_warp);

// RESULT_INVALID, naming the key, where the tibia of a key pose appears elsewhere than in its
// target by more than 1e-6 mm at the joint or 1e-6 degrees.
enum result adaptive_check(const struct adaptive *adaptive, struct error *error);
