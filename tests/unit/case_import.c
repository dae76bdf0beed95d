#include "case/deform.h"
#include "case/import.h"
#include "case_knee.h"
#include "mesh/topology.h"
#include "random.h"
#include "test.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static struct error err;
static char folder[256];

static int make(void **state) {
    (void)state;
    make_folder(folder, sizeof folder);
    return 0;
}

static int clear(void **state) {
    (void)state;
    remove_folder(folder);
    return 0;
}

// A file of the test's folder, in millimetres and the case's frame unless `source` says otherwise.
static enum result read_mesh(const char *name, struct import_source source, struct mesh *out_mesh,
                             struct import_counts *out_counts) {
    struct case_limits limits = case_limits_default();
    char path[300];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    source.path = path;
    memset(&err, 0, sizeof err);
    return import_mesh(&source, &limits, out_mesh, out_counts, &err);
}

static const struct import_source as_it_is = {.mm_per_unit = 1, .T_case_file = {{1, 0, 0, 0}, {0}}};

static void write_text(const char *name, const char *text) {
    write_file(folder, name, text, strlen(text));
}

// A tetrahedron with corners at the origin and on the axes at 1, 2, 3.
static const char tetra_ply[] =
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
    "property float z\nelement face 4\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0\n1 0 0\n0 2 0\n0 0 3\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";
static const char tetra_off[] = "OFF\n4 4 0\n0 0 0\n1 0 0\n0 2 0\n0 0 3\n"
                                "3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";
static const char tetra_obj[] = "v 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 0 3\nvn 0 0 1\n"
                                "f 1 3 2\nf 1//1 2//1 4//1\nf 1 4 3\nf 2 3 4\n";
static const char tetra_stl[] =
    "solid t\n"
    "facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 2 0\nvertex 1 0 0\nendloop\nendfacet\n"
    "facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 0 3\nendloop\nendfacet\n"
    "facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 0 3\nvertex 0 2 0\nendloop\nendfacet\n"
    "facet normal 0 0 0\nouter loop\nvertex 1 0 0\nvertex 0 2 0\nvertex 0 0 3\nendloop\nendfacet\n"
    "endsolid t\n";

static void assert_tetra(const char *name) {
    struct mesh mesh;
    struct import_counts counts;
    if (read_mesh(name, as_it_is, &mesh, &counts) != RESULT_OK)
        fail_msg("%s", err.text);
    struct topology t = topology_of(&mesh);
    assert_int_equal(mesh.vertex_count, 4);
    assert_int_equal(mesh.triangle_count, 4);
    assert_true(t.closed && t.manifold && t.oriented && t.components == 1);
    assert_near(mesh_volume(&mesh), 1, 1e-6);
    assert_false(counts.turned);
    mesh_fini(&mesh);
}

static void write_binary_stl(const char *name) {
    static const float corners[4][9] = {{0, 0, 0, 0, 2, 0, 1, 0, 0},
                                        {0, 0, 0, 1, 0, 0, 0, 0, 3},
                                        {0, 0, 0, 0, 0, 3, 0, 2, 0},
                                        {1, 0, 0, 0, 2, 0, 0, 0, 3}};
    char bytes[84 + 4 * 50] = {0};
    bytes[80] = 4;
    for (int i = 0; i < 4; i++)
        memcpy(bytes + 84 + 50 * i + 12, corners[i], 36);
    write_file(folder, name, bytes, sizeof bytes);
}

static void each_format_gives_the_same_closed_mesh(void **state) {
    (void)state;
    write_text("t.ply", tetra_ply);
    write_text("t.off", tetra_off);
    write_text("t.obj", tetra_obj);
    write_text("t.STL", tetra_stl);
    write_binary_stl("b.stl");
    assert_tetra("t.ply");
    assert_tetra("t.off");
    assert_tetra("t.obj");
    assert_tetra("t.STL");
    assert_tetra("b.stl");
}

static void unit_and_frame_of_a_file_are_applied(void **state) {
    (void)state;
    write_text("t.ply", tetra_ply);
    struct random r = {3};
    struct import_source source = {.mm_per_unit = 10, .T_case_file = random_pose(&r, 50)};
    struct mesh mesh;
    struct import_counts counts;
    assert_int_equal(read_mesh("t.ply", source, &mesh, &counts), RESULT_OK);
    assert_vec3_near(mesh_vertex(&mesh, 0), source.T_case_file.translation, 1e-5);
    vec3 expected = pose_apply(source.T_case_file, (vec3){0, 0, 30});
    assert_vec3_near(mesh_vertex(&mesh, 3), expected, 1e-5);
    assert_near(mesh_volume(&mesh), 1000, 1e-2);
    mesh_fini(&mesh);
}

static void a_closed_mesh_that_is_inside_out_is_turned(void **state) {
    (void)state;
    write_text("t.off",
               "OFF\n4 4 0\n0 0 0\n1 0 0\n0 2 0\n0 0 3\n3 0 1 2\n3 0 3 1\n3 0 2 3\n3 1 3 2\n");
    struct mesh mesh;
    struct import_counts counts;
    assert_int_equal(read_mesh("t.off", as_it_is, &mesh, &counts), RESULT_OK);
    assert_true(counts.turned);
    assert_near(mesh_volume(&mesh), 1, 1e-6);
    mesh_fini(&mesh);
}

static void polygons_become_triangles_and_degenerate_ones_are_counted(void **state) {
    (void)state;
    write_text("p.off", "OFF\n5 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n2 2 2\n4 0 1 2 3\n3 0 1 0\n");
    struct mesh mesh;
    struct import_counts counts;
    assert_int_equal(read_mesh("p.off", as_it_is, &mesh, &counts), RESULT_OK);
    assert_int_equal(mesh.triangle_count, 2);
    assert_near(mesh_area(&mesh), 1, 1e-6);
    assert_int_equal(counts.dropped, 1);
    mesh_fini(&mesh);
}

// Three triangles on one edge: an importer that builds half-edges would split or drop one.
static void what_is_not_manifold_stays_as_it_is(void **state) {
    (void)state;
    write_text("n.off",
               "OFF\n5 3 0\n0 0 0\n0 0 1\n1 0 0\n0 1 0\n-1 0 0\n3 0 1 2\n3 0 1 3\n3 0 1 4\n");
    struct mesh mesh;
    struct import_counts counts;
    assert_int_equal(read_mesh("n.off", as_it_is, &mesh, &counts), RESULT_OK);
    assert_int_equal(mesh.vertex_count, 5);
    assert_int_equal(topology_of(&mesh).non_manifold_edges, 1);
    mesh_fini(&mesh);
}

static void a_bad_file_is_refused_by_name(void **state) {
    (void)state;
    static const struct {
        const char *name, *text;
    } rows[] = {
        {"empty.ply", ""},
        {"empty.stl", ""},
        {"empty.obj", ""},
        {"empty.off", ""},
        {"words.ply", "once upon a time"},
        {"words.off", "once upon a time"},
        {"words.obj", "once upon a time\n"},
        {"words.stl", "once upon a time"},
        {"points.obj", "v 0 0 0\nv 1 0 0\n"},
        {"index.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n"},
        {"index.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n"},
        {"minus.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n"},
        {"nan.off", "OFF\n3 1 0\n0 0 0\nnan 0 0\n0 1 0\n3 0 1 2\n"},
        {"far.off", "OFF\n3 1 0\n0 0 0\n1e30 0 0\n0 1 0\n3 0 1 2\n"},
        {"short.ply", "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\n"},
        {"mesh.vtk", "v 0 0 0\n"},
        {"mesh", "v 0 0 0\n"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        write_text(rows[i].name, rows[i].text);
        struct mesh mesh;
        struct import_counts counts;
        if (read_mesh(rows[i].name, as_it_is, &mesh, &counts) == RESULT_OK)
            fail_msg("%s was taken", rows[i].name);
        if (!strstr(err.text, rows[i].name))
            fail_msg("\"%s\" does not name %s", err.text, rows[i].name);
        assert_null(mesh.positions);
    }
    struct mesh mesh;
    struct import_counts counts;
    assert_int_equal(read_mesh("gone.ply", as_it_is, &mesh, &counts), RESULT_MISSING);
}

static void a_file_cut_anywhere_is_refused_or_read_but_never_does_harm(void **state) {
    (void)state;
    static const struct {
        const char *name, *text;
    } rows[] = {
        {"t.ply", tetra_ply}, {"t.off", tetra_off}, {"t.obj", tetra_obj}, {"t.stl", tetra_stl}};
    for (size_t i = 0; i < 4; i++) {
        for (size_t size = 0; size < strlen(rows[i].text); size += 3) {
            write_file(folder, rows[i].name, rows[i].text, size);
            struct mesh mesh;
            struct import_counts counts;
            if (read_mesh(rows[i].name, as_it_is, &mesh, &counts) == RESULT_OK)
                mesh_fini(&mesh);
            else
                assert_non_null(strstr(err.text, rows[i].name));
        }
    }
}

static void limits_hold_for_a_file_and_its_triangles(void **state) {
    (void)state;
    write_text("t.off", tetra_off);
    char path[300];
    snprintf(path, sizeof path, "%s/t.off", folder);
    struct import_source source = as_it_is;
    source.path = path;
    struct mesh mesh;
    struct import_counts counts;
    struct case_limits limits = {.file_bytes = 20, .group_triangles = 4};
    assert_int_equal(import_mesh(&source, &limits, &mesh, &counts, &err), RESULT_LIMIT);
    limits = (struct case_limits){.file_bytes = 2000, .group_triangles = 3};
    assert_int_equal(import_mesh(&source, &limits, &mesh, &counts, &err), RESULT_LIMIT);
}

static void three_letters_turn_any_right_handed_frame(void **state) {
    (void)state;
    pose T;
    assert_true(import_axes("ASR", &T)); // x anterior, y superior, z right
    assert_vec3_near(pose_apply(T, (vec3){1, 2, 3}), ((vec3){3, 1, 2}), 1e-12);
    assert_true(import_axes("LPS", &T));
    assert_vec3_near(pose_apply(T, (vec3){1, 2, 3}), ((vec3){-1, -2, 3}), 1e-12);
    assert_true(import_axes("RAS", &T));
    assert_vec3_near(pose_apply(T, (vec3){1, 2, 3}), ((vec3){1, 2, 3}), 1e-12);
    static const char *const bad[] = {"", "RA", "RASS", "LAS", "RRS", "RLA", "ras", "XYZ", "AAS"};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
        assert_false(import_axes(bad[i], &T));
}

static void a_bone_of_a_wrong_size_names_the_unit_that_fits(void **state) {
    (void)state;
    static const struct {
        double half_mm, mm_per_unit;
        const char *says; // NULL: the bone is fine
    } rows[] = {
        {40, 1, NULL},
        {0.04, 1, "would fit is m"},
        {4, 1, "would fit is cm"},
        {40000, 1000, "would fit is mm"},
        {20, 1, NULL},
        {14, 1, "neither"},
        {80, 1, "neither"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct case_group group = {.name = "tibia"};
        box_mesh((vec3){0}, vec3_scale(rows[i].half_mm, (vec3){0.2, 1, 4}), &group.mesh);
        enum result result = import_check_bone(&group, rows[i].mm_per_unit, &err);
        assert_int_equal(result, rows[i].says ? RESULT_INVALID : RESULT_OK);
        if (rows[i].says && !strstr(err.text, rows[i].says))
            fail_msg("\"%s\" does not say \"%s\"", err.text, rows[i].says);
        mesh_fini(&group.mesh);
    }
}

static void the_joint_is_estimated_between_the_posterior_condyles(void **state) {
    (void)state;
    struct knee_case *knee = case_create("estimate", "");
    struct mesh mesh;
    box_mesh((vec3){3, 5, 50}, (vec3){40, 30, 60}, &mesh);
    struct case_group *femur = case_add_group(knee, "femur", BODY_FEMUR);
    assert_int_equal(case_add_part(femur, "femur", &mesh, &err), RESULT_OK);
    pose T = import_estimate_joint(knee);
    assert_vec3_near(T.translation, ((vec3){3, -25 + 21.6, -10 + 21.6}), 1e-5);
    assert_near(quat_angle(T.rotation, quat_identity()), 0, 0);
    mesh_fini(&mesh);
    case_destroy(&knee);
}

// ---- deform
// --------------------------------------------------------------------------------------

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

#define with_folder(test) cmocka_unit_test_setup_teardown(test, make, clear)

int main(void) {
    const struct CMUnitTest tests[] = {
        with_folder(each_format_gives_the_same_closed_mesh),
        with_folder(unit_and_frame_of_a_file_are_applied),
        with_folder(a_closed_mesh_that_is_inside_out_is_turned),
        with_folder(polygons_become_triangles_and_degenerate_ones_are_counted),
        with_folder(what_is_not_manifold_stays_as_it_is),
        with_folder(a_bad_file_is_refused_by_name),
        with_folder(a_file_cut_anywhere_is_refused_or_read_but_never_does_harm),
        with_folder(limits_hold_for_a_file_and_its_triangles),
        cmocka_unit_test(three_letters_turn_any_right_handed_frame),
        cmocka_unit_test(a_bone_of_a_wrong_size_names_the_unit_that_fits),
        cmocka_unit_test(the_joint_is_estimated_between_the_posterior_condyles),
        cmocka_unit_test(a_cavity_is_exactly_as_deep_and_as_wide_as_asked),
        cmocka_unit_test(parts_that_lie_on_one_another_keep_their_order),
        cmocka_unit_test(dents_that_overlap_go_deeper_from_where_the_first_left_off),
        cmocka_unit_test(further_groups_follow_the_same_map),
        cmocka_unit_test(a_cavity_that_would_fold_or_hits_nothing_is_refused_and_changes_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
