#include "warp/avatar.h"

#include "scene/probe.h"
#include "scene/world.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

// ---- instruments --------------------------------------------------------------------------------

#define STRAIGHT 8
#define SPACING_MM 7.0

static struct avatar_point straight[STRAIGHT], hooked[STRAIGHT + 2];

// A straight shaft; and one with a hook at its end, that has a width.
static int make_instruments(void **state) {
    (void)state;
    hooked[1] = (struct avatar_point){{0, -2, 0}, 0.3};
    hooked[2] = (struct avatar_point){{0, -4, 1}, 0};
    for (int i = 0; i < STRAIGHT; i++) {
        vec3 at = {0, 0, -SPACING_MM * i};
        straight[i] = (struct avatar_point){at, 0};
        hooked[i ? i + 2 : 0] = (struct avatar_point){at, i ? 1 : 0};
    }
    return 0;
}

static struct avatar_body body_of(enum avatar_mode mode, bool hook) {
    return (struct avatar_body){mode, hook ? hooked : straight, hook ? STRAIGHT + 2 : STRAIGHT};
}

static struct avatar warp_once(const struct warp_scene *scene, const struct avatar_body *body,
                               const struct probe *probe) {
    struct field field = field_default(FIELD_INVERSE_DISTANCE);
    struct avatar_memory memory;
    struct avatar avatar;
    avatar_memory_init(&memory);
    avatar_warp(scene, &field, body, probe->portal, probe->T_world_tip, &memory, &avatar);
    return avatar;
}

// A pose in the world's joint, and a portal that its axis misses by up to 2 mm.
static struct probe somewhere(struct random *r) {
    vec3 portal = {random_between(r, -30, 30), 60, random_between(r, -3, 15)};
    vec3 tip = world_somewhere(r);
    struct probe probe = {portal,
                          probe_aim(portal, vec3_sub(tip, portal), vec3_distance(tip, portal))};
    quat roll = quat_from_axis_angle((vec3){0, 0, 1}, random_between(r, -3, 3));
    probe.T_world_tip.rotation = quat_multiply(probe.T_world_tip.rotation, roll);
    probe.portal = vec3_add(portal, random_in_box(r, 1));
    return probe;
}

// ---- what every mode must be --------------------------------------------------------------------

static void nothing_displaced_moves_nothing_by_a_bit(void **state) {
    (void)state;
    struct random r = {1};
    struct bodies knee;
    const pose B[3] = {pose_identity(), pose_identity(), pose_identity()};
    bodies_knee(&knee, 20);
    for (int k = 0; k < knee.count; k++)
        knee.surfaces[k].displacement = NULL;
    struct warp_scene scene = {knee.surfaces, knee.count, B, NULL};
    for (int i = 0; i < 60; i++) {
        enum probe_touch touch;
        struct probe probe = i % 2 ? probe_in_touch(&knee, &r, &touch) : probe_in_knee(&knee, &r);
        for (int m = 0; m < AVATAR_MODE_COUNT; m++) {
            struct avatar_body body = body_of((enum avatar_mode)m, i % 3 == 0);
            struct avatar avatar = warp_once(&scene, &body, &probe);
            assert_memory_equal(&avatar.T_world_warped, &probe.T_world_tip, sizeof(pose));
            assert_true(avatar.penetration_mm == 0 && avatar.tip_gap_mm == 0);
        }
    }
    bodies_fini(&knee);
}

static void a_tip_goes_where_the_space_warp_takes_it(void **state) {
    (void)state;
    struct random r = {2};
    struct world w;
    world_create(&w, &r, true);
    struct field field = field_default(FIELD_INVERSE_DISTANCE);
    for (int i = 0; i < 200; i++) {
        world_place(&w, &r, i % 2);
        struct probe probe = somewhere(&r);
        struct avatar_body body = body_of(AVATAR_TIP, i % 3 == 0);
        struct avatar avatar = warp_once(&w.scene, &body, &probe);
        struct warp warp = world_warp(&w.scene, &field, probe.T_world_tip.translation);
        vec3 target = vec3_add(probe.T_world_tip.translation, warp.displacement);
        assert_memory_equal(&avatar.T_world_warped.translation, &target, sizeof target);
        assert_memory_equal(&avatar.T_world_warped.rotation, &probe.T_world_tip.rotation,
                            sizeof(quat));
        assert_true(avatar.extrapolation.trust_radius_mm == warp.trust_radius_mm);
    }
    world_fini(&w);
}

// 0, and never -0: traces of every build have the same bits. Fails without the optimizer alone.
static void the_reach_of_what_lies_beside_and_before_the_tip_is_one_zero(void **state) {
    (void)state;
    struct random r = {9};
    struct world w;
    world_create(&w, &r, true);
    for (int count = 1; count <= 3; count++) {
        static const struct avatar_point points[] = {
            {{0, 0, 0}, 0}, {{2, 0, 0}, 0}, {{0, 1, 3}, 0}};
        struct avatar_body body = {AVATAR_RIGID, points, count};
        struct probe probe = somewhere(&r);
        struct avatar avatar = warp_once(&w.scene, &body, &probe);
        assert_true(avatar.extrapolation.reach_mm == 0 && !signbit(avatar.extrapolation.reach_mm));
    }
    world_fini(&w);
}

static void memory_never_changes_a_bit(void **state) {
    (void)state;
    struct random r = {3};
    struct world w;
    world_create(&w, &r, true);
    struct field field = field_default(FIELD_INVERSE_DISTANCE);
    struct avatar_memory kept;
    avatar_memory_init(&kept);
    for (int i = 0; i < 300; i++) {
        struct probe probe = somewhere(&r);
        struct avatar_body body = body_of((enum avatar_mode)(i % AVATAR_MODE_COUNT), i % 2);
        struct avatar fresh = warp_once(&w.scene, &body, &probe), again;
        avatar_warp(&w.scene, &field, &body, probe.portal, probe.T_world_tip, &kept, &again);
        assert_memory_equal(&fresh, &again, sizeof fresh);
    }
    world_fini(&w);
}

// ---- a field that is the same everywhere --------------------------------------------------------

static void displace_all(struct bodies *knee, vec3 by) {
    for (int k = 0; k < knee->count; k++)
        for (uint32_t v = 0; v < knee->meshes[k].vertex_count; v++) {
            float *d = knee->displacements[k] + 3 * (size_t)v;
            d[0] = (float)by.x;
            d[1] = (float)by.y;
            d[2] = (float)by.z;
        }
}

static void a_field_that_is_one_translation(void **state) {
    (void)state;
    struct random r = {4};
    struct bodies knee;
    const pose B[3] = {pose_identity(), pose_identity(), pose_identity()};
    bodies_knee(&knee, 20);
    struct warp_scene scene = {knee.surfaces, knee.count, B, NULL};
    struct field field = field_default(FIELD_INVERSE_DISTANCE);
    field.background_per_mm = 0;
    for (int i = 0; i < 60; i++) {
        struct probe probe = probe_in_knee(&knee, &r);
        if (bodies_gap(&knee, probe.T_world_tip.translation) > 11)
            continue; // out of reach
        vec3 along = quat_rotate(probe.T_world_tip.rotation, (vec3){0, 0, 1});
        vec3 by = i % 2 ? vec3_scale(random_between(&r, -3, 3), along) : random_in_box(&r, 2);
        displace_all(&knee, by);
        for (int m = 0; m < AVATAR_MODE_COUNT; m++) {
            struct avatar_memory memory;
            struct avatar avatar;
            struct avatar_body body = body_of((enum avatar_mode)m, false);
            if (m == AVATAR_RIGID && i % 2 == 0)
                body.point_count = 1; // several cannot all follow a translation across the axis
            avatar_memory_init(&memory);
            avatar_warp(&scene, &field, &body, probe.portal, probe.T_world_tip, &memory, &avatar);
            vec3 moved = vec3_sub(avatar.T_world_warped.translation, probe.T_world_tip.translation);
            assert_vec3_near(moved, by, 1e-6); // displacements are floats
            assert_near(avatar.tip_gap_mm, 0, 1e-6);
            assert_near(avatar.penetration_mm, 0, 1e-6);
            if (i % 2) // along the axis: no turn
                assert_true(quat_angle(avatar.T_world_warped.rotation, probe.T_world_tip.rotation) <
                            1e-7);
        }
    }
    bodies_fini(&knee);
}

// ---- the rigid fit ------------------------------------------------------------------------------

static void the_axis_goes_through_the_portal(void **state) {
    (void)state;
    struct random r = {5};
    struct world w;
    world_create(&w, &r, true);
    int turned = 0;
    for (int i = 0; i < 500; i++) {
        world_place(&w, &r, i % 2);
        struct probe probe = somewhere(&r);
        struct avatar_body body = body_of(AVATAR_RIGID, i % 3 == 0);
        pose T = probe.T_world_tip, after = warp_once(&w.scene, &body, &probe).T_world_warped;
        vec3 u = quat_rotate(T.rotation, (vec3){0, 0, 1});
        vec3 P =
            vec3_add_scaled(T.translation, vec3_dot(u, vec3_sub(probe.portal, T.translation)), u);
        vec3 along = quat_rotate(after.rotation, (vec3){0, 0, 1});
        vec3 off = vec3_sub(P, after.translation);
        assert_vec3_near(vec3_add_scaled(off, -vec3_dot(off, along), along), ((vec3){0}), 1e-9);
        // The shortest turn: about an axis across the shaft.
        quat turn = quat_multiply(after.rotation, quat_conjugate(T.rotation));
        assert_near(vec3_dot((vec3){turn.x, turn.y, turn.z}, u), 0, 1e-12);
        turned += quat_angle(after.rotation, T.rotation) > 0.005;
    }
    assert_true(turned > 250);
    world_fini(&w);
}

static double fade_in(double past_portal_mm) {
    double x = fmin(fmax((past_portal_mm - 5) / 10, 0), 1);
    return x * x * (3 - 2 * x);
}

// The header's sum, for a motion as a pose.
static double cost_of(const struct warp_scene *scene, const struct avatar_body *body,
                      const struct probe *probe, pose after) {
    struct field field = field_default(FIELD_INVERSE_DISTANCE);
    pose T = probe->T_world_tip;
    vec3 u = quat_rotate(T.rotation, (vec3){0, 0, 1});
    double portal = vec3_dot(u, vec3_sub(probe->portal, T.translation)), cost = 0;
    for (int i = 0; i < body->point_count; i++) {
        struct warp_contact contacts[WARP_SURFACES_MAX];
        struct warp_memory memory;
        struct warp warp;
        warp_memory_init(&memory);
        vec3 at = body->points[i].at, p = pose_apply(T, at);
        int count = warp_contacts(scene, &field, p, &memory, &warp, contacts);
        double h = fade_in(at.z - portal), H = fade_in(-portal);
        vec3 delta = vec3_sub(pose_apply(after, at), p);
        for (int k = 0; k < count; k++) {
            const struct warp_contact *c = &contacts[k];
            double radius = body->points[i].radius_mm, g = c->distance - radius;
            double weight = 1 / (fmax(g, 0) + 0.05) - 1 / (field.radius_mm - radius + 0.05);
            vec3 off = vec3_sub(delta, vec3_scale(H, warp.displacement));
            double along = vec3_dot(c->normal, vec3_sub(delta, vec3_scale(H, c->delta)));
            double row = fmin(along + fmax(g - 0.02, 0), 0);
            if (weight > 0)
                cost += h * weight * (0.5 * vec3_dot(off, off) + along * along);
            cost += 100 * h * row * row;
        }
    }
    return cost;
}

// No other turn about the portal and slide is cheaper.
static void the_fit_is_the_best_there_is(void **state) {
    (void)state;
    struct random r = {6};
    struct world w;
    world_create(&w, &r, true);
    for (int i = 0; i < 150; i++) {
        world_place(&w, &r, i % 2);
        struct probe probe = somewhere(&r);
        struct avatar_body body = body_of(AVATAR_RIGID, i % 3 == 0);
        struct avatar avatar = warp_once(&w.scene, &body, &probe);
        double best = cost_of(&w.scene, &body, &probe, avatar.T_world_warped);
        for (int k = 0; k < 40; k++) {
            double size = pow(10, random_between(&r, -4, 0));
            struct avatar_motion other = avatar.extrapolation.motion;
            other.v = vec3_add(other.v, random_in_box(&r, size / 50));
            other.s += random_between(&r, -size, size);
            pose after = avatar_place(AVATAR_RIGID, probe.portal, &other, probe.T_world_tip);
            assert_true(cost_of(&w.scene, &body, &probe, after) >= best * (1 - 1e-9));
        }
    }
    world_fini(&w);
}

static void a_roll_of_a_straight_instrument_does_not_matter(void **state) {
    (void)state;
    struct random r = {7};
    struct world w;
    world_create(&w, &r, true);
    for (int i = 0; i < 100; i++) {
        struct probe probe = somewhere(&r), rolled = probe;
        quat roll = quat_from_axis_angle((vec3){0, 0, 1}, random_between(&r, -3, 3));
        rolled.T_world_tip.rotation = quat_multiply(probe.T_world_tip.rotation, roll);
        struct avatar_body body = body_of(AVATAR_RIGID, false);
        struct avatar one = warp_once(&w.scene, &body, &probe);
        struct avatar other = warp_once(&w.scene, &body, &rolled);
        assert_vec3_near(one.extrapolation.motion.v, other.extrapolation.motion.v, 1e-9);
        assert_near(one.extrapolation.motion.s, other.extrapolation.motion.s, 1e-8);
        assert_vec3_near(one.T_world_warped.translation, other.T_world_warped.translation, 1e-7);
    }
    world_fini(&w);
}

// Pulled back to the portal, it comes to rest; on the way nothing jumps.
static void an_instrument_outside_is_not_moved(void **state) {
    (void)state;
    struct random r = {8};
    struct bodies walls;
    bodies_walls(&walls, 6, 3);
    pose B = pose_identity();
    struct warp_scene scene = {walls.surfaces, walls.count, &B, NULL};
    vec3 portal = {0, 8, 0.5};
    struct avatar_body body = body_of(AVATAR_RIGID, false);
    vec3 direction = vec3_add((vec3){0, -1, 0}, random_in_box(&r, 0.05));
    struct avatar before = {0};
    for (double depth = -5; depth < 20; depth += 0.001) {
        struct probe probe = {portal, probe_aim(portal, direction, depth)};
        struct avatar avatar = warp_once(&scene, &body, &probe);
        if (depth < 4)
            assert_memory_equal(&avatar.T_world_warped, &probe.T_world_tip, sizeof(pose));
        else if (vec3_length(before.extrapolation.motion.v) > 0)
            assert_vec3_near(avatar.displacement[0], before.displacement[0], 0.01);
        before = avatar;
    }
    assert_true(vec3_length(before.displacement[0]) > 0.5);
    bodies_fini(&walls);
}

// ---- in touch -----------------------------------------------------------------------------------

#define POSES 100

static int ascending(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

// How deep the body's points are in the virtual surfaces, the deepest of each pose, on average; and
// the tip's virtual gap over its gap, where it touches.
struct depths {
    double sum[PROBE_TOUCHES];
    int count[PROBE_TOUCHES], gap_count;
    double gaps[PROBE_TOUCHES * POSES];
};

static void add_depth(const struct bodies *knee, const struct bodies *virtual,
                      const struct probe *probe, enum probe_touch touch, enum avatar_mode mode,
                      struct depths *out) {
    const pose B[3] = {pose_identity(), pose_identity(), pose_identity()};
    struct warp_scene scene = {knee->surfaces, knee->count, B, NULL};
    struct avatar_body body = body_of(mode, false);
    pose after = warp_once(&scene, &body, probe).T_world_warped;
    double deepest = 0, gap = bodies_gap(knee, probe->T_world_tip.translation);
    for (int i = 0; i < body.point_count; i++)
        deepest = fmax(deepest, -bodies_gap(virtual, pose_apply(after, body.points[i].at)));
    out->sum[touch] += deepest;
    out->count[touch]++;
    if (gap < 0.1)
        out->gaps[out->gap_count++] = bodies_gap(virtual, after.translation) - gap;
}

static double depth(const struct depths *depths, enum probe_touch touch) {
    return depths->sum[touch] / depths->count[touch];
}

static void a_rigid_instrument_stays_out_of_what_its_shaft_touches(void **state) {
    (void)state;
    struct random r = {9};
    struct bodies knee, virtual;
    bodies_knee(&knee, 20);
    bodies_displaced(&virtual, &knee);
    struct depths tip = {0}, rigid = {0};
    while (tip.count[PROBE_SHAFT] < POSES || tip.count[PROBE_BOTH] < POSES) {
        enum probe_touch touch;
        struct probe probe = probe_in_touch(&knee, &r, &touch);
        if (tip.count[touch] == POSES)
            continue;
        add_depth(&knee, &virtual, &probe, touch, AVATAR_TIP, &tip);
        add_depth(&knee, &virtual, &probe, touch, AVATAR_RIGID, &rigid);
    }
    qsort(rigid.gaps, (size_t)rigid.gap_count, sizeof *rigid.gaps, ascending);
    double gap = rigid.gaps[rigid.gap_count * 99 / 100];
    print_message("rigid over tip: shaft %.3f, both %.3f; gap of the tip %.3f mm at 99 %%\n",
                  depth(&rigid, PROBE_SHAFT) / depth(&tip, PROBE_SHAFT),
                  depth(&rigid, PROBE_BOTH) / depth(&tip, PROBE_BOTH), gap);
    assert_true(depth(&tip, PROBE_SHAFT) > 0.05);
    assert_true(depth(&rigid, PROBE_SHAFT) < 0.2 * depth(&tip, PROBE_SHAFT));
    assert_true(depth(&rigid, PROBE_BOTH) < 0.43 * depth(&tip, PROBE_BOTH));
    assert_true(gap <= 1);
    bodies_fini(&virtual);
    bodies_fini(&knee);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nothing_displaced_moves_nothing_by_a_bit),
        cmocka_unit_test(a_tip_goes_where_the_space_warp_takes_it),
        cmocka_unit_test(the_reach_of_what_lies_beside_and_before_the_tip_is_one_zero),
        cmocka_unit_test(memory_never_changes_a_bit),
        cmocka_unit_test(a_field_that_is_one_translation),
        cmocka_unit_test(the_axis_goes_through_the_portal),
        cmocka_unit_test(the_fit_is_the_best_there_is),
        cmocka_unit_test(a_roll_of_a_straight_instrument_does_not_matter),
        cmocka_unit_test(an_instrument_outside_is_not_moved),
        cmocka_unit_test(a_rigid_instrument_stays_out_of_what_its_shaft_touches),
    };
    return cmocka_run_group_tests(tests, make_instruments, NULL);
}
