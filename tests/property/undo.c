// Undoing cuts: the tissue, the touch and the figures are those from before, however it goes on.
#include "random.h"
#include "scene/hand.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>
#include <xxhash.h>

#define TISSUES 2

// ---- a state in full ----------------------------------------------------------------------------

static uint64_t mesh_print(const struct cut_mesh *mesh) {
    struct mesh flat;
    uint32_t *ids[2], *labels;
    cut_mesh_flatten(mesh, &flat, &ids[0], &ids[1]);
    labels = calloc(flat.triangle_count, sizeof *labels);
    for (uint32_t i = 0; i < flat.triangle_count; i++)
        labels[i] = cut_mesh_label(mesh, ids[1][i]);
    uint64_t hash = XXH3_64bits(flat.triangles, 3 * sizeof(uint32_t) * flat.triangle_count);
    for (uint32_t i = 0; i < flat.vertex_count; i++) {
        vec3 p = mesh_vertex(&flat, i);
        hash = XXH3_64bits_withSeed(&p, sizeof p, hash);
    }
    hash = XXH3_64bits_withSeed(ids[0], sizeof(uint32_t) * flat.vertex_count, hash);
    hash = XXH3_64bits_withSeed(ids[1], sizeof(uint32_t) * flat.triangle_count, hash);
    hash = XXH3_64bits_withSeed(labels, sizeof(uint32_t) * flat.triangle_count, hash);
    free(ids[0]);
    free(ids[1]);
    free(labels);
    mesh_fini(&flat);
    return hash;
}

// Meshes with their ids, blends, and figures but for the meshes' numbers.
struct print {
    uint64_t meshes[TISSUES], blends[TISSUES];
    struct tissue_figures figures[TISSUES];
};

static uint32_t surface_size(int tissue) {
    return scene_case(scene)->groups[scene_tissue_group(scene, tissue)].mesh.vertex_count;
}

static struct print print_of(const struct operation *operation) {
    struct print print;
    memset(&print, 0, sizeof print);
    for (int i = 0; i < TISSUES; i++) {
        const double *blends = match_blends(operation_match(operation, i));
        print.meshes[i] = mesh_print(operation_mesh(operation, i));
        print.blends[i] = XXH3_64bits(blends, surface_size(i) * sizeof *blends);
        print.figures[i] = *operation_figures(operation, i);
        print.figures[i].mesh_number = 0;
    }
    return print;
}

static void assert_same(const struct print *a, const struct print *b) {
    for (int i = 0; i < TISSUES; i++) {
        assert_true(a->meshes[i] == b->meshes[i]);
        assert_true(a->blends[i] == b->blends[i]);
        assert_memory_equal(&a->figures[i], &b->figures[i], sizeof a->figures[i]);
    }
}

// ---- an operation -------------------------------------------------------------------------------

// What a session knows of the blends, from results alone.
struct follower {
    double *blends[TISSUES];
    uint32_t mesh_number[TISSUES];
};

static void follow(struct follower *f, const struct operation *operation,
                   const struct job_result *result) {
    int t = result->tissue;
    for (uint32_t i = 0; i < result->blend_count; i++) {
        assert_true(i == 0 || result->vertices[i] > result->vertices[i - 1]);
        f->blends[t][result->vertices[i]] = result->blends[i];
    }
    assert_memory_equal(f->blends[t], match_blends(operation_match(operation, t)),
                        surface_size(t) * sizeof(double));
    assert_int_equal(result->figures.mesh_number,
                     f->mesh_number[t] + (result->outcome == JOB_DONE));
    f->mesh_number[t] = result->figures.mesh_number;
}

// A short way of a burr at the surface; every fourth is beside it.
static struct blade_move random_move(struct random *r, const struct cut_mesh *mesh) {
    uint32_t vertex;
    do
        vertex = (uint32_t)(random_bits(r) % cut_mesh_vertex_bound(mesh));
    while (!cut_mesh_vertex_alive(mesh, vertex));
    vec3 at = vec3_add(cut_mesh_vertex(mesh, vertex), random_in_box(r, 0.5));
    if (random_bits(r) % 4 == 0)
        at.z += 20;
    pose tip = {random_pose(r, 0).rotation, at};
    struct blade_move move = {.kind = BLADE_SHAVER, .T_mesh_tip = {tip, tip}};
    move.T_mesh_tip[1].translation = vec3_add(at, random_in_box(r, 0.3));
    return move;
}

static enum job_outcome run(struct operation *operation, struct follower *follower,
                            const struct job *job) {
    struct job_result *result = operation_run(operation, job);
    enum job_outcome outcome = result->outcome;
    assert_int_equal(result->kind, job->kind);
    if (follower)
        follow(follower, operation, result);
    job_result_destroy(&result);
    return outcome;
}

#define CUTS 90

// The cuts that stand, and the state before each.
struct past {
    struct job jobs[CUTS];
    struct print before[CUTS];
    int count;
};

static void cut(struct operation *operation, struct follower *follower, struct random *r,
                struct past *past) {
    struct job *job = &past->jobs[past->count];
    *job = (struct job){.id = 1, .kind = JOB_CUT, .tissue = (int)(random_bits(r) % TISSUES)};
    job->move = random_move(r, operation_mesh(operation, job->tissue));
    past->before[past->count] = print_of(operation);
    past->count += run(operation, follower, job) == JOB_DONE;
}

static void undo(struct operation *operation, struct follower *follower, struct past *past) {
    assert_int_equal(run(operation, follower, &(struct job){.id = 1, .kind = JOB_UNDO}), JOB_DONE);
    struct print now = print_of(operation);
    assert_same(&now, &past->before[--past->count]);
}

// Whoever only made the cuts that stand is in the same state.
static void assert_as_without_the_undone(const struct operation *operation,
                                         const struct past *past) {
    struct operation *other = operation_create(scene);
    for (int i = 0; i < past->count; i++)
        assert_int_equal(run(other, NULL, &past->jobs[i]), JOB_DONE);
    struct print a = print_of(operation), b = print_of(other);
    assert_same(&a, &b);
    operation_destroy(&other);
}

static struct follower follower_start(void) {
    struct follower f;
    for (int i = 0; i < TISSUES; i++) {
        f.blends[i] = calloc(surface_size(i), sizeof(double));
        f.mesh_number[i] = 1;
    }
    return f;
}

static void follower_end(struct follower *f) {
    for (int i = 0; i < TISSUES; i++)
        free(f->blends[i]);
}

// Two thirds of the way cuts, two undone in between now and then, then all of them undone.
static void undoing_leads_back_to_the_state_before_each_cut(void **state) {
    (void)state;
    struct random r = {7};
    struct past *past = calloc(1, sizeof *past);
    struct operation *operation = operation_create(scene);
    struct follower follower = follower_start();
    assert_int_equal(scene_tissue_count(scene), TISSUES);
    while (past->count < CUTS) {
        cut(operation, &follower, &r, past);
        for (int i = 0; past->count > 2 && random_bits(&r) % 6 == 0 && i < 2; i++)
            undo(operation, &follower, past);
    }
    assert_as_without_the_undone(operation, past);
    while (past->count > 0)
        undo(operation, &follower, past);
    assert_int_equal(run(operation, &follower, &(struct job){.id = 1, .kind = JOB_UNDO}),
                     JOB_NOTHING);
    cut(operation, &follower, &r, past);
    operation_destroy(&operation);
    follower_end(&follower);
    free(past);
}

static void what_was_restored_is_not_undone(void **state) {
    (void)state;
    struct random r = {8};
    struct past *past = calloc(1, sizeof *past);
    struct operation *operation = operation_create(scene);
    int of[TISSUES] = {0};
    while (of[0] < 2 || of[1] < 2) {
        int before = past->count;
        cut(operation, NULL, &r, past);
        of[past->jobs[before].tissue] += past->count - before;
    }
    run(operation, NULL, &(struct job){.id = 1, .kind = JOB_RESTORE});
    uint64_t whole = mesh_print(operation_mesh(operation, 0));
    for (int i = 0; i < of[1]; i++)
        assert_int_equal(run(operation, NULL, &(struct job){.id = 1, .kind = JOB_UNDO}), JOB_DONE);
    assert_int_equal(run(operation, NULL, &(struct job){.id = 1, .kind = JOB_UNDO}), JOB_NOTHING);
    assert_true(mesh_print(operation_mesh(operation, 0)) == whole);
    assert_int_equal(operation_figures(operation, 1)->cuts, 0);
    operation_destroy(&operation);
    free(past);
}

// ---- a session ----------------------------------------------------------------------------------

static struct landed undo_by_hand(struct hand *h) {
    give(h, INPUT_UNDO, 0, NULL);
    run_job(h);
    assert_int_equal(h->out.job.kind, JOB_UNDO);
    return land(h);
}

static void a_session_takes_back_one_cut_after_the_other(void **state) {
    (void)state;
    struct hand h = hand_start();
    struct landed last = bite(&h);
    assert_true(last.figures.cuts >= 3);
    for (uint32_t left = last.figures.cuts; left-- > 0;) {
        struct landed landed = undo_by_hand(&h);
        assert_int_equal(landed.outcome, JOB_DONE);
        assert_int_equal(landed.figures.cuts, left);
        assert_int_equal(h.out.events & (EVENT_UNDONE | EVENT_CUT), EVENT_UNDONE);
    }
    assert_near(h.out.landed.figures.removed_mm3, 0, 0);
    assert_int_equal(undo_by_hand(&h).outcome, JOB_NOTHING);
    assert_int_equal(h.out.events & EVENT_UNDONE, 0);
    assert_true(bite(&h).figures.cuts >= 3);
    hand_end(&h);
}

// It lands, and is what is taken back; as often as was asked for.
static void a_cut_that_is_on_its_way_is_the_last(void **state) {
    (void)state;
    struct hand h = hand_start();
    uint32_t cuts = bite(&h).figures.cuts;
    h.opening = 1;
    step(&h);
    h.tip = vec3_add_scaled(h.tip, 1, outward);
    step(&h);
    close_to_job(&h);
    for (int i = 0; i < 2; i++) {
        give(&h, INPUT_UNDO, 0, NULL);
        assert_int_equal(h.out.job.id, 0);
    }
    assert_int_equal(land(&h).figures.cuts, cuts + 1);
    assert_int_equal(h.out.job.kind, JOB_UNDO);
    assert_int_equal(land(&h).figures.cuts, cuts);
    assert_int_equal(h.out.job.kind, JOB_UNDO);
    assert_int_equal(land(&h).figures.cuts, cuts - 1);
    hand_end(&h);
}

static void a_reset_forgets_what_was_to_be_undone(void **state) {
    (void)state;
    struct hand h = hand_start();
    bite(&h);
    h.opening = 1;
    step(&h);
    close_to_job(&h);
    give(&h, INPUT_UNDO, 0, NULL);
    give(&h, INPUT_RESET, 0, NULL);
    land(&h);
    assert_int_equal(h.out.job.kind, JOB_RESTORE);
    assert_int_equal(land(&h).figures.cuts, 0);
    assert_int_equal(h.out.job.id, 0);
    assert_int_equal(undo_by_hand(&h).outcome, JOB_NOTHING);
    hand_end(&h);
}

static void a_paused_session_can_be_set_back(void **state) {
    (void)state;
    struct hand h = hand_start();
    uint32_t cuts = bite(&h).figures.cuts;
    give(&h, INPUT_PAUSE, 0, NULL);
    assert_int_equal(undo_by_hand(&h).figures.cuts, cuts - 1);
    assert_int_equal(h.out.state, SESSION_PAUSED);
    give(&h, INPUT_STOP, 0, NULL);
    give(&h, INPUT_UNDO, 0, NULL);
    assert_int_equal(h.out.job.id, 0);
    hand_end(&h);
}

static vec3 displacement(const struct hand *h) {
    return h->out.instruments[0].warp.displacement;
}

// A hand that rests where the tissue comes back feels it come no faster than it may, and all of it.
static void the_touch_comes_back_without_a_jump(void **state) {
    (void)state;
    struct hand h = hand_start();
    double floor_mm = session_settings_default().ease_mm_s * STEP_NS / NS_PER_S;
    uint32_t cuts = bite(&h).figures.cuts;
    h.probe_is_there = true;
    h.probe = inner;
    for (int i = 0; i < 3000; i++)
        step(&h);
    vec3 last = displacement(&h);
    assert_true(vec3_length(last) > 0.2);
    while (cuts-- > 0)
        undo_by_hand(&h);
    for (int i = 0; i < 4000; i++) {
        step(&h);
        if (i)
            assert_true(vec3_distance(displacement(&h), last) <= floor_mm * (1 + 1e-9));
        last = displacement(&h);
    }
    assert_near(vec3_length(last), 0, 1e-6);
    hand_end(&h);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(undoing_leads_back_to_the_state_before_each_cut),
        cmocka_unit_test(what_was_restored_is_not_undone),
        cmocka_unit_test(a_session_takes_back_one_cut_after_the_other),
        cmocka_unit_test(a_cut_that_is_on_its_way_is_the_last),
        cmocka_unit_test(a_reset_forgets_what_was_to_be_undone),
        cmocka_unit_test(a_paused_session_can_be_set_back),
        cmocka_unit_test(the_touch_comes_back_without_a_jump),
    };
    return cmocka_run_group_tests_name("undo", tests, hand_make_scene, hand_drop_scene);
}
