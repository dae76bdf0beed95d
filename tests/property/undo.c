// Undoing strokes: the tissue, the touch and the figures are those from before, however it goes on.
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

// Meshes with their ids, touched surfaces, and figures but for the meshes' numbers and what was
// refused.
struct print {
    uint64_t meshes[TISSUES], touches[TISSUES];
    struct tissue_figures figures[TISSUES];
};

static uint32_t surface_size(int tissue) {
    return scene_case(scene)->groups[scene_tissue_group(scene, tissue)].mesh.vertex_count;
}

#define TOUCH_WIDTH 3

// Offsets, or blends with two zeros; the caller frees them.
static double *touch_of(const struct operation *operation, int tissue) {
    double *touch = calloc(TOUCH_WIDTH * (size_t)surface_size(tissue), sizeof *touch);
    for (uint32_t v = 0; v < surface_size(tissue); v++)
        operation_touch(operation, tissue, v, touch + TOUCH_WIDTH * (size_t)v);
    return touch;
}

static struct print print_of(const struct operation *operation) {
    struct print print;
    memset(&print, 0, sizeof print);
    for (int i = 0; i < TISSUES; i++) {
        double *touch = touch_of(operation, i);
        print.meshes[i] = mesh_print(operation_mesh(operation, i));
        print.touches[i] = XXH3_64bits(touch, TOUCH_WIDTH * surface_size(i) * sizeof *touch);
        free(touch);
        print.figures[i] = *operation_figures(operation, i);
        print.figures[i].mesh_number = print.figures[i].refused = 0;
    }
    return print;
}

static void assert_same(const struct print *a, const struct print *b) {
    for (int i = 0; i < TISSUES; i++) {
        assert_true(a->meshes[i] == b->meshes[i]);
        assert_true(a->touches[i] == b->touches[i]);
        assert_memory_equal(&a->figures[i], &b->figures[i], sizeof a->figures[i]);
    }
}

// ---- an operation -------------------------------------------------------------------------------

// What a session knows of the touched surfaces, from results alone.
struct follower {
    double *touches[TISSUES];
    uint32_t mesh_number[TISSUES], refused[TISSUES];
};

static void follow(struct follower *f, const struct operation *operation,
                   const struct job_result *result) {
    int t = result->tissue;
    const struct touch_change *change = &result->touch;
    for (uint32_t i = 0; i < change->count; i++) {
        assert_true(i == 0 || change->vertices[i] > change->vertices[i - 1]);
        memcpy(f->touches[t] + TOUCH_WIDTH * (size_t)change->vertices[i],
               change->values + (size_t)change->width * i, (size_t)change->width * sizeof(double));
    }
    double *touch = touch_of(operation, t);
    assert_memory_equal(f->touches[t], touch, TOUCH_WIDTH * surface_size(t) * sizeof *touch);
    free(touch);
    assert_int_equal(result->figures.mesh_number,
                     f->mesh_number[t] + (result->outcome == JOB_DONE));
    f->mesh_number[t] = result->figures.mesh_number;
    assert_true(result->figures.refused >= f->refused[t]);
    f->refused[t] = result->figures.refused;
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
    struct blade_move move = {.blade = BLADE_SHAVER, .T_mesh_tip = {tip, tip}};
    move.T_mesh_tip[1].translation = vec3_add(at, random_in_box(r, 0.3));
    return move;
}

struct ran {
    enum job_outcome outcome;
    bool more;
    uint32_t cuts_back;
    double mm3_back;
};

static struct ran run(struct operation *operation, struct follower *follower,
                      const struct job *job) {
    struct job_result *result = operation_run(operation, job);
    struct ran ran = {result->outcome, result->more, result->cuts_back, result->mm3_back};
    assert_int_equal(result->kind, job->kind);
    if (follower)
        follow(follower, operation, result);
    job_result_destroy(&result);
    return ran;
}

static struct ran run_undo(struct operation *operation, struct follower *follower) {
    return run(operation, follower, &(struct job){.id = 1, .kind = JOB_UNDO});
}

#define CUTS 70

// The cuts that stand, and the state before each.
struct past {
    struct job jobs[CUTS];
    struct print before[CUTS];
    int count;
};

// Of the stroke before, of a new one, or, as another instrument's, of the one before that.
static uint32_t random_stroke(struct random *r, const struct past *past) {
    uint64_t chance = random_bits(r) % 12;
    uint32_t last = past->count ? past->jobs[past->count - 1].stroke : 0;
    if (chance == 0 && last > 1)
        return last - 1;
    return chance < 3 || !last ? 1 + (uint32_t)(random_bits(r) >> 33) : last;
}

static void cut(struct operation *operation, struct follower *follower, struct random *r,
                struct past *past) {
    struct job *job = &past->jobs[past->count];
    *job = (struct job){.id = 1, .kind = JOB_CUT, .tissue = (int)(random_bits(r) % TISSUES)};
    job->stroke = random_stroke(r, past);
    job->move_count = 1;
    job->moves[0] = random_move(r, operation_mesh(operation, job->tissue));
    past->before[past->count] = print_of(operation);
    past->count += run(operation, follower, job).outcome == JOB_DONE;
}

static double volume(const struct operation *operation) {
    return operation_figures(operation, 0)->volume_mm3 +
           operation_figures(operation, 1)->volume_mm3;
}

// The cuts in a row that are of the last one's stroke, whichever tissue each was of.
static void undo(struct operation *operation, struct follower *follower, struct past *past) {
    uint32_t stroke = past->jobs[past->count - 1].stroke, cuts = 0, back = 0;
    double before_mm3 = volume(operation), back_mm3 = 0;
    for (; past->count && past->jobs[past->count - 1].stroke == stroke; past->count--)
        cuts++;
    struct ran ran;
    do {
        ran = run_undo(operation, follower);
        assert_int_equal(ran.outcome, JOB_DONE);
        back += ran.cuts_back;
        back_mm3 += ran.mm3_back;
    } while (ran.more);
    assert_int_equal(back, cuts);
    assert_near(back_mm3, volume(operation) - before_mm3, 1e-9);
    struct print now = print_of(operation);
    assert_same(&now, &past->before[past->count]);
}

// Whoever only made the cuts that stand is in the same state.
static void assert_as_without_the_undone(const struct operation *operation,
                                         const struct past *past) {
    struct operation *other = operation_create(scene, RULES_NEWEST, instruments_usual());
    for (int i = 0; i < past->count; i++)
        assert_int_equal(run(other, NULL, &past->jobs[i]).outcome, JOB_DONE);
    struct print a = print_of(operation), b = print_of(other);
    assert_same(&a, &b);
    operation_destroy(&other);
}

static struct follower follower_start(void) {
    struct follower f = {0};
    for (int i = 0; i < TISSUES; i++) {
        f.touches[i] = calloc(TOUCH_WIDTH * (size_t)surface_size(i), sizeof(double));
        f.mesh_number[i] = 1;
    }
    return f;
}

static void follower_end(struct follower *f) {
    for (int i = 0; i < TISSUES; i++)
        free(f->touches[i]);
}

// One undone in between now and then, then all of them.
static void undoing_leads_back_to_the_state_before_each_stroke(void **state) {
    (void)state;
    struct random r = {7};
    struct past *past = calloc(1, sizeof *past);
    struct operation *operation = operation_create(scene, RULES_NEWEST, instruments_usual());
    struct follower follower = follower_start();
    assert_int_equal(scene_tissue_count(scene), TISSUES);
    while (past->count < CUTS) {
        cut(operation, &follower, &r, past);
        if (past->count > 2 && random_bits(&r) % 10 == 0)
            undo(operation, &follower, past);
    }
    assert_as_without_the_undone(operation, past);
    while (past->count > 0)
        undo(operation, &follower, past);
    assert_int_equal(run_undo(operation, &follower).outcome, JOB_NOTHING);
    cut(operation, &follower, &r, past);
    operation_destroy(&operation);
    follower_end(&follower);
    free(past);
}

static void strokes_before_a_restore_are_not_undone(void **state) {
    (void)state;
    struct random r = {8};
    struct past *past = calloc(1, sizeof *past);
    struct operation *operation = operation_create(scene, RULES_NEWEST, instruments_usual());
    int of[TISSUES] = {0};
    while (of[0] < 2 || of[1] < 2) {
        int before = past->count;
        cut(operation, NULL, &r, past);
        of[past->jobs[before].tissue] += past->count - before;
    }
    run(operation, NULL, &(struct job){.id = 1, .kind = JOB_RESTORE});
    uint64_t whole = mesh_print(operation_mesh(operation, 0));
    for (int left = of[1]; left > 0;) {
        struct ran ran = run_undo(operation, NULL);
        assert_int_equal(ran.outcome, JOB_DONE);
        left -= (int)ran.cuts_back;
    }
    assert_int_equal(run_undo(operation, NULL).outcome, JOB_NOTHING);
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

// Another bite, deeper by so much.
static struct landed bite_deeper(struct hand *h, double by_mm) {
    h->opening = 1;
    step(h);
    h->tip = vec3_add_scaled(h->tip, by_mm, outward);
    return bite(h);
}

static void assert_state(const struct hand *h, const struct print *wanted) {
    struct print now = print_of(h->operation);
    assert_same(&now, wanted);
}

static void a_session_takes_back_one_bite_after_the_other(void **state) {
    (void)state;
    struct hand h = hand_start();
    struct print before[3];
    for (int i = 0; i < 3; i++) {
        before[i] = print_of(h.operation);
        uint32_t cuts = before[i].figures[0].cuts;
        assert_true((i ? bite_deeper(&h, 1) : bite(&h)).figures.cuts >= cuts + 2);
    }
    for (int i = 3; i-- > 0;) {
        struct landed landed = undo_by_hand(&h);
        assert_int_equal(landed.outcome, JOB_DONE);
        assert_int_equal(h.out.events & (EVENT_UNDONE | EVENT_CUT), EVENT_UNDONE);
        assert_int_equal(h.out.job.id, 0);
        assert_state(&h, &before[i]);
    }
    assert_near(h.out.landed.figures.removed_mm3, 0, 0);
    assert_int_equal(undo_by_hand(&h).outcome, JOB_NOTHING);
    assert_int_equal(h.out.events & EVENT_UNDONE, 0);
    assert_true(bite(&h).figures.cuts >= 3);
    hand_end(&h);
}

// A trembling finger ends no bite.
static void a_jaw_that_opens_a_little_goes_on_biting(void **state) {
    (void)state;
    struct hand h = hand_start();
    struct print whole = print_of(h.operation);
    while (h.opening > 0) {
        close_to_job(&h);
        if (h.pending)
            land(&h);
        if (h.opening > 0.01)
            h.opening += 0.14;
        step(&h);
    }
    assert_true(operation_figures(h.operation, 0)->cuts >= 2);
    undo_by_hand(&h);
    assert_state(&h, &whole);
    hand_end(&h);
}

// It lands, and is taken back with its stroke, as often as was asked for.
static void a_cut_that_is_on_its_way_is_the_last(void **state) {
    (void)state;
    struct hand h = hand_start();
    struct print whole = print_of(h.operation);
    uint32_t cuts = bite(&h).figures.cuts;
    struct print bitten = print_of(h.operation);
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
    assert_state(&h, &bitten);
    land(&h);
    assert_int_equal(h.out.job.kind, JOB_UNDO);
    assert_state(&h, &whole);
    land(&h);
    assert_int_equal(h.out.job.id, 0);
    hand_end(&h);
}

// What it cuts after the undo stays, and is a stroke of its own.
static void a_bite_goes_on_after_an_undo(void **state) {
    (void)state;
    struct hand h = hand_start();
    bite(&h);
    struct print before = print_of(h.operation);
    h.opening = 1;
    step(&h);
    h.tip = vec3_add_scaled(h.tip, 1, outward);
    step(&h);
    close_to_job(&h);
    land(&h);
    undo_by_hand(&h);
    assert_state(&h, &before);
    while (h.opening > 0) {
        close_to_job(&h);
        if (h.pending)
            land(&h);
    }
    assert_true(operation_figures(h.operation, 0)->cuts > before.figures[0].cuts);
    undo_by_hand(&h);
    assert_state(&h, &before);
    hand_end(&h);
}

// For so many steps, every 50th of which is a cut where the tissue is.
static void shave(struct hand *h, int steps, vec3 way) {
    for (int i = 0; i < steps; i++) {
        h->tip = vec3_add_scaled(h->tip, 1.0 / steps, way);
        step(h);
        if (h->pending)
            land(h);
    }
}

static struct hand burr(void) {
    struct hand h = hand_start();
    h.channel = CHANNEL_SHAVER;
    h.buttons = 1;
    h.tip = inner;
    return h;
}

static const vec3 rest = {0, 0, 0};

// rests_ms: the tip is away from the tissue for so long, the burr running.
static void assert_strokes_of_burr(int rests_ms, bool lets_go, int strokes) {
    struct hand h = burr();
    struct print whole = print_of(h.operation);
    vec3 way = vec3_scale(1.5, outward), back = vec3_scale(-6.5, outward);
    shave(&h, 200, way);
    shave(&h, 1, back);
    struct print shaven = print_of(h.operation);
    assert_true(shaven.figures[0].cuts > 1);
    h.buttons = !lets_go;
    shave(&h, rests_ms, rest);
    h.buttons = 1;
    shave(&h, 1, vec3_scale(6, outward));
    shave(&h, 100, way);
    assert_true(operation_figures(h.operation, 0)->cuts > shaven.figures[0].cuts);
    undo_by_hand(&h);
    assert_state(&h, strokes == 2 ? &shaven : &whole);
    assert_int_equal(undo_by_hand(&h).outcome, strokes == 2 ? JOB_DONE : JOB_NOTHING);
    assert_state(&h, &whole);
    hand_end(&h);
}

static void a_burr_ends_its_stroke_by_a_pause_or_when_it_stands(void **state) {
    (void)state;
    assert_strokes_of_burr(300, false, 1);
    assert_strokes_of_burr(600, false, 2);
    assert_strokes_of_burr(20, true, 2);
}

// However long the burr cuts, or its cuts take.
static void a_long_stroke_is_one(void **state) {
    (void)state;
    struct hand h = burr();
    struct print whole = print_of(h.operation);
    for (int i = 0; i < 20; i++) {
        shave(&h, 40, vec3_scale(0.1, outward));
        do
            step(&h);
        while (!h.pending);
        for (int k = 0; k < (i % 2 ? 0 : 1000); k++)
            step(&h);
        land(&h);
    }
    assert_true(operation_figures(h.operation, 0)->cuts > 10);
    undo_by_hand(&h);
    assert_state(&h, &whole);
    hand_end(&h);
}

static void a_knife_ends_its_stroke_by_a_pause(void **state) {
    (void)state;
    struct hand h = hand_start();
    h.channel = CHANNEL_KNIFE;
    struct print before[3];
    vec3 along = vec3_cross((vec3){0, 0, 1}, outward);
    for (int i = 0; i < 2; i++) {
        before[i] = print_of(h.operation);
        h.tip = vec3_add_scaled(vec3_add_scaled(inner, 0.5 + 0.7 * i, outward), -2, along);
        shave(&h, 100, vec3_scale(4, along));
        assert_true(operation_figures(h.operation, 0)->cuts > before[i].figures[0].cuts);
        shave(&h, 600, rest);
    }
    for (int i = 2; i-- > 0;) {
        undo_by_hand(&h);
        assert_state(&h, &before[i]);
    }
    hand_end(&h);
}

static vec3 inner_of(int tissue) {
    const struct case_group *group = &scene_case(scene)->groups[scene_tissue_group(scene, tissue)];
    return mesh_vertex(&group->mesh, most_moved(group));
}

// From one meniscus to the other without a pause: both come back, one after the other.
static void a_stroke_in_two_tissues_is_one(void **state) {
    (void)state;
    struct hand h = burr();
    struct print whole = print_of(h.operation);
    shave(&h, 100, vec3_scale(0.5, outward));
    h.tip = inner_of(1);
    shave(&h, 200, vec3_scale(-1, outward));
    assert_true(operation_figures(h.operation, 0)->cuts > 0);
    assert_true(operation_figures(h.operation, 1)->cuts > 0);
    h.buttons = 0;
    assert_int_equal(undo_by_hand(&h).tissue, 1);
    assert_int_equal(h.out.job.kind, JOB_UNDO);
    assert_int_equal(land(&h).tissue, 0);
    assert_int_equal(h.out.job.id, 0);
    assert_state(&h, &whole);
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
    bite(&h);
    give(&h, INPUT_PAUSE, 0, NULL);
    assert_int_equal(undo_by_hand(&h).figures.cuts, 0);
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
    bite(&h);
    h.probe_is_there = true;
    h.probe = inner;
    for (int i = 0; i < 3000; i++)
        step(&h);
    vec3 last = displacement(&h);
    assert_true(vec3_length(last) > 0.2);
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
        cmocka_unit_test(undoing_leads_back_to_the_state_before_each_stroke),
        cmocka_unit_test(strokes_before_a_restore_are_not_undone),
        cmocka_unit_test(a_session_takes_back_one_bite_after_the_other),
        cmocka_unit_test(a_jaw_that_opens_a_little_goes_on_biting),
        cmocka_unit_test(a_cut_that_is_on_its_way_is_the_last),
        cmocka_unit_test(a_bite_goes_on_after_an_undo),
        cmocka_unit_test(a_burr_ends_its_stroke_by_a_pause_or_when_it_stands),
        cmocka_unit_test(a_long_stroke_is_one),
        cmocka_unit_test(a_knife_ends_its_stroke_by_a_pause),
        cmocka_unit_test(a_stroke_in_two_tissues_is_one),
        cmocka_unit_test(a_reset_forgets_what_was_to_be_undone),
        cmocka_unit_test(a_paused_session_can_be_set_back),
        cmocka_unit_test(the_touch_comes_back_without_a_jump),
    };
    return cmocka_run_group_tests_name("undo", tests, hand_make_scene, hand_drop_scene);
}
