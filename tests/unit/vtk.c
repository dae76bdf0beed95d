#include "mesh/topology.h"
#include "mesh_files.h"
#include "test.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// A tetrahedron with corners at the origin and on the axes at 1, 2, 3.
#define VTK(version, form) "# vtk DataFile Version " version "\ntitle\n" form "\nDATASET POLYDATA\n"
static const char tetra_vtk[] =
    VTK("3.0", "ASCII") "POINTS 4 float\n0 0 0 1 0 0\n0 2 0 0 0 3\n\nMETADATA\nINFORMATION 0\n\n"
                        "LINES 1 3\n2 0 1\nPOLYGONS 4 16\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"
                        "CELL_DATA 4\nSCALARS anything at all\n";
static const char tetra_vtk_5[] =
    VTK("5.1", "ASCII") "FIELD FieldData 1\nTimeValue 1 1 double\n0.5\n"
                        "POINTS 4 double\n0 0 0 1 0 0 0 2 0 0 0 3\n"
                        "POLYGONS 3 6\nOFFSETS vtktypeint64\n0 3 6\n"
                        "CONNECTIVITY vtktypeint64\n0 2 1 0 1 3\n"
                        "TRIANGLE_STRIPS 2 4\nOFFSETS int\n0 4\nCONNECTIVITY int\n0 3 2 1\n";

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

static void text_of_both_forms_is_read(void **state) {
    (void)state;
    write_text_file("t.vtk", tetra_vtk);
    write_text_file("t5.VTK", tetra_vtk_5);
    assert_tetra("t.vtk");
    assert_tetra("t5.VTK");
}

static void text_cut_anywhere_is_refused_or_read_but_never_does_harm(void **state) {
    (void)state;
    const char *const texts[] = {tetra_vtk, tetra_vtk_5};
    for (size_t i = 0; i < 2; i++) {
        for (size_t size = 0; size < strlen(texts[i]); size += 3) {
            write_file(folder, "cut.vtk", texts[i], size);
            struct mesh mesh;
            struct repair_report report;
            if (read_mesh("cut.vtk", as_it_is, &mesh, &report) == RESULT_OK)
                mesh_fini(&mesh);
            else
                assert_non_null(strstr(err.text, "cut.vtk"));
        }
    }
}

static size_t put_big(char *out, size_t at, uint64_t bits, int width) {
    for (int i = 0; i < width; i++)
        out[at++] = (char)(bits >> 8 * (width - 1 - i));
    return at;
}

// The tetrahedron as a binary VTK file of version 3, or of version 5 with doubles.
static size_t vtk_bytes(bool wide, char *out) {
    static const double places[12] = {0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3};
    static const uint32_t corners[12] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
    size_t at = (size_t)sprintf(out, VTK("%s", "BINARY") "POINTS 4 %s\n", wide ? "5.1" : "3.0",
                                wide ? "double" : "float");
    for (int i = 0; i < 12; i++) {
        float narrow = (float)places[i];
        uint64_t bits = 0;
        memcpy(&bits, wide ? (const void *)&places[i] : (const void *)&narrow, wide ? 8 : 4);
        at = put_big(out, at, bits, wide ? 8 : 4);
    }
    at += (size_t)sprintf(out + at,
                          wide ? "\nPOLYGONS 5 12\nOFFSETS vtktypeint64\n" : "\nPOLYGONS 4 16\n");
    for (uint64_t i = 0; wide && i < 5; i++)
        at = put_big(out, at, 3 * i, 8);
    if (wide)
        at += (size_t)sprintf(out + at, "\nCONNECTIVITY vtktypeint64\n");
    for (int i = 0; i < 12; i++) {
        if (!wide && i % 3 == 0)
            at = put_big(out, at, 3, 4);
        at = put_big(out, at, corners[i], wide ? 8 : 4);
    }
    return at;
}

static void binary_of_both_forms_is_read_and_refused_where_it_is_cut(void **state) {
    (void)state;
    for (int wide = 0; wide < 2; wide++) {
        char bytes[2048];
        size_t size = vtk_bytes(wide, bytes);
        write_file(folder, "b.vtk", bytes, size);
        assert_tetra("b.vtk");
        for (size_t cut = 1; cut < size; cut += 7) {
            write_file(folder, "b.vtk", bytes, size - cut);
            struct mesh mesh;
            struct repair_report report;
            if (read_mesh("b.vtk", as_it_is, &mesh, &report) == RESULT_OK)
                fail_msg("%zu bytes less were taken", cut);
            assert_non_null(strstr(err.text, "b.vtk"));
        }
    }
}

static void a_binary_file_of_more_cells_than_it_says_is_refused(void **state) {
    (void)state;
    char bytes[2048];
    size_t size = vtk_bytes(false, bytes);
    memcpy(bytes + size - 16 * 4 - 14, "POLYGONS 3 12", 13);
    write_file(folder, "b.vtk", bytes, size);
    struct mesh mesh;
    struct repair_report report;
    assert_int_equal(read_mesh("b.vtk", as_it_is, &mesh, &report), RESULT_FORMAT);
    assert_non_null(strstr(err.text, "b.vtk: what follows the last section"));
}

static void a_file_at_fault_is_refused_with_what(void **state) {
    (void)state;
#define POINTS_3 VTK("3.0", "ASCII") "POINTS 3 float\n0 0 0 1 0 0 0 1 0\n"
#define WORD_64 "a_word_of_64_letters_is_longer_than_the_name_of_any_section_is__"
#define POINTS_5 VTK("5.1", "ASCII") "POINTS 3 float\n0 0 0 1 0 0 0 1 0\n"
    static const struct {
        const char *text, *says;
    } rows[] = {
        {"# vtk DataFile Version 9.0\nt\nASCII\nDATASET POLYDATA\n", "version 1 to 5"},
        {"# vtk DataFile Version 3.0\nt\nPLAIN\n", "neither ASCII nor BINARY"},
        {"# vtk DataFile Version 3.0\nt\nASCII\nDATASET STRUCTURED_POINTS\n", "only POLYDATA"},
        {POINTS_3, "holds no triangle"},
        {POINTS_3 "POLYGONS 1 4\n3 0 1 3\n", "there is no vertex 3"},
        {POINTS_3 "POLYGONS 1 4\n3 0 1 -2\n", "POLYGONS"},
        {POINTS_3 "POLYGONS 1 4\n3 0 1 1.5\n", "POLYGONS"},
        {POINTS_3 "POLYGONS 1 4\n4 0 1 2\n", "do not add up"},
        {POINTS_3 "POLYGONS 2 4\n3 0 1 2\n", "do not add up"},
        {POINTS_3 "POLYGONS 1 4000000000000\n3 0 1 2\n", "POLYGONS"},
        {POINTS_3 "POINTS 1 float\n0 0 0\n", "comes twice"},
        {POINTS_3 "CUBES 1 4\n", "unknown section: CUBES"},
        {POINTS_5 "POLYGONS 2 3\nOFFSETS int\n0 4\nCONNECTIVITY int\n0 1 2\n", "do not rise"},
        {POINTS_5 "POLYGONS 2 3\nOFFSETS float\n0 3\nCONNECTIVITY int\n0 1 2\n", "POLYGONS"},
        {POINTS_3 "POLYGONS 1 4\n3 0 1 2\n" WORD_64, "the name of none"},
        {VTK("3.0", "ASCII") "POINTS 3 float\n0 0 0 nan 0 0 0 1 0\n", "point 1: a coordinate"},
        {VTK("3.0", "ASCII") "POINTS 99999999 float\n0 0 0\n", "more triangles or vertices"},
        {VTK("3.0", "ASCII") "POINTS 3 bit\n0 0 0\n", "a count and a type"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        write_text_file("bad.vtk", rows[i].text);
        struct mesh mesh;
        struct repair_report report;
        if (read_mesh("bad.vtk", as_it_is, &mesh, &report) == RESULT_OK)
            fail_msg("row %zu was taken", i);
        if (!strstr(err.text, "bad.vtk") || !strstr(err.text, rows[i].says))
            fail_msg("row %zu: \"%s\" does not say \"%s\"", i, err.text, rows[i].says);
    }
}

#define with_folder(test)                                                                          \
    cmocka_unit_test_setup_teardown(test, mesh_folder_make, mesh_folder_remove)

int main(void) {
    const struct CMUnitTest tests[] = {
        with_folder(text_of_both_forms_is_read),
        with_folder(text_cut_anywhere_is_refused_or_read_but_never_does_harm),
        with_folder(binary_of_both_forms_is_read_and_refused_where_it_is_cut),
        with_folder(a_binary_file_of_more_cells_than_it_says_is_refused),
        with_folder(a_file_at_fault_is_refused_with_what),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
