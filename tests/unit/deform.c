#include "generate/deform.h"

#include "mesh/topology.h"
#include "random.h"
#include "test.h"

#include <string.h>

static struct error err;

#define SIDE_VERTICES 81

// A plate in z = height, 80 by 80 mm, facing up, with a vertex each millimetre.
static void plate(double height, struct mesh *out_mesh) {
    mesh_init(out_mesh, SIDE_VERTICES * SIDE_VERTICES,
              2 * (SIDE_VERTICES - 1) * (SIDE_VERTICES - 1));
    uint32_t *t = out_mesh->triangles;
    for (uint32_t i = 0; i < SIDE_VERTICES; i++) {
        for (uint32_t k = 0; k < SIDE_VERTICES; k++) {
            uint32_t v = i * SIDE_VERTICES + k;
            mesh_set_vertex(out_mesh, v, (vec3){(double)i - 40, (double)k - 40, height});
            if (i + 1 == SIDE_VERTICES || k + 1 == SIDE_VERTICES)
                continue;
            uint32_t corners[6] = {v, v + SIDE_VERTICES,     v + SIDE_VERTICES + 1,
                                   v, v + SIDE_VERTICES + 1, v + 1};
            memcpy(t, corners, sizeof corners);
            t += 6;
        }
    }
}

static struct knee_case *plates(void) {
    struct knee_case *knee = case_create("plates", "");
    struct case_group *tibia = case_add_group(knee, "tibia", BODY_TIBIA);
    struct mesh mesh;
    plate(0, &mesh);
    assert_int_equal(case_add_part(tibia, "cartilage", &mesh, &err), RESULT_OK);
    mesh_fini(&mesh);
    plate(-2, &mesh);
    assert_int_equal(case_add_part(tibia, "bone", &mesh, &err), RESULT_OK);
    mesh_fini(&mesh);
    return knee;
}

static vec3 warp_of(const struct case_group *group, uint32_t v) {
    const float *w = group->warp + 3 * (size_t)v;
    return (vec3){(double)w[0], (double)w[1], (double)w[2]};
}

static void a_cavity_is_exactly_as_deep_and_as_wide_as_asked(void **state) {
    (void)state;
    struct knee_case *knee = plates();
    struct case_group *tibia = &knee->groups[0];
    struct deform_cavity cavity = {{5.2, -7.1, 0.3}, 10, 3};
    assert_int_equal(deform_cavity_add(&tibia, 1, &cavity, &err), RESULT_OK);
    vec3 middle = {5, -7, 0};
    for (uint32_t v = 0; v < tibia->mesh.vertex_count; v++) {
        double d = vec3_distance(mesh_vertex(&tibia->mesh, v), middle), t = d / 10;
        double depth = d < 10 ? 3 * pow(1 - t * t, 3) : 0;
        assert_vec3_near(warp_of(tibia, v), ((vec3){0, 0, -depth}), 1e-6);
        if (d == 0)
            assert_true(warp_of(tibia, v).z == -3);
        if (d >= 10)
            assert_true(vec3_length(warp_of(tibia, v)) == 0);
    }
    case_destroy(&knee);
}

static void parts_that_lie_on_one_another_keep_their_order(void **state) {
    (void)state;
    struct knee_case *knee = plates();
    struct case_group *tibia = &knee->groups[0];
    struct deform_cavity cavity = {{0, 0, 0}, 10, 5}, beside = {{4, 0, 0}, 10, 5};
    assert_int_equal(deform_cavity_add(&tibia, 1, &cavity, &err), RESULT_OK);
    assert_int_equal(deform_cavity_add(&tibia, 1, &beside, &err), RESULT_OK);
    uint32_t below = tibia->parts[1].first_vertex;
    for (uint32_t v = 0; v < below; v++) {
        double gap = 2 + warp_of(tibia, v).z - warp_of(tibia, v + below).z;
        assert_true(gap > 0.2 && gap < 4);
    }
    case_destroy(&knee);
}

static void dents_that_overlap_go_deeper_from_where_the_first_left_off(void **state) {
    (void)state;
    struct knee_case *knee = plates();
    struct case_group *tibia = &knee->groups[0];
    struct deform_cavity cavity = {{0, 0, 0}, 10, 3};
    for (int i = 0; i < 3; i++)
        assert_int_equal(deform_cavity_add(&tibia, 1, &cavity, &err), RESULT_OK);
    assert_near(warp_of(tibia, 40 * SIDE_VERTICES + 40).z, -9, 1e-6);
    case_destroy(&knee);
}

static void further_groups_follow_the_same_map(void **state) {
    (void)state;
    struct knee_case *knee = plates();
    struct mesh mesh;
    plate(1, &mesh);
    struct case_group *above = case_add_group(knee, "meniscus_medial", BODY_TIBIA);
    assert_int_equal(case_add_part(above, "m", &mesh, &err), RESULT_OK);
    struct case_group *groups[] = {&knee->groups[0], above};
    struct deform_cavity cavity = {{0, 0, 0}, 10, 3};
    assert_int_equal(deform_cavity_add(groups, 2, &cavity, &err), RESULT_OK);
    assert_near(warp_of(above, 40 * SIDE_VERTICES + 40).z, -3 * pow(0.99, 3), 1e-6);
    mesh_fini(&mesh);
    case_destroy(&knee);
}

// Two triangles, 80 mm wide: a part of its own in the group.
static void add_long_triangles(struct case_group *group, const char *name, double height) {
    static const uint32_t corners[6] = {0, 1, 2, 0, 2, 3};
    struct mesh mesh;
    mesh_init(&mesh, 4, 2);
    for (uint32_t v = 0; v < 4; v++)
        mesh_set_vertex(&mesh, v, (vec3){v == 1 || v == 2 ? 40 : -40, v > 1 ? 40 : -40, height});
    memcpy(mesh.triangles, corners, sizeof corners);
    assert_int_equal(case_add_part(group, name, &mesh, &err), RESULT_OK);
    mesh_fini(&mesh);
}

// From part 2 on.
static double deepest_error(const struct case_group *group, vec3 middle) {
    struct random r = {1};
    uint32_t first = group->parts[2].first_triangle, count = group->mesh.triangle_count - first;
    double worst = 0;
    for (int i = 0; i < 20000; i++) {
        uint32_t t = first + (uint32_t)(random_bits(&r) % count);
        double u = random_between(&r, 0, 1), w = random_between(&r, 0, 1 - u), depth = 0;
        double weights[3] = {1 - u - w, u, w};
        vec3 p = {0};
        for (int k = 0; k < 3; k++) {
            uint32_t v = group->mesh.triangles[3 * (size_t)t + (size_t)k];
            p = vec3_add_scaled(p, weights[k], mesh_vertex(&group->mesh, v));
            depth -= weights[k] * warp_of(group, v).z;
        }
        double distance = vec3_distance(p, middle) / 10;
        double meant = distance < 1 ? 3 * pow(1 - distance * distance, 3) : 0;
        worst = fmax(worst, fabs(depth - meant));
    }
    return worst;
}

static void long_triangles_are_halved_until_the_cavity_shows_in_them(void **state) {
    (void)state;
    for (int refines = 0; refines < 2; refines++) {
        struct knee_case *knee = plates();
        struct case_group *tibia = &knee->groups[0];
        add_long_triangles(tibia, "long", 0.5);
        add_long_triangles(tibia, "longer", 1);
        float *covered = case_group_need_covered(tibia);
        covered[tibia->parts[3].first_vertex] = 1;
        struct deform_cavity cavity = {{0, 0, 0}, 10, 3, refines};
        assert_int_equal(deform_cavity_add(&tibia, 1, &cavity, &err), RESULT_OK);
        double worst = deepest_error(tibia, (vec3){0, 0, 0});
        assert_true(refines ? worst < 0.05 : worst > 2);
        case_destroy(&knee);
    }
}

static void halved_triangles_make_the_same_surface(void **state) {
    (void)state;
    struct knee_case *knee = plates();
    struct case_group *tibia = &knee->groups[0];
    add_long_triangles(tibia, "long", 0.5);
    add_long_triangles(tibia, "longer", 1);
    float *covered = case_group_need_covered(tibia);
    for (uint32_t v = 0; v < 3; v++)
        covered[tibia->parts[3].first_vertex + v] = 1;
    struct deform_cavity cavity = {{3, 1, 0}, 10, 3, true};
    double area = mesh_area(&tibia->mesh);
    assert_int_equal(deform_cavity_add(&tibia, 1, &cavity, &err), RESULT_OK);
    static const double heights[] = {0, -2, 0.5, 1};
    uint32_t vertex = 0, triangle = 0, hidden = 0;
    for (int i = 0; i < 4; i++) {
        const struct case_part *part = &tibia->parts[i];
        assert_int_equal(part->first_vertex, vertex);
        assert_int_equal(part->first_triangle, triangle);
        vertex += part->vertex_count;
        triangle += part->triangle_count;
        for (uint32_t v = part->first_vertex; v < vertex; v++) {
            assert_true(mesh_vertex(&tibia->mesh, v).z == heights[i]);
            assert_true(tibia->covered[v] == 0 || (i == 3 && tibia->covered[v] == 1));
            hidden += tibia->covered[v] > 0;
        }
        for (uint32_t k = 3 * part->first_triangle; k < 3 * triangle; k++)
            assert_in_range(tibia->mesh.triangles[k], part->first_vertex, vertex - 1);
    }
    assert_int_equal(vertex, tibia->mesh.vertex_count);
    assert_int_equal(triangle, tibia->mesh.triangle_count);
    assert_true(hidden > 30);
    assert_near(mesh_area(&tibia->mesh), area, 1e-3);
    struct topology t = topology_of(&tibia->mesh);
    assert_int_equal(t.components, 4);
    assert_int_equal(t.euler, 4); // four disks: nothing is torn
    assert_true(t.manifold && t.oriented && t.unused_vertices == 0);
    case_destroy(&knee);
}

static void a_cavity_that_would_fold_or_hits_nothing_is_refused_and_changes_nothing(void **state) {
    (void)state;
    static const struct {
        struct deform_cavity cavity;
        const char *says;
    } rows[] = {
        {{{0, 0, 0}, 10, 5.01}, "would fold"}, {{{0, 0, 0}, 10, 0}, "depth"},
        {{{0, 0, 0}, 10, -3}, "depth"},        {{{0, 0, 0}, 0, 1}, "radius"},
        {{{0, 0, 0}, 101, 1}, "radius"},       {{{0, 0, NAN}, 10, 3}, "not finite"},
        {{{0, 0, 6}, 10, 3}, "6.0 mm away"},   {{{0, 0, 0}, NAN, 3}, "radius"},
    };
    struct knee_case *knee = plates();
    struct case_group *tibia = &knee->groups[0];
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        assert_int_equal(deform_cavity_add(&tibia, 1, &rows[i].cavity, &err), RESULT_INVALID);
        if (!strstr(err.text, rows[i].says))
            fail_msg("\"%s\" does not say \"%s\"", err.text, rows[i].says);
        assert_null(tibia->warp);
    }
    case_destroy(&knee);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_cavity_is_exactly_as_deep_and_as_wide_as_asked),
        cmocka_unit_test(parts_that_lie_on_one_another_keep_their_order),
        cmocka_unit_test(dents_that_overlap_go_deeper_from_where_the_first_left_off),
        cmocka_unit_test(further_groups_follow_the_same_map),
        cmocka_unit_test(long_triangles_are_halved_until_the_cavity_shows_in_them),
        cmocka_unit_test(halved_triangles_make_the_same_surface),
        cmocka_unit_test(a_cavity_that_would_fold_or_hits_nothing_is_refused_and_changes_nothing),
    };
    return cmocka_run_group_tests_name("deform", tests, NULL, NULL);
}
