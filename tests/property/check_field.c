#include "base/check.h"
#include "check/facing.h"
#include "check/field.h"
#include "scene/bodies.h"
#include "scene/world.h"
#include "test.h"

#include <stdlib.h>

static const pose still[3] = {
    {{1, 0, 0, 0}, {0, 0, 0}}, {{1, 0, 0, 0}, {0, 0, 0}}, {{1, 0, 0, 0}, {0, 0, 0}}};

static struct warp_scene scene_of(const struct bodies *bodies) {
    return (struct warp_scene){bodies->surfaces, bodies->count, still, NULL};
}

// All of a box, whatever is in it: solids are another test's.
static struct space whole(struct box box, double spacing) {
    struct warp_scene nothing = {NULL, 0, still, NULL};
    struct space_setup setup = {.scene = &nothing, .box = box, .spacing_mm = spacing};
    struct space space;
    struct error err;
    assert_int_equal(space_init(&setup, &space, &err), RESULT_OK);
    return space;
}

// The caller frees them.
static struct field_figures *walk(const struct warp_scene *scene, const struct field *field,
                                  const struct space *space) {
    struct field_figures *figures = alloc(1, sizeof *figures);
    struct moved moved;
    struct error err;
    assert_int_equal(moved_init(scene, field, &moved, &err), RESULT_OK);
    field_walk(scene, NULL, field, &moved, space, NULL, figures);
    moved_fini(&moved);
    return figures;
}

static struct field_figures *walk_walls(double gap, double rise) {
    struct bodies bodies;
    struct field field = field_default(FIELD_INVERSE_DISTANCE);
    bodies_walls(&bodies, gap, rise);
    struct warp_scene scene = scene_of(&bodies);
    struct space space = whole((struct box){{-6, -6, -0.49 * gap}, {6, 6, 0.49 * gap}}, 0.25);
    struct field_figures *figures = walk(&scene, &field, &space);
    space_fini(&space);
    bodies_fini(&bodies);
    return figures;
}

static void a_bump_that_fills_its_gap_folds_for_the_cases_fault(void **state) {
    (void)state;
    struct field_figures *f = walk_walls(2, 2.1);
    assert_true(f->folded > 0.8 * (double)f->looked);
    assert_int_equal(f->filled, f->folded);
    assert_near(f->filling.gap_mm, 2, 1e-6);
    assert_near(f->filling.left_mm, -0.1, 1e-6);
    assert_int_equal(f->close, 0);
    free(f);
    f = walk_walls(0.7, 0.3); // with one at hand, the other is too near in the middle only
    assert_true(f->close > 0 && f->looked > 0);
    free(f);
    f = walk_walls(2, 1);
    assert_int_equal(f->folded, 0);
    assert_near(f->gain.value, 0.5, 0.05); // 1 mm over 2 mm, and the background
    assert_near(field_gain_within(f, 1), f->gain.value, 1e-9);
    f->gains[GAIN_BINS - 1] = 2 * f->looked; // beyond all bins
    f->looked *= 3;
    f->gain.value = 77;
    assert_true(field_gain_within(f, 0.9) == 77);
    f->gains[GAIN_BINS - 1] = 0;
    f->looked /= 3;
    assert_true(field_gain_within(f, 0.1) <= f->gain.value);
    free(f);
}

// Walls whose displacements scale x by `x` and y by `y`: what is between them folds where x y < 0.
static void scale_walls(struct bodies *bodies, double x, double y) {
    bodies_walls(bodies, 2, 0);
    for (int i = 0; i < 2; i++) {
        struct mesh *mesh = &bodies->meshes[i];
        float *d = alloc(3 * (size_t)mesh->vertex_count, sizeof *d);
        for (uint32_t v = 0; v < mesh->vertex_count; v++) {
            vec3 p = mesh_vertex(mesh, v);
            d[3 * (size_t)v] = (float)((x - 1) * p.x);
            d[3 * (size_t)v + 1] = (float)((y - 1) * p.y);
        }
        free(bodies->displacements[i]);
        bodies->displacements[i] = d;
        bodies->surfaces[i].displacement = d;
    }
    bodies_integrate(bodies);
}

static struct field_figures *walk_scaled(const struct space *space, double share, bool eased) {
    struct bodies still_walls, bodies;
    struct field field = field_default(FIELD_INTEGRAL);
    struct field_figures *figures = alloc(1, sizeof *figures);
    struct moved moved;
    struct error err;
    scale_walls(&still_walls, 1, 1);
    scale_walls(&bodies, 1 - 3 * share, 1 - 1.5 * share);
    struct warp_scene from = scene_of(&still_walls), to = scene_of(&bodies);
    assert_ok(moved_init(&to, &field, &moved, &err));
    if (eased)
        field_walk(&from, &to, &field, &moved, space, NULL, figures);
    else
        field_walk(&to, NULL, &field, &moved, space, NULL, figures);
    moved_fini(&moved);
    bodies_fini(&still_walls);
    bodies_fini(&bodies);
    return figures;
}

// In the end two axes are turned over, on the way first one alone.
static void folds_between_the_ends_of_an_easing_are_found(void **state) {
    (void)state;
    struct space space = whole((struct box){{-2, -2, -0.4}, {2, 2, 0.4}}, 0.25);
    struct field_figures *end = walk_scaled(&space, 1, false);
    struct field_figures *half = walk_scaled(&space, 0.5, false);
    struct field_figures *eased = walk_scaled(&space, 1, true);
    struct field_figures *little = walk_scaled(&space, 0.25, true);
    assert_int_equal(end->folded, 0);
    assert_int_equal(half->folded, half->looked);
    assert_int_equal(eased->folded, eased->looked);
    assert_true(eased->looked > 500 && little->looked > 500);
    assert_true(field_worst_fold(eased)->value <= field_worst_fold(half)->value + 1e-9);
    assert_int_equal(little->folded, 0);
    assert_null(field_worst_fold(little));
    free(end);
    free(half);
    free(eased);
    free(little);
    space_fini(&space);
}

// A wall is displaced by more than the field reaches, and nothing else is near.
static void a_field_that_fades_too_fast_folds_off_one_surface(void **state) {
    (void)state;
    for (int far = 0; far < 2; far++) {
        struct bodies bodies;
        bodies_walls(&bodies, 40, far ? 16 : 6);
        bodies_integrate(&bodies);
        struct warp_scene scene = scene_of(&bodies);
        struct field field = field_default(FIELD_INTEGRAL);
        struct space space = whole((struct box){{-3, -3, -18}, {3, 3, -10}}, 0.5);
        struct field_figures *f = walk(&scene, &field, &space);
        assert_true(f->looked > 1000);
        assert_int_equal(f->faded, f->folded);
        assert_int_equal(field_own_folds(f), 0);
        assert_true(far ? f->faded > f->looked / 2 : f->faded == 0);
        if (far)
            assert_true(f->fading.value < 0 && f->fading.nearest[0] == 0);
        space_fini(&space);
        bodies_fini(&bodies);
        free(f);
    }
}

// By central differences, with kinks between: nodes near them may count either way.
static uint64_t count_folds(const struct warp_scene *scene, const struct field *field,
                            const struct space *space, uint64_t *out_looked) {
    uint64_t folds = 0;
    double h = 1e-5;
    for (size_t n = 0; n < space_count(space); n++) {
        int i = (int)(n % (size_t)space->size[0]);
        int j = (int)(n / (size_t)space->size[0] % (size_t)space->size[1]);
        vec3 y = space_at(space, i, j, (int)(n / (size_t)space->size[0] / (size_t)space->size[1]));
        int near = 0;
        for (int k = 0; k < scene->surface_count; k++)
            near += world_contact(scene, k, y).distance < SECOND_GROUP_MM;
        vec3 columns[3], axes[3] = {{h, 0, 0}, {0, h, 0}, {0, 0, h}};
        for (int a = 0; a < 3; a++) {
            vec3 up = world_warp(scene, field, vec3_add(y, axes[a])).displacement;
            vec3 down = world_warp(scene, field, vec3_sub(y, axes[a])).displacement;
            columns[a] = vec3_scale(0.5 / h, vec3_add_scaled(vec3_sub(up, down), 2, axes[a]));
        }
        struct warp at = world_warp(scene, field, y);
        if (near >= 2 ||
            (vec3_length(at.displacement) <= MATTERS && mat3_norm(at.gradient) <= MATTERS))
            continue;
        *out_looked += 1;
        folds += vec3_dot(columns[0], vec3_cross(columns[1], columns[2])) <= 0;
    }
    return folds;
}

static void folds_agree_with_central_differences(void **state) {
    (void)state;
    struct bodies bodies;
    bodies_knee(&bodies, 8);
    for (int i = 0; i < bodies.count; i++) // far enough to fold
        for (size_t v = 0; v < 3 * (size_t)bodies.meshes[i].vertex_count; v++)
            bodies.displacements[i][v] *= 4;
    struct warp_scene scene = scene_of(&bodies);
    struct field field = field_default(FIELD_INVERSE_DISTANCE);
    struct space space = whole((struct box){{-30, -20, -8}, {30, 20, 8}}, 1.1);
    struct field_figures *f = walk(&scene, &field, &space);
    uint64_t looked = 0, folds = count_folds(&scene, &field, &space, &looked);
    assert_int_equal(f->looked, looked);
    assert_true(folds > 50);
    assert_near((double)f->folded, (double)folds, 0.02 * (double)folds);
    space_fini(&space);
    bodies_fini(&bodies);
    free(f);
}

static void nothing_is_displaced_beyond_the_reach_of_what_moved(void **state) {
    (void)state;
    struct random r = {3};
    struct bodies bodies;
    bodies_knee(&bodies, 6);
    for (int i = 0; i < bodies.count; i++)
        for (uint32_t v = 0; v < bodies.meshes[i].vertex_count; v++)
            if (mesh_vertex(&bodies.meshes[i], v).x > -15)
                for (int a = 0; a < 3; a++)
                    bodies.displacements[i][3 * v + (uint32_t)a] = 0;
    bodies_integrate(&bodies);
    struct warp_scene scene = scene_of(&bodies);
    for (int kind = FIELD_INVERSE_DISTANCE; kind < FIELD_COUNT; kind++) {
        struct field field = field_default((enum field_kind)kind);
        field.skin_mm = 0.1;
        struct moved moved;
        struct error err;
        assert_int_equal(moved_init(&scene, &field, &moved, &err), RESULT_OK);
        int beyond = 0;
        double most = kind == FIELD_INTEGRAL ? 0.05 : 0;
        for (int i = 0; i < 3000; i++) {
            vec3 y = random_in_box(&r, 50);
            struct closest closest;
            if (query_closest(moved.query, y, moved.reach_mm, MESH_NONE, &closest))
                continue;
            beyond++;
            assert_true(vec3_length(world_warp(&scene, &field, y).displacement) <= most);
        }
        assert_true(beyond > 300);
        moved_fini(&moved);
    }
    bodies_fini(&bodies);
}

// Two balls that are one surface, one of them displaced: half way between them the closest point
// jumps from one to the other. 2 mm of each: W = 2 ω/(ω + ω_0).
static void jumps_of_the_closest_point_are_told_and_measured(void **state) {
    (void)state;
    struct bodies bodies = {0};
    struct mesh balls, other;
    shape_sphere(&balls, 5, 10);
    shape_move(&balls, (pose){quat_identity(), {-7, 0, 0}});
    uint32_t first = balls.vertex_count;
    shape_sphere(&other, 5, 10);
    shape_move(&other, (pose){quat_identity(), {7, 0, 0}});
    shape_append(&balls, &other);
    mesh_fini(&other);
    float *displacement = alloc(3 * (size_t)balls.vertex_count, sizeof *displacement);
    for (uint32_t v = 0; v < first; v++)
        displacement[3 * v + 2] = 2;
    bodies_add(&bodies, &balls, displacement, 0);
    struct warp_scene scene = scene_of(&bodies);
    struct field field = field_default(FIELD_INVERSE_DISTANCE);
    struct space space = whole((struct box){{-1.7, -4, -4}, {1.7, 4, 4}}, 0.5);
    struct field_figures *f = walk(&scene, &field, &space);
    double weight = 1.0 / 2 - 1 / field.radius_mm;
    assert_true(f->jumped > 100);
    assert_near(f->jump.value, 2 * weight / (weight + field.background_per_mm), 0.02);
    assert_near(f->jump.place.x, 0, 0.5);
    assert_int_equal(f->jump.nearest[0], 0);
    free(f);
    bodies_smooth(&bodies);
    field.kind = FIELD_SMOOTH;
    scene = scene_of(&bodies);
    f = walk(&scene, &field, &space);
    assert_int_equal(f->jumped, 0);
    free(f);
    space_fini(&space);
    bodies_fini(&bodies);
}

static void a_touch_is_where_it_should_be(void **state) {
    (void)state;
    struct bodies bodies;
    bodies_knee(&bodies, 5);
    struct warp_scene scene = scene_of(&bodies);
    struct field field = field_default(FIELD_INVERSE_DISTANCE);
    struct touch_figures touch = {0};
    field_touch(&scene, &field, &touch);
    assert_true(touch.count > 300);
    assert_true(touch.largest_mm < 1e-6);
    struct touch_figures off = {0};
    field_touch(&scene,
                &(struct field){.kind = FIELD_INVERSE_DISTANCE,
                                .radius_mm = 12,
                                .background_per_mm = 0.05,
                                .strength = 0.5},
                &off);
    assert_int_equal(off.count, touch.count);
    assert_true(off.largest_mm < 1e-6);
    bodies_fini(&bodies);
}

// ---- facing -------------------------------------------------------------------------------------

static struct facing_figures compare(const struct bodies *bodies) {
    static struct facing_figures figures;
    struct warp_scene scene = scene_of(bodies);
    facing_compare(&scene, 0, &figures);
    return figures;
}

static struct facing_figures compare_walls(double gap, double rise, vec3 both, bool slide) {
    struct bodies bodies;
    bodies_walls(&bodies, gap, rise);
    struct warp_surface *upper = &bodies.surfaces[1];
    bodies.displacements[1] = alloc(3 * (size_t)upper->mesh->vertex_count, sizeof(float));
    upper->displacement = bodies.displacements[1];
    for (int i = 0; i < 2; i++)
        for (uint32_t v = 0; v < upper->mesh->vertex_count; v++) {
            float *d = bodies.displacements[i] + 3 * (size_t)v;
            d[0] += (float)both.x + (slide && i ? 0.2f : 0);
            d[1] += (float)both.y;
            d[2] += (float)both.z;
        }
    struct facing_figures f = compare(&bodies);
    bodies_fini(&bodies);
    return f;
}

static void facing_plates_are_compatible_where_the_gap_stays(void **state) {
    (void)state;
    const struct {
        double gap, rise;
        vec3 both;
        bool slide, filled, strained;
    } rows[] = {
        {0.5, 0.6, {0, 0, 0}, false, true, true},   // pushed through
        {0.5, 0.5, {0, 0, 0}, false, true, false},  // just filled
        {0.5, 0.4, {0, 0, 0}, false, false, false}, // what is left is enough
        {0.5, 0, {1, -2, 3}, false, false, false},  // equal
        {0.5, -0.7, {0, 0, 0}, false, false, true}, // apart
        {0, 0, {0, 0, 3}, false, false, false},     // touching, equal
        {0, 0.04, {0, 0, 0}, false, false, false},  // within the slack
        {0, 0.06, {0, 0, 0}, false, true, true},    // touching, not equal
        {0, 0, {0, 0, 0}, true, false, true},       // touching, sliding
        {0.5, 0, {0, 0, 0}, true, false, false},    // sliding at a distance
        {-0.3, 0, {0, 0, 1}, false, false, false},  // overlapping as scanned, equal
        {-0.3, 0.1, {0, 0, 0}, false, true, true},  // overlapping, and more so
        {1.2, 3, {0, 0, 0}, false, false, false},   // too far to face each other
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct facing_figures f =
            compare_walls(rows[i].gap, rows[i].rise, rows[i].both, rows[i].slide);
        bool faces = rows[i].gap <= FACING_GAP_MM;
        assert_int_equal(f.count, faces);
        if (!faces)
            continue;
        if ((f.pairs[0].filled > 0) != rows[i].filled ||
            (f.pairs[0].strained > 0) != rows[i].strained)
            fail_msg("row %zu: filled %d, strained %d", i, (int)f.pairs[0].filled,
                     (int)f.pairs[0].strained);
    }
}

static void concentric_shells_tell_where_and_by_how_much(void **state) {
    (void)state;
    for (int equal = 0; equal < 2; equal++) {
        struct bodies bodies = {0};
        for (int i = 0; i < 2; i++) {
            struct mesh ball;
            shape_sphere(&ball, i ? 10.4 : 10, 16);
            float *out = alloc(3 * (size_t)ball.vertex_count, sizeof *out);
            for (uint32_t v = 0; v < ball.vertex_count; v++)
                for (int a = 0; a < 3; a++)
                    out[3 * v + (uint32_t)a] =
                        i && !equal ? 0 : 0.08f * ball.positions[3 * v + (uint32_t)a];
            for (uint32_t t = 0; i && t < ball.triangle_count; t++) { // the outer one looks inwards
                uint32_t kept = ball.triangles[3 * t];
                ball.triangles[3 * t] = ball.triangles[3 * t + 1];
                ball.triangles[3 * t + 1] = kept;
            }
            bodies_add(&bodies, &ball, out, 0);
        }
        struct facing_figures f = compare(&bodies);
        assert_int_equal(f.count, 1);
        assert_int_equal(f.pairs[0].a, 0);
        assert_int_equal(f.pairs[0].b, 1);
        assert_true(f.pairs[0].count > 1000);
        if (equal) {
            assert_int_equal(f.pairs[0].filled + f.pairs[0].strained, 0);
        } else {
            assert_true(f.pairs[0].filled > 0.99 * (double)f.pairs[0].count);
            assert_near(f.pairs[0].filling.gap_mm, 0.4, 0.06);
            assert_near(f.pairs[0].filling.closed_mm, 0.8, 0.03);
            assert_near(vec3_length(f.pairs[0].filling.place), 10.2, 0.25);
        }
        bodies_fini(&bodies);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_bump_that_fills_its_gap_folds_for_the_cases_fault),
        cmocka_unit_test(folds_between_the_ends_of_an_easing_are_found),
        cmocka_unit_test(a_field_that_fades_too_fast_folds_off_one_surface),
        cmocka_unit_test(folds_agree_with_central_differences),
        cmocka_unit_test(nothing_is_displaced_beyond_the_reach_of_what_moved),
        cmocka_unit_test(jumps_of_the_closest_point_are_told_and_measured),
        cmocka_unit_test(a_touch_is_where_it_should_be),
        cmocka_unit_test(facing_plates_are_compatible_where_the_gap_stays),
        cmocka_unit_test(concentric_shells_tell_where_and_by_how_much),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
