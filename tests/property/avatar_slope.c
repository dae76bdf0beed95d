#include "base/turn.h"
#include "scene/probe.h"
#include "scene/world.h"
#include "test.h"
#include "warp/avatar.h"

#include <string.h>

#define POINTS 9

// A shaft, its hook off the axis; with a width.
static struct avatar_point points[POINTS];

static int make_instrument(void **state) {
    (void)state;
    points[1] = (struct avatar_point){{0.5, -1, 0.3}, 0.1};
    for (int i = 2; i < POINTS; i++)
        points[i] = (struct avatar_point){{0, 0, -7.0 * (i - 1)}, 0.15};
    return 0;
}

struct setting {
    const struct warp_scene *scene;
    enum avatar_mode mode;
    vec3 portal;
};

static struct avatar warp_at(const struct setting *s, pose T) {
    struct field field = field_default(FIELD_INVERSE_DISTANCE);
    struct avatar_body body = {s->mode, points, POINTS};
    struct avatar_memory memory;
    struct avatar avatar;
    avatar_memory_init(&memory);
    avatar_warp(s->scene, &field, &body, s->portal, T, &memory, &avatar);
    return avatar;
}

// The hand's way along one of six: three along the world's axes, three turns about the tip.
static pose moved(pose T, int way, double by) {
    vec3 axis = {way % 3 == 0, way % 3 == 1, way % 3 == 2};
    if (way < 3)
        return (pose){T.rotation, vec3_add_scaled(T.translation, by, axis)};
    return (pose){quat_multiply(quat_from_axis_angle(axis, by), T.rotation), T.translation};
}

struct row {
    double m[4];
};

static struct row motion_at(const struct setting *s, pose T, int way, double by) {
    struct avatar_motion motion = warp_at(s, moved(T, way, by)).extrapolation.motion;
    return (struct row){{motion.v.x, motion.v.y, motion.v.z, motion.s}};
}

// Central differences of fourth order; false where a point changes the triangle that it is next to,
// or comes to hold or to let go, on the way: there are two slopes.
static bool differences(const struct setting *s, pose T, int way, double h, struct row *out) {
    struct row at[5];
    for (int i = 0; i < 5; i++)
        at[i] = motion_at(s, T, way, (i - 2) * h);
    for (int i = 0; i < 4; i++) {
        double before = (at[2].m[i] - at[0].m[i]) / (2 * h), middle;
        double after = (at[4].m[i] - at[2].m[i]) / (2 * h);
        middle = (at[3].m[i] - at[1].m[i]) / (2 * h);
        double bend = fabs((at[4].m[i] - 2 * at[2].m[i] + at[0].m[i]) / (4 * h)) +
                      fabs((at[3].m[i] - 2 * at[2].m[i] + at[1].m[i]) / h);
        if (fabs(0.5 * (before + after) - middle) > 1e-5 * (1 + fabs(middle)) || bend > 1e-2)
            return false;
        out->m[i] = (8 * (at[3].m[i] - at[1].m[i]) - (at[4].m[i] - at[0].m[i])) / (12 * h);
    }
    return true;
}

// A pose in the joint, and one of six with its tip just coming in.
static pose somewhere(struct setting *s, struct random *r, int i) {
    s->portal = (vec3){random_between(r, -30, 30), 60, random_between(r, -3, 15)};
    vec3 tip = world_somewhere(r), way = vec3_sub(tip, s->portal);
    double depth = vec3_length(way);
    if (i % 6 == 0) {
        s->portal = vec3_add_scaled(tip, -random_between(r, 6, 14) / depth, way);
        depth = vec3_distance(tip, s->portal);
    }
    pose T = probe_aim(s->portal, way, depth);
    quat roll = quat_from_axis_angle((vec3){0, 0, 1}, random_between(r, -3, 3));
    T.rotation = quat_multiply(T.rotation, roll);
    s->portal = vec3_add(s->portal, random_in_box(r, 1));
    return T;
}

static void check_slopes(const struct setting *s, pose T, int *out_checked) {
    struct avatar avatar = warp_at(s, T);
    for (int way = 0; way < 6; way++) {
        struct row told, found;
        if (!differences(s, T, way, way < 3 ? 1e-4 : 1e-5, &found))
            continue;
        for (int i = 0; i < 4; i++) {
            told.m[i] = avatar.extrapolation.slope[i][way];
            assert_near(told.m[i], found.m[i], 1e-4 * (1 + fabs(found.m[i])));
        }
        ++*out_checked;
    }
}

static void the_slope_agrees_with_central_differences(void **state) {
    (void)state;
    struct random r = {1};
    struct world w;
    world_create(&w, &r, true);
    for (int m = 0; m < AVATAR_MODE_COUNT; m++) {
        struct setting s = {&w.scene, (enum avatar_mode)m, {0}};
        int checked = 0;
        for (int i = 0; i < 200; i++) {
            world_place(&w, &r, i % 2);
            pose T = somewhere(&s, &r, i);
            check_slopes(&s, T, &checked);
        }
        print_message("%s: %d of %d\n", avatar_mode_name(s.mode), checked, 200 * 6);
        assert_true(checked > 200 * 6 / 2);
    }
    world_fini(&w);
}

// ---- the turn underneath ------------------------------------------------------------------------

static void a_turn_is_the_shortest_and_has_its_slopes(void **state) {
    (void)state;
    struct random r = {5};
    const double h = 1e-4;
    for (int i = 0; i < 200; i++) {
        mat3 R = quat_to_mat3(random_pose(&r, 1).rotation);
        vec3 e[2] = {{R.m[0][0], R.m[1][0], R.m[2][0]}, {R.m[0][1], R.m[1][1], R.m[2][1]}};
        vec3 u = {R.m[0][2], R.m[1][2], R.m[2][2]}, x = random_in_box(&r, 50);
        double v[2] = {random_between(&r, -0.5, 0.5), random_between(&r, -0.5, 0.5)};
        struct turn turn = turn_into(u, e, v);
        vec3 leaning = vec3_add_scaled(vec3_add_scaled(u, v[0], e[0]), v[1], e[1]);
        vec3 into = vec3_unit_or(leaning, u), across = vec3_unit_or(vec3_cross(u, into), u);
        quat shortest = quat_from_axis_angle(across, acos(vec3_dot(u, into)));
        assert_vec3_near(turn_apply(&turn, x), quat_rotate(shortest, x), 1e-6);
        assert_vec3_near(turn_apply(&turn, x), quat_rotate(turn_rotation(&turn), x), 1e-12);
        vec3 first[2], second[3], ahead[2], behind[2], unused[3];
        turn_slopes(&turn, x, first, second);
        for (int k = 0; k < 2; k++) {
            double more[2] = {v[0] + h * (k == 0), v[1] + h * (k == 1)};
            double less[2] = {v[0] - h * (k == 0), v[1] - h * (k == 1)};
            struct turn after = turn_into(u, e, more), before = turn_into(u, e, less);
            vec3 way = vec3_sub(turn_apply(&after, x), turn_apply(&before, x));
            assert_vec3_near(first[k], vec3_scale(0.5 / h, way), 1e-5);
            turn_slopes(&after, x, ahead, unused);
            turn_slopes(&before, x, behind, unused);
            for (int j = 0; j < 2; j++)
                assert_vec3_near(second[k + j], vec3_scale(0.5 / h, vec3_sub(ahead[j], behind[j])),
                                 1e-5);
        }
    }
}

// ---- a pose that is late ------------------------------------------------------------------------

// How wrong two points of the instrument are on average, of `poses` poses that are 0.5 mm and 0.3
// degrees late: with the motion kept, and with it followed.
static void be_late(struct setting *s, const struct bodies *knee, int poses, double out[2]) {
    struct random r = {2};
    out[0] = out[1] = 0;
    for (int i = 0; i < poses; i++) {
        struct probe probe = probe_in_knee(knee, &r);
        pose sent = probe.T_world_tip, late = world_small_pose(&r, 0.3 * RAD_PER_DEG, 0.5);
        pose now = {quat_multiply(late.rotation, sent.rotation),
                    vec3_add(sent.translation, late.translation)};
        s->portal = probe.portal;
        struct avatar before = warp_at(s, sent), after = warp_at(s, now);
        struct avatar_motion followed = avatar_extrapolate(&before.extrapolation, sent, now);
        const struct avatar_motion *motions[2] = {&before.extrapolation.motion, &followed};
        for (int k = 0; k < 4; k++) {
            vec3 at = {0, 0, k / 2 ? -30.0 : 0};
            pose guess = avatar_place(s->mode, s->portal, motions[k % 2], now);
            vec3 truth = pose_apply(after.T_world_warped, at);
            out[k % 2] += vec3_distance(pose_apply(guess, at), truth) / (2 * poses);
        }
    }
}

static void a_late_pose_is_made_up_for(void **state) {
    (void)state;
    struct bodies knee;
    const pose B[3] = {pose_identity(), pose_identity(), pose_identity()};
    bodies_knee(&knee, 20);
    struct warp_scene scene = {knee.surfaces, knee.count, B, NULL};
    for (int m = 0; m < AVATAR_MODE_COUNT; m++) {
        struct setting s = {&scene, (enum avatar_mode)m, {0}};
        double wrong[2];
        be_late(&s, &knee, 200, wrong);
        print_message("%s: %.4f mm with the motion kept, %.4f followed\n", avatar_mode_name(s.mode),
                      wrong[0], wrong[1]);
        assert_true(wrong[1] < 0.4 * wrong[0]);
    }
    bodies_fini(&knee);
}

static double change(const struct avatar *avatar, const struct avatar_motion *motion) {
    return vec3_distance(motion->v, avatar->extrapolation.motion.v) +
           fabs(motion->s - avatar->extrapolation.motion.s);
}

static void past_the_trust_radius_the_way_is_cut_short(void **state) {
    (void)state;
    struct random r = {3};
    struct world w;
    world_create(&w, &r, true);
    int changed = 0;
    for (int i = 0; i < 100; i++) {
        struct setting s = {&w.scene, (enum avatar_mode)(i % AVATAR_MODE_COUNT), {0}};
        pose sent = somewhere(&s, &r, 1), near = sent, far = sent;
        struct avatar avatar = warp_at(&s, sent);
        assert_true(avatar.extrapolation.trust_radius_mm >= 0.1 &&
                    avatar.extrapolation.trust_radius_mm <= 2);
        vec3 way = vec3_scale(avatar.extrapolation.trust_radius_mm, random_direction(&r));
        near.translation = vec3_add_scaled(sent.translation, 0.999999999, way);
        far.translation = vec3_add_scaled(sent.translation, 10, way);
        struct avatar_motion a = avatar_extrapolate(&avatar.extrapolation, sent, near),
                             b = avatar_extrapolate(&avatar.extrapolation, sent, far);
        assert_vec3_near(a.v, b.v, 1e-6 * (1 + vec3_length(a.v)));
        assert_near(a.s, b.s, 1e-6 * (1 + fabs(a.s)));
        struct avatar_motion none = avatar_extrapolate(&avatar.extrapolation, sent, sent);
        assert_near(change(&avatar, &none), 0, 1e-12);
        changed += change(&avatar, &b) > 1e-3;
    }
    assert_true(changed > 50);
    world_fini(&w);
}

// ---- small steps ----------------------------------------------------------------------------

// Between two convex bodies nothing jumps: over a step a hundredth as long, a point moves a
// hundredth as far.
static void between_convex_bodies_motion_is_continuous(void **state) {
    (void)state;
    struct random r = {4};
    struct bodies balls = {0};
    const pose B[2] = {{quat_identity(), {0, 0, 33}}, {quat_identity(), {0, 0, -33}}};
    for (int k = 0; k < 2; k++) {
        struct mesh mesh;
        shape_sphere(&mesh, 30, 30);
        float *displacement = shape_displacement(&mesh, 2, 5 + (uint64_t)k);
        bodies_add(&balls, &mesh, displacement, k);
    }
    struct warp_scene scene = {balls.surfaces, balls.count, B, NULL};
    for (int m = 0; m < AVATAR_MODE_COUNT; m++) {
        struct setting s = {&scene, (enum avatar_mode)m, {5, 60, 1}};
        double largest[2] = {0};
        for (int i = 0; i < 4000; i++) {
            vec3 tip = {random_between(&r, -5, 5), random_between(&r, -20, 10),
                        random_between(&r, -3, 3)};
            pose T = probe_aim(s.portal, vec3_sub(tip, s.portal), vec3_distance(tip, s.portal));
            vec3 side = random_direction(&r);
            struct avatar here = warp_at(&s, T);
            for (int k = 0; k < 2; k++) {
                double step = k ? 1e-5 : 1e-3;
                pose next = {T.rotation, vec3_add_scaled(T.translation, step, side)};
                struct avatar there = warp_at(&s, next);
                for (int p = 0; p < POINTS; p++) {
                    double way = vec3_distance(here.displacement[p], there.displacement[p]);
                    largest[k] = fmax(largest[k], way / step);
                }
            }
        }
        print_message("%s: %.2f and %.2f mm for each mm\n", avatar_mode_name(s.mode), largest[0],
                      largest[1]);
        assert_true(largest[0] < 20 && largest[1] < 20);
    }
    bodies_fini(&balls);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_slope_agrees_with_central_differences),
        cmocka_unit_test(a_turn_is_the_shortest_and_has_its_slopes),
        cmocka_unit_test(a_late_pose_is_made_up_for),
        cmocka_unit_test(past_the_trust_radius_the_way_is_cut_short),
        cmocka_unit_test(between_convex_bodies_motion_is_continuous),
    };
    return cmocka_run_group_tests(tests, make_instrument, NULL);
}
