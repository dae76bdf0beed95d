// Scenes of glTF as surfaces: transforms, both forms of file, and what is refused.
#include "mesh_files.h"
#include "test.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// A tetrahedron of 1, 2, 3 m, and its triangles as 16-bit indices.
static const float places[12] = {0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3};
static const uint16_t corners[12] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
#define BIN_SIZE 72

#define HEAD "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":["
#define REST                                                                                       \
    "],\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},\"indices\":1}]}],"           \
    "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\","       \
    "\"min\":[0,0,0],\"max\":[1,2,3]},"                                                            \
    "{\"bufferView\":1,\"componentType\":5123,\"count\":12,\"type\":\"SCALAR\"}],"                 \
    "\"bufferViews\":[{\"buffer\":0,\"byteLength\":48},"                                           \
    "{\"buffer\":0,\"byteOffset\":48,\"byteLength\":24}],\"buffers\":[{\"byteLength\":72%s}]}"

static void fill_bin(unsigned char out[BIN_SIZE]) {
    memcpy(out, places, 48);
    memcpy(out + 48, corners, 24);
}

static void put_u32(unsigned char *to, size_t value) {
    for (int i = 0; i < 4; i++)
        to[i] = (unsigned char)(value >> 8 * i);
}

static void write_binary(const char *name, const char *nodes) {
    unsigned char bytes[4096];
    char json[2048];
    int size = snprintf(json, sizeof json, HEAD "%s" REST, nodes, "");
    while (size % 4 != 0)
        json[size++] = ' ';
    size_t text = (size_t)size, all = 12 + 8 + text + 8 + BIN_SIZE;
    memcpy(bytes, "glTF", 4);
    put_u32(bytes + 4, 2);
    put_u32(bytes + 8, all);
    put_u32(bytes + 12, text);
    memcpy(bytes + 16, "JSON", 4);
    memcpy(bytes + 20, json, text);
    put_u32(bytes + 20 + text, BIN_SIZE);
    memcpy(bytes + 24 + text, "BIN", 4);
    fill_bin(bytes + 28 + text);
    write_file(folder, name, (const char *)bytes, all);
}

static void write_text_form(const char *name, const char *nodes) {
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    unsigned char bin[BIN_SIZE];
    char json[4096], uri[200] = ",\"uri\":\"data:application/octet-stream;base64,";
    fill_bin(bin);
    size_t at = strlen(uri);
    for (int i = 0; i < BIN_SIZE; i += 3) {
        unsigned three = (unsigned)bin[i] << 16 | (unsigned)bin[i + 1] << 8 | bin[i + 2];
        for (int k = 18; k >= 0; k -= 6)
            uri[at++] = digits[three >> k & 63];
    }
    strcpy(uri + at, "\"");
    snprintf(json, sizeof json, HEAD "%s" REST, nodes, uri);
    write_file(folder, name, json, strlen(json));
}

static enum result read_scene(const char *name, uint32_t triangles_max, struct import_arrays *out) {
    char path[300];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return import_reader_read(path, triangles_max, out, &err);
}

// A child, whose own transform is a mirror, under a turn by 90 degrees about z and a shift.
#define TURNED                                                                                     \
    "{\"children\":[1,2],\"translation\":[1.5001234567890125,0,-2],"                               \
    "\"rotation\":[0,0,0.7071067811865476,0.7071067811865476]},"                                   \
    "{\"name\":\"bone\",\"mesh\":0},{\"name\":\"mirrored\",\"mesh\":0,\"scale\":[-1,1,1]}"

static void assert_turned(const char *name) {
    struct import_arrays arrays;
    assert_ok(read_scene(name, 100, &arrays));
    assert_int_equal(arrays.vertex_count, 8);
    assert_int_equal(arrays.triangle_count, 8);
    double volume[2] = {0, 0}, lowest[2] = {INFINITY, INFINITY};
    for (uint32_t i = 0; i < 24; i += 3) {
        vec3 p[3];
        for (uint32_t k = 0; k < 3; k++) {
            const double *at = arrays.positions + 3 * (size_t)arrays.triangles[i + k];
            // x of the file becomes y, y becomes -x
            p[k] = (vec3){at[0] - 1.5001234567890125, at[1], at[2] + 2};
            assert_true(p[k].x > -2.0000001 && p[k].x < 1e-7 && p[k].z > -1e-7 && p[k].z < 3.1);
            lowest[i / 12] = fmin(lowest[i / 12], p[k].y);
        }
        volume[i / 12] += vec3_dot(p[0], vec3_cross(p[1], p[2])) / 6;
    }
    assert_near(volume[0], 1, 1e-12); // both face outwards
    assert_near(volume[1], 1, 1e-12);
    assert_near(fmin(lowest[0], lowest[1]), -1, 1e-12);
    assert_near(fmax(lowest[0], lowest[1]), 0, 1e-12);
    import_arrays_fini(&arrays);
}

static void nodes_are_placed_by_their_transforms_in_both_forms_of_file(void **state) {
    (void)state;
    write_binary("t.glb", TURNED);
    write_text_form("t.gltf", TURNED);
    assert_turned("t.glb");
    assert_turned("t.gltf");
}

static void a_scene_that_cannot_be_read_is_refused_with_what(void **state) {
    (void)state;
    static const struct {
        const char *nodes, *says;
    } rows[] = {
        {"{\"children\":[0],\"mesh\":0}", "nodes[0] has two parents"},
        {"{\"children\":[1,1],\"mesh\":0},{}", "nodes[1] has two parents"},
        {"{\"children\":[7],\"mesh\":0}", "nodes[7]: there is no such node"},
        {"{\"name\":\"x\",\"mesh\":3}", "there is no mesh 3"},
        {"{\"name\":\"nothing\"}", "holds no triangle"},
    };
    struct import_arrays arrays;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        write_binary("bad.glb", rows[i].nodes);
        assert_int_not_equal(read_scene("bad.glb", 100, &arrays), RESULT_OK);
        if (!strstr(err.text, "bad.glb") || !strstr(err.text, rows[i].says))
            fail_msg("\"%s\" does not say \"%s\"", err.text, rows[i].says);
        assert_null(arrays.positions);
    }
    write_binary("many.glb", TURNED);
    assert_int_equal(read_scene("many.glb", 7, &arrays), RESULT_LIMIT);
    static const char outside[] =
        "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":4,\"uri\":\"/etc/hosts\"}]}";
    write_file(folder, "outside.gltf", outside, strlen(outside));
    assert_int_equal(read_scene("outside.gltf", 7, &arrays), RESULT_REFUSED);
    assert_non_null(strstr(err.text, "the data must be inside the file"));
}

static void a_file_cut_anywhere_is_refused(void **state) {
    (void)state;
    static const char *const names[] = {"t.glb", "t.gltf"};
    write_binary("t.glb", TURNED);
    write_text_form("t.gltf", TURNED);
    for (int i = 0; i < 2; i++) {
        size_t size;
        char *bytes = read_file(folder, names[i], &size);
        for (size_t cut = 0; cut < size; cut += 5) {
            struct import_arrays arrays;
            write_file(folder, names[i], bytes, cut);
            assert_int_not_equal(read_scene(names[i], 100, &arrays), RESULT_OK);
        }
        free(bytes);
    }
}

#define with_folder(test)                                                                          \
    cmocka_unit_test_setup_teardown(test, mesh_folder_make, mesh_folder_remove)

int main(void) {
    const struct CMUnitTest tests[] = {
        with_folder(nodes_are_placed_by_their_transforms_in_both_forms_of_file),
        with_folder(a_scene_that_cannot_be_read_is_refused_with_what),
        with_folder(a_file_cut_anywhere_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
