// The same cuts near the origin and far from it: a scan may lie anywhere in its scanner's frame.

#include "cut/blade.h"
#include "cutting/inside.h"
#include "cutting/specimens.h"
#include "cutting/surface.h"
#include "random.h"
#include "test.h"

#define GRID_MM (1.0 / 1024) // floats up to 16 m have it
#define CUTS 25
#define SINK_MM 1e-4    // cleaning moves the surface by less, in an order of its own
#define VOLUME_MM3 1e-5 // and what a cut takes by less; all but one of 100 differ by less than 2e-8

static const vec3 places[] = {{1500, 0, 0}, {-900, 1200, 0}, {10000, 0, 0}, {6000, -4800, 6400}};

struct tissue {
    struct cut_mesh *mesh;
    vec3 at;
};

static struct tissue tissue_at(const struct mesh *shape, vec3 at) {
    struct tissue tissue = {.at = at};
    struct mesh moved;
    struct error err;
    mesh_copy(&moved, shape);
    for (uint32_t v = 0; v < moved.vertex_count; v++)
        mesh_set_vertex(&moved, v, vec3_add(mesh_vertex(shape, v), at));
    assert_int_equal(cut_mesh_create(&moved, &tissue.mesh, &err), RESULT_OK);
    mesh_fini(&moved);
    return tissue;
}

static void rounded_meniscus(struct mesh *out) {
    specimen_make(SPECIMEN_MENISCUS, out);
    for (size_t i = 0; i < 3 * (size_t)out->vertex_count; i++)
        out->positions[i] = (float)(GRID_MM * round((double)out->positions[i] / GRID_MM));
}

static struct blade_move next_move(struct random *r, const struct cut_mesh *mesh) {
    struct snapshot now;
    snapshot_of_cut(mesh, &now);
    uint32_t v;
    do
        v = (uint32_t)(random_bits(r) % now.vertex_bound);
    while (!now.vertex_alive[v]);
    pose from = {random_pose(r, 0).rotation, now.vertices[v]}, to = from;
    snapshot_fini(&now);
    to.translation = vec3_add(to.translation, random_in_box(r, 0.5));
    quat turn = quat_from_axis_angle(random_direction(r), random_between(r, 0, 0.05));
    to.rotation = quat_multiply(turn, to.rotation);
    int kind = (int)(random_bits(r) % (BLADE_KNIFE + 1));
    return (struct blade_move){kind, {from, to}, {1, 0.3}};
}

// The volume that went.
static double cut(const struct tissue *tissue, const struct blade_move *near_move,
                  enum cut_outcome *out_outcome) {
    struct blade_move move = *near_move;
    struct convex parts[CUT_PARTS_MAX];
    struct cut_change change = {0};
    struct error err;
    for (int i = 0; i < 2; i++)
        move.T_mesh_tip[i].translation = vec3_add(move.T_mesh_tip[i].translation, tissue->at);
    int count = blade_parts(instruments_usual(), &move, true, parts, &err);
    if (count < 0)
        fail_msg("%s", err.text);
    *out_outcome = cut_apply(tissue->mesh, parts, count, &change, &err);
    double removed = change.removed_mm3;
    cut_change_fini(&change);
    return removed;
}

static double farthest(const struct snapshot *from, vec3 shift, const struct snapshot *to) {
    double farthest = 0;
    for (uint32_t v = 0; v < from->vertex_bound; v += 3)
        if (from->vertex_alive[v])
            farthest = fmax(farthest, snapshot_distance(to, vec3_add(from->vertices[v], shift)));
    return farthest;
}

static void assert_same_surface(const struct tissue *here, const struct tissue *there) {
    struct snapshot a, b;
    snapshot_of_cut(here->mesh, &a);
    snapshot_of_cut(there->mesh, &b);
    assert_true(farthest(&a, there->at, &b) < SINK_MM);
    assert_true(farthest(&b, vec3_scale(-1, there->at), &a) < SINK_MM);
    snapshot_fini(&a);
    snapshot_fini(&b);
}

static void a_cut_is_the_same_wherever_the_knee_lies(void **state) {
    (void)state;
    struct mesh shape;
    rounded_meniscus(&shape);
    int cuts = 0;
    for (size_t k = 0; k < sizeof places / sizeof *places; k++) {
        struct tissue here = tissue_at(&shape, (vec3){0}), there = tissue_at(&shape, places[k]);
        struct random r = {k};
        for (int i = 0; i < CUTS; i++) {
            struct blade_move move = next_move(&r, here.mesh);
            enum cut_outcome near_outcome, far_outcome;
            double near_mm3 = cut(&here, &move, &near_outcome);
            double far_mm3 = cut(&there, &move, &far_outcome);
            assert_int_equal(near_outcome, far_outcome);
            assert_near(near_mm3, far_mm3, VOLUME_MM3);
            cuts += near_outcome == CUT_CHANGED;
        }
        assert_same_surface(&here, &there);
        cut_mesh_destroy(&here.mesh);
        cut_mesh_destroy(&there.mesh);
    }
    assert_true(cuts > 60);
    mesh_fini(&shape);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_cut_is_the_same_wherever_the_knee_lies),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
