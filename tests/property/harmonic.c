#include "bench/harmonic.h"

#include "scene/bodies.h"
#include "test.h"

#include <stdlib.h>

static const pose here[1] = {{{1, 0, 0, 0}, {0, 0, 0}}};

static struct warp_scene scene_of(const struct bodies *bodies) {
    return (struct warp_scene){bodies->surfaces, bodies->count, here, NULL};
}

// Constant.
static float *shifted(const struct mesh *mesh, vec3 by) {
    float *d = malloc(3 * sizeof(float) * mesh->vertex_count);
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        d[3 * v] = (float)by.x;
        d[3 * v + 1] = (float)by.y;
        d[3 * v + 2] = (float)by.z;
    }
    return d;
}

static struct box cube(double half) {
    return (struct box){{-half, -half, -half}, {half, half, half}};
}

// ---- between two spheres ----

#define INNER 10.0
#define OUTER 20.0

static const vec3 shift = {2, 1, -2}; // 3 mm

struct error_of {
    double rms, largest;
};

static void spheres(struct bodies *out) {
    struct mesh inner, outer;
    *out = (struct bodies){0};
    shape_sphere(&inner, INNER, 96);
    shape_sphere(&outer, OUTER, 96);
    float *displacement = shifted(&inner, shift);
    bodies_add(out, &inner, displacement, 0);
    bodies_add(out, &outer, NULL, 0);
}

// W = Δ (1/r − 1/b)/(1/a − 1/b)
static struct error_of error_between_spheres(double spacing_mm) {
    struct bodies bodies;
    struct harmonic h;
    struct error_of error = {0};
    spheres(&bodies);
    struct warp_scene scene = scene_of(&bodies);
    struct harmonic_setup setup = {
        .scene = &scene, .hollow = 1 << 1, .box = cube(25), .spacing_mm = spacing_mm};
    harmonic_solve(&setup, &h);
    assert_true(h.count > 1000);
    for (uint32_t i = 0; i < h.count; i++) {
        double r = vec3_length(harmonic_place(&h, i));
        double share = (1 / r - 1 / OUTER) / (1 / INNER - 1 / OUTER);
        assert_true(r > INNER - 0.01 && r < OUTER + 0.01);
        double off = vec3_distance(h.values[i], vec3_scale(share, shift));
        error.rms += off * off / h.count;
        error.largest = fmax(error.largest, off);
    }
    error.rms = sqrt(error.rms);
    harmonic_fini(&h);
    bodies_fini(&bodies);
    return error;
}

static void between_two_spheres_it_is_the_closed_solution_to_second_order(void **state) {
    (void)state;
    struct error_of coarse = error_between_spheres(2), fine = error_between_spheres(1);
    print_message("2 mm: rms %g, largest %g; 1 mm: rms %g, largest %g\n", coarse.rms,
                  coarse.largest, fine.rms, fine.largest);
    assert_true(fine.largest < 0.03 && fine.rms < 0.01);
    assert_true(coarse.rms / fine.rms > 3 && coarse.rms / fine.rms < 6);
}

// In a box on a finer grid that cuts both spheres, from place to place: what is around is told by a
// coarse solution. Largest error up to 2 mm from the middle.
static double error_around(const struct harmonic_setup *whole, const struct harmonic *around,
                           vec3 middle) {
    const vec3 half = {6, 6, 6};
    struct harmonic_setup setup = *whole;
    struct harmonic h;
    double largest = 0;
    setup.box = (struct box){vec3_sub(middle, half), vec3_add(middle, half)};
    setup.spacing_mm = 0.5;
    setup.around = around;
    harmonic_solve(&setup, &h);
    assert_int_not_equal(harmonic_find(&h, middle), HARMONIC_NONE);
    for (uint32_t i = 0; i < h.count; i++) {
        vec3 p = harmonic_place(&h, i);
        double share = (1 / vec3_length(p) - 1 / OUTER) / (1 / INNER - 1 / OUTER);
        if (vec3_distance(p, middle) <= 2)
            largest = fmax(largest, vec3_distance(h.values[i], vec3_scale(share, shift)));
    }
    harmonic_fini(&h);
    return largest;
}

static void a_box_within_a_coarse_solution_has_the_closed_one(void **state) {
    (void)state;
    struct bodies bodies;
    struct harmonic coarse;
    spheres(&bodies);
    struct warp_scene scene = scene_of(&bodies);
    struct harmonic_setup setup = {
        .scene = &scene, .hollow = 1 << 1, .box = cube(25), .spacing_mm = 1};
    harmonic_solve(&setup, &coarse);
    for (int i = 0; i < 3; i++) {
        const vec3 middles[] = {{15, 0, 0}, {-7, 8, 6}, {1, -13, -13}};
        double within = error_around(&setup, &coarse, middles[i]);
        double alone = error_around(&setup, NULL, middles[i]);
        print_message("place %d: off by %g, and by %g with 0 around\n", i, within, alone);
        assert_true(within < 0.01);
        assert_true(alone > 10 * within);
    }
    harmonic_fini(&coarse);
    bodies_fini(&bodies);
}

// ---- linear between walls ----

static vec3 linear(vec3 p) {
    return (vec3){0.1 * p.x - 0.05 * p.y + 0.3, 0.2 * p.z - 0.1, 0.07 * p.y + 0.15 * p.x};
}

static float *displaced(const struct mesh *mesh) {
    float *d = malloc(3 * sizeof(float) * mesh->vertex_count);
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        vec3 u = linear(mesh_vertex(mesh, v));
        d[3 * v] = (float)u.x;
        d[3 * v + 1] = (float)u.y;
        d[3 * v + 2] = (float)u.z;
    }
    return d;
}

// The walls of a room and of what stands in it, turned, on the grid's lines or not.
static void a_linear_displacement_of_all_walls_goes_on_between_them(void **state) {
    (void)state;
    struct bodies bodies = {0};
    struct mesh room, bone;
    shape_box(&room, (vec3){9, 8, 7});
    shape_bumpy(&bone, (vec3){4, 3, 3}, 0.5, 12, 3);
    shape_move(&room, (pose){quat_from_axis_angle((vec3){0.6, 0, 0.8}, 0.3), {0.1371, 0, 0}});
    float *of_room = displaced(&room), *of_bone = displaced(&bone);
    bodies_add(&bodies, &room, of_room, 0);
    bodies_add(&bodies, &bone, of_bone, 0);
    struct warp_scene scene = scene_of(&bodies);
    struct harmonic_setup setup = {
        .scene = &scene, .hollow = 1 << 0, .box = cube(15), .spacing_mm = 0.8};
    struct harmonic h;
    harmonic_solve(&setup, &h);
    assert_true(h.count > 1000);
    for (uint32_t i = 0; i < h.count; i++)
        assert_vec3_near(h.values[i], linear(harmonic_place(&h, i)), 1e-5);
    mat3 gradient;
    for (uint32_t i = 0; i < h.count; i++)
        if (harmonic_gradient(&h, i, &gradient)) {
            vec3 d = mat3_apply(gradient, (vec3){1, 2, 3});
            assert_vec3_near(d, vec3_sub(linear((vec3){1, 2, 3}), linear((vec3){0})), 1e-4);
        }
    harmonic_fini(&h);
    bodies_fini(&bodies);
}

// Of a body that is moved by its pose, displaced by its correction alone.
static void a_corrected_body_is_a_displaced_one(void **state) {
    (void)state;
    struct bodies bodies = {0};
    struct mesh room;
    shape_box(&room, (vec3){6, 5, 4});
    bodies_add(&bodies, &room, NULL, 0);
    const pose B = {quat_from_axis_angle((vec3){0, 0.6, 0.8}, 0.4), {1, 2, 3}};
    const pose M = {quat_from_axis_angle((vec3){0.8, 0.6, 0}, 0.1), {0.5, -1, 0.2}};
    struct warp_scene scene = {bodies.surfaces, 1, &B, &M};
    struct harmonic_setup setup = {
        .scene = &scene, .hollow = 1, .box = cube(15), .spacing_mm = 0.9};
    struct harmonic h;
    harmonic_solve(&setup, &h);
    assert_true(h.count > 300);
    for (uint32_t i = 0; i < h.count; i++) {
        vec3 p = harmonic_place(&h, i);
        assert_vec3_near(h.values[i], vec3_sub(pose_apply(M, p), p), 1e-6);
    }
    harmonic_fini(&h);
    bodies_fini(&bodies);
}

// ---- the space ----

static bool above(const void *context, vec3 p) {
    (void)context;
    return p.z > -6;
}

static void the_space_ends_at_surfaces_and_where_it_is_told_to(void **state) {
    (void)state;
    struct bodies bodies = {0};
    struct mesh ball;
    shape_sphere(&ball, 5, 24);
    float *displacement = shifted(&ball, (vec3){1, 0, 0});
    bodies_add(&bodies, &ball, displacement, 0);
    struct warp_scene scene = scene_of(&bodies);
    struct harmonic_setup setup = {
        .scene = &scene, .box = cube(8), .spacing_mm = 1, .is_within = above};
    struct harmonic h, half;
    harmonic_solve(&setup, &h);
    for (uint32_t i = 0; i < h.count; i++) {
        vec3 p = harmonic_place(&h, i);
        assert_true(vec3_length(p) > 4.9 && p.z > -6);
        assert_true(vec3_length(h.values[i]) < 1);
    }
    setup.spacing_mm = 0.5;
    harmonic_solve(&setup, &half);
    for (uint32_t i = 0; i < h.count; i++) {
        vec3 p = harmonic_place(&h, i);
        if (fmax(fabs(p.x), fmax(fabs(p.y), fabs(p.z))) < 8)
            assert_int_not_equal(harmonic_find(&half, p), HARMONIC_NONE);
    }
    assert_int_equal(harmonic_find(&half, (vec3){0.1371, 0.1371, 0.1371}), HARMONIC_NONE);
    harmonic_fini(&half);
    harmonic_fini(&h);
    bodies_fini(&bodies);
}

// A sheet has two sides: what is displaced below is not seen through it.
static void an_open_sheet_parts_what_is_on_its_two_sides(void **state) {
    (void)state;
    struct bodies bodies = {0};
    struct mesh room, sheet;
    shape_box(&room, (vec3){6, 6, 6});
    shape_grid(&sheet, 7, 9);
    float *displacement = shifted(&room, (vec3){0, 0, 1});
    for (uint32_t v = 0; v < room.vertex_count; v++)
        displacement[3 * v + 2] = room.positions[3 * v + 2] < 0 ? 1 : 0;
    bodies_add(&bodies, &room, displacement, 0);
    bodies_add(&bodies, &sheet, NULL, 0);
    struct warp_scene scene = scene_of(&bodies);
    struct harmonic_setup setup = {.scene = &scene, .hollow = 1, .box = cube(8), .spacing_mm = 0.7};
    struct harmonic h;
    harmonic_solve(&setup, &h);
    double above_most = 0, below_most = 0;
    for (uint32_t i = 0; i < h.count; i++) {
        vec3 p = harmonic_place(&h, i);
        bool is_above = p.z > 0;
        // The room's upper corners do not move, its lower ones do: its sides in between.
        double middle = fmax(fabs(p.x), fabs(p.y)) < 3 ? vec3_length(h.values[i]) : 0;
        above_most = is_above ? fmax(above_most, middle) : above_most;
        below_most = is_above ? below_most : fmax(below_most, middle);
    }
    assert_true(above_most > 0.01 && above_most < 0.25);
    assert_true(below_most > 0.8);
    harmonic_fini(&h);
    bodies_fini(&bodies);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(between_two_spheres_it_is_the_closed_solution_to_second_order),
        cmocka_unit_test(a_box_within_a_coarse_solution_has_the_closed_one),
        cmocka_unit_test(a_linear_displacement_of_all_walls_goes_on_between_them),
        cmocka_unit_test(a_corrected_body_is_a_displaced_one),
        cmocka_unit_test(the_space_ends_at_surfaces_and_where_it_is_told_to),
        cmocka_unit_test(an_open_sheet_parts_what_is_on_its_two_sides),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
