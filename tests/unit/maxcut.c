#include "generate/maxcut.h"

#include "case/arc.h"
#include "generated.h"
#include "mesh/columns.h"
#include "test.h"
#include "unit/case_knee.h"
#include "winding.h"

#include <stdlib.h>
#include <string.h>

static struct knee_case *knee;

static int make_knee(void **state) {
    (void)state;
    knee = plain_knee(SIDE_RIGHT, 2, 3.5);
    return 0;
}

static int destroy_knee(void **state) {
    (void)state;
    case_destroy(&knee);
    return 0;
}

static vec3 move_of(const struct case_group *group, uint32_t v) {
    const float *d = group->maxcut + 3 * (size_t)v;
    return (vec3){(double)d[0], (double)d[1], (double)d[2]};
}

static void displace(const struct case_group *group, struct mesh *out_mesh) {
    mesh_copy(out_mesh, &group->mesh);
    for (size_t i = 0; i < 3 * (size_t)group->mesh.vertex_count; i++)
        out_mesh->positions[i] += group->maxcut[i];
}

static struct maxcut_report inspect(const struct case_group *group) {
    struct maxcut_report report;
    struct error err;
    if (maxcut_inspect(group, &report, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return report;
}

static const char *const menisci[] = {"meniscus_medial", "meniscus_lateral"};

// The outline's ellipse, which the generator is written with.
static const vec3 middles[] = {{-21, -1, 0}, {21, -1, 0}};

// ---- S'_max -------------------------------------------------------------------------------------

static void what_is_left_lies_inside_by_the_solid_angle(void **state) {
    (void)state;
    for (int i = 0; i < 2; i++) {
        struct case_group *group = case_group(knee, menisci[i]);
        struct mesh least;
        displace(group, &least);
        int looked = 0;
        for (uint32_t t = 0; t < least.triangle_count; t += 5) {
            const uint32_t *c = least.triangles + 3 * (size_t)t;
            if (vec3_length(move_of(group, c[0])) < 0.6 || vec3_length(move_of(group, c[1])) < 0.6)
                continue;
            vec3 middle = vec3_scale(
                1.0 / 3, vec3_add(mesh_vertex(&least, c[0]),
                                  vec3_add(mesh_vertex(&least, c[1]), mesh_vertex(&least, c[2]))));
            assert_true(is_inside(&group->mesh, middle));
            looked++;
        }
        assert_true(looked > 100);
        mesh_fini(&least);
    }
}

static void nothing_sticks_out_and_nothing_folds(void **state) {
    (void)state;
    for (int i = 0; i < 2; i++) {
        const struct case_group *group = case_group(knee, menisci[i]);
        struct maxcut_report report = inspect(group);
        assert_int_equal(report.samples, MAXCUT_SAMPLES * group->mesh.triangle_count);
        assert_int_equal(report.out_count, 0);
        assert_int_equal(report.folds.crossed, 0);
        assert_int_equal(report.folds.creased, 0);
        assert_near(report.whole_mm3, 2400, 5);
        assert_true(report.least_mm3 > 1500 && report.least_mm3 < 1900);
    }
}

// From the nearest to the farthest point of the mesh's edges on a ray from the middle in plan.
static double width_of(const struct mesh *mesh, vec3 middle, double angle) {
    double nearest = INFINITY, farthest = 0, c = cos(angle), s = sin(angle);
    for (size_t i = 0; i < 3 * (size_t)mesh->triangle_count; i++) {
        size_t next = i % 3 == 2 ? i - 2 : i + 1;
        vec3 a = vec3_sub(mesh_vertex(mesh, mesh->triangles[i]), middle);
        vec3 b = vec3_sub(mesh_vertex(mesh, mesh->triangles[next]), middle);
        double off_a = c * a.y - s * a.x, off_b = c * b.y - s * b.x;
        if (off_a * off_b >= 0)
            continue;
        vec3 p = vec3_lerp(a, b, off_a / (off_a - off_b));
        double way = c * p.x + s * p.y;
        if (way > 0) {
            nearest = fmin(nearest, way);
            farthest = fmax(farthest, way);
        }
    }
    return farthest - nearest;
}

static void a_rim_of_the_width_asked_for_is_left_in_the_body(void **state) {
    (void)state;
    for (int i = 0; i < 2; i++) {
        struct case_group *group = case_group(knee, menisci[i]);
        struct mesh least;
        displace(group, &least);
        for (double off = -0.8; off <= 0.8; off += 0.2) {
            double angle = (i == 0 ? 3.14159265358979323846 : 0) + off;
            assert_true(width_of(&group->mesh, middles[i], angle) > 8.5);
            assert_near(width_of(&least, middles[i], angle), 3.5, 0.25);
        }
        mesh_fini(&least);
    }
}

static void roots_and_capsule_stay_where_they_are(void **state) {
    (void)state;
    struct case_group *group = case_group(knee, "meniscus_medial");
    int roots = 0, capsule = 0;
    for (uint32_t v = 0; v < group->mesh.vertex_count; v++) {
        vec3 p = mesh_vertex(&group->mesh, v), d = vec3_sub(p, middles[0]);
        bool root = d.x > 9;
        bool outer = hypot(d.x / (16 - 1.4), d.y / (20.5 - 1.4)) > 1;
        roots += root;
        capsule += outer;
        if (root || outer)
            assert_true(vec3_length(move_of(group, v)) == 0);
    }
    assert_true(roots > 30 && capsule > 500);
}

static void a_left_knee_keeps_the_mirrored_rim(void **state) {
    (void)state;
    struct knee_case *left = plain_knee(SIDE_LEFT, 2, 3.5);
    for (int i = 0; i < 2; i++) {
        const struct case_group *a = case_group(left, menisci[i]);
        const struct case_group *b = case_group(knee, menisci[i]);
        for (uint32_t v = 0; v < a->mesh.vertex_count; v++) {
            vec3 p = move_of(a, v), q = move_of(b, v);
            assert_vec3_near(p, ((vec3){-q.x, q.y, q.z}), 1e-3);
        }
    }
    case_destroy(&left);
}

static void a_wider_rim_lets_less_go(void **state) {
    (void)state;
    struct case_group *group = case_group(knee, "meniscus_lateral");
    struct error err;
    double before = 0;
    for (double rim = 2; rim <= 8; rim += 1.5) {
        assert_int_equal(maxcut_make(group, pose_identity(), rim, &err), RESULT_OK);
        struct maxcut_report report = inspect(group);
        assert_true(report.least_mm3 > before + 50 && report.out_count == 0);
        assert_int_equal(report.folds.crossed + report.folds.creased, 0);
        before = report.least_mm3;
    }
    assert_int_equal(maxcut_make(group, pose_identity(), 3.5, &err), RESULT_OK);
}

static void a_group_that_is_no_meniscus_is_refused(void **state) {
    (void)state;
    struct error err;
    struct case_group *group = case_group(knee, "meniscus_medial");
    float first = group->maxcut[0];
    assert_int_equal(maxcut_make(group, pose_identity(), 15, &err), RESULT_INVALID);
    assert_non_null(strstr(err.text, "meniscus_medial: nowhere wider than a rim of 15 mm"));
    assert_true(group->maxcut[0] == first);
    assert_int_equal(maxcut_make(case_group(knee, "tibia"), pose_identity(), 3, &err),
                     RESULT_INVALID);
    assert_non_null(strstr(err.text, "tibia cannot be cut"));
    struct knee_case *boxes = box_knee();
    group = case_group(boxes, "meniscus_medial");
    assert_int_equal(maxcut_make(group, pose_identity(), 3, &err), RESULT_INVALID);
    assert_non_null(strstr(err.text, "not a C"));
    case_destroy(&boxes);
}

// ---- what hands have made -----------------------------------------------------------------------

static uint32_t farthest_moved(const struct case_group *group) {
    uint32_t farthest = 0;
    for (uint32_t v = 1; v < group->mesh.vertex_count; v++)
        if (vec3_length(move_of(group, v)) > vec3_length(move_of(group, farthest)))
            farthest = v;
    return farthest;
}

static void a_vertex_that_sticks_out_is_counted_with_its_depth(void **state) {
    (void)state;
    struct case_group *group = case_group(knee, "meniscus_medial");
    uint32_t v = farthest_moved(group);
    float *d = group->maxcut + 3 * (size_t)v, kept = d[2];
    double top = (double)mesh_bounds(&group->mesh).max.z;
    d[2] = (float)(top + 2) - group->mesh.positions[3 * (size_t)v + 2];
    struct maxcut_report report = inspect(group);
    assert_true(report.out_count >= 6);
    assert_true(report.deepest_mm >= 2 && report.deepest_mm < 6);
    d[2] = kept;
    assert_int_equal(inspect(group).out_count, 0);
}

static void a_vertex_pulled_through_the_other_side_folds(void **state) {
    (void)state;
    struct case_group *group = case_group(knee, "meniscus_medial");
    uint32_t v = farthest_moved(group);
    float kept = group->maxcut[3 * (size_t)v];
    group->maxcut[3 * (size_t)v] -= 9; // through the capsule
    assert_true(inspect(group).folds.crossed > 0);
    group->maxcut[3 * (size_t)v] = kept;
}

static void a_plan_is_measured_against_what_may_go(void **state) {
    (void)state;
    struct case_group *group = case_group(knee, "meniscus_medial");
    // A slab across the body, from the inner margin through the capsule.
    const struct plane slab[] = {{{1, 0, 0}, 0},  {{-1, 0, 0}, 60}, {{0, 1, 0}, 1},
                                 {{0, -1, 0}, 1}, {{0, 0, 1}, 0},   {{0, 0, -1}, 60}};
    struct error err;
    assert_int_equal(case_region_add(&group->lesion.plan, slab, 6, &err), RESULT_OK);
    struct maxcut_report report = inspect(group);
    struct mesh least;
    displace(group, &least);
    // Volumes of the slab in both by solid angle, on another lattice.
    double whole = 0, left = 0;
    const double sample = 0.3 * 0.4 * 0.3;
    for (double y = -0.8; y < 1; y += 0.4)
        for (double x = -38; x < -20; x += 0.3)
            for (double z = -23; z < -14; z += 0.3)
                if (is_inside(&group->mesh, (vec3){x, y, z})) {
                    whole += sample;
                    left += is_inside(&least, (vec3){x, y, z}) ? sample : 0;
                }
    assert_near(report.plan_mm3, whole, 0.05 * whole);
    assert_near(report.plan_beyond_mm3, left, 0.08 * left);
    assert_true(left > 0.4 * whole && left < 0.9 * whole);
    mesh_fini(&least);
    group->lesion.plan.part_count = 0;
}

// ---- folds and columns --------------------------------------------------------------------------

static void surfaces_that_cross_are_found(void **state) {
    (void)state;
    struct mesh a, b, both;
    box_mesh((vec3){0, 0, 0}, (vec3){1, 1, 1}, &a);
    assert_int_equal(folds_of(&a, NULL).crossed + folds_of(&a, NULL).creased, 0);
    for (int apart = 0; apart < 2; apart++) {
        box_mesh((vec3){apart ? 2.5 : 1.2, 0.3, 0.2}, (vec3){1, 1, 1}, &b);
        mesh_init(&both, 16, 24);
        memcpy(both.positions, a.positions, 24 * sizeof(float));
        memcpy(both.positions + 24, b.positions, 24 * sizeof(float));
        memcpy(both.triangles, a.triangles, 36 * sizeof(uint32_t));
        for (int i = 0; i < 36; i++)
            both.triangles[36 + i] = 8 + b.triangles[i];
        bool folded[24];
        assert_true((folds_of(&both, folded).crossed > 0) == !apart);
        bool any = false;
        for (int t = 0; t < 24; t++)
            any |= folded[t];
        assert_true(any == !apart);
        mesh_fini(&both);
        mesh_fini(&b);
    }
    mesh_fini(&a);
}

static void a_triangle_folded_on_its_neighbour_is_found(void **state) {
    (void)state;
    float positions[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0.1f, 0.8f, 0.001f};
    uint32_t triangles[] = {0, 1, 2, 1, 0, 3};
    struct mesh mesh = {4, 2, positions, triangles};
    assert_int_equal(folds_of(&mesh, NULL).creased, 1);
    positions[10] = -0.8f;
    assert_int_equal(folds_of(&mesh, NULL).creased, 0);
}

static void columns_hold_the_volume_and_always_leave(void **state) {
    (void)state;
    const struct mesh *mesh = &case_group(knee, "meniscus_lateral")->mesh;
    vec3 *points = malloc(mesh->vertex_count * sizeof *points);
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        points[v] = mesh_vertex(mesh, v);
    struct columns columns;
    columns_init(&columns, mesh, points, 0.2);
    double length = 0;
    for (size_t c = 0; c < (size_t)columns.nx * (size_t)columns.ny; c++) {
        assert_int_equal((columns.first[c + 1] - columns.first[c]) % 2, 0);
        for (size_t i = columns.first[c]; i < columns.first[c + 1]; i += 2) {
            assert_true(columns.heights[i + 1] >= columns.heights[i]);
            length += columns.heights[i + 1] - columns.heights[i];
        }
    }
    assert_near(length * 0.2 * 0.2, mesh_volume(mesh), 5);
    columns_fini(&columns);
    free(points);
}

// Lattice lines through vertices, edges and faces of a box.
static void columns_through_edges_count_once(void **state) {
    (void)state;
    struct mesh mesh;
    box_mesh((vec3){0}, (vec3){1, 1, 1}, &mesh);
    vec3 points[8];
    for (uint32_t v = 0; v < 8; v++)
        points[v] = mesh_vertex(&mesh, v);
    struct columns columns;
    columns_init(&columns, &mesh, points, 0.5); // columns at -1, -0.5, 0, 0.5 and 1
    assert_int_equal(columns.nx, 5);
    for (size_t c = 0; c < 25; c++) {
        size_t count = columns.first[c + 1] - columns.first[c];
        bool within = c % 5 % 4 != 0 && c / 5 % 4 != 0;
        assert_true(count == 2 || (count == 0 && !within));
    }
    columns_fini(&columns);
    mesh_fini(&mesh);
}

// ---- the arc ------------------------------------------------------------------------------------

static void a_meniscus_of_metres_is_refused(void **state) {
    (void)state;
    struct mesh mesh;
    struct arc *arc;
    struct error err;
    mesh_copy(&mesh, &case_group(knee, menisci[0])->mesh);
    for (uint32_t v = 0; v < mesh.vertex_count; v++)
        mesh_set_vertex(&mesh, v, vec3_scale(100, mesh_vertex(&mesh, v)));
    assert_int_equal(arc_create(&mesh, pose_identity(), &arc, &err), RESULT_INVALID);
    assert_non_null(strstr(err.text, "where a meniscus has at most 200 mm"));
    mesh_fini(&mesh);
}

static void an_arc_runs_from_the_anterior_end_and_knows_its_margins(void **state) {
    (void)state;
    struct error err;
    for (int i = 0; i < 2; i++) {
        const struct mesh *mesh = &case_group(knee, menisci[i])->mesh;
        struct arc *arc;
        assert_int_equal(arc_create(mesh, pose_identity(), &arc, &err), RESULT_OK);
        vec3 front = arc_point(arc, (struct arc_place){0, 2, -20});
        vec3 back = arc_point(arc, (struct arc_place){1, 2, -20});
        assert_true(front.y > 8 && back.y < -8);
        vec3 outward = arc_outward(arc, 0.5);
        assert_true(i == 0 ? outward.x < -0.9 : outward.x > 0.9);
        for (uint32_t v = 0; v < mesh->vertex_count; v += 7) {
            vec3 p = mesh_vertex(mesh, v);
            struct arc_place place = arc_place(arc, p);
            assert_vec3_near(arc_point(arc, place), p, 1e-9);
            if (place.along < 0.1 || place.along > 0.9)
                continue;
            assert_true(place.inward > -0.4 && place.inward < arc_width(arc, place.along) + 0.4);
            double lower, upper;
            arc_heights(arc, place.along, place.inward, &lower, &upper);
            if (place.inward > 0.5 && place.inward < arc_width(arc, place.along) - 0.5)
                assert_true(fmin(fabs(p.z - lower), fabs(p.z - upper)) < 0.2);
        }
        arc_destroy(&arc);
        assert_null(arc);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_left_lies_inside_by_the_solid_angle),
        cmocka_unit_test(nothing_sticks_out_and_nothing_folds),
        cmocka_unit_test(a_rim_of_the_width_asked_for_is_left_in_the_body),
        cmocka_unit_test(roots_and_capsule_stay_where_they_are),
        cmocka_unit_test(a_left_knee_keeps_the_mirrored_rim),
        cmocka_unit_test(a_wider_rim_lets_less_go),
        cmocka_unit_test(a_group_that_is_no_meniscus_is_refused),
        cmocka_unit_test(a_vertex_that_sticks_out_is_counted_with_its_depth),
        cmocka_unit_test(a_vertex_pulled_through_the_other_side_folds),
        cmocka_unit_test(a_plan_is_measured_against_what_may_go),
        cmocka_unit_test(surfaces_that_cross_are_found),
        cmocka_unit_test(a_triangle_folded_on_its_neighbour_is_found),
        cmocka_unit_test(columns_hold_the_volume_and_always_leave),
        cmocka_unit_test(columns_through_edges_count_once),
        cmocka_unit_test(a_meniscus_of_metres_is_refused),
        cmocka_unit_test(an_arc_runs_from_the_anterior_end_and_knows_its_margins),
    };
    return cmocka_run_group_tests(tests, make_knee, destroy_knee);
}
