// Whatever mesh comes: what repair may do and what it may not.

#include "import/repair.h"

#include "random.h"
#include "scene/shapes.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

static void turn(struct mesh *mesh, uint32_t t) {
    uint32_t *v = mesh->triangles + 3 * (size_t)t, second = v[1];
    v[1] = v[2];
    v[2] = second;
}

static struct repair_report repaired(struct mesh *mesh) {
    const struct repair_settings gentle = {.weld_mm = 0, .island_share = 0.02};
    struct repair_report report;
    struct error err;
    assert_true(repair_mesh(mesh, &gentle, &report));
    assert_int_equal(RESULT_OK, mesh_validate(mesh, &err));
    return report;
}

// Bumpy bodies that share vertices at random, with holes, turned and doubled triangles.
static void spoil(struct mesh *mesh, struct random *r) {
    uint32_t count = mesh->triangle_count;
    for (int i = 0; i < 12; i++) {
        uint32_t t = (uint32_t)(random_bits(r) % count), other = (uint32_t)(random_bits(r) % count);
        uint32_t *v = mesh->triangles + 3 * (size_t)t;
        uint32_t doubled[3] = {v[1], v[random_bits(r) % 2 ? 0 : 2], 0};
        doubled[2] = v[0] + v[1] + v[2] - doubled[0] - doubled[1];
        switch (random_bits(r) % 5) {
        case 0:
            turn(mesh, t);
            break;
        case 1:
            shape_add_triangles(mesh, 1, doubled);
            break;
        case 2: // a corner goes elsewhere
            v[random_bits(r) % 3] = mesh->triangles[3 * (size_t)other];
            break;
        case 3: // a hole
            v[0] = v[1];
            break;
        default: { // two vertices become one
            uint32_t from = v[0], to = mesh->triangles[3 * (size_t)other];
            for (size_t k = 0; k < 3 * (size_t)mesh->triangle_count; k++)
                if (mesh->triangles[k] == from)
                    mesh->triangles[k] = to;
        }
        }
    }
}

struct places {
    float at[9]; // three corners, the lowest first
};

static int compare_places(const void *a, const void *b) {
    return memcmp(a, b, sizeof(struct places));
}

static struct places *places_of(const struct mesh *mesh) {
    struct places *all = malloc((mesh->triangle_count + 1) * sizeof *all);
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        for (int i = 0; i < 3; i++)
            memcpy(all[t].at + 3 * i, mesh->positions + 3 * mesh->triangles[3 * t + (uint32_t)i],
                   12);
        for (int i = 0; i < 3; i++) {
            float low[3], *p = all[t].at + 3 * (i % 2);
            if (memcmp(p, p + 3, 12) > 0) {
                memcpy(low, p + 3, 12);
                memcpy(p + 3, p, 12);
                memcpy(p, low, 12);
            }
        }
    }
    qsort(all, mesh->triangle_count, sizeof *all, compare_places);
    return all;
}

static void
whatever_comes_nothing_is_moved_or_made_and_a_second_repair_finds_nothing(void **state) {
    (void)state;
    struct random r = {2026};
    for (int round = 0; round < 300; round++) {
        struct mesh mesh, other, again;
        struct repair_report report;
        shape_bumpy(&mesh, (vec3){20, 15, 12}, 2, 5, (uint64_t)round + 1);
        shape_box(&other, (vec3){2, 2, 2});
        shape_append(&mesh, &other);
        spoil(&mesh, &r);
        struct places *before = places_of(&mesh);
        uint32_t count = mesh.triangle_count;
        double area = mesh_area(&mesh);
        report = repaired(&mesh);
        assert_true(mesh_area(&mesh) <= area * (1 + 1e-12));
        assert_int_equal(count, mesh.triangle_count + report.repeated_corners +
                                    report.duplicate_triangles + report.wall_triangles +
                                    report.fin_triangles + report.island_triangles);
        struct places *after = places_of(&mesh);
        for (uint32_t i = 0; i < mesh.triangle_count; i++)
            assert_non_null(bsearch(&after[i], before, count, sizeof *before, compare_places));
        mesh_copy(&again, &mesh);
        report = repaired(&again);
        assert_int_equal(0, report.repeated_corners + report.wall_triangles + report.island_count);
        free(before);
        free(after);
        mesh_fini(&mesh);
        mesh_fini(&other);
        mesh_fini(&again);
    }
}

static void a_soup_of_anything_does_no_harm(void **state) {
    (void)state;
    for (uint64_t seed = 1; seed <= 40; seed++) {
        struct mesh mesh;
        struct repair_settings settings = {seed % 2 ? 2.0 : 0, 0.02};
        struct repair_report report;
        struct error err;
        shape_soup(&mesh, 10, 200, seed);
        if (repair_mesh(&mesh, &settings, &report))
            assert_int_equal(RESULT_OK, mesh_validate(&mesh, &err));
        assert_true(report.welded_mm <= settings.weld_mm);
        mesh_fini(&mesh);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(whatever_comes_nothing_is_moved_or_made_and_a_second_repair_finds_nothing),
        cmocka_unit_test(a_soup_of_anything_does_no_harm),
    };
    return cmocka_run_group_tests_name("repair_anything", tests, NULL, NULL);
}
