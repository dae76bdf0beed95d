#include "mesh/topology.h"
#include "mesh_files.h"
#include "random.h"
#include "test.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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
    struct repair_report report;
    if (read_mesh(name, as_it_is, &mesh, &report) != RESULT_OK)
        fail_msg("%s", err.text);
    struct topology t = topology_of(&mesh);
    assert_int_equal(mesh.vertex_count, 4);
    assert_int_equal(mesh.triangle_count, 4);
    assert_true(t.closed && t.manifold && t.oriented && t.components == 1);
    assert_near(mesh_volume(&mesh), 1, 1e-6);
    assert_false(report.turned_triangles);
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
    write_text_file("t.ply", tetra_ply);
    write_text_file("t.off", tetra_off);
    write_text_file("t.obj", tetra_obj);
    write_text_file("t.STL", tetra_stl);
    write_binary_stl("b.stl");
    assert_tetra("t.ply");
    assert_tetra("t.off");
    assert_tetra("t.obj");
    assert_tetra("t.STL");
    assert_tetra("b.stl");
}

static void unit_and_frame_of_a_file_are_applied(void **state) {
    (void)state;
    write_text_file("t.ply", tetra_ply);
    struct random r = {3};
    struct import_source source = {.mm_per_unit = 10, .T_common_file = random_pose(&r, 50)};
    struct mesh mesh;
    struct repair_report report;
    assert_int_equal(read_mesh("t.ply", source, &mesh, &report), RESULT_OK);
    assert_vec3_near(mesh_vertex(&mesh, 0), source.T_common_file.translation, 1e-5);
    vec3 expected = pose_apply(source.T_common_file, (vec3){0, 0, 30});
    assert_vec3_near(mesh_vertex(&mesh, 3), expected, 1e-5);
    assert_near(mesh_volume(&mesh), 1000, 1e-2);
    mesh_fini(&mesh);
}

static void a_closed_mesh_that_is_inside_out_is_turned(void **state) {
    (void)state;
    write_text_file("t.off",
                    "OFF\n4 4 0\n0 0 0\n1 0 0\n0 2 0\n0 0 3\n3 0 1 2\n3 0 3 1\n3 0 2 3\n3 1 3 2\n");
    struct mesh mesh;
    struct repair_report report;
    assert_int_equal(read_mesh("t.off", as_it_is, &mesh, &report), RESULT_OK);
    assert_int_equal(report.turned_triangles, 4);
    assert_near(mesh_volume(&mesh), 1, 1e-6);
    mesh_fini(&mesh);
}

static void polygons_become_triangles_and_degenerate_ones_are_counted(void **state) {
    (void)state;
    write_text_file("p.off", "OFF\n5 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n2 2 2\n4 0 1 2 3\n3 0 1 0\n");
    struct mesh mesh;
    struct repair_report report;
    assert_int_equal(read_mesh("p.off", as_it_is, &mesh, &report), RESULT_OK);
    assert_int_equal(mesh.triangle_count, 2);
    assert_near(mesh_area(&mesh), 1, 1e-6);
    assert_int_equal(report.repeated_corners, 1);
    mesh_fini(&mesh);
}

static void colours_of_an_off_file_are_passed_over(void **state) {
    (void)state;
    write_text_file("c.off",
                    "COFF\n4 4 0\n0 0 0 255 0 0\n1 0 0 255 0 0\n0 2 0 255 0 0\n0 0 3 255 0 0\n"
                    "3 0 2 1 255 0 0\n3 0 1 3 0 255 0 255\n3 1 2 3 7\n3 0 3 2\n");
    assert_tetra("c.off");
}

// Three triangles on one edge: an importer that builds half-edges would split or drop one.
static void what_is_not_manifold_stays_as_it_is(void **state) {
    (void)state;
    write_text_file("n.off",
                    "OFF\n5 3 0\n0 0 0\n0 0 1\n1 0 0\n0 1 0\n-1 0 0\n3 0 1 2\n3 0 1 3\n3 0 1 4\n");
    struct mesh mesh;
    struct repair_report report;
    assert_int_equal(read_mesh("n.off", as_it_is, &mesh, &report), RESULT_OK);
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
        write_text_file(rows[i].name, rows[i].text);
        struct mesh mesh;
        struct repair_report report;
        if (read_mesh(rows[i].name, as_it_is, &mesh, &report) == RESULT_OK)
            fail_msg("%s was taken", rows[i].name);
        if (!strstr(err.text, rows[i].name))
            fail_msg("\"%s\" does not name %s", err.text, rows[i].name);
        assert_null(mesh.positions);
    }
    struct mesh mesh;
    struct repair_report report;
    assert_int_equal(read_mesh("gone.ply", as_it_is, &mesh, &report), RESULT_MISSING);
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
            struct repair_report report;
            if (read_mesh(rows[i].name, as_it_is, &mesh, &report) == RESULT_OK)
                mesh_fini(&mesh);
            else
                assert_non_null(strstr(err.text, rows[i].name));
        }
    }
}

// ---- what readers misread -----------------------------------------------------------------------

// A number as some Windows programs print it: 1.0e-001.
static void print_long(char *out, size_t size, double value) {
    int length = snprintf(out, size, "%.9e", value);
    memmove(out + length - 1, out + length - 2, 3);
    out[length - 2] = '0';
}

static void numbers_with_exponents_of_three_digits_are_read(void **state) {
    (void)state;
    static const double places[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 2, 0}, {0, 0, 3}};
    static const int triangles[4][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
    char text[4096] = "solid t\n", number[32];
    for (int t = 0; t < 4; t++) {
        strcat(text, "facet normal 0 0 0\nouter loop\n");
        for (int i = 0; i < 9; i++) {
            print_long(number, sizeof number, places[triangles[t][i / 3]][i % 3]);
            sprintf(text + strlen(text), "%s%s", i % 3 ? " " : i ? "\nvertex " : "vertex ", number);
        }
        strcat(text, "\nendloop\nendfacet\n");
    }
    strcat(text, "endsolid t\n");
    assert_non_null(strstr(text, "3.000000000e+000"));
    write_text_file("t.stl", text);
    assert_tetra("t.stl");
}

// The tetrahedron as a binary PLY.
static size_t ply_bytes(bool big, bool wide, char *out) {
    static const double places[12] = {0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3};
    static const uint32_t corners[12] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
    const char *type = wide ? "double" : "float";
    int size = sprintf(out,
                       "ply\nformat binary_%s_endian 1.0\nelement vertex 4\nproperty %s x\n"
                       "property %s y\nproperty %s z\nelement face 4\n"
                       "property list uchar uint vertex_indices\nend_header\n",
                       big ? "big" : "little", type, type, type);
    for (int i = 0; i < 24; i++) {
        float narrow = (float)places[i % 12];
        unsigned char bytes[8];
        int width = i >= 12 ? 4 : wide ? 8 : 4;
        memcpy(bytes,
               i >= 12 ? (const void *)&corners[i - 12]
               : wide  ? (const void *)&places[i]
                       : &narrow,
               (size_t)width);
        if (i >= 12 && i % 3 == 0)
            out[size++] = 3;
        for (int k = 0; k < width; k++)
            out[size++] = (char)bytes[big ? width - 1 - k : k];
    }
    return (size_t)size;
}

static void binary_ply_of_both_endians_is_read_and_refused_where_it_is_cut(void **state) {
    (void)state;
    for (int i = 0; i < 4; i++) {
        char bytes[1024];
        size_t size = ply_bytes(i % 2, i / 2, bytes);
        write_file(folder, "b.ply", bytes, size);
        assert_tetra("b.ply");
        for (size_t cut = 1; cut < size; cut += 7) {
            write_file(folder, "b.ply", bytes, size - cut);
            struct mesh mesh;
            struct repair_report report;
            if (read_mesh("b.ply", as_it_is, &mesh, &report) == RESULT_OK)
                fail_msg("%zu bytes less were taken", cut);
            assert_non_null(strstr(err.text, "b.ply"));
        }
    }
}

#define FACET_LOOP "facet normal 0 0 0\nouter loop\n"
#define FACET_END "endloop\nendfacet\n"
#define FACET FACET_LOOP "vertex 0 0 0\nvertex 0 2 0\nvertex 1 0 0\n" FACET_END
#define PLY_HEADER(faces)                                                                          \
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"                \
    "property float z\nelement face " faces                                                        \
    "\nproperty list uchar int vertex_indices\nend_header\n"
#define CORNERS "0 0 0\n1 0 0\n0 1 0\n"

// Each of these is taken by OpenMesh, without a part or with parts that are not there, or worse.
static void what_the_reader_misreads_is_refused_by_name(void **state) {
    (void)state;
    static const struct {
        const char *name, *text, *says;
    } rows[] = {
        {"cut.stl", "solid t\n" FACET, "does not end"},
        {"end.stl", "solid t\n" FACET FACET_LOOP "vertex 0 0 0\nendsolid t\n",
         "2 facets begin, 1 end"},
        {"four.stl", "solid t\n" FACET_LOOP CORNERS FACET_END "endsolid t\n", "1 facets begin"},
        {"nan.stl",
         "solid t\n" FACET FACET_LOOP "vertex nan 0 0\nvertex 0 1 0\nvertex 0 0 1\n" FACET_END
         "endsolid t\n",
         "line 11: not a vertex"},
        {"comma.stl",
         "solid t\n" FACET FACET_LOOP "vertex 0,5 0 0\nvertex 0 1 0\nvertex 0 0 1\n" FACET_END
         "endsolid t\n",
         "line 11: not a vertex"},
        {"huge.stl",
         "solid t\n" FACET_LOOP "vertex 1.0e+100 0 0\nvertex 0 1 0\nvertex 0 0 1\n" FACET_END
         "endsolid t\n",
         "beyond 10 m"},
        {"fewer.off", "OFF\n3 3 0\n" CORNERS "3 0 1 2\n",
         "4 lines of data, where its header says 6"},
        {"more.off", "OFF\n3 1 0\n" CORNERS "3 0 1 2\n3 0 2 1\n", "5 lines of data"},
        {"comment.off", "OFF\n3 1 0\n0 0 0\n# here\n1 0 0\n0 1 0\n3 0 1 2\n", "line 4: neither"},
        {"comment_of_faces.off", "OFF\n3 2 0\n" CORNERS "3 0 1 2\n# here\n3 0 2 1\n",
         "line 7: neither"},
        {"two_counts.off", "OFF\n3 1\n" CORNERS "3 0 1 2\n", "line 2: not the header"},
        {"one_word.off", "OFF\n0000000000\n", "line 2: not the header"},
        {"four_counts.off", "OFF\n3 1 0 7\n" CORNERS "3 0 1 2\n", "line 2: not the header"},
        {"coloured.off", "OFF\n3 1 0\n" CORNERS "3 0 1 2 255 0 0\n", "COFF"},
        {"binary.off", "OFF BINARY\n3 1 0\n", "not the header of a text OFF"},
        {"fewer.ply", PLY_HEADER("2") CORNERS "3 0 1 2\n",
         "4 lines of data, where its header says 5"},
        {"more.ply", PLY_HEADER("1") CORNERS "3 0 1 2\n3 0 2 1\n", "5 lines of data"},
        {"comment.ply", PLY_HEADER("2") CORNERS "3 0 1 2\n# here\n3 0 2 1\n",
         "contradicts the header"},
        {"huge.ply", PLY_HEADER("1") "0 0 0\n1.0e+100 0 0\n0 1 0\n3 0 1 2\n", "huge.ply"},
        {"huge.obj", "v 0 0 0\nv 1.0e+100 0 0\nv 1 0 0\nv 0 1 0\nf 1 3 4\n",
         "3 vertices arrived of 4"},
        {"comma.obj",
         "v 0,5 0 0\n"
         "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
         "vertices arrived of 4"},
        {"two.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2\n", "1 faces arrived of 2"},
        {"continued.obj", "v 0 0 0\nv 1 0 \\\n0\nv 0 1 0\nf 1 2 3\n", "line 2: continued"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        write_text_file(rows[i].name, rows[i].text);
        struct mesh mesh;
        struct repair_report report;
        if (read_mesh(rows[i].name, as_it_is, &mesh, &report) == RESULT_OK)
            fail_msg("%s was taken", rows[i].name);
        if (!strstr(err.text, rows[i].name) || !strstr(err.text, rows[i].says))
            fail_msg("%s: \"%s\" does not say \"%s\"", rows[i].name, err.text, rows[i].says);
    }
}

static void a_binary_stl_whose_bytes_do_not_fit_is_refused(void **state) {
    (void)state;
    write_binary_stl("b.stl");
    size_t size;
    char *bytes = read_file(folder, "b.stl", &size);
    struct mesh mesh;
    struct repair_report report;
    memcpy(bytes, "solid of bytes", 14); // as some programs begin: binary all the same
    write_file(folder, "b.stl", bytes, size);
    assert_tetra("b.stl");
    for (uint8_t count = 0; count < 9; count++) {
        bytes[80] = (char)count;
        write_file(folder, "b.stl", bytes, size);
        if (count != 4)
            assert_int_not_equal(read_mesh("b.stl", as_it_is, &mesh, &report), RESULT_OK);
    }
    bytes[80] = 4;
    memcpy(bytes + 84 + 50 + 12, &(float){NAN}, sizeof(float));
    write_file(folder, "b.stl", bytes, size);
    assert_int_equal(read_mesh("b.stl", as_it_is, &mesh, &report), RESULT_INVALID);
    assert_non_null(strstr(err.text, "triangle 1: a coordinate is no number"));
    free(bytes);
}

static void a_stl_in_metres_is_welded_and_its_thin_facets_are_counted(void **state) {
    (void)state;
    write_text_file("t.stl",
                    "solid t\n" FACET_LOOP
                    "vertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n" FACET_END FACET_LOOP
                    "vertex 1.0000005 0 0\nvertex 1 1 0\nvertex 0 1 0\n" FACET_END FACET_LOOP
                    "vertex 0 0 0\nvertex 0 0 0\nvertex 0 1 0\n" FACET_END "endsolid t\n");
    struct import_source metres = as_it_is;
    metres.mm_per_unit = 1000;
    struct mesh mesh;
    struct repair_report report;
    assert_int_equal(read_mesh("t.stl", metres, &mesh, &report), RESULT_OK);
    assert_int_equal(mesh.vertex_count, 4);
    assert_int_equal(report.welded_vertices, 1);
    assert_near(report.welded_mm, 0.0005, 1e-4);
    assert_int_equal(report.repeated_corners, 1);
    mesh_fini(&mesh);
}

static void limits_hold_for_a_file_and_its_triangles(void **state) {
    (void)state;
    write_text_file("t.off", tetra_off);
    char path[300];
    snprintf(path, sizeof path, "%s/t.off", folder);
    struct import_source source = as_it_is;
    source.path = path;
    struct mesh mesh;
    struct repair_report report;
    struct case_limits limits = {.file_bytes = 20, .group_triangles = 4};
    assert_int_equal(import_mesh(&source, &limits, &mesh, &report, &err), RESULT_LIMIT);
    limits = (struct case_limits){.file_bytes = 2000, .group_triangles = 3};
    assert_int_equal(import_mesh(&source, &limits, &mesh, &report, &err), RESULT_LIMIT);
}

static vec3 turned(const char *letters) {
    struct import_frame frame;
    assert_true(import_axes(letters, &frame));
    return import_to_case(&frame, (vec3){1, 2, 3});
}

static void three_letters_turn_any_frame(void **state) {
    (void)state;
    assert_vec3_near(turned("ASR"), ((vec3){3, 1, 2}), 0); // x anterior, y superior, z right
    assert_vec3_near(turned("LPS"), ((vec3){-1, -2, 3}), 0);
    assert_vec3_near(turned("RAS"), ((vec3){1, 2, 3}), 0);
    assert_vec3_near(turned("LAS"), ((vec3){-1, 2, 3}), 0); // a mirror
    struct import_frame frame;
    static const char *const bad[] = {"", "RA", "RASS", "LRS", "RRS", "RLA", "ras", "XYZ", "AAS"};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
        assert_false(import_axes(bad[i], &frame));
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

#define with_folder(test)                                                                          \
    cmocka_unit_test_setup_teardown(test, mesh_folder_make, mesh_folder_remove)

int main(void) {
    const struct CMUnitTest tests[] = {
        with_folder(each_format_gives_the_same_closed_mesh),
        with_folder(unit_and_frame_of_a_file_are_applied),
        with_folder(a_closed_mesh_that_is_inside_out_is_turned),
        with_folder(polygons_become_triangles_and_degenerate_ones_are_counted),
        with_folder(colours_of_an_off_file_are_passed_over),
        with_folder(what_is_not_manifold_stays_as_it_is),
        with_folder(a_bad_file_is_refused_by_name),
        with_folder(a_file_cut_anywhere_is_refused_or_read_but_never_does_harm),
        with_folder(numbers_with_exponents_of_three_digits_are_read),
        with_folder(binary_ply_of_both_endians_is_read_and_refused_where_it_is_cut),
        with_folder(what_the_reader_misreads_is_refused_by_name),
        with_folder(a_binary_stl_whose_bytes_do_not_fit_is_refused),
        with_folder(a_stl_in_metres_is_welded_and_its_thin_facets_are_counted),
        with_folder(limits_hold_for_a_file_and_its_triangles),
        cmocka_unit_test(three_letters_turn_any_frame),
        cmocka_unit_test(a_bone_of_a_wrong_size_names_the_unit_that_fits),
        cmocka_unit_test(the_joint_is_estimated_between_the_posterior_condyles),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
