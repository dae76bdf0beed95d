#include "cut/blade.h"

#include "random.h"
#include "test.h"

#include <string.h>

static double distance_to_way(const struct blade_move *move, vec3 p) {
    vec3 a = move->T_mesh_tip[0].translation, b = move->T_mesh_tip[1].translation;
    vec3 way = vec3_sub(b, a);
    double length = vec3_dot(way, way);
    double t = length > 0 ? vec3_dot(vec3_sub(p, a), way) / length : 0;
    return vec3_distance(p, vec3_lerp(a, b, fmax(0, fmin(1, t))));
}

static struct blade_move random_move(struct random *r, int kind) {
    pose at = random_pose(r, 50);
    quat turn = quat_from_axis_angle(random_direction(r), random_between(r, 0, 0.2));
    pose after = {quat_multiply(turn, at.rotation), vec3_add(at.translation, random_in_box(r, 2))};
    return (struct blade_move){kind, {at, after}, {random_between(r, 0.5, 1), 0.3}};
}

static bool contained(const struct convex *parts, int count, vec3 p) {
    for (int i = 0; i < count; i++)
        if (convex_contains(&parts[i], p))
            return true;
    return false;
}

// One of each kind that cuts, of any size, behind the usual ones.
static struct instruments described(struct random *r) {
    struct instruments tools = *instruments_usual();
    struct instrument jaw = instrument_of_kind(INSTRUMENT_JAW);
    struct instrument burr = instrument_of_kind(INSTRUMENT_BURR);
    struct instrument blade = instrument_of_kind(INSTRUMENT_BLADE);
    strcpy(jaw.name, "basket");
    jaw.length_mm = random_between(r, 2, 30);
    jaw.width_mm = random_between(r, 0.5, 20);
    jaw.opening_deg = random_between(r, 5, 90);
    strcpy(burr.name, "drill");
    burr.width_mm = random_between(r, 1, 12);
    strcpy(blade.name, "curette");
    blade.length_mm = random_between(r, 1, 30);
    blade.width_mm = random_between(r, 0.5, 20);
    blade.thickness_mm = random_between(r, 0.1, 2);
    assert_int_equal(instruments_add(&tools, &jaw, NULL), RESULT_OK);
    assert_int_equal(instruments_add(&tools, &burr, NULL), RESULT_OK);
    assert_int_equal(instruments_add(&tools, &blade, NULL), RESULT_OK);
    return tools;
}

static void every_part_is_within_reach(void **state) {
    (void)state;
    static const int blades[] = {BLADE_PUNCH, BLADE_SHAVER, BLADE_KNIFE, 4, 5, 6};
    struct random r = {7};
    struct convex parts[CUT_PARTS_MAX];
    for (int round = 0; round < 1200; round++) {
        struct instruments tools = described(&r);
        struct blade_move move = random_move(&r, blades[round % 6]);
        const struct instrument *tool = &tools.of[instrument_of_blade(move.blade)];
        int count = blade_parts(&tools, &move, true, parts, NULL);
        assert_in_range(count, 1, CUT_PARTS_MAX);
        for (int i = 0; i < count; i++)
            for (int v = 0; v < parts[i].vertex_count; v++)
                assert_true(distance_to_way(&move, parts[i].vertices[v]) <= blade_reach_mm(tool));
    }
}

// A described one of the usual size takes what the usual one takes, to the bit.
static void a_described_blade_cuts_by_its_kind_and_size(void **state) {
    (void)state;
    static const enum instrument_kind kinds[] = {INSTRUMENT_JAW, INSTRUMENT_BURR, INSTRUMENT_BLADE};
    struct random r = {11};
    struct convex usual[CUT_PARTS_MAX], parts[CUT_PARTS_MAX];
    for (int round = 0; round < 60; round++) {
        struct instruments tools = *instruments_usual();
        struct instrument one = instrument_of_kind(kinds[round % 3]);
        strcpy(one.name, "other");
        assert_int_equal(instruments_add(&tools, &one, NULL), RESULT_OK);
        struct blade_move move = random_move(&r, round % 3);
        int count = blade_parts(&tools, &move, true, usual, NULL);
        move.blade = blade_of_instrument(INSTRUMENTS_USUAL);
        assert_int_equal(blade_parts(&tools, &move, true, parts, NULL), count);
        for (int i = 0; i < count; i++) {
            assert_int_equal(parts[i].vertex_count, usual[i].vertex_count);
            assert_memory_equal(parts[i].vertices, usual[i].vertices,
                                (size_t)usual[i].vertex_count * sizeof *usual[i].vertices);
        }
    }
}

// Points of the burr at any time of the move are taken; a hair's breadth off its rim they are not.
static void a_burr_takes_what_it_sweeps(void **state) {
    (void)state;
    struct random r = {8};
    struct convex parts[CUT_PARTS_MAX];
    for (int round = 0; round < 200; round++) {
        struct blade_move move = random_move(&r, BLADE_SHAVER);
        int count = blade_parts(instruments_usual(), &move, true, parts, NULL);
        vec3 centres[2];
        for (int i = 0; i < 2; i++)
            centres[i] = pose_apply(move.T_mesh_tip[i], (vec3){0, 0, -2});
        vec3 centre = vec3_lerp(centres[0], centres[1], random_between(&r, 0, 1));
        vec3 direction = random_direction(&r);
        assert_true(contained(parts, count, vec3_add_scaled(centre, 1.999, direction)));
        vec3 way = vec3_unit_or(vec3_sub(centres[1], centres[0]), direction);
        vec3 across = vec3_unit_or(vec3_cross(way, direction), direction);
        assert_false(contained(parts, count, vec3_add_scaled(centre, 2.1, across)));
    }
}

// The jaw's own face at any opening in between is taken, the tissue above and below it is not.
static void a_punch_takes_what_its_jaw_closes_over(void **state) {
    (void)state;
    struct random r = {9};
    struct convex parts[CUT_PARTS_MAX];
    for (int round = 0; round < 200; round++) {
        struct blade_move move = random_move(&r, BLADE_PUNCH);
        int count = blade_parts(instruments_usual(), &move, true, parts, NULL);
        for (int i = 0; i < 30; i++) {
            double opening = random_between(&r, 0, 1.2), along = random_between(&r, 1.01, 5.9);
            double angle = opening * 35 * RAD_PER_DEG, beside = random_between(&r, -1.7, 1.7);
            vec3 p = {beside, along * sin(angle), along * cos(angle) - 6};
            bool closes_over = opening < move.opening[0] && opening > move.opening[1];
            assert_int_equal(contained(parts, count, pose_apply(move.T_mesh_tip[1], p)),
                             closes_over);
        }
        double opening = move.opening[0];
        move.opening[0] = move.opening[1];
        move.opening[1] = opening;
        assert_int_equal(blade_parts(instruments_usual(), &move, true, parts, NULL), 0);
    }
}

// The face of the jaw where the move before ended is taken, unless the hand has gone on.
static void a_punch_that_trembles_leaves_no_film(void **state) {
    (void)state;
    struct random r = {10};
    struct convex parts[CUT_PARTS_MAX];
    for (int round = 0; round < 200; round++) {
        struct blade_move move = random_move(&r, BLADE_PUNCH);
        bool gone = round % 2;
        vec3 up = quat_rotate(move.T_mesh_tip[0].rotation, (vec3){0, 1, 0});
        quat turn = quat_from_axis_angle(random_direction(&r), gone ? 0 : 0.02);
        move.T_mesh_tip[1].rotation = quat_multiply(move.T_mesh_tip[0].rotation, turn);
        move.T_mesh_tip[1].translation =
            vec3_add_scaled(move.T_mesh_tip[0].translation, gone ? -0.6 : -0.2, up);
        int count = blade_parts(instruments_usual(), &move, true, parts, NULL);
        for (int i = 0; i < 30; i++) {
            double angle = move.opening[0] * 35 * RAD_PER_DEG - 1e-9;
            double along = random_between(&r, 1.01, 5.9), beside = random_between(&r, -1.7, 1.7);
            vec3 p = {beside, along * sin(angle), along * cos(angle) - 6};
            assert_int_equal(contained(parts, count, pose_apply(move.T_mesh_tip[0], p)), !gone);
        }
    }
}

static void a_knife_takes_its_kerf_along_its_way(void **state) {
    (void)state;
    struct convex parts[CUT_PARTS_MAX];
    pose start = pose_identity(), end = pose_identity();
    end.translation = (vec3){0, 4, -1};
    struct blade_move move = {BLADE_KNIFE, {start, end}, {0}};
    assert_int_equal(blade_parts(instruments_usual(), &move, true, parts, NULL), 1);
    double plate = 2.5 * 3.5, swept = 4 * 3.5 + 1 * 2.5; // of its plan, as it moves within it
    assert_near(parts[0].volume, 0.2 * (plate + swept), 1e-9);
    move.T_mesh_tip[1] = (pose){quat_from_axis_angle((vec3){1, 0, 0}, 0.3), {0, 0, 0}};
    assert_int_equal(blade_parts(instruments_usual(), &move, true, parts, NULL), CUT_PARTS_MAX);
    for (int i = 0; i < CUT_PARTS_MAX; i++)
        assert_near(parts[i].box.max.x - parts[i].box.min.x, 0.2, 1e-9);
}

// Where the blade is at some time of a move.
static vec3 random_point_of(struct random *r, const struct blade_move *move, double inset) {
    vec3 low = {-0.1, -1.25, -3.5}, high = {0.1, 1.25, 0};
    vec3 p = {random_between(r, low.x + inset, high.x - inset),
              random_between(r, low.y + inset, high.y - inset),
              random_between(r, low.z + inset, high.z - inset)};
    return pose_apply(
        pose_interpolate(move->T_mesh_tip[0], move->T_mesh_tip[1], random_between(r, 0, 1)), p);
}

static void a_knife_that_turns_takes_less_in_parts_that_fit_closer(void **state) {
    (void)state;
    struct random r = {12};
    struct convex tight[CUT_PARTS_MAX], loose[CUT_PARTS_MAX];
    int taken_tightly = 0, taken_loosely = 0;
    for (int round = 0; round < 60; round++) {
        struct blade_move move = random_move(&r, BLADE_KNIFE);
        move.T_mesh_tip[1].translation =
            vec3_add_scaled(move.T_mesh_tip[0].translation, 0.5, random_direction(&r));
        int tights = blade_parts(instruments_usual(), &move, true, tight, NULL);
        int looses = blade_parts(instruments_usual(), &move, false, loose, NULL);
        assert_in_range(tights, 1, looses);
        for (int i = 0; i < 300; i++) {
            assert_true(contained(tight, tights, random_point_of(&r, &move, 1e-3)));
            vec3 near = vec3_add(random_point_of(&r, &move, 0), random_in_box(&r, 0.2));
            taken_tightly += contained(tight, tights, near);
            taken_loosely += contained(loose, looses, near);
        }
    }
    assert_true(taken_tightly < taken_loosely);
}

static void a_blade_that_cannot_be_made_is_told_with_its_place(void **state) {
    (void)state;
    struct convex parts[CUT_PARTS_MAX];
    for (int kind = 0; kind <= BLADE_KNIFE; kind++) {
        struct error err = {0};
        pose far = {quat_identity(), {0, 250e3, 0}};
        struct blade_move move = {kind, {far, far}, {1, 0}};
        assert_int_equal(blade_parts(instruments_usual(), &move, true, parts, &err), -1);
        assert_non_null(strstr(err.text, channel_name((enum channel)(move.blade + CHANNEL_PUNCH))));
        assert_non_null(strstr(err.text, "0.0,250000.0,0.0: "));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_part_is_within_reach),
        cmocka_unit_test(a_described_blade_cuts_by_its_kind_and_size),
        cmocka_unit_test(a_burr_takes_what_it_sweeps),
        cmocka_unit_test(a_punch_takes_what_its_jaw_closes_over),
        cmocka_unit_test(a_punch_that_trembles_leaves_no_film),
        cmocka_unit_test(a_knife_takes_its_kerf_along_its_way),
        cmocka_unit_test(a_knife_that_turns_takes_less_in_parts_that_fit_closer),
        cmocka_unit_test(a_blade_that_cannot_be_made_is_told_with_its_place),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
