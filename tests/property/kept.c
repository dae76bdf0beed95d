// A session that is kept behind any step and read again goes on with the same bits, and what is
// read from damaged memory is refused or does no harm.
#include "base/kept.h"

#include "base/clock.h"
#include "generated.h"
#include "property/busy_hands.h"
#include "step/operation_parts.h"
#include "step/scene_parts.h"
#include "step/session.h"
#include "test.h"

#include <stdlib.h>
#include <string.h>

#define STEPS 1600
#define TWINS_MAX 3
#define TWIN_STEPS 300
#define RESOLUTION_MM 2.5
#define SEEDS 1
#define DAMAGES 60

static struct scene *scene;
static struct session_settings settings;

static int make_scene(void **state) {
    (void)state;
    struct error err;
    struct recipe recipe;
    struct knee_case *knee;
    struct pathology loose;
    struct instrument grasper = instrument_grasper();
    assert_ok(recipe_load(CASES "/everything", &recipe, &err));
    recipe.resolution_mm = RESOLUTION_MM;
    assert_ok(generate_knee(&recipe, &knee, &err));
    pathology_init(&loose, PATHOLOGY_LOOSE, "loose");
    assert_ok(pathology_take(&loose, "count", "3", &err));
    assert_ok(pathology_check(&loose, &err));
    assert_ok(pathology_apply(knee, &loose, 0, &err));
    assert_ok(scene_create(&knee, &scene, &err));
    settings = session_settings_default();
    assert_ok(instruments_add(&settings.instruments, &grasper, &err));
    return 0;
}

static int drop_scene(void **state) {
    (void)state;
    scene_destroy(&scene);
    return 0;
}

// ---- a session and its twins --------------------------------------------------------------------

struct living {
    struct session *session;
    struct operation *operation;
    struct session_output out;
    struct job_result *pending;
};

static struct living live(void) {
    return (struct living){.session = session_create(scene, &settings),
                           .operation =
                               operation_create(scene, settings.rules, &settings.instruments)};
}

static void end(struct living *l) {
    session_destroy(&l->session);
    operation_destroy(&l->operation);
    job_result_destroy(&l->pending);
}

static void run_job(struct living *l, const struct job *job) {
    if (!job->id)
        return;
    job_result_destroy(&l->pending);
    l->pending = operation_run(l->operation, job);
}

static void step(struct living *l, const struct session_input *input) {
    struct session_input own = *input;
    if (own.kind == INPUT_JOB)
        own.result = l->pending;
    session_step(l->session, &own, &l->out);
    if (own.kind == INPUT_JOB)
        job_result_destroy(&l->pending);
}

struct image {
    struct kept session, operation;
};

static void drop(struct image *image) {
    free(image->session.data);
    free(image->operation.data);
}

// Before the job of the last step is run.
static struct image keep(struct living *l) {
    struct image image = {kept_growing(), kept_growing()};
    session_keep(l->session, &l->out.job, NULL, &image.session);
    operation_keep(l->operation, &image.operation);
    assert_false(image.session.bad || image.operation.bad);
    assert_true(image.session.used <= SESSION_KEPT_MAX);
    return image;
}

static bool take(const struct image *image, struct living *out) {
    struct job asked = {0};
    struct kept session = kept_from(image->session.data, image->session.used);
    struct kept operation = kept_from(image->operation.data, image->operation.used);
    *out = live();
    operation_keep(out->operation, &operation);
    if (!operation.bad && !kept_left(&operation))
        session_keep(out->session, &asked, out->operation, &session);
    if (operation.bad || session.bad || kept_left(&operation) || kept_left(&session))
        return false;
    out->out.job = asked;
    return true;
}

// ---- the same bits ------------------------------------------------------------------------------

static void assert_same_tissue(const struct living *a, const struct living *b) {
    for (int t = 0; t < scene->tissue_count; t++) {
        struct mesh one, other;
        uint32_t *of_one, *of_other;
        cut_mesh_flatten(operation_mesh(a->operation, t), &one, NULL, &of_one);
        cut_mesh_flatten(operation_mesh(b->operation, t), &other, NULL, &of_other);
        assert_int_equal(one.triangle_count, other.triangle_count);
        assert_memory_equal(one.triangles, other.triangles,
                            3 * one.triangle_count * sizeof *one.triangles);
        assert_memory_equal(of_one, of_other, one.triangle_count * sizeof *of_one);
        assert_memory_equal(operation_figures(a->operation, t), operation_figures(b->operation, t),
                            sizeof(struct tissue_figures));
        mesh_fini(&one);
        mesh_fini(&other);
        free(of_one);
        free(of_other);
    }
}

struct twin {
    struct living living;
    int left; // steps; 0: there is none
};

struct tally {
    int kept, refused, cuts, undone, grasped, asked, eased;
};

static void step_twin(struct twin *twin, const struct living *l,
                      const struct session_input *input) {
    step(&twin->living, input);
    if (twin->living.out.hash != l->out.hash)
        fail_msg("step %llu differs, %d steps behind the kept one", (unsigned long long)l->out.step,
                 TWIN_STEPS - twin->left + 1);
    if (--twin->left) {
        run_job(&twin->living, &twin->living.out.job);
        return;
    }
    assert_same_tissue(&twin->living, l);
    end(&twin->living);
}

static void make_twin(struct twin *twin, struct living *l, struct tally *tally) {
    if (!session_can_be_kept(l->session, &l->out.job)) {
        tally->refused++;
        return;
    }
    struct image image = keep(l);
    assert_true(take(&image, &twin->living));
    run_job(&twin->living, &twin->living.out.job);
    if (!twin->living.pending && l->pending)
        fail_msg("step %llu was kept with a job on its way", (unsigned long long)l->out.step);
    twin->left = TWIN_STEPS;
    tally->kept++;
    tally->asked += l->out.job.id > 0;
    drop(&image);
}

static void count(struct tally *tally, const struct session_output *out) {
    tally->cuts += (out->events & EVENT_CUT) != 0;
    tally->undone += (out->events & EVENT_UNDONE) != 0;
    tally->grasped += (out->events & EVENT_GRASPED) != 0;
}

static struct tally run(uint64_t seed) {
    struct tally tally = {0};
    struct twin twins[TWINS_MAX] = {0};
    struct living l = live();
    struct busy_hands hands = busy_hands_begin(scene, seed);
    struct session_input input = {.kind = INPUT_START};
    for (int i = 0; i < STEPS; i++) {
        step(&l, &input);
        count(&tally, &l.out);
        for (int k = 0; k < TWINS_MAX; k++)
            if (twins[k].left)
                step_twin(&twins[k], &l, &input);
            else if (random_bits(&hands.random) % 40 == 0)
                make_twin(&twins[k], &l, &tally);
        run_job(&l, &l.out.job);
        busy_hands_next(&hands, &l.out, l.pending, &input);
    }
    for (int k = 0; k < TWINS_MAX; k++)
        if (twins[k].left)
            end(&twins[k].living);
    end(&l);
    return tally;
}

static void a_session_that_is_kept_goes_on_with_the_same_bits(void **state) {
    (void)state;
    struct tally sum = {0};
    for (uint64_t seed = 1; seed <= SEEDS; seed++) {
        struct tally t = run(seed);
        sum.kept += t.kept;
        sum.refused += t.refused;
        sum.cuts += t.cuts;
        sum.undone += t.undone;
        sum.grasped += t.grasped;
        sum.asked += t.asked;
    }
    print_message("%d kept, %d with a job, %d not; %d cuts, %d undone, %d grasped\n", sum.kept,
                  sum.asked, sum.refused, sum.cuts, sum.undone, sum.grasped);
    assert_true(sum.kept > 8 && sum.asked > 0 && sum.cuts > 20 && sum.undone > 2);
}

// ---- damage -------------------------------------------------------------------------------------

static void go_on(struct living *l, struct busy_hands hands) {
    struct session_input input;
    run_job(l, &l->out.job);
    hands.time_ns += 3600 * NS_PER_S; // the damaged clock may be ahead
    for (int i = 0; i < 20 && l->out.time_ns <= hands.time_ns; i++) {
        busy_hands_next(&hands, &l->out, l->pending, &input);
        step(l, &input);
        run_job(l, &l->out.job);
    }
}

static void damage(struct random *r, struct kept *k) {
    size_t at = random_bits(r) % k->used;
    switch (random_bits(r) % 3) {
    case 0:
        k->data[at] ^= (uint8_t)(1 << random_bits(r) % 8);
        break;
    case 1:
        k->data[at] = (uint8_t)random_bits(r);
        break;
    default:
        k->used = at;
        break;
    }
}

static struct living cut_a_while(struct busy_hands *hands) {
    struct living l = live();
    struct session_input input = {.kind = INPUT_START};
    for (int i = 0; i < 700 || !session_can_be_kept(l.session, &l.out.job); i++) {
        run_job(&l, &l.out.job);
        step(&l, &input);
        busy_hands_next(hands, &l.out, l.pending, &input);
        if (input.kind == INPUT_RESET)
            input.kind = INPUT_EMPTY;
    }
    return l;
}

static struct image copy_of(const struct image *image) {
    struct image copy = {kept_growing(), kept_growing()};
    kept_bytes(&copy.session, image->session.data, image->session.used);
    kept_bytes(&copy.operation, image->operation.data, image->operation.used);
    return copy;
}

static void damaged_memory_is_refused_or_harmless(void **state) {
    (void)state;
    struct random r = {7};
    struct busy_hands hands = busy_hands_begin(scene, 11);
    struct living l = cut_a_while(&hands);
    struct image image = keep(&l);
    int refused = 0;
    for (int i = 0; i < DAMAGES; i++) {
        struct image damaged = copy_of(&image);
        struct living other;
        damage(&r, i % 2 ? &damaged.session : &damaged.operation);
        if (take(&damaged, &other))
            go_on(&other, hands);
        else
            refused++;
        end(&other);
        drop(&damaged);
    }
    print_message("%d of %d refused\n", refused, DAMAGES);
    assert_true(refused > DAMAGES / 4);
    drop(&image);
    end(&l);
}

// Tissue that no cut has changed yet, but one was refused.
static void refused_cuts_stay_counted(void **state) {
    (void)state;
    struct living l = live(), other;
    struct job job = {.id = 1, .kind = JOB_CUT, .move_count = 1};
    pose away = {{1, 0, 0, 0}, {500, 0, 0}};
    job.moves[0] =
        (struct blade_move){CHANNEL_PUNCH - CHANNEL_FIRST_INSTRUMENT, {away, away}, {1, 0}};
    step(&l, &(struct session_input){.kind = INPUT_START, .time_ns = 1});
    l.operation->tissues[0].now.figures.refused = 2;
    struct image image = keep(&l);
    assert_true(take(&image, &other));
    struct job_result *result = operation_run(other.operation, &job);
    assert_int_equal(result->figures.refused, 2);
    job_result_destroy(&result);
    end(&other);
    drop(&image);
    end(&l);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_session_that_is_kept_goes_on_with_the_same_bits),
        cmocka_unit_test(refused_cuts_stay_counted),
        cmocka_unit_test(damaged_memory_is_refused_or_harmless),
    };
    return cmocka_run_group_tests(tests, make_scene, drop_scene);
}
