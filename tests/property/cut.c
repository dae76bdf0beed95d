// Whatever is cut, with whatever sequence of blades.

#include "cutting/bites.h"
#include "cutting/inside.h"
#include "cutting/specimens.h"
#include "cutting/trial.h"
#include "cutting/voxels.h"
#include "mesh/topology.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

#define SEEDS 4
#define CUTS 60

// What a sequence of bites does to a specimen, looked at after each.
typedef void look(struct trial *trial, struct biter *biter, void *context);

static void run(enum specimen specimen, uint64_t seed, int cuts, look *see, void *context) {
    struct mesh mesh;
    struct trial trial;
    struct biter *biter = malloc(sizeof *biter);
    specimen_make(specimen, &mesh);
    trial_init(&trial, &mesh);
    biter_init(biter, seed);
    for (int i = 0; i < cuts; i++) {
        biter_next(biter, trial.mesh);
        trial_cut(&trial, biter->last.parts, biter->last.part_count);
        if (trial.outcome == CUT_REFUSED)
            fail_msg("%s, seed %d, cut %d: refused: %s", specimen_name(specimen), (int)seed, i,
                     trial.err.text);
        if (trial.fault)
            fail_msg("%s, seed %d, cut %d: %s", specimen_name(specimen), (int)seed, i, trial.fault);
        see(&trial, biter, context);
    }
    free(biter);
    trial_fini(&trial);
    mesh_fini(&mesh);
}

static void run_all(look *see, void *context) {
    for (int specimen = 0; specimen < SPECIMENS; specimen++)
        for (uint64_t seed = 1; seed <= SEEDS; seed++)
            run((enum specimen)specimen, seed, CUTS, see, context);
}

// ---- what holds after each cut ------------------------------------------------------------------

struct counts {
    int cuts, changes, pieces, patches, of_kind[BITE_KINDS];
};

static void count(struct trial *trial, struct biter *biter, void *context) {
    struct counts *counts = context;
    counts->cuts++;
    counts->changes += trial->outcome == CUT_CHANGED;
    counts->of_kind[biter->kind] += trial->outcome == CUT_CHANGED;
    counts->pieces += trial->change.piece_count;
    counts->patches += trial->change.patch_count;
}

static void every_cut_leaves_one_closed_manifold_oriented_body_and_says_what_it_did(void **state) {
    (void)state;
    struct counts counts = {0};
    run_all(count, &counts);
    assert_true(counts.changes > counts.cuts / 3);
    assert_true(counts.patches >= counts.changes);
    assert_true(counts.pieces > 10);
    for (int kind = 0; kind < BITE_KINDS; kind++)
        assert_true(counts.of_kind[kind] > 5);
}

static void the_library_s_own_checker_agrees(void **state) {
    (void)state;
    struct mesh mesh, flat;
    struct trial trial;
    struct biter *biter = malloc(sizeof *biter);
    specimen_make(SPECIMEN_MENISCUS, &mesh);
    trial_init(&trial, &mesh);
    biter_init(biter, 5);
    for (int i = 0; i < 40; i++) {
        uint32_t *vertices, *triangles;
        biter_next(biter, trial.mesh);
        trial_cut(&trial, biter->last.parts, biter->last.part_count);
        cut_mesh_flatten(trial.mesh, &flat, &vertices, &triangles);
        struct topology topology = topology_of(&flat);
        assert_true(topology.closed && topology.manifold && topology.oriented);
        assert_int_equal(0, topology.unused_vertices);
        assert_int_equal(trial.now.triangle_count, flat.triangle_count);
        assert_int_equal(trial.now.vertex_count, flat.vertex_count);
        for (uint32_t t = 0; t < flat.triangle_count; t++)
            for (size_t k = 0; k < 3; k++)
                assert_int_equal(trial.now.triangles[3 * (size_t)triangles[t] + k],
                                 vertices[flat.triangles[3 * (size_t)t + k]]);
        for (uint32_t v = 0; v < flat.vertex_count; v++)
            assert_vec3_near(trial.now.vertices[vertices[v]], mesh_vertex(&flat, v), 1e-5);
        assert_near(snapshot_volume(&trial.now), cut_mesh_volume(trial.mesh), 1e-6);
        mesh_fini(&flat);
        free(vertices);
        free(triangles);
    }
    free(biter);
    trial_fini(&trial);
    mesh_fini(&mesh);
}

// ---- what is inside -----------------------------------------------------------------------------

static void hold_points(struct trial *trial, struct biter *biter, void *context) {
    struct random r = {(uint64_t)trial->now.triangle_count};
    const struct bite *bite = &biter->last;
    if (trial->outcome == CUT_CHANGED)
        assert_null(trial_points_fault(trial, bite->parts, bite->part_count, 30, &r, context));
}

static void what_is_left_is_what_the_blade_did_not_hold(void **state) {
    (void)state;
    int points = 0;
    run_all(hold_points, &points);
    assert_true(points > 5000);
}

struct deviations {
    double most;
    int count;
};

static void hold_volume(struct trial *trial, struct biter *biter, void *context) {
    struct random r = {7 + (uint64_t)trial->now.triangle_count};
    struct deviations *deviations = context;
    if (trial->outcome != CUT_CHANGED)
        return;
    struct locator *locator = locator_create(&trial->before);
    struct estimate common =
        estimate_common(locator, biter->last.parts, biter->last.part_count, 4000, &r);
    double sigmas = fabs(trial->change.removed_mm3 - common.volume) / common.sigma;
    deviations->most = fmax(deviations->most, sigmas);
    deviations->count++;
    locator_destroy(&locator);
}

// Of 500 estimates of which each may be off by 4.5 sigmas once in 150 000.
static void what_a_cut_says_it_removed_is_what_random_points_say(void **state) {
    (void)state;
    struct deviations deviations = {0};
    run_all(hold_volume, &deviations);
    assert_true(deviations.count > 300);
    assert_true(deviations.most < 4.5);
}

// ---- unions -------------------------------------------------------------------------------------

static double volume_left(const struct mesh *mesh, const struct bite *bite, bool at_once,
                          int *out_pieces) {
    struct trial trial;
    *out_pieces = 0;
    trial_init(&trial, mesh);
    for (int i = 0; i < (at_once ? 1 : bite->part_count); i++) {
        trial_cut(&trial, &bite->parts[i], at_once ? bite->part_count : 1);
        assert_true(trial.outcome != CUT_REFUSED);
        assert_null(trial.fault);
        *out_pieces += trial.change.piece_count;
    }
    double volume = cut_mesh_volume(trial.mesh);
    trial_fini(&trial);
    return volume;
}

static void parts_taken_at_once_are_parts_taken_one_after_the_other(void **state) {
    (void)state;
    struct random r = {11};
    struct mesh mesh;
    struct bite *bite = malloc(sizeof *bite);
    int compared = 0;
    specimen_make(SPECIMEN_SPHERE, &mesh);
    for (int round = 0; round < 60; round++) {
        vec3 centre = vec3_scale(random_between(&r, 4.5, 6.5), random_direction(&r));
        bite->part_count = 2 + round % (CUT_PARTS_MAX - 1);
        for (int i = 0; i < bite->part_count; i++)
            convex_random(&r, vec3_add(centre, random_in_box(&r, 1)), random_between(&r, 0.4, 1.2),
                          &bite->parts[i]);
        int pieces_at_once, pieces_after;
        double at_once = volume_left(&mesh, bite, true, &pieces_at_once);
        double after = volume_left(&mesh, bite, false, &pieces_after);
        if (pieces_at_once || pieces_after)
            continue;
        assert_near(at_once, after, 1e-3);
        compared++;
    }
    assert_true(compared > 40);
    free(bite);
    mesh_fini(&mesh);
}

// ---- the same again -----------------------------------------------------------------------------

static void assert_same_change(const struct cut_change *a, const struct cut_change *b) {
    assert_int_equal(a->number, b->number);
    assert_memory_equal(&a->removed_mm3, &b->removed_mm3, sizeof(double));
    assert_memory_equal(&a->volume_mm3, &b->volume_mm3, sizeof(double));
    assert_int_equal(a->retries, b->retries);
    assert_int_equal(a->freed_count, b->freed_count);
    assert_int_equal(a->made_count, b->made_count);
    assert_int_equal(a->vertex_count, b->vertex_count);
    assert_int_equal(a->patch_count, b->patch_count);
    assert_int_equal(a->piece_count, b->piece_count);
    for (uint32_t i = 0; i < a->made_count; i++)
        assert_int_equal(a->made[i], b->made[i]);
    for (int i = 0; i < a->patch_count; i++)
        assert_memory_equal(&a->patches[i], &b->patches[i], sizeof a->patches[i]);
    for (int i = 0; i < a->piece_count; i++)
        assert_memory_equal(&a->pieces[i].volume, &b->pieces[i].volume, sizeof(double));
}

static void assert_same_mesh(const struct cut_mesh *a, const struct cut_mesh *b) {
    struct snapshot surface_a, surface_b;
    snapshot_of_cut(a, &surface_a);
    snapshot_of_cut(b, &surface_b);
    assert_true(snapshot_equals(&surface_a, &surface_b));
    snapshot_fini(&surface_a);
    snapshot_fini(&surface_b);
}

// A second mesh is cut along with the first: from the start, or a copy made half-way.
static void cut_two(enum specimen specimen, int copy_at) {
    struct mesh mesh;
    struct error err;
    struct biter *biter = malloc(sizeof *biter);
    struct cut_mesh *first, *second;
    specimen_make(specimen, &mesh);
    assert_int_equal(RESULT_OK, cut_mesh_create(&mesh, &first, &err));
    assert_int_equal(RESULT_OK, cut_mesh_create(&mesh, &second, &err));
    biter_init(biter, 21);
    for (int i = 0; i < 2 * CUTS; i++) {
        struct cut_change a = {0}, b = {0};
        if (i == copy_at) {
            cut_mesh_destroy(&second);
            second = cut_mesh_copy(first);
        }
        biter_next(biter, first);
        const struct bite *bite = &biter->last;
        enum cut_outcome outcome = cut_apply(first, bite->parts, bite->part_count, &a, &err);
        if (i >= copy_at) {
            assert_int_equal(outcome, cut_apply(second, bite->parts, bite->part_count, &b, &err));
            assert_same_change(&a, &b);
            assert_same_mesh(first, second);
        }
        cut_change_fini(&a);
        cut_change_fini(&b);
    }
    cut_mesh_destroy(&first);
    cut_mesh_destroy(&second);
    free(biter);
    mesh_fini(&mesh);
}

static void the_same_cuts_give_the_same_bits(void **state) {
    (void)state;
    for (int specimen = 0; specimen < SPECIMENS; specimen++)
        cut_two((enum specimen)specimen, 0);
}

static void a_copy_goes_on_as_its_original_would(void **state) {
    (void)state;
    for (int specimen = 0; specimen < SPECIMENS; specimen++)
        cut_two((enum specimen)specimen, CUTS);
}

static void cutting_a_copy_leaves_the_original_alone(void **state) {
    (void)state;
    struct mesh mesh;
    struct trial trial;
    struct error err;
    struct biter *biter = malloc(sizeof *biter);
    specimen_make(SPECIMEN_TORUS, &mesh);
    trial_init(&trial, &mesh);
    struct cut_mesh *copy = cut_mesh_copy(trial.mesh);
    biter_init(biter, 8);
    for (int i = 0; i < 20; i++) {
        struct cut_change change = {0};
        biter_next(biter, copy);
        cut_apply(copy, biter->last.parts, biter->last.part_count, &change, &err);
        cut_change_fini(&change);
    }
    assert_true(cut_mesh_volume(copy) < cut_mesh_volume(trial.mesh) - 1);
    struct snapshot now;
    snapshot_of_cut(trial.mesh, &now);
    assert_true(snapshot_equals(&trial.now, &now));
    snapshot_fini(&now);
    cut_mesh_destroy(&copy);
    free(biter);
    trial_fini(&trial);
    mesh_fini(&mesh);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_cut_leaves_one_closed_manifold_oriented_body_and_says_what_it_did),
        cmocka_unit_test(the_library_s_own_checker_agrees),
        cmocka_unit_test(what_is_left_is_what_the_blade_did_not_hold),
        cmocka_unit_test(what_a_cut_says_it_removed_is_what_random_points_say),
        cmocka_unit_test(parts_taken_at_once_are_parts_taken_one_after_the_other),
        cmocka_unit_test(the_same_cuts_give_the_same_bits),
        cmocka_unit_test(a_copy_goes_on_as_its_original_would),
        cmocka_unit_test(cutting_a_copy_leaves_the_original_alone),
    };
    return cmocka_run_group_tests_name("cut", tests, NULL, NULL);
}
