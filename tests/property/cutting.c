// Cutting as a session sees it: from a closing jaw to the touch that follows.
#include "step/cutting.h"

#include "mesh/query.h"
#include "scene/hand.h"
#include "test.h"

#include <string.h>

static int go_smooth(void **state) {
    (void)state;
    hand_field = FIELD_SMOOTH;
    return 0;
}

static void a_closing_jaw_takes_tissue_and_the_warp_gives_way(void **state) {
    (void)state;
    struct hand h = hand_start();
    double whole = operation_figures(h.operation, 0)->volume_mm3;
    struct landed landed = bite(&h);
    const struct tissue_figures *f = &landed.figures;
    assert_int_equal(landed.tissue, 0);
    assert_true(f->cuts >= 3);
    assert_true(f->removed_mm3 > 5 && f->removed_mm3 < 40);
    assert_near(f->volume_mm3, whole - f->removed_mm3 - f->pieces_mm3, 1e-6);
    assert_near(cut_mesh_volume(operation_mesh(h.operation, 0)), f->volume_mm3, 1e-6);
    assert_near(f->warped_mm3 - f->left_mm3, whole - f->removed_mm3 - f->pieces_mm3,
                1e-3); // no tear, so S' is whole
    assert_near(f->quality.removed_mm3, f->removed_mm3 + f->pieces_mm3, 0.1 * f->removed_mm3);
    assert_true(h.out.instruments[CHANNEL_PUNCH - CHANNEL_FIRST_INSTRUMENT].present);
    hand_end(&h);
}

// Each is of unit length within what a frame may have; one after the other they are not.
static void rotations_of_nearly_unit_length_cut(void **state) {
    (void)state;
    for (int sign = -1; sign <= 1; sign += 2) {
        struct hand h = hand_start();
        h.tibia_is_tracked = true;
        h.length = 1 + sign * 0.9e-3;
        assert_true(bite(&h).figures.cuts >= 3);
        hand_end(&h);
    }
}

static vec3 probe_displacement(const struct hand *h) {
    return h->out.instruments[0].warp.displacement;
}

// S'' − S', which is S here.
static vec3 offset_at(const struct hand *h, uint32_t vertex) {
    return vec3_sub(operation_touched(h->operation, 0, vertex),
                    mesh_vertex(&meniscus->mesh, vertex));
}

// A hand that rests on the margin feels it give way no faster than it may, and all of it in the
// end.
static void a_resting_tip_feels_no_jump(void **state) {
    (void)state;
    struct hand h = hand_start();
    h.probe_is_there = true;
    h.probe = inner;
    step(&h);
    vec3 last = probe_displacement(&h);
    double floor_mm = session_settings_default().ease_mm_s * STEP_NS / NS_PER_S;
    bite(&h);
    double moved = 0;
    for (int i = 0; i < 4000; i++) {
        step(&h);
        if (h.pending)
            land(&h);
        double change = vec3_distance(probe_displacement(&h), last);
        if (i)
            assert_true(change <= floor_mm * (1 + 1e-9));
        moved += i ? change : 0;
        last = probe_displacement(&h);
    }
    vec3 full = offset_at(&h, most_moved(meniscus));
    assert_true(moved > 0.2);
    assert_vec3_near(last, full, 1e-4);
    hand_end(&h);
}

// ---- memory -------------------------------------------------------------------------------------

static size_t allocations; // of all rooms; the linker leads them here

void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void *__real_realloc(void *memory, size_t size);
void *__real_aligned_alloc(size_t alignment, size_t size);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);
void *__wrap_realloc(void *memory, size_t size);
void *__wrap_aligned_alloc(size_t alignment, size_t size);

void *__wrap_malloc(size_t size) {
    allocations++;
    return __real_malloc(size);
}

void *__wrap_calloc(size_t count, size_t size) {
    allocations++;
    return __real_calloc(count, size);
}

void *__wrap_realloc(void *memory, size_t size) {
    allocations++;
    return __real_realloc(memory, size);
}

void *__wrap_aligned_alloc(size_t alignment, size_t size) {
    allocations++;
    return __real_aligned_alloc(alignment, size);
}

// Also where a result lands, and while it is eased in.
static void a_step_allocates_nothing(void **state) {
    (void)state;
    struct hand h = hand_start();
    h.probe_is_there = true;
    h.probe = vec3_add_scaled(inner, -1, outward);
    assert_true(allocations > 0);
    step(&h);
    for (close_to_job(&h); h.opening > 0.5 || h.pending->outcome != JOB_DONE; close_to_job(&h))
        land(&h);
    struct session_input job = {
        .kind = INPUT_JOB, .time_ns = h.input.time_ns, .job = h.pending->job, .result = h.pending};
    vec3 before = probe_displacement(&h);
    size_t count = allocations;
    session_step(h.session, &job, &h.out);
    assert_true(h.out.events & EVENT_CUT);
    for (int i = 0; i < 300; i++) {
        h.input.time_ns += STEP_NS;
        h.input.frame.number++;
        h.input.frame.time_ns = h.input.time_ns;
        for (int k = 0; k < h.input.frame.count; k++)
            h.input.frame.samples[k].time_ns = h.input.time_ns;
        session_step(h.session, &h.input, &h.out);
    }
    assert_int_equal(allocations, count);
    assert_true(vec3_distance(probe_displacement(&h), before) > 1e-3);
    hand_end(&h);
}

// ---- blades -------------------------------------------------------------------------------------

static double removed(const struct hand *h) {
    return operation_figures(h->operation, 0)->removed_mm3;
}

static void move(struct hand *h, vec3 way, int steps) {
    for (int i = 0; i < steps; i++) {
        h->tip = vec3_add_scaled(h->tip, 1.0 / steps, way);
        step(h);
        if (h->pending)
            land(h);
    }
}

// However slowly it goes, and also where it rests; not where it does not run.
static void a_burr_takes_tissue_while_it_runs(void **state) {
    (void)state;
    struct hand h = hand_start();
    h.channel = CHANNEL_SHAVER;
    h.tip = vec3_add_scaled(inner, -1, outward); // a burr lies behind its tip
    move(&h, vec3_scale(2, outward), 200);
    assert_near(removed(&h), 0, 0);
    h.buttons = 1;
    move(&h, vec3_scale(1, outward), 1000);
    double slow = removed(&h);
    assert_true(slow > 2);
    move(&h, (vec3){0}, 1000);   // until the touch is eased in, which moves the burr
    double rested = removed(&h); // of the last bit of its way
    assert_true(rested > slow);
    move(&h, (vec3){0}, 1000);
    assert_near(removed(&h), rested, 0.01);
    uint32_t cuts = operation_figures(h.operation, 0)->cuts;
    h.buttons = 0;
    move(&h, vec3_scale(1, outward), 100);
    assert_int_equal(operation_figures(h.operation, 0)->cuts, cuts);
    hand_end(&h);
}

// A cleft of the kerf's width, and not more.
static void a_knife_leaves_its_kerf(void **state) {
    (void)state;
    struct hand h = hand_start();
    h.channel = CHANNEL_KNIFE;
    h.tip = vec3_add_scaled(inner, -1, outward);
    move(&h, vec3_scale(4, outward), 400);
    const struct tissue_figures *f = operation_figures(h.operation, 0);
    assert_true(f->cuts > 5);
    assert_true(f->removed_mm3 > 0.2 * 1 && f->removed_mm3 < 0.2 * 2.5 * 5);
    hand_end(&h);
}

// A hand that is elsewhere in the next frame has not cut all in between.
static void a_jump_is_not_swept(void **state) {
    (void)state;
    struct hand h = hand_start();
    h.channel = CHANNEL_SHAVER;
    h.buttons = 1;
    h.tip = vec3_add_scaled(inner, -15, outward);
    move(&h, (vec3){0}, 10);
    h.tip = vec3_add_scaled(inner, 20, outward);
    move(&h, (vec3){0}, 10);
    assert_near(removed(&h), 0, 0);
    hand_end(&h);
}

// While a job is on its way no other is asked for; the jaw's way since then is in the next.
static void jobs_go_one_by_one_and_no_way_is_lost(void **state) {
    (void)state;
    struct hand h = hand_start();
    step(&h);
    close_to_job(&h);
    double opening = h.out.job.moves[0].opening[1];
    uint64_t first = h.out.job.id;
    for (int i = 0; i < 8; i++) {
        h.opening -= 0.05;
        step(&h); // asserts that there is no second job
        assert_int_equal(h.out.job.id, 0);
    }
    land(&h);
    if (!h.pending)
        step(&h);
    assert_non_null(h.pending);
    assert_int_equal(h.out.job.id, first + 1);
    int last = h.out.job.move_count - 1;
    assert_near(h.out.job.moves[0].opening[0], opening, 0);
    assert_near(h.out.job.moves[last].opening[1], h.opening, 0);
    hand_end(&h);
}

// ---- while jobs are held up ---------------------------------------------------------------------

#define HELD_STEPS 60

// Lands what is under way, and all that waited. The moves of all jobs go to `out`.
static int land_all(struct hand *h, struct blade_move *out, int room) {
    int count = 0;
    memset(out, 0, (size_t)room * sizeof *out);
    while (h->pending) {
        land(h);
        if (!h->pending)
            step(h);
        for (int i = 0; h->out.job.id && i < h->out.job.move_count && count < room; i++)
            out[count++] = h->out.job.moves[i];
    }
    return count;
}

static struct hand start_burr(void) {
    struct hand h = hand_start();
    h.channel = CHANNEL_SHAVER;
    h.buttons = 1;
    for (int i = 0; !h.pending && i < 100; i++)
        step(&h);
    return h;
}

// However long a job takes, and however far the tip goes meanwhile.
static void a_way_that_waits_for_long_is_not_lost(void **state) {
    (void)state;
    struct blade_move moves[4 * CUTTING_WAITING_MAX];
    struct hand h = start_burr();
    vec3 from = h.out.job.moves[0].T_mesh_tip[1].translation;
    for (int i = 0; i < 4 * CUTTING_WAITING_MAX; i++) {
        h.tip = vec3_add_scaled(h.tip, i % 40 < 20 ? 0.25 : -0.25, outward);
        step(&h);
    }
    h.buttons = 0;
    step(&h);
    int count = land_all(&h, moves, 4 * CUTTING_WAITING_MAX);
    assert_in_range(count, 2, CUTTING_WAITING_MAX);
    assert_vec3_near(moves[0].T_mesh_tip[0].translation, from, 0);
    for (int i = 1; i < count; i++)
        assert_vec3_near(moves[i].T_mesh_tip[0].translation, moves[i - 1].T_mesh_tip[1].translation,
                         0);
    hand_end(&h);
}

// A way with a corner is cut along the corner, not straight from its begin to its end.
static void a_burr_is_cut_along_the_way_that_it_went(void **state) {
    (void)state;
    struct blade_move moves[CUTTING_WAITING_MAX];
    struct hand h = start_burr();
    vec3 begin = h.tip, corner = vec3_add_scaled(begin, -4, outward);
    for (int i = 1; i <= HELD_STEPS; i++) {
        double there = fmin(1, 2.0 * i / HELD_STEPS), up = fmax(0, 2.0 * i / HELD_STEPS - 1);
        h.tip = vec3_add(vec3_lerp(begin, corner, there), (vec3){0, 0, 4 * up});
        step(&h);
    }
    h.buttons = 0;
    step(&h);
    int count = land_all(&h, moves, CUTTING_WAITING_MAX);
    vec3 first = moves[0].T_mesh_tip[0].translation;
    vec3 last = moves[count - 1].T_mesh_tip[1].translation;
    double way = 0;
    for (int i = 0; i < count; i++)
        way +=
            vec3_distance(moves[i].T_mesh_tip[0].translation, moves[i].T_mesh_tip[1].translation);
    assert_true(count > 10);
    assert_true(way > 1.3 * vec3_distance(first, last)); // two legs of 4 mm
    hand_end(&h);
}

static double volume_of_bite(bool held, double withdrawn_mm) {
    struct blade_move moves[CUTTING_WAITING_MAX];
    struct hand h = hand_start();
    struct job_result *other = NULL;
    step(&h);
    if (held) { // a job that takes nothing is under way until the hand has gone
        give(&h, INPUT_UNDO, 0, NULL);
        run_job(&h);
        other = h.pending;
        assert_non_null(other);
    }
    for (h.opening = 1; h.opening > 0; h.opening = fmax(0, h.opening - 0.05)) {
        step(&h);
        while (!held && h.pending)
            land(&h);
    }
    step(&h);
    h.opening = 0;
    for (int i = 0; i < 20; i++) {
        h.tip = vec3_add_scaled(h.tip, withdrawn_mm / 20, outward);
        h.opening = fmin(1, h.opening + 0.05);
        step(&h);
    }
    if (h.pending)
        land_all(&h, moves, CUTTING_WAITING_MAX);
    double removed_mm3 = operation_figures(h.operation, 0)->removed_mm3;
    hand_end(&h);
    return removed_mm3;
}

// Though the jaw opens and goes away meanwhile. Not to the bit: where each part of the bite lands
// at once, the warp under the tip gives way a little between them.
static void a_bite_is_cut_where_the_jaw_closed(void **state) {
    (void)state;
    double at_once = volume_of_bite(false, 0);
    assert_true(at_once > 1);
    assert_near(volume_of_bite(true, 0), at_once, 1e-3 * at_once);
    assert_near(volume_of_bite(true, -20), volume_of_bite(true, 0), 0);
}

// A bite is of one place, so bites do not become one; those without room are told of.
static void bites_without_room_are_reported(void **state) {
    (void)state;
    struct blade_move moves[2 * CUTTING_WAITING_MAX];
    struct hand h = hand_start();
    uint64_t refused = 0, due = 0;
    step(&h);
    give(&h, INPUT_UNDO, 0, NULL);
    run_job(&h);
    for (int i = 0; i < CUTTING_WAITING_MAX; i++) {
        for (h.opening = 1; h.opening > 0; h.opening = fmax(0, h.opening - 0.25)) {
            step(&h);
            refused += h.out.events & EVENT_REFUSED ? 1 : 0;
        }
        h.opening = 0;
        step(&h);
        refused += h.out.events & EVENT_REFUSED ? 1 : 0;
        due += 4;
    }
    int count = land_all(&h, moves, 2 * CUTTING_WAITING_MAX);
    assert_int_equal(count, CUTTING_WAITING_MAX);
    assert_int_equal(refused, due - CUTTING_WAITING_MAX);
    hand_end(&h);
}

static struct hand start_under(int rules) {
    struct session_settings settings = session_settings_default();
    settings.rules = rules;
    struct hand h = hand_start();
    session_destroy(&h.session);
    operation_destroy(&h.operation);
    h.session = session_create(scene, &settings);
    h.operation = operation_create(scene, rules, instruments_usual());
    h.input = (struct session_input){.kind = INPUT_START};
    session_step(h.session, &h.input, &h.out);
    return h;
}

// How far S'' is from the surface of a bite, as the operation tells it and on average over it.
static double apart_under(int rules, double *out_told_mm) {
    struct hand h = start_under(rules);
    *out_told_mm = bite(&h).figures.distance_mm;
    const struct cut_mesh *cut = operation_mesh(h.operation, 0);
    struct mesh touched;
    struct query *query;
    struct error err;
    mesh_copy(&touched, &meniscus->mesh);
    for (uint32_t v = 0; v < touched.vertex_count; v++)
        mesh_set_vertex(&touched, v, operation_touched(h.operation, 0, v));
    assert_ok(query_create(&touched, &query, &err));
    double sum = 0, count = 0;
    for (uint32_t t = 0; t < cut_mesh_triangle_bound(cut); t++)
        for (int k = 0; k < 3 && cut_mesh_triangle_alive(cut, t) && cut_mesh_label(cut, t); k++) {
            struct closest closest;
            vec3 p = cut_mesh_vertex(cut, cut_mesh_triangle(cut, t)[k]);
            query_closest(query, p, INFINITY, MESH_NONE, &closest);
            sum += closest.distance;
            count++;
        }
    query_destroy(&query);
    mesh_fini(&touched);
    hand_end(&h);
    return sum / count;
}

// In the figures of each landing: little of what a bite took, and the volumes agree.
static void what_touch_and_sight_differ_by_is_told(void **state) {
    (void)state;
    struct hand h = hand_start();
    struct tissue_figures f = bite(&h).figures;
    assert_true(f.touched_unseen_mm3 > 0.01 && f.touched_unseen_mm3 < 0.1 * f.removed_mm3);
    assert_near(f.touched_unseen_mm3 - f.seen_untouched_mm3, f.left_mm3, 0.1);
    give(&h, INPUT_UNDO, 0, NULL);
    run_job(&h);
    f = land(&h).figures;
    assert_true(f.touched_unseen_mm3 == 0 && f.seen_untouched_mm3 == 0);
    hand_end(&h);
    h = start_under(RULES_TOUCH_FITTED - 1);
    f = bite(&h).figures;
    assert_true(f.touched_unseen_mm3 == 0 && f.seen_untouched_mm3 == 0); // no record has them
    hand_end(&h);
}

static void a_bite_is_touched_where_it_is_seen(void **state) {
    (void)state;
    double blends_told, told, blends = apart_under(RULES_TOUCH_FITTED - 1, &blends_told);
    double fitted = apart_under(RULES_NEWEST, &told);
    assert_true(blends > 3 * fitted); // the last bits decide whether it is 0.09 or 0.11 mm
    assert_true(told >= fitted && told < 0.5);
    assert_true(blends_told >= blends);
}

// As a record of that time has it: the move grows while it waits.
static void under_the_older_rules_a_move_that_waits_grows(void **state) {
    (void)state;
    struct hand h = start_under(RULES_WITH_WAITING_MOVES - 1);
    h.channel = CHANNEL_SHAVER;
    h.buttons = 1;
    for (int i = 0; !h.pending && i < 100; i++)
        step(&h);
    vec3 from = h.out.job.moves[0].T_mesh_tip[1].translation;
    for (int i = 0; i < HELD_STEPS; i++) {
        h.tip = vec3_add_scaled(h.tip, 0.2, outward);
        step(&h);
    }
    land(&h);
    assert_int_equal(h.out.job.move_count, 1);
    assert_vec3_near(h.out.job.moves[0].T_mesh_tip[0].translation, from, 0);
    assert_true(vec3_distance(h.out.job.moves[0].T_mesh_tip[1].translation, from) > 10);
    hand_end(&h);
}

// What a hand does while the session rests is seen, and cuts nothing.
static void a_session_that_is_paused_shows_its_instruments(void **state) {
    (void)state;
    struct hand h = hand_start();
    step(&h);
    give(&h, INPUT_PAUSE, 0, NULL);
    h.opening = 0;
    step(&h);
    const struct instrument_output *punch =
        &h.out.instruments[CHANNEL_PUNCH - CHANNEL_FIRST_INSTRUMENT];
    assert_int_equal(h.out.state, SESSION_PAUSED);
    assert_true(punch->present);
    assert_true(punch->handle.opening == 0);
    assert_int_equal(h.out.job.id, 0);
    hand_end(&h);
}

// Two blades that always have something to be cut.
static void instruments_take_turns(void **state) {
    (void)state;
    struct hand h = hand_start();
    int jobs[BLADE_KNIFE + 1] = {0};
    h.channel = CHANNEL_SHAVER;
    h.buttons = 1;
    h.knife_is_there = true;
    vec3 middle = h.tip;
    for (int i = 0; i < 200; i++) {
        double way = i % 20 < 10 ? i % 10 : 10 - i % 10;
        h.tip = vec3_add_scaled(middle, 0.3 * way, outward);
        h.knife = vec3_add_scaled(middle, 3 - 0.3 * way, outward);
        step(&h);
        jobs[h.out.job.moves[0].blade] += h.out.job.id != 0;
        if (h.pending && i % 5 == 4) {
            land(&h);
            jobs[h.out.job.moves[0].blade] += h.out.job.id != 0;
        }
    }
    assert_true(jobs[BLADE_SHAVER] > 10 && jobs[BLADE_KNIFE] > 10);
    hand_end(&h);
}

static void a_lost_handle_does_not_cut(void **state) {
    (void)state;
    struct hand h = hand_start();
    step(&h);
    h.handle = VALIDITY_LOST;
    h.opening = 0;
    for (int i = 0; i < 5; i++)
        step(&h);
    const struct instrument_output *punch =
        &h.out.instruments[CHANNEL_PUNCH - CHANNEL_FIRST_INSTRUMENT];
    assert_int_equal(punch->handle_validity, VALIDITY_LOST);
    assert_near(punch->handle.opening, 1, 0);
    h.handle = VALIDITY_OK; // it closed in the dark
    for (int i = 0; i < 5; i++)
        step(&h);
    assert_null(h.pending);
    hand_end(&h);
}

static void a_reset_makes_the_tissue_whole(void **state) {
    (void)state;
    struct hand h = hand_start();
    h.probe_is_there = true;
    h.probe = inner;
    double whole = operation_figures(h.operation, 0)->volume_mm3;
    bite(&h);
    close_to_job(&h);
    uint32_t number = operation_figures(h.operation, 0)->mesh_number;
    give(&h, INPUT_RESET, 0, NULL);
    run_job(&h);
    h.opening = 1;
    step(&h);
    assert_near(vec3_length(probe_displacement(&h)), 0, 0);
    struct landed landed = land(&h);
    assert_int_equal(h.out.events & EVENT_CUT, 0);
    assert_int_equal(landed.figures.mesh_number, number + 1);
    assert_int_equal(landed.figures.cuts, 0);
    assert_near(landed.figures.volume_mm3, whole, 0);
    struct landed again = bite(&h);
    assert_true(again.figures.cuts >= 3);
    hand_end(&h);
}

// Asked for before the reset, done after it.
static void a_cut_from_before_a_reset_does_not_land(void **state) {
    (void)state;
    struct hand h = hand_start();
    step(&h);
    close_to_job(&h);
    give(&h, INPUT_RESET, 0, NULL);
    assert_int_equal(h.out.job.id, 0); // the cut is still on its way
    struct landed landed = land(&h);
    assert_int_equal(landed.job, 0);
    assert_non_null(h.pending); // and now the tissue is restored
    assert_int_equal(h.out.job.kind, JOB_RESTORE);
    assert_int_equal(land(&h).figures.cuts, 0);
    hand_end(&h);
}

static void a_lost_result_does_not_hold_up_the_next(void **state) {
    (void)state;
    struct hand h = hand_start();
    step(&h);
    close_to_job(&h);
    uint64_t id = h.pending->job;
    job_result_destroy(&h.pending);
    give(&h, INPUT_JOB, id, NULL);
    assert_int_equal(h.out.landed.job, 0);
    close_to_job(&h);
    assert_int_equal(land(&h).job, id + 1);
    hand_end(&h);
}

static void the_same_inputs_give_the_same_hash(void **state) {
    (void)state;
    uint64_t hashes[2];
    for (int i = 0; i < 2; i++) {
        struct hand h = hand_start();
        bite(&h);
        hashes[i] = h.out.hash;
        hand_end(&h);
    }
    assert_true(hashes[0] == hashes[1]);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_closing_jaw_takes_tissue_and_the_warp_gives_way),
        cmocka_unit_test(rotations_of_nearly_unit_length_cut),
        cmocka_unit_test(a_bite_is_touched_where_it_is_seen),
        cmocka_unit_test(what_touch_and_sight_differ_by_is_told),
        cmocka_unit_test(a_resting_tip_feels_no_jump),
        cmocka_unit_test(a_step_allocates_nothing),
        cmocka_unit_test(a_burr_takes_tissue_while_it_runs),
        cmocka_unit_test(a_knife_leaves_its_kerf),
        cmocka_unit_test(a_jump_is_not_swept),
        cmocka_unit_test(jobs_go_one_by_one_and_no_way_is_lost),
        cmocka_unit_test(a_way_that_waits_for_long_is_not_lost),
        cmocka_unit_test(a_burr_is_cut_along_the_way_that_it_went),
        cmocka_unit_test(a_bite_is_cut_where_the_jaw_closed),
        cmocka_unit_test(bites_without_room_are_reported),
        cmocka_unit_test(under_the_older_rules_a_move_that_waits_grows),
        cmocka_unit_test(a_session_that_is_paused_shows_its_instruments),
        cmocka_unit_test(instruments_take_turns),
        cmocka_unit_test(a_lost_handle_does_not_cut),
        cmocka_unit_test(a_reset_makes_the_tissue_whole),
        cmocka_unit_test(a_cut_from_before_a_reset_does_not_land),
        cmocka_unit_test(a_lost_result_does_not_hold_up_the_next),
        cmocka_unit_test(the_same_inputs_give_the_same_hash),
        cmocka_unit_test_setup(a_resting_tip_feels_no_jump, go_smooth),
        cmocka_unit_test_setup(the_same_inputs_give_the_same_hash, go_smooth),
    };
    return cmocka_run_group_tests_name("cutting", tests, hand_make_scene, hand_drop_scene);
}
