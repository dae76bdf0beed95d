// Coordinates arrive as the file has them: with more digits than a float holds.
#include "import/reader.h"
#include "mesh_files.h"
#include "test.h"

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// 1.5 m from the origin, floats are 1.2e-4 mm apart.
static const double places[4][3] = {{1500.1234567890125, -1200.0000001, 900.00000325},
                                    {1501.1234567890125, -1200.0000001, 900.00000325},
                                    {1500.1234567890125, -1198.0000001, 900.00000325},
                                    {1500.1234567890125, -1200.0000001, 903.00000325}};
static const uint32_t corners[12] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};

static void read_surface(const char *name, struct import_arrays *out) {
    char path[300];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    assert_ok(import_reader_read(path, 1000, out, &err));
}

static void assert_exact(const char *name) {
    struct import_arrays arrays;
    read_surface(name, &arrays);
    assert_int_equal(arrays.vertex_count, 4);
    assert_int_equal(arrays.triangle_count, 4);
    for (int t = 0; t < 12; t++)
        for (int axis = 0; axis < 3; axis++)
            if (arrays.positions[3 * arrays.triangles[t] + axis] != places[corners[t]][axis])
                fail_msg("%s: corner %d: %.17g, not %.17g", name, t,
                         arrays.positions[3 * arrays.triangles[t] + axis],
                         places[corners[t]][axis]);
    import_arrays_fini(&arrays);
}

static void write_text(const char *name, const char *head, const char *before_vertex,
                       const char *before_face, int first) {
    char text[4096];
    int size = snprintf(text, sizeof text, "%s", head);
    for (int v = 0; v < 4; v++)
        size += snprintf(text + size, sizeof text - (size_t)size, "%s%.17g %.17g %.17g\n",
                         before_vertex, places[v][0], places[v][1], places[v][2]);
    for (int t = 0; t < 4; t++)
        size += snprintf(text + size, sizeof text - (size_t)size, "%s%u %u %u\n", before_face,
                         corners[3 * t] + (unsigned)first, corners[3 * t + 1] + (unsigned)first,
                         corners[3 * t + 2] + (unsigned)first);
    write_file(folder, name, text, (size_t)size);
}

static void write_stl(const char *name) {
    char text[4096];
    int size = snprintf(text, sizeof text, "solid t\n");
    for (int i = 0; i < 12; i++)
        size += snprintf(text + size, sizeof text - (size_t)size, "%svertex %.17g %.17g %.17g\n%s",
                         i % 3 ? "" : "facet normal 0 0 0\nouter loop\n", places[corners[i]][0],
                         places[corners[i]][1], places[corners[i]][2],
                         i % 3 == 2 ? "endloop\nendfacet\n" : "");
    size += snprintf(text + size, sizeof text - (size_t)size, "endsolid t\n");
    write_file(folder, name, text, (size_t)size);
}

#define HEADER(format)                                                                             \
    "ply\nformat " format " 1.0\nelement camera 1\nproperty float f\nelement vertex 4\n"           \
    "property double z\nproperty uchar red\nproperty double x\nproperty double y\n"                \
    "element face 4\nproperty list uchar uint vertex_indices\nend_header\n"

static size_t put(char *to, const void *bytes, size_t size, bool big) {
    for (size_t k = 0; k < size; k++)
        to[k] = ((const char *)bytes)[big ? size - 1 - k : k];
    return size;
}

// With another element before the vertices, and their coordinates in another order.
static size_t ply_bytes(bool big, char *out) {
    size_t size = (size_t)sprintf(
        out, "%s", big ? HEADER("binary_big_endian") : HEADER("binary_little_endian"));
    size += put(out + size, &(float){7}, sizeof(float), big);
    for (int v = 0; v < 4; v++) {
        size += put(out + size, &places[v][2], sizeof(double), big);
        size += put(out + size, "\xff", 1, big);
        size += put(out + size, &places[v][0], sizeof(double), big);
        size += put(out + size, &places[v][1], sizeof(double), big);
    }
    for (int i = 0; i < 12; i++) {
        if (i % 3 == 0)
            out[size++] = 3;
        size += put(out + size, &corners[i], sizeof corners[i], big);
    }
    return size;
}

static void text_keeps_all_digits(void **state) {
    (void)state;
    write_text("t.ply",
               "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
               "property float z\nelement face 4\nproperty list uchar int vertex_indices\n"
               "end_header\n",
               "", "3 ", 0);
    write_text("t.off", "OFF\n4 4 0\n", "", "3 ", 0);
    write_text("t.obj", "# a comment\n", "v ", "f ", 1);
    write_stl("t.stl");
    assert_exact("t.ply");
    assert_exact("t.off");
    assert_exact("t.obj");
    assert_exact("t.stl");
}

static void binary_doubles_of_both_endians_are_kept(void **state) {
    (void)state;
    char bytes[1024];
    for (int big = 0; big < 2; big++) {
        write_file(folder, "b.ply", bytes, ply_bytes(big, bytes));
        assert_exact("b.ply");
    }
}

// What is equal as a float is one vertex: that of the first corner.
static void corners_of_a_text_stl_that_a_float_does_not_tell_apart_are_one(void **state) {
    (void)state;
    static const char text[] =
        "solid t\nfacet normal 0 0 0\nouter loop\nvertex 1500.00000001 0 0\nvertex 0 1 0\n"
        "vertex 0 0 1\nendloop\nendfacet\nfacet normal 0 0 0\nouter loop\n"
        "vertex 1500.00000002 0 0\nvertex 0 0 1\nvertex 0 -1 0\nendloop\nendfacet\nendsolid t\n";
    write_file(folder, "t.stl", text, strlen(text));
    struct import_arrays arrays;
    read_surface("t.stl", &arrays);
    assert_int_equal(arrays.vertex_count, 4);
    assert_near(arrays.positions[0], 1500.00000001, 0);
    assert_near(arrays.positions[10], -1, 0);
    import_arrays_fini(&arrays);
}

#define with_folder(test)                                                                          \
    cmocka_unit_test_setup_teardown(test, mesh_folder_make, mesh_folder_remove)

int main(void) {
    const struct CMUnitTest tests[] = {
        with_folder(text_keeps_all_digits),
        with_folder(binary_doubles_of_both_endians_are_kept),
        with_folder(corners_of_a_text_stl_that_a_float_does_not_tell_apart_are_one),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
