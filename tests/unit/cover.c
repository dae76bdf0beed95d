#include "import/cover.h"

#include "folder.h"
#include "random.h"
#include "scene/brute.h"
#include "scene/shapes.h"
#include "test.h"
#include "winding.h"

#include <string.h>

static struct error err;

#define TRIALS 200
#define BONE_MM 10.0
#define THICK_MM 2.0

// A tibia of these parts, which it frees, and a femur.
static struct knee_case *knee_of(struct mesh *parts, int count) {
    static const char *const names[] = {"bone", "cartilage", "third"};
    struct knee_case *knee = case_create("parts", "");
    struct case_group *tibia = case_add_group(knee, "tibia", BODY_TIBIA);
    struct case_group *femur = case_add_group(knee, "femur", BODY_FEMUR);
    assert_ok(case_add_part(femur, "femur", &parts[0], &err));
    for (int i = 0; i < count; i++) {
        assert_ok(case_add_part(tibia, names[i], &parts[i], &err));
        mesh_fini(&parts[i]);
    }
    return knee;
}

static void sphere_at(struct mesh *out, double radius, vec3 centre) {
    shape_sphere(out, radius, 12);
    shape_move(out, (pose){quat_identity(), centre});
}

// Cartilage on the upper side of a sphere of BONE_MM, which leaves a gap: a lens that is bent.
static void cartilage(struct mesh *out, double gap) {
    shape_sphere(out, 1, 16);
    for (uint32_t v = 0; v < out->vertex_count; v++) {
        vec3 u = mesh_vertex(out, v), aside = vec3_unit_or((vec3){u.x, u.y, 0}, (vec3){0});
        double angle = acos(fabs(fmax(fmin(u.z, 1), -1))) * 2 / 3, up = fmax(u.z, 0);
        double radius = BONE_MM + gap + THICK_MM * sqrt(up);
        vec3 direction = vec3_add_scaled((vec3){0, 0, cos(angle)}, sin(angle), aside);
        mesh_set_vertex(out, v, vec3_scale(radius, direction));
    }
}

static struct knee_case *joint_of(double gap) {
    struct mesh parts[2];
    shape_sphere(&parts[0], BONE_MM, 16);
    cartilage(&parts[1], gap);
    return knee_of(parts, 2);
}

static struct case_group *covered_tibia(struct knee_case *knee, struct mesh *out_outer) {
    struct case_group *tibia = case_group(knee, "tibia");
    assert_ok(cover_parts(tibia, &err));
    case_group_surface(tibia, out_outer);
    return tibia;
}

// Outside of all parts.
static bool is_free(const struct case_group *group, vec3 p) {
    for (int i = 0; i < group->part_count; i++) {
        const struct case_part *part = &group->parts[i];
        struct mesh mesh = group->mesh;
        mesh.triangles += 3 * (size_t)part->first_triangle;
        mesh.triangle_count = part->triangle_count;
        if (is_inside(&mesh, p))
            return false;
    }
    return true;
}

// Of places that are not in the void below the cartilage, half of the gap wide.
static void assert_distances(const struct case_group *group, const struct mesh *outer,
                             double half_gap) {
    struct random r = {7};
    int looked = 0;
    while (looked < TRIALS) {
        vec3 p = random_in_box(&r, 17);
        double whole = brute_distance(&group->mesh, p);
        if (whole < half_gap || !is_free(group, p))
            continue;
        assert_near(brute_distance(outer, p), whole, 1e-9);
        looked++;
    }
}

static void the_outer_surface_of_bodies_that_cross_is_as_far_as_their_union(void **state) {
    (void)state;
    struct mesh parts[3], outer;
    sphere_at(&parts[0], 10, (vec3){0, 0, 0});
    sphere_at(&parts[1], 7, (vec3){9, 1, 0});
    sphere_at(&parts[2], 3, (vec3){1, 0, 2}); // inside
    struct knee_case *knee = knee_of(parts, 3);
    struct case_group *tibia = covered_tibia(knee, &outer);
    assert_distances(tibia, &outer, 0);
    assert_true(outer.triangle_count < tibia->mesh.triangle_count * 7 / 10);
    for (uint32_t t = tibia->parts[2].first_triangle; t < tibia->mesh.triangle_count; t++)
        assert_true(tibia->covered[tibia->mesh.triangles[3 * t]] == 1);
    mesh_fini(&outer);
    case_destroy(&knee);
}

static void no_wall_of_the_void_below_cartilage_is_left(void **state) {
    (void)state;
    static const double gaps[] = {-0.3, 0, 0.15, 0.4};
    for (int i = 0; i < 4; i++) {
        struct knee_case *knee = joint_of(gaps[i]);
        struct mesh outer;
        struct case_group *tibia = covered_tibia(knee, &outer);
        assert_distances(tibia, &outer, fmax(gaps[i], 0) / 2 + 0.05);
        vec3 under = {0, 0, BONE_MM + gaps[i] / 2};
        assert_true(brute_distance(&tibia->mesh, under) < 0.3);
        assert_true(brute_distance(&outer, under) > THICK_MM - 0.3);
        mesh_fini(&outer);
        case_destroy(&knee);
    }
}

static void parts_that_leave_room_for_an_instrument_cover_nothing(void **state) {
    (void)state;
    struct knee_case *knee = joint_of(COVER_GAP_MM + 0.2);
    struct mesh outer;
    struct case_group *tibia = covered_tibia(knee, &outer);
    assert_null(tibia->covered);
    assert_int_equal(outer.triangle_count, tibia->mesh.triangle_count);
    mesh_fini(&outer);
    case_destroy(&knee);
}

static void of_two_parts_in_one_place_the_first_stays(void **state) {
    (void)state;
    struct mesh parts[2], outer;
    shape_sphere(&parts[0], BONE_MM, 8);
    shape_sphere(&parts[1], BONE_MM, 8);
    struct knee_case *knee = knee_of(parts, 2);
    struct case_group *tibia = covered_tibia(knee, &outer);
    assert_int_equal(outer.triangle_count, tibia->parts[0].triangle_count);
    for (uint32_t v = 0; v < tibia->parts[0].vertex_count; v++)
        assert_true(tibia->covered[v] == 0);
    mesh_fini(&outer);
    case_destroy(&knee);
}

// The surface of cartilage alone: an open sheet a little above the bone.
static void an_open_sheet_covers_the_bone_below_it_and_not_beside_it(void **state) {
    (void)state;
    struct mesh parts[2], outer;
    shape_sphere(&parts[0], BONE_MM, 16);
    shape_grid(&parts[1], 5, 10);
    shape_move(&parts[1], (pose){quat_identity(), {0, 0, BONE_MM + 1}});
    struct knee_case *knee = knee_of(parts, 2);
    struct case_group *tibia = covered_tibia(knee, &outer);
    assert_true(brute_distance(&outer, (vec3){0, 0, BONE_MM}) > 0.9);
    assert_true(brute_distance(&outer, (vec3){BONE_MM, 0, 0}) < 0.2);
    assert_true(brute_distance(&outer, (vec3){0, 0, -BONE_MM}) < 0.2);
    assert_non_null(tibia->covered);
    mesh_fini(&outer);
    case_destroy(&knee);
}

static void a_case_keeps_what_is_covered(void **state) {
    (void)state;
    char folder[FOLDER_MAX];
    folder_make(folder);
    struct knee_case *knee = joint_of(0.1), *read;
    struct mesh outer, again;
    struct case_group *tibia = covered_tibia(knee, &outer);
    assert_ok(case_save(knee, folder, &err));
    assert_ok(case_load(folder, NULL, &read, &err));
    assert_memory_equal(case_group(read, "tibia")->covered, tibia->covered,
                        tibia->mesh.vertex_count * sizeof(float));
    assert_null(case_group(read, "femur")->covered);
    case_group_surface(case_group(read, "tibia"), &again);
    assert_int_equal(again.triangle_count, outer.triangle_count);
    assert_memory_equal(again.triangles, outer.triangles, 12 * (size_t)outer.triangle_count);
    mesh_fini(&outer);
    mesh_fini(&again);
    case_destroy(&knee);
    case_destroy(&read);
    folder_remove(folder);
}

static void a_group_that_is_covered_wrongly_is_refused(void **state) {
    (void)state;
    struct knee_case *knee = joint_of(0.1);
    struct case_group *tibia = case_group(knee, "tibia");
    float *covered = case_group_need_covered(tibia);
    covered[3] = 0.5f;
    assert_int_equal(case_validate(knee, &err), RESULT_INVALID);
    assert_non_null(strstr(err.text, "covered of vertex 3"));
    for (uint32_t v = 0; v < tibia->mesh.vertex_count; v++)
        covered[v] = 1;
    assert_int_equal(case_validate(knee, &err), RESULT_INVALID);
    assert_non_null(strstr(err.text, "all of it is covered"));
    case_destroy(&knee);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_outer_surface_of_bodies_that_cross_is_as_far_as_their_union),
        cmocka_unit_test(no_wall_of_the_void_below_cartilage_is_left),
        cmocka_unit_test(parts_that_leave_room_for_an_instrument_cover_nothing),
        cmocka_unit_test(of_two_parts_in_one_place_the_first_stays),
        cmocka_unit_test(an_open_sheet_covers_the_bone_below_it_and_not_beside_it),
        cmocka_unit_test(a_case_keeps_what_is_covered),
        cmocka_unit_test(a_group_that_is_covered_wrongly_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
