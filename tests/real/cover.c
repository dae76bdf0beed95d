// Bone and cartilage of scanned knees as one outer surface: what is covered, and nothing else.
#include "import/cover.h"

#include "import/import.h"
#include "mesh/query.h"
#include "random.h"
#include "test.h"
#include "winding.h"

#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>

#define KNEE_A "knee_A_spl_left/"
#define KNEE_B "knee_B_smith2019_right/"
#define TRIALS 60

static struct error err;

static const char *data_folder(void) {
    const char *data = getenv("ARTHRON_DATA");
    return data ? data : DATA;
}

static void add_file(struct case_group *group, const char *file) {
    struct case_limits limits = case_limits_default();
    struct repair_report report;
    struct mesh mesh;
    char path[512], name[8];
    snprintf(path, sizeof path, "%s/%s", data_folder(), file);
    snprintf(name, sizeof name, "%d", group->part_count);
    struct import_source source = {path, 1, pose_identity(), NULL};
    assert_ok(import_mesh(&source, &limits, &mesh, &report, &err));
    assert_ok(case_add_part(group, name, &mesh, &err));
    mesh_fini(&mesh);
}

// Of a closed part, by solid angles.
static bool is_in_part(const struct case_group *group, int part, vec3 p) {
    struct mesh mesh = group->mesh;
    mesh.triangles += 3 * (size_t)group->parts[part].first_triangle;
    mesh.triangle_count = group->parts[part].triangle_count;
    return is_inside(&mesh, p);
}

static bool is_in_any(const struct case_group *group, int closed, int other_than, vec3 p) {
    bool inside = false;
    for (int i = 0; i < closed && !inside; i++)
        inside = i != other_than && is_in_part(group, i, p);
    return inside;
}

static double distance_to(const struct query *query, vec3 p) {
    struct closest closest;
    assert_true(query_closest(query, p, INFINITY, MESH_NONE, &closest));
    return closest.distance;
}

// closed: so many parts, the first ones. void_mm: how far a place in the void may be from a wall.
static void assert_distances(const struct case_group *group, const struct mesh *outer, int closed,
                             double void_mm) {
    struct query *whole, *left;
    struct random r = {3};
    assert_ok(query_create(&group->mesh, &whole, &err));
    assert_ok(query_create(outer, &left, &err));
    for (int looked = 0; looked < TRIALS;) {
        uint32_t v = (uint32_t)(random_bits(&r) % group->mesh.vertex_count);
        vec3 p = vec3_add(mesh_vertex(&group->mesh, v), random_in_box(&r, 6));
        double distance = distance_to(whole, p);
        if (distance < void_mm || is_in_any(group, closed, -1, p))
            continue;
        assert_near(distance_to(left, p), distance, 1e-9);
        looked++;
    }
    query_destroy(&whole);
    query_destroy(&left);
}

// Of triangles that are left: whether they lie deep in another closed part.
static double buried_share(const struct case_group *group, const struct mesh *outer) {
    struct random r = {5};
    int buried = 0;
    for (int i = 0; i < TRIALS; i++) {
        uint32_t t = (uint32_t)(random_bits(&r) % outer->triangle_count);
        uint32_t corner = outer->triangles[3 * (size_t)t];
        int own = 0;
        while (corner >= group->parts[own].first_vertex + group->parts[own].vertex_count)
            own++;
        vec3 a = mesh_corner(outer, t, 0), b = mesh_corner(outer, t, 1),
             c = mesh_corner(outer, t, 2);
        vec3 normal = vec3_unit_or(vec3_cross(vec3_sub(b, a), vec3_sub(c, a)), (vec3){0});
        vec3 middle = vec3_scale(1.0 / 3, vec3_add(a, vec3_add(b, c)));
        buried += is_in_any(group, group->part_count, own, vec3_add_scaled(middle, 0.5, normal));
    }
    return (double)buried / TRIALS;
}

static void bone_and_cartilage_have_one_outer_surface(void **state) {
    (void)state;
    struct case_group group = {.name = "patella"};
    struct mesh outer;
    add_file(&group, KNEE_A "bone_patella.ply");
    add_file(&group, KNEE_A "cartilage_patella.ply");
    assert_ok(cover_parts(&group, &err));
    case_group_surface(&group, &outer);
    assert_true(outer.triangle_count < group.mesh.triangle_count * 4 / 5);
    assert_distances(&group, &outer, 2, 0.6);
    assert_true(buried_share(&group, &outer) < 0.08);
    mesh_fini(&outer);
    mesh_fini(&group.mesh);
    free(group.covered);
}

// Knee B has the surface of its cartilage alone, up to 4 mm above the bone.
static void a_sheet_of_cartilage_covers_the_bone_below_it(void **state) {
    (void)state;
    struct case_group group = {.name = "tibia"};
    struct mesh outer;
    add_file(&group, KNEE_B "bone_tibia.ply");
    add_file(&group, KNEE_B "cartilage_tibia_open.ply");
    assert_ok(cover_parts(&group, &err));
    case_group_surface(&group, &outer);
    assert_true(outer.triangle_count < group.mesh.triangle_count * 19 / 20);
    assert_distances(&group, &outer, 1, 3);
    mesh_fini(&outer);
    mesh_fini(&group.mesh);
    free(group.covered);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bone_and_cartilage_have_one_outer_surface),
        cmocka_unit_test(a_sheet_of_cartilage_covers_the_bone_below_it),
    };
    struct stat status;
    char path[512];
    snprintf(path, sizeof path, "%s/" KNEE_A, data_folder());
    if (stat(path, &status) != 0) {
        printf("skipped: no folder %s (ARTHRON_DATA names where it may be)\n", data_folder());
        return 77;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
