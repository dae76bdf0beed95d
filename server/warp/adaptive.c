#include "warp/adaptive.h"

#include "base/check.h"
#include "warp/curve.h"

#include <stdlib.h>
#include <string.h>

#define LEVER_MM 57.0           // ℓ: a translation of ℓ counts as one radian
#define SAME_FLEXION_DEG 1e-9   // of keys of two ligaments
#define OWN_SHARE 0.03          // least ⟨u, o⟩/⟨o, o⟩: 10 degrees from what others make up
#define DIRECTION_LEAST 0.00175 // least length of o: 0.1 degrees, or 0.1 mm
#define CORRECTION_MOST_DEG 90.0
#define ROUNDING 1e-9
#define WIDTH_LEAST 1e-6 // radians

_Static_assert(ADAPTIVE_KEYS_MAX <= CURVE_KNOTS_MAX, "each key may be a knot");
_Static_assert(sizeof(twist) == CURVE_COMPONENTS * sizeof(double), "a twist is a curve's value");

struct ligament_curves {
    struct curve direction; // o
    struct curve own;       // u
    struct curve extra;     // ξ
};

struct key {
    struct adaptive_key given;
    double flexion_deg;
    twist extra;      // ξ
    double width_rad; // σ
};

struct adaptive {
    enum adaptive_kind kind;
    struct joint_frame joint;
    struct curve rest; // varus, internal, shift, drawer, distraction
    int key_count;
    struct key keys[ADAPTIVE_KEYS_MAX];
    struct ligament_curves ligaments[ADAPTIVE_LIGAMENTS_MAX];
};

static const char *const names[ADAPTIVE_COUNT] = {"hinge", "paper", "paper-narrow"};

const char *adaptive_name(enum adaptive_kind kind) {
    return (unsigned)kind < ADAPTIVE_COUNT ? names[kind] : "unknown";
}

bool adaptive_from_name(const char *name, enum adaptive_kind *out_kind) {
    for (int i = 0; i < ADAPTIVE_COUNT; i++)
        if (!strcmp(name, names[i])) {
            *out_kind = (enum adaptive_kind)i;
            return true;
        }
    return false;
}

// ---- twists ----

static twist scaled_sum(twist a, double s, twist b) {
    return (twist){vec3_add_scaled(a.rotation, s, b.rotation),
                   vec3_add_scaled(a.translation, s, b.translation)};
}

static double product(twist a, twist b) {
    return vec3_dot(a.rotation, b.rotation) +
           vec3_dot(a.translation, b.translation) / (LEVER_MM * LEVER_MM);
}

static twist twist_at(const struct curve *curve, double flexion) {
    double value[CURVE_COMPONENTS];
    curve_at(curve, flexion, value);
    return (twist){{value[0], value[1], value[2]}, {value[3], value[4], value[5]}};
}

static bool add_twist(struct curve *curve, double flexion, double gap, twist t) {
    const double value[CURVE_COMPONENTS] = {t.rotation.x,    t.rotation.y,    t.rotation.z,
                                            t.translation.x, t.translation.y, t.translation.z};
    return curve_add(curve, flexion, gap, value);
}

// What takes the tibia from one pose to another, in its joint frame.
static twist motion_between(const struct joint_frame *joint, pose from, pose to) {
    pose T_joint_from = pose_inverse(pose_compose(from, joint->T_tibia_joint));
    return pose_log(pose_compose(T_joint_from, pose_compose(to, joint->T_tibia_joint)));
}

// A exp(t) A⁻¹
static pose correction_of(const struct joint_frame *joint, pose T_femur_tibia, twist t) {
    pose T_femur_joint = pose_compose(T_femur_tibia, joint->T_tibia_joint);
    return pose_compose(pose_compose(T_femur_joint, pose_exp(t)), pose_inverse(T_femur_joint));
}

static pose unit(pose p) {
    return (pose){quat_unit(p.rotation), p.translation};
}

static pose rest_pose(const struct adaptive *a, double flexion) {
    double v[CURVE_COMPONENTS];
    curve_at(&a->rest, flexion, v);
    struct joint_angles angles = {flexion, v[0], v[1], v[2], v[3], v[4]};
    return joint_to_pose(&a->joint, &angles);
}

// ---- building ----

static enum result add_rest(struct adaptive *a, const struct adaptive_setup *setup,
                            struct error *error) {
    for (int i = 0; i < setup->rest_count; i++) {
        if (!pose_is_valid(setup->rest[i]))
            return fail(error, RESULT_INVALID, "rest key %d: not a pose", i);
        struct joint_angles angles = joint_from_pose(&a->joint, unit(setup->rest[i]));
        const double value[CURVE_COMPONENTS] = {angles.varus_deg, angles.internal_deg,
                                                angles.shift_mm, angles.drawer_mm,
                                                angles.distraction_mm};
        if (!curve_add(&a->rest, angles.flexion_deg, ADAPTIVE_KEY_GAP_DEG, value))
            return fail(error, RESULT_INVALID,
                        "rest key %d: within %g degrees of flexion of another", i,
                        ADAPTIVE_KEY_GAP_DEG);
    }
    curve_finish(&a->rest);
    return RESULT_OK;
}

static double paper_width(const struct adaptive *a, const struct key *key) {
    double flexion = a->kind == ADAPTIVE_PAPER ? 0 : key->flexion_deg;
    double angle = quat_angle(rest_pose(a, flexion).rotation, key->given.T_femur_tibia.rotation);
    return fmax(angle, WIDTH_LEAST); // a key that only shifts has no angle
}

static enum result add_key(struct adaptive *a, const struct adaptive_key *given, int index,
                           struct error *error) {
    if (given->ligament < 0 || given->ligament >= ADAPTIVE_LIGAMENTS_MAX)
        return fail(error, RESULT_INVALID, "key %d: no ligament %d", index, given->ligament);
    if (!pose_is_valid(given->T_femur_tibia) || !pose_is_valid(given->target))
        return fail(error, RESULT_INVALID, "key %d: not a pose", index);
    struct key *key = &a->keys[a->key_count++];
    pose A = unit(given->T_femur_tibia), target = unit(given->target);
    key->given = (struct adaptive_key){given->ligament, A, target};
    key->flexion_deg = joint_from_pose(&a->joint, A).flexion_deg;
    key->extra = motion_between(&a->joint, A, target);
    key->width_rad = paper_width(a, key);
    if (vec3_length(key->extra.rotation) > CORRECTION_MOST_DEG * RAD_PER_DEG)
        return fail(error, RESULT_INVALID, "key %d: a correction of more than %g degrees", index,
                    CORRECTION_MOST_DEG);
    struct ligament_curves *ligament = &a->ligaments[given->ligament];
    twist direction = motion_between(&a->joint, rest_pose(a, key->flexion_deg), A);
    if (!add_twist(&ligament->direction, key->flexion_deg, ADAPTIVE_KEY_GAP_DEG, direction))
        return fail(error, RESULT_INVALID,
                    "key %d: within %g degrees of flexion of another of ligament %d", index,
                    ADAPTIVE_KEY_GAP_DEG, given->ligament);
    add_twist(&ligament->extra, key->flexion_deg, 0, key->extra);
    return RESULT_OK;
}

// t less its projection on axes at right angles.
static twist without(twist t, const twist *axes, int count) {
    for (int i = 0; i < count; i++)
        t = scaled_sum(t, -product(t, axes[i]) / product(axes[i], axes[i]), axes[i]);
    return t;
}

// o less its projection on the span of some of the others.
static twist beside(twist o, const twist *others, int count, unsigned some) {
    twist axes[ADAPTIVE_LIGAMENTS_MAX];
    int axis_count = 0;
    for (int i = 0; i < count; i++) {
        twist axis = without(others[i], axes, axis_count);
        if (some >> i & 1 && product(axis, axis) > ROUNDING * product(others[i], others[i]))
            axes[axis_count++] = axis;
    }
    return without(o, axes, axis_count);
}

static bool has_no_part_in(twist u, const twist *others, int count) {
    for (int i = 0; i < count; i++) {
        double part = product(u, others[i]);
        if (part > 0 &&
            part * part > ROUNDING * ROUNDING * product(u, u) * product(others[i], others[i]))
            return false;
    }
    return true;
}

// u: the projection of o on the cone of directions without a part (a positive product) in others.
// It lies beside the span of some of them: of all that are in the cone, the longest.
static twist own_direction(const struct adaptive *a, int ligament, double flexion) {
    twist others[ADAPTIVE_LIGAMENTS_MAX], own = {0};
    int count = 0;
    for (int i = 0; i < ADAPTIVE_LIGAMENTS_MAX; i++)
        if (i != ligament && a->ligaments[i].direction.count)
            others[count++] = twist_at(&a->ligaments[i].direction, flexion);
    twist o = twist_at(&a->ligaments[ligament].direction, flexion);
    for (unsigned some = 0; some < 1U << count; some++) {
        twist u = beside(o, others, count, some);
        if (product(u, u) > product(own, own) && has_no_part_in(u, others, count))
            own = u;
    }
    return own;
}

static void part_directions(struct adaptive *a) {
    for (int i = 0; i < ADAPTIVE_LIGAMENTS_MAX; i++) {
        struct ligament_curves *ligament = &a->ligaments[i];
        if (!ligament->direction.count)
            continue;
        for (int k = 0; k < a->key_count; k++) {
            double flexion = a->keys[k].flexion_deg;
            add_twist(&ligament->own, flexion, SAME_FLEXION_DEG, own_direction(a, i, flexion));
        }
        curve_finish(&ligament->own);
    }
}

// Also between the keys ⟨u, o⟩ is far from 0.
static enum result check_directions(const struct adaptive *a, int index, struct error *error) {
    const struct ligament_curves *ligament = &a->ligaments[index];
    int last = ligament->own.count - 1;
    double step = 0.25;
    for (double f = ligament->own.at[0]; f < ligament->own.at[last] + step; f += step) {
        twist o = twist_at(&ligament->direction, f), u = twist_at(&ligament->own, f);
        double length = product(o, o);
        if (length < DIRECTION_LEAST * DIRECTION_LEAST)
            return fail(error, RESULT_INVALID,
                        "ligament %d: does not leave the rest path at %.1f degrees", index, f);
        if (product(u, o) < OWN_SHARE * length)
            return fail(error, RESULT_INVALID,
                        "ligament %d: opens as others do at %.1f degrees; give one of them the "
                        "extra motion of all",
                        index, f);
    }
    return RESULT_OK;
}

static enum result build(struct adaptive *a, const struct adaptive_setup *setup,
                         struct error *error) {
    enum result result = add_rest(a, setup, error);
    for (int i = 0; i < setup->key_count && result == RESULT_OK; i++)
        result = add_key(a, &setup->keys[i], i, error);
    if (result != RESULT_OK)
        return result;
    for (int i = 0; i < ADAPTIVE_LIGAMENTS_MAX; i++) {
        curve_finish(&a->ligaments[i].direction);
        curve_finish(&a->ligaments[i].extra);
    }
    part_directions(a);
    for (int i = 0; i < ADAPTIVE_LIGAMENTS_MAX && result == RESULT_OK; i++)
        if (a->ligaments[i].own.count)
            result = check_directions(a, i, error);
    return result;
}

enum result adaptive_create(const struct adaptive_setup *setup, struct adaptive **out_adaptive,
                            struct error *error) {
    *out_adaptive = NULL;
    if (setup->key_count > ADAPTIVE_KEYS_MAX || setup->rest_count > ADAPTIVE_KEYS_MAX)
        return fail(error, RESULT_LIMIT, "more than %d keys", ADAPTIVE_KEYS_MAX);
    struct adaptive *a = alloc(1, sizeof *a);
    a->kind = setup->kind;
    a->joint = (struct joint_frame){setup->joint.side, unit(setup->joint.T_femur_joint),
                                    unit(setup->joint.T_tibia_joint)};
    enum result result = build(a, setup, error);
    if (result == RESULT_OK)
        *out_adaptive = a;
    else
        free(a);
    return result;
}

void adaptive_destroy(struct adaptive **adaptive) {
    free(*adaptive);
    *adaptive = NULL;
}

// ---- the present pose ----

static double eased(enum adaptive_ramp ramp, double s) {
    double t = fmax(0, fmin(1, s));
    if (ramp == ADAPTIVE_RAMP_CUBIC)
        return t * t * (3 - 2 * t);
    if (t < 0.2)
        return 3.125 * t * t;
    return t > 0.8 ? 1 - 3.125 * (1 - t) * (1 - t) : 0.5 + 1.25 * (t - 0.5);
}

static twist hinge(const struct adaptive *a, enum adaptive_ramp ramp, pose A,
                   struct adaptive_warp *warp) {
    twist e = motion_between(&a->joint, rest_pose(a, warp->flexion_deg), A), sum = {0};
    for (int i = 0; i < ADAPTIVE_LIGAMENTS_MAX; i++) {
        const struct ligament_curves *ligament = &a->ligaments[i];
        if (!ligament->own.count)
            continue;
        twist o = twist_at(&ligament->direction, warp->flexion_deg);
        twist u = twist_at(&ligament->own, warp->flexion_deg);
        warp->opening[i] = product(u, e) / product(u, o);
        warp->share[i] = eased(ramp, warp->opening[i]);
        sum = scaled_sum(sum, warp->share[i], twist_at(&ligament->extra, warp->flexion_deg));
    }
    return sum;
}

static twist paper(const struct adaptive *a, pose A, struct adaptive_warp *warp) {
    twist sum = {0};
    for (int i = 0; i < a->key_count; i++) {
        const struct key *key = &a->keys[i];
        double alpha = quat_angle(A.rotation, key->given.T_femur_tibia.rotation) / key->width_rad;
        double s = exp(-alpha * alpha / 2);
        warp->opening[key->given.ligament] += s;
        warp->share[key->given.ligament] += s;
        sum = scaled_sum(sum, s, key->extra);
    }
    return sum;
}

void adaptive_at(const struct adaptive *a, enum adaptive_ramp ramp, pose T_femur_tibia,
                 struct adaptive_warp *out_warp) {
    pose A = unit(T_femur_tibia);
    *out_warp = (struct adaptive_warp){.flexion_deg = joint_from_pose(&a->joint, A).flexion_deg};
    twist sum = a->kind == ADAPTIVE_HINGE ? hinge(a, ramp, A, out_warp) : paper(a, A, out_warp);
    out_warp->correction = correction_of(&a->joint, A, sum);
}

enum result adaptive_check(const struct adaptive *a, struct error *error) {
    for (int i = 0; i < a->key_count; i++) {
        const struct adaptive_key *key = &a->keys[i].given;
        struct adaptive_warp warp;
        adaptive_at(a, ADAPTIVE_RAMP_STRAIGHT, key->T_femur_tibia, &warp);
        pose seen = pose_compose(warp.correction, key->T_femur_tibia);
        twist miss = motion_between(&a->joint, key->target, seen);
        double degrees = vec3_length(miss.rotation) * DEG_PER_RAD;
        double mm = vec3_length(miss.translation);
        if (!(degrees <= 1e-6 && mm <= 1e-6))
            return fail(error, RESULT_INVALID,
                        "key %d (ligament %d, flexion %.1f degrees): %.2g degrees and %.2g mm from "
                        "its target",
                        i, key->ligament, a->keys[i].flexion_deg, degrees, mm);
    }
    return RESULT_OK;
}
