// How far the touched surface lies from the vertices of cut tissue, against every triangle in turn
// and the winding number.
#include "match/mismatch.h"

#include "cut/cut.h"
#include "cutting/inside.h"
#include "generate/tube.h"
#include "scene/brute.h"
#include "scene/shapes.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

#define BITES 6
#define NEAR_MM 1e-6 // a vertex so near the surface is on either side

// A meniscus that a few cuboids have bitten, and S' with smooth hills and hollows.
struct pair {
    struct mesh touched, tissue;
    uint32_t *ids, *triangle_ids;
    double *mm;
};

static struct convex cuboid(vec3 centre, quat turn, double half) {
    struct plane planes[6];
    struct convex convex;
    for (int i = 0; i < 6; i++) {
        vec3 axis = {i / 2 == 0, i / 2 == 1, i / 2 == 2};
        vec3 normal = quat_rotate(turn, vec3_scale(i % 2 ? 1 : -1, axis));
        planes[i] = (struct plane){normal, vec3_dot(normal, centre) + half};
    }
    struct error err;
    assert_ok(convex_create(planes, 6, &convex, &err));
    return convex;
}

static void measure(struct pair *p, const struct convex *clefts, int count) {
    struct mismatch_setting setting = {
        .touched = &p->touched, .tissue = &p->tissue, .clefts = clefts, .cleft_count = count};
    mismatch_at_vertices(&setting, p->ids, p->mm);
}

static struct pair pair_make(uint64_t seed) {
    struct pair p;
    struct random r = {seed};
    struct cut_mesh *cut;
    struct error err;
    assert_true(tube_meniscus(false, 2360, 1.2, &p.touched));
    assert_ok(cut_mesh_create(&p.touched, &cut, &err));
    for (int i = 0; i < BITES; i++) {
        vec3 at = mesh_vertex(&p.touched, (uint32_t)(random_bits(&r) % p.touched.vertex_count));
        struct convex bite = cuboid(at, random_pose(&r, 0).rotation, random_between(&r, 1.5, 3));
        struct cut_change change = {0};
        cut_apply(cut, &bite, 1, &change, &err);
        cut_change_fini(&change);
    }
    cut_mesh_flatten(cut, &p.tissue, &p.ids, &p.triangle_ids);
    cut_mesh_destroy(&cut);
    float *hills = shape_displacement(&p.touched, 0.3, seed);
    for (size_t i = 0; i < 3 * (size_t)p.touched.vertex_count; i++)
        if (p.touched.positions[i - i % 3 + 1] > 0) // the other half stays
            p.touched.positions[i] += hills[i];
    free(hills);
    p.mm = calloc(p.tissue.vertex_count, sizeof *p.mm);
    measure(&p, NULL, 0);
    return p;
}

static void pair_fini(struct pair *p) {
    mesh_fini(&p->touched);
    mesh_fini(&p->tissue);
    free(p->ids);
    free(p->triangle_ids);
    free(p->mm);
}

static void each_vertex_is_as_far_as_the_nearest_triangle_and_on_its_side(void **state) {
    (void)state;
    struct pair p = pair_make(1);
    struct snapshot touched;
    int inside = 0, outside = 0, on = 0;
    snapshot_of_mesh(&p.touched, &touched);
    for (uint32_t v = 0; v < p.tissue.vertex_count; v++) {
        vec3 at = mesh_vertex(&p.tissue, v);
        double distance = brute_distance(&p.touched, at);
        assert_near(fabs(p.mm[v]), distance, 1e-5);
        if (distance < NEAR_MM) {
            on++;
            continue;
        }
        bool is_inside = winding_inside(&touched, at);
        assert_true(is_inside ? p.mm[v] > 0 : p.mm[v] < 0);
        inside += is_inside;
        outside += !is_inside;
    }
    assert_true(inside > 50 && outside > 50 && on > 50);
    snapshot_fini(&touched);
    pair_fini(&p);
}

static void in_a_cleft_and_on_its_walls_nothing_is_told(void **state) {
    (void)state;
    struct pair p = pair_make(3);
    double *before = calloc(p.tissue.vertex_count, sizeof *before);
    memcpy(before, p.mm, p.tissue.vertex_count * sizeof *before);
    uint32_t worst = 0;
    for (uint32_t v = 0; v < p.tissue.vertex_count; v++)
        if (fabs(before[v]) > fabs(before[worst]))
            worst = v;
    // The vertex lies on a wall.
    double half = 2;
    vec3 wall = mesh_vertex(&p.tissue, worst);
    struct convex cleft = cuboid(vec3_add(wall, (vec3){half, 0, 0}), (quat){1, 0, 0, 0}, half);
    measure(&p, &cleft, 1);
    assert_near(p.mm[worst], 0, 0);
    for (uint32_t v = 0; v < p.tissue.vertex_count; v++) {
        vec3 d = vec3_sub(mesh_vertex(&p.tissue, v), vec3_add(wall, (vec3){half, 0, 0}));
        double beside = fmax(fabs(d.x), fmax(fabs(d.y), fabs(d.z))) - half;
        if (beside > 0.01)
            assert_near(p.mm[v], before[v], 0);
        else if (beside < 0)
            assert_near(p.mm[v], 0, 0);
    }
    free(before);
    pair_fini(&p);
}

static void what_is_far_is_told_as_the_reach(void **state) {
    (void)state;
    struct mesh touched, tissue;
    shape_sphere(&touched, 3, 6);
    mesh_copy(&tissue, &touched);
    for (uint32_t v = 0; v < tissue.vertex_count; v++)
        mesh_set_vertex(&tissue, v, vec3_add(mesh_vertex(&tissue, v), (vec3){40, 0, 0}));
    uint32_t *ids = calloc(tissue.vertex_count, sizeof *ids);
    double *mm = calloc(tissue.vertex_count, sizeof *mm);
    struct mismatch_setting setting = {.touched = &touched, .tissue = &tissue};
    mismatch_at_vertices(&setting, ids, mm);
    for (uint32_t v = 0; v < tissue.vertex_count; v++)
        assert_near(mm[v], -MISMATCH_REACH_MM, 0);
    free(ids);
    free(mm);
    mesh_fini(&touched);
    mesh_fini(&tissue);
}

// Whoever tells which triangles may be the same saves the columns over them, and changes no bit.
static void columns_over_what_is_the_same_tell_nothing(void **state) {
    (void)state;
    for (uint64_t seed = 1; seed < 6; seed++) {
        struct pair p = pair_make(seed);
        struct mismatch known, unknown;
        struct convex cleft = cuboid(mesh_vertex(&p.touched, 7), (quat){1, 0, 0, 0}, 3);
        struct mismatch_setting setting = {.touched = &p.touched,
                                           .tissue = &p.tissue,
                                           .clefts = &cleft,
                                           .cleft_count = seed % 2,
                                           .step_mm = 0.25};
        mismatch_measure(&setting, &unknown);
        setting.triangle_ids = p.triangle_ids;
        mismatch_measure(&setting, &known);
        assert_true(known.touched_mm3 > 1 && known.seen_mm3 > 1);
        assert_memory_equal(&known, &unknown, sizeof known);
        pair_fini(&p);
    }
}

static void the_same_mesh_differs_in_nothing(void **state) {
    (void)state;
    struct pair p = pair_make(1);
    struct mismatch m;
    uint32_t *ids = calloc(p.touched.triangle_count, sizeof *ids);
    for (uint32_t t = 0; t < p.touched.triangle_count; t++)
        ids[t] = t;
    mismatch_measure(
        &(struct mismatch_setting){
            .touched = &p.touched, .tissue = &p.touched, .step_mm = 0.25, .triangle_ids = ids},
        &m);
    assert_near(m.touched_mm3, 0, 0);
    assert_near(m.seen_mm3, 0, 0);
    free(ids);
    pair_fini(&p);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_vertex_is_as_far_as_the_nearest_triangle_and_on_its_side),
        cmocka_unit_test(in_a_cleft_and_on_its_walls_nothing_is_told),
        cmocka_unit_test(what_is_far_is_told_as_the_reach),
        cmocka_unit_test(columns_over_what_is_the_same_tell_nothing),
        cmocka_unit_test(the_same_mesh_differs_in_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
