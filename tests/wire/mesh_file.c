// The file of changes that the pages' reader of meshes is tested with (web/test/mesh.test.ts): it
// is what the C code makes today. `test-mesh_file write` makes it anew, after a change of the
// format.
//
// For each payload, little-endian: u32 number of the mesh after it, u64 hash, u32 vertices, u32
// triangles, u32 bytes of the payload, and those.
#include "test.h"
#include "wire/mesh_model.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PAYLOADS 12
#define ROOM 200000

struct file {
    uint8_t bytes[ROOM];
    size_t size;
};

static void put(struct file *file, uint64_t value, int bytes) {
    for (int i = 0; i < bytes; i++)
        file->bytes[file->size++] = (uint8_t)(value >> 8 * i);
}

// One change, in every third payload two.
static void put_payload(struct file *file, struct model *model, struct random *random,
                        struct tissue *tissue, bool two) {
    struct mesh_bytes bytes[2] = {{0}};
    for (int i = 0; i <= two; i++) {
        struct mesh_delta delta = model_change(model, random, 0.15, tissue->number);
        assert_int_equal(tissue_change(tissue, &delta, NULL), RESULT_OK);
        bytes[i] = mesh_bytes_of(&delta);
        mesh_delta_fini(&delta);
    }
    put(file, tissue->number, 4);
    put(file, model_hash(model), 8);
    put(file, tissue->vertex_count, 4);
    put(file, tissue->triangle_count, 4);
    put(file, bytes[0].size + bytes[1].size, 4);
    for (int i = 0; i < 2; i++) {
        if (bytes[i].size)
            memcpy(file->bytes + file->size, bytes[i].data, bytes[i].size);
        file->size += bytes[i].size;
        free(bytes[i].data);
    }
}

static void make(struct file *file) {
    static struct model model;
    struct random random = {7};
    struct tissue tissue = {0};
    for (int i = 0; i < PAYLOADS; i++)
        put_payload(file, &model, &random, &tissue, i % 3 == 2);
    tissue_fini(&tissue);
}

static void the_file_is_what_is_made_today(void **state) {
    (void)state;
    static struct file made;
    static uint8_t kept[ROOM];
    make(&made);
    FILE *file = fopen(MESH_FILE, "rb");
    assert_non_null(file);
    size_t size = fread(kept, 1, sizeof kept, file);
    fclose(file);
    assert_int_equal(size, made.size);
    assert_memory_equal(kept, made.bytes, size);
}

static int write_file(void) {
    static struct file made;
    make(&made);
    FILE *file = fopen(MESH_FILE, "wb");
    if (!file)
        return 1;
    bool good = fwrite(made.bytes, 1, made.size, file) == made.size;
    return fclose(file) == 0 && good ? 0 : 1;
}

int main(int argc, char **argv) {
    if (argc == 2 && strcmp(argv[1], "write") == 0)
        return write_file();
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_file_is_what_is_made_today),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
