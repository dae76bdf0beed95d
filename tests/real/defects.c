// Meshes of scanned knees as they were published: what import finds, does and leaves.

#include "import/import.h"
#include "test.h"

#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>

#define KNEE_A "knee_A_spl_left/defective/asis_"
#define KNEE_B "knee_B_smith2019_right/"

static const char *data_folder(void) {
    const char *data = getenv("ARTHRON_DATA");
    return data ? data : DATA;
}

struct expected {
    const char *file;
    struct { // before
        uint32_t components, open, edges, vertices, flipped;
    } was;
    struct {
        uint32_t duplicates, walls, turned, split, islands;
    } did;
    struct {
        uint32_t components, open, edges, vertices, flipped;
        int64_t genus;
    } is;
    uint32_t triangles;
    double volume_mm3; // NAN: it is open
};

// Volumes are those of the knee's repaired meshes where there are such.
static const struct expected rows[] = {
    {KNEE_A "adductor_tendon.ply",
     {32, 0, 114, 1, 446},
     {19, 98, 953, 52, 53},
     {1, 0, 9, 0, 0, -1},
     19526,
     566.2},
    {KNEE_A "meniscus_lateral.ply",
     {2, 0, 1, 0, 0},
     {2, 0, 0, 0, 1},
     {1, 0, 0, 0, 0, 5},
     29542,
     1682.3},
    {KNEE_A "meniscus_medial.ply",
     {4, 0, 0, 0, 0},
     {0, 0, 0, 0, 3},
     {1, 0, 0, 0, 0, 0},
     36588,
     2154.9},
    {KNEE_A "middle_genicular_artery.ply",
     {1, 0, 10, 0, 7},
     {0, 12, 0, 4, 4},
     {1, 0, 0, 0, 0, 0},
     2276,
     37.04},
    {KNEE_A "popliteus_tendon.ply",
     {13, 0, 33, 0, 4},
     {6, 34, 0, 13, 20},
     {1, 0, 0, 0, 0, 2},
     17842,
     1084.5},
    {KNEE_A "sup_med_genicular_artery.ply",
     {3, 0, 32, 0, 140},
     {2, 34, 568, 13, 9},
     {2, 0, 2, 0, 0, -1},
     9968,
     75.5},
    {KNEE_B "bone_fibula_open.ply",
     {6, 15, 0, 0, 0},
     {0, 0, 0, 0, 5},
     {1, 0, 0, 0, 0, 0},
     6588,
     12366.8},
    {KNEE_B "cartilage_patella_open.ply", {1, 166, 0, 0, 0}, {0}, {1, 166, 0, 0, 0, -1}, 6052, NAN},
    {KNEE_B "cartilage_tibia_open.ply", {2, 300, 0, 0, 0}, {0}, {2, 300, 0, 0, 0, -1}, 8602, NAN},
    {KNEE_B "femur_articular_open.ply", {1, 443, 0, 0, 0}, {0}, {1, 443, 0, 0, 0, -1}, 19229, NAN},
    {KNEE_B "bone_femur_condyles_capped.ply",
     {1, 0, 0, 0, 0},
     {0},
     {1, 0, 0, 0, 0, 0},
     19672,
     50621.9},
};

static void assert_before(const struct expected *row, const struct topology *t) {
    assert_int_equal(row->was.components, t->components);
    assert_int_equal(row->was.open, t->open_edges);
    assert_int_equal(row->was.edges, t->non_manifold_edges);
    assert_int_equal(row->was.vertices, t->non_manifold_vertices);
    assert_int_equal(row->was.flipped, t->flipped_edges);
}

static void assert_after(const struct expected *row, const struct topology *t) {
    assert_int_equal(row->is.components, t->components);
    assert_int_equal(row->is.open, t->open_edges);
    assert_int_equal(row->is.edges, t->non_manifold_edges);
    assert_int_equal(row->is.vertices, t->non_manifold_vertices);
    assert_int_equal(row->is.flipped, t->flipped_edges);
    assert_int_equal(row->is.genus, t->genus);
}

static void defects_of_published_meshes_are_found_mended_and_named(void **state) {
    (void)state;
    struct case_limits limits = case_limits_default();
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        const struct expected *row = &rows[i];
        char path[512];
        struct mesh mesh;
        struct repair_report report;
        struct error err;
        snprintf(path, sizeof path, "%s/%s", data_folder(), row->file);
        struct import_source source = {path, 1, pose_identity(), NULL};
        printf("%s\n", row->file);
        if (import_mesh(&source, &limits, &mesh, &report, &err) != RESULT_OK)
            fail_msg("%s", err.text);
        assert_before(row, &report.before);
        assert_int_equal(row->did.duplicates, report.duplicate_triangles);
        assert_int_equal(row->did.walls, report.wall_triangles);
        assert_int_equal(row->did.turned, report.turned_triangles);
        assert_int_equal(row->did.split, report.split_vertices);
        assert_int_equal(row->did.islands, report.island_count);
        assert_after(row, &report.after);
        assert_int_equal(row->triangles, mesh.triangle_count);
        assert_int_equal(0, report.welded_vertices + report.repeated_corners + report.voids);
        if (!isnan(row->volume_mm3))
            assert_near(mesh_volume(&mesh), row->volume_mm3, 1e-3 * row->volume_mm3);
        mesh_fini(&mesh);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(defects_of_published_meshes_are_found_mended_and_named),
    };
    struct stat status;
    char path[512];
    snprintf(path, sizeof path, "%s/knee_A_spl_left/defective", data_folder());
    if (stat(path, &status) != 0) {
        printf("skipped: no folder %s (ARTHRON_DATA names where it may be)\n", data_folder());
        return 77;
    }
    return cmocka_run_group_tests_name("defects", tests, NULL, NULL);
}
