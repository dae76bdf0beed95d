#include "check/space.h"
#include "random.h"
#include "scene/bodies.h"
#include "test.h"
#include "winding.h"

#include <stdlib.h>
#include <string.h>

static const pose still[1] = {{{1, 0, 0, 0}, {0, 0, 0}}};

static struct space space_of(const struct bodies *bodies, const pose *T,
                             const struct space_surface *roles, double half, double spacing) {
    struct warp_scene scene = {bodies->surfaces, bodies->count, T, NULL};
    struct space_setup setup = {.scene = &scene,
                                .surfaces = roles,
                                .box = {{-half, -half, -half}, {half, half, half}},
                                .spacing_mm = spacing};
    struct space space;
    struct error err;
    assert_int_equal(space_init(&setup, &space, &err), RESULT_OK);
    return space;
}

static void turn_inside_out(struct mesh *mesh) {
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        uint32_t *v = mesh->triangles + 3 * (size_t)t, kept = v[1];
        v[1] = v[2];
        v[2] = kept;
    }
}

static enum space_place place_at(const struct space *space, vec3 p) {
    vec3 off = vec3_sub(p, space->origin);
    return space->places[space_node(space, (int)lround(off.x / space->spacing_mm),
                                    (int)lround(off.y / space->spacing_mm),
                                    (int)lround(off.z / space->spacing_mm))];
}

static void solids_skin_and_outside_agree_with_solid_angles(void **state) {
    (void)state;
    struct random r = {1};
    struct bodies bodies = {0};
    struct mesh mesh;
    shape_bumpy(&mesh, (vec3){8, 6, 7}, 1.5, 6, 4);
    bodies_add(&bodies, &mesh, NULL, 0);
    shape_bumpy(&mesh, (vec3){14, 15, 13}, 2, 8, 5);
    bodies_add(&bodies, &mesh, NULL, 1);
    pose T[2] = {random_pose(&r, 3), random_pose(&r, 3)};
    struct space_surface roles[2] = {{SPACE_SOLID, false}, {SPACE_SKIN, false}};
    struct space space = space_of(&bodies, T, roles, 20, 0.83);
    int seen[PLACE_COUNT] = {0};
    for (int n = 0; n < 2000; n++) {
        int i = (int)(random_bits(&r) % (uint64_t)space.size[0]);
        int j = (int)(random_bits(&r) % (uint64_t)space.size[1]);
        int k = (int)(random_bits(&r) % (uint64_t)space.size[2]);
        vec3 p = space_at(&space, i, j, k);
        bool in_solid = is_inside(&bodies.meshes[0], pose_apply_inverse(T[0], p));
        bool in_skin = is_inside(&bodies.meshes[1], pose_apply_inverse(T[1], p));
        int place = space.places[space_node(&space, i, j, k)];
        assert_int_equal(place, in_solid ? PLACE_SOLID : in_skin ? PLACE_FREE : PLACE_OUTSIDE);
        seen[place]++;
    }
    assert_true(seen[PLACE_SOLID] > 10 && seen[PLACE_FREE] > 50 && seen[PLACE_OUTSIDE] > 50);
    space_fini(&space);
    bodies_fini(&bodies);
}

static void a_solid_of_many_shells_is_solid(void **state) {
    (void)state;
    static const double growth_mm[] = {0, 0.04}; // all in one place; each around the one before
    struct space_surface roles[1] = {{SPACE_SOLID, false}};
    for (int n = 0; n < 2; n++) {
        struct bodies bodies = {0};
        struct mesh shells, shell;
        shape_sphere(&shells, 4, 4);
        for (int i = 1; i < 200; i++) {
            shape_sphere(&shell, 4 + growth_mm[n] * i, 4);
            shape_append(&shells, &shell);
            mesh_fini(&shell);
        }
        bodies_add(&bodies, &shells, NULL, 0);
        struct space space = space_of(&bodies, still, roles, 15, 0.7);
        assert_int_equal(place_at(&space, (vec3){0, 0, 0}), PLACE_SOLID);
        assert_int_equal(place_at(&space, (vec3){14, 0, 0}), PLACE_FREE);
        space_fini(&space);
        bodies_fini(&bodies);
    }
}

// Without the cap above z = 6 of a radius of 10.
static void an_open_surface_has_its_inside_nearly_everywhere(void **state) {
    (void)state;
    struct bodies bodies = {0};
    struct mesh mesh;
    shape_sphere(&mesh, 10, 12);
    uint32_t kept = 0;
    for (uint32_t t = 0; t < mesh.triangle_count; t++) {
        if (mesh_corner(&mesh, t, 0).z > 6)
            continue;
        for (int i = 0; i < 3; i++)
            mesh.triangles[3 * kept + (uint32_t)i] = mesh.triangles[3 * t + (uint32_t)i];
        kept++;
    }
    mesh.triangle_count = kept;
    bodies_add(&bodies, &mesh, NULL, 0);
    struct space_surface roles[1] = {{SPACE_SOLID, true}};
    struct space space = space_of(&bodies, still, roles, 15, 0.7);
    for (int k = 0; k < space.size[2]; k++)
        for (int j = 0; j < space.size[1]; j++)
            for (int i = 0; i < space.size[0]; i++) {
                vec3 p = space_at(&space, i, j, k);
                bool is_solid = space.places[space_node(&space, i, j, k)] == PLACE_SOLID;
                if (vec3_length(p) < 9.5 && p.z < 4)
                    assert_true(is_solid);
                if (vec3_length(p) > 10 && (p.z < 3 || hypot(p.x, p.y) > 10))
                    assert_false(is_solid);
            }
    space_fini(&space);
    bodies_fini(&bodies);
}

static void space_enclosed_by_solids_is_a_pocket(void **state) {
    (void)state;
    struct bodies bodies = {0};
    struct mesh shell, hollow;
    shape_sphere(&shell, 10, 8);
    shape_sphere(&hollow, 6, 8);
    turn_inside_out(&hollow);
    shape_append(&shell, &hollow);
    mesh_fini(&hollow);
    bodies_add(&bodies, &shell, NULL, 0);
    struct space_surface roles[1] = {{SPACE_SOLID, false}};
    struct space space = space_of(&bodies, still, roles, 12, 0.6);
    vec3 inside = {0.5, -1, 0.7}, between = {8, 0, 0}, outside = {11, 0, 0};
    assert_int_equal(place_at(&space, inside), PLACE_FREE);
    space_find_pockets(&space);
    assert_int_equal(place_at(&space, inside), PLACE_POCKET);
    assert_int_equal(place_at(&space, between), PLACE_SOLID);
    assert_int_equal(place_at(&space, outside), PLACE_FREE);
    space_fini(&space);
    bodies_fini(&bodies);
}

static void planes_end_the_space_and_too_many_nodes_are_refused(void **state) {
    (void)state;
    struct warp_scene scene = {NULL, 0, still, NULL};
    struct plane plane = {{1, 0, 0}, 2};
    struct space_setup setup = {.scene = &scene,
                                .planes = &plane,
                                .plane_count = 1,
                                .box = {{-5, -5, -5}, {5, 5, 5}},
                                .spacing_mm = 0.5};
    struct space space;
    struct error err;
    assert_int_equal(space_init(&setup, &space, &err), RESULT_OK);
    assert_int_equal(place_at(&space, (vec3){1.5, 0, 0}), PLACE_FREE);
    assert_int_equal(place_at(&space, (vec3){2.5, 0, 0}), PLACE_OUTSIDE);
    space_fini(&space);
    setup.spacing_mm = 0.001;
    assert_int_equal(space_init(&setup, &space, &err), RESULT_LIMIT);
    assert_non_null(strstr(err.text, "nodes"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(solids_skin_and_outside_agree_with_solid_angles),
        cmocka_unit_test(a_solid_of_many_shells_is_solid),
        cmocka_unit_test(an_open_surface_has_its_inside_nearly_everywhere),
        cmocka_unit_test(space_enclosed_by_solids_is_a_pocket),
        cmocka_unit_test(planes_end_the_space_and_too_many_nodes_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
