// Changes of meshes as bytes, and meshes that are kept by them, beside a plain model. Every input
// lies in memory of just its size.
#include "test.h"
#include "wire/mesh_model.h"

#include <stdlib.h>
#include <string.h>

#define BYTES 100000

// ---- changes that are good ----------------------------------------------------------------------

static enum result apply(struct tissue *tissue, const struct mesh_delta *delta) {
    struct error err = {0};
    struct mesh_bytes bytes = mesh_bytes_of(delta);
    enum result result = tissue_apply(tissue, bytes.data, bytes.size, &err);
    free(bytes.data);
    if (result != RESULT_OK)
        print_message("%s\n", err.text);
    return result;
}

static void assert_same_piece(const struct delta_piece *a, const struct delta_piece *b) {
    assert_memory_equal(&a->volume_mm3, &b->volume_mm3, 16);
    assert_int_equal(a->vertex_count, b->vertex_count);
    assert_int_equal(a->triangle_count, b->triangle_count);
    assert_memory_equal(a->positions, b->positions, 12 * a->vertex_count);
    assert_memory_equal(a->triangles, b->triangles, 12 * a->triangle_count);
}

static void a_change_is_the_same_behind_the_wire(void **state) {
    (void)state;
    static struct model model;
    struct random random = {1};
    for (uint32_t i = 0; i < 100; i++) {
        struct mesh_delta delta = model_change(&model, &random, 0.2, i), back;
        struct mesh_bytes bytes = mesh_bytes_of(&delta);
        size_t used;
        assert_int_equal(mesh_delta_decode(bytes.data, bytes.size, &used, &back, NULL), RESULT_OK);
        assert_int_equal(used, bytes.size);
        assert_int_equal(back.base, delta.base);
        assert_int_equal(back.number, delta.number);
        assert_int_equal(back.hash, delta.hash);
        assert_int_equal(back.freed_count, delta.freed_count);
        assert_memory_equal(back.freed, delta.freed, 4 * delta.freed_count);
        assert_int_equal(back.vertex_count, delta.vertex_count);
        assert_memory_equal(back.vertices, delta.vertices, 16 * delta.vertex_count);
        assert_int_equal(back.made_count, delta.made_count);
        assert_memory_equal(back.made, delta.made, 20 * delta.made_count);
        assert_int_equal(back.piece_count, delta.piece_count);
        for (uint32_t k = 0; k < delta.piece_count; k++)
            assert_same_piece(&back.pieces[k], &delta.pieces[k]);
        mesh_delta_fini(&delta);
        mesh_delta_fini(&back);
        free(bytes.data);
    }
}

static void a_tissue_follows_a_model_through_random_changes(void **state) {
    (void)state;
    for (uint64_t seed = 0; seed < 20; seed++) {
        struct model model = {0};
        struct random random = {seed};
        struct tissue tissue = {0};
        for (uint32_t i = 0; i < 60; i++) {
            struct mesh_delta delta = model_change(&model, &random, 0.2, i);
            assert_int_equal(apply(&tissue, &delta), RESULT_OK);
            assert_int_equal(tissue.number, i + 1);
            model_assert_same(&tissue, &model);
            mesh_delta_fini(&delta);
        }
        tissue_fini(&tissue);
    }
}

// With the same change a model and a tissue `count` changes old.
static void grow(struct model *model, struct tissue *tissue, uint32_t count) {
    struct random random = {count};
    *model = (struct model){0};
    *tissue = (struct tissue){0};
    for (uint32_t i = 0; i < count; i++) {
        struct mesh_delta delta = model_change(model, &random, 0.2, i);
        assert_int_equal(apply(tissue, &delta), RESULT_OK);
        mesh_delta_fini(&delta);
    }
}

static void a_whole_mesh_takes_the_place_of_whatever_was_there(void **state) {
    (void)state;
    struct model model, other;
    struct tissue tissue, late;
    struct mesh_delta whole;
    grow(&other, &late, 5);
    grow(&model, &tissue, 20);
    tissue_whole(&tissue, &whole);
    assert_int_equal(whole.base, 0);
    assert_int_equal(apply(&late, &whole), RESULT_OK);
    assert_int_equal(late.number, 20);
    model_assert_same(&late, &model);
    mesh_delta_fini(&whole);
    tissue_fini(&late);
    tissue_fini(&tissue);
}

static void a_copy_is_equal_and_its_own(void **state) {
    (void)state;
    struct model model, before;
    struct tissue tissue, copy;
    struct random random = {3};
    grow(&model, &tissue, 10);
    before = model;
    tissue_copy(&copy, &tissue);
    struct mesh_delta delta = model_change(&model, &random, 0.2, 10);
    assert_int_equal(apply(&tissue, &delta), RESULT_OK);
    model_assert_same(&tissue, &model);
    model_assert_same(&copy, &before);
    assert_int_equal(copy.number, 10);
    mesh_delta_fini(&delta);
    tissue_fini(&tissue);
    tissue_fini(&copy);
}

static void several_changes_travel_in_one_payload(void **state) {
    (void)state;
    static uint8_t payload[BYTES];
    size_t used = 0;
    struct model model;
    struct tissue tissue;
    struct random random = {7};
    grow(&model, &tissue, 4);
    for (uint32_t i = 4; i < 9; i++) {
        struct mesh_delta delta = model_change(&model, &random, 0.2, i);
        used += mesh_delta_encode(&delta, payload + used, sizeof payload - used);
        mesh_delta_fini(&delta);
    }
    uint8_t *exact = malloc(used);
    memcpy(exact, payload, used);
    assert_int_equal(tissue_apply(&tissue, exact, used, NULL), RESULT_OK);
    assert_int_equal(tissue.number, 9);
    model_assert_same(&tissue, &model);
    free(exact);
    tissue_fini(&tissue);
}

static void after_a_gap_the_tissue_is_as_before(void **state) {
    (void)state;
    struct model model, ahead;
    struct tissue tissue;
    struct random random = {11};
    grow(&model, &tissue, 6);
    ahead = model;
    static const uint32_t bases[] = {5, 7, 4000000000};
    for (size_t i = 0; i < sizeof bases / sizeof *bases; i++) {
        struct mesh_delta delta = model_change(&ahead, &random, 0.2, bases[i]);
        assert_int_equal(apply(&tissue, &delta), RESULT_MISSING);
        assert_int_equal(tissue.number, 6);
        model_assert_same(&tissue, &model);
        mesh_delta_fini(&delta);
    }
    tissue_fini(&tissue);
}

// ---- what contradicts the mesh ------------------------------------------------------------------

// Two triangles, 2 and 5, over the vertices 1, 3, 4, 6; number 1.
static void two_triangles(struct tissue *out) {
    struct delta_vertex vertices[] = {
        {1, {0, 0, 0}}, {3, {1, 0, 0}}, {4, {0, 1, 0}}, {6, {1, 1, 0}}};
    struct delta_triangle made[] = {{2, {1, 3, 4}, 0}, {5, {3, 6, 4}, 0}};
    struct mesh_delta delta = {
        .number = 1, .vertex_count = 4, .vertices = vertices, .made_count = 2, .made = made};
    *out = (struct tissue){0};
    assert_int_equal(tissue_change(out, &delta, NULL), RESULT_OK);
}

struct contradiction {
    const char *text; // of the error; NULL: the change is good
    uint32_t freed, vertex;
    struct delta_triangle made;
};

#define NONE 99

static void what_contradicts_the_mesh_is_refused_and_nothing_is_left(void **state) {
    (void)state;
    static const struct contradiction rows[] = {
        {NULL, 2, NONE, {NONE, {0}, 0}},
        {"frees triangle 3, which is not alive", 3, NONE, {NONE, {0}, 0}},
        {"frees triangle 6, which is not alive", 6, NONE, {NONE, {0}, 0}},
        {NULL, NONE, NONE, {2, {1, 4, 3}, 7}},
        {NULL, NONE, NONE, {3, {1, 4, 3}, 7}},
        {NULL, 2, NONE, {3, {1, 4, 3}, 7}}, // vertex 1 loses one triangle and gets another
        {"triangle 3 has corner 0, which is not alive", NONE, NONE, {3, {0, 4, 3}, 0}},
        {"triangle 3 has corner 5, which is not alive", NONE, NONE, {3, {3, 4, 5}, 0}},
        {"triangle 3 has corner 7, which is not alive", NONE, NONE, {3, {3, 7, 4}, 0}},
        {NULL, NONE, 7, {3, {3, 7, 4}, 0}},
        {"new vertex 4 has the id of a living one", NONE, 4, {3, {3, 1, 4}, 0}},
        {NULL, 2, 1, {3, {3, 1, 4}, 0}}, // vertex 1 is gone, and another has its id
        {"new vertex 1 has the id of a living one", 5, 1, {3, {3, 1, 4}, 0}},
        {"new vertex 9 has no triangle", NONE, 9, {3, {3, 1, 4}, 0}},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct contradiction row = rows[i];
        struct delta_vertex vertex = {row.vertex, {5, 5, 5}};
        struct mesh_delta delta = {.base = 1,
                                   .number = 2,
                                   .freed_count = row.freed != NONE,
                                   .freed = &row.freed,
                                   .vertex_count = row.vertex != NONE,
                                   .vertices = &vertex,
                                   .made_count = row.made.id != NONE,
                                   .made = &row.made};
        struct tissue tissue;
        struct error err = {0};
        two_triangles(&tissue);
        enum result result = tissue_change(&tissue, &delta, &err);
        assert_int_equal(result, row.text ? RESULT_INVALID : RESULT_OK);
        assert_int_equal(tissue.number, row.text ? 0 : 2);
        assert_non_null(strstr(err.text, row.text ? row.text : ""));
        if (row.text)
            assert_null(tissue.corners);
        tissue_fini(&tissue);
    }
}

static void a_wrong_hash_is_refused_and_nothing_is_left(void **state) {
    (void)state;
    struct model model;
    struct tissue tissue;
    struct random random = {5};
    grow(&model, &tissue, 3);
    struct mesh_delta delta = model_change(&model, &random, 0.2, 3);
    delta.hash++;
    assert_int_equal(apply(&tissue, &delta), RESULT_CORRUPT);
    assert_int_equal(tissue.number, 0);
    assert_int_equal(tissue.triangle_count, 0);
    mesh_delta_fini(&delta);
    tissue_fini(&tissue);
}

// ---- bytes that were harmed ---------------------------------------------------------------------

static void every_change_that_is_cut_short_is_refused(void **state) {
    (void)state;
    struct model model = {0};
    struct random random = {9};
    struct mesh_delta delta = model_change(&model, &random, 0.2, 0);
    struct mesh_bytes bytes = mesh_bytes_of(&delta);
    for (size_t size = 1; size < bytes.size; size++) {
        struct tissue tissue;
        two_triangles(&tissue);
        uint8_t *exact = malloc(size);
        memcpy(exact, bytes.data, size);
        assert_int_equal(tissue_apply(&tissue, exact, size, NULL), RESULT_FORMAT);
        assert_int_equal(tissue.number, 0);
        free(exact);
        tissue_fini(&tissue);
    }
    free(bytes.data);
    mesh_delta_fini(&delta);
}

// Numbers and pieces are none of the mesh: what is left of a flip there is for the payload's hash.
static void no_flipped_bit_makes_another_mesh(void **state) {
    (void)state;
    struct model model = {0};
    struct random random = {13};
    struct mesh_delta delta = model_change(&model, &random, 0.2, 0);
    struct mesh_bytes bytes = mesh_bytes_of(&delta);
    int refused = 0;
    for (size_t bit = 0; bit < 8 * bytes.size; bit++) {
        struct tissue tissue = {0};
        bytes.data[bit / 8] ^= (uint8_t)(1 << bit % 8);
        if (tissue_apply(&tissue, bytes.data, bytes.size, NULL) == RESULT_OK)
            model_assert_same(&tissue, &model);
        else
            refused++;
        bytes.data[bit / 8] ^= (uint8_t)(1 << bit % 8);
        tissue_fini(&tissue);
    }
    assert_true(refused > (int)bytes.size);
    free(bytes.data);
    mesh_delta_fini(&delta);
}

// ---- size ---------------------------------------------------------------------------------------

#define SIDE 100 // squares of a sheet, each two triangles

static struct mesh_delta sheet(void) {
    struct mesh_delta whole = {.number = 1,
                               .vertices = calloc((SIDE + 1) * (SIDE + 1), sizeof *whole.vertices),
                               .made = calloc(2 * SIDE * SIDE, sizeof *whole.made)};
    for (uint32_t y = 0; y <= SIDE; y++)
        for (uint32_t x = 0; x <= SIDE; x++, whole.vertex_count++)
            whole.vertices[whole.vertex_count] = (struct delta_vertex){
                whole.vertex_count, {0.31f * (float)x, 0.29f * (float)y, sinf((float)(x * y))}};
    for (uint32_t y = 0; y < SIDE; y++)
        for (uint32_t x = 0; x < SIDE; x++) {
            uint32_t a = y * (SIDE + 1) + x, b = a + 1, c = a + SIDE + 1, d = c + 1;
            struct delta_triangle *made = &whole.made[whole.made_count];
            made[0] = (struct delta_triangle){whole.made_count, {a, b, c}, 0};
            made[1] = (struct delta_triangle){whole.made_count + 1, {b, d, c}, 0};
            whole.made_count += 2;
        }
    return whole;
}

// A hole of 10 by 12 squares, and a bowl of 200 new vertices and 300 triangles in its place.
static struct mesh_delta bite(void) {
    struct mesh_delta delta = {.base = 1,
                               .number = 2,
                               .freed = calloc(240, sizeof *delta.freed),
                               .vertices = calloc(200, sizeof *delta.vertices),
                               .made = calloc(300, sizeof *delta.made)};
    uint32_t first = 40 * (SIDE + 1) + 40, bowl = (SIDE + 1) * (SIDE + 1);
    for (uint32_t y = 40; y < 50; y++)
        for (uint32_t x = 40; x < 52; x++)
            for (uint32_t k = 0; k < 2; k++)
                delta.freed[delta.freed_count++] = 2 * (y * SIDE + x) + k;
    for (; delta.vertex_count < 200; delta.vertex_count++)
        delta.vertices[delta.vertex_count] = (struct delta_vertex){
            bowl + delta.vertex_count, {13, 14, cosf((float)delta.vertex_count)}};
    for (uint32_t i = 0; i < 300; i++) {
        uint32_t a = i % 3 ? bowl + (i + 1) % 200 : first + i / 12 * (SIDE + 1);
        delta.made[delta.made_count++] = (struct delta_triangle){
            2 * SIDE * SIDE + i, {bowl + i % 200, a, bowl + (i * 7 + 3) % 200}, 1};
    }
    return delta;
}

static void a_bite_takes_less_than_three_percent_of_the_whole(void **state) {
    (void)state;
    struct mesh_delta whole = sheet(), change = bite();
    struct tissue tissue = {0};
    assert_int_equal(tissue_change(&tissue, &whole, NULL), RESULT_OK);
    assert_int_equal(tissue.triangle_count, 20000);
    struct mesh_bytes all = mesh_bytes_of(&whole), part = mesh_bytes_of(&change);
    struct error err = {0};
    if (tissue_change(&tissue, &change, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    print_message("whole %zu bytes, bite %zu bytes\n", all.size, part.size);
    assert_true(part.size * 100 < all.size * 3);
    free(all.data);
    free(part.data);
    mesh_delta_fini(&whole);
    mesh_delta_fini(&change);
    tissue_fini(&tissue);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_change_is_the_same_behind_the_wire),
        cmocka_unit_test(a_tissue_follows_a_model_through_random_changes),
        cmocka_unit_test(a_whole_mesh_takes_the_place_of_whatever_was_there),
        cmocka_unit_test(a_copy_is_equal_and_its_own),
        cmocka_unit_test(several_changes_travel_in_one_payload),
        cmocka_unit_test(after_a_gap_the_tissue_is_as_before),
        cmocka_unit_test(what_contradicts_the_mesh_is_refused_and_nothing_is_left),
        cmocka_unit_test(a_wrong_hash_is_refused_and_nothing_is_left),
        cmocka_unit_test(every_change_that_is_cut_short_is_refused),
        cmocka_unit_test(no_flipped_bit_makes_another_mesh),
        cmocka_unit_test(a_bite_takes_less_than_three_percent_of_the_whole),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
