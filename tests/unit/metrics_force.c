// The figures of force, against the same sums made millisecond by millisecond from the steps alone.

#include "base/clock.h"
#include "metrics/subject.h"
#include "random.h"
#include "test.h"

#include <string.h>

#define MS NS_PER_MS
#define STEPS 3000
#define GROUPS 3
#define PROBE 0

static const struct view_optic optic = {30, 90};

// What a step told: of the probe and of the gauges of probe and tibia.
struct told {
    int64_t ms;
    bool present, running;
    int nearest; // -1: none
    double nearest_mm;
    bool has_force[2]; // probe, tibia
    enum validity validity[2];
    double force_n[2];
};

static struct told steps[STEPS];

// Touches and silences last for some steps, as a hand's and a device's do.
static void make_steps(struct random *random) {
    struct told now = {.present = true, .running = true, .nearest = -1, .nearest_mm = 5};
    for (int i = 0; i < STEPS; i++) {
        now.ms += 1 + (int64_t)(random_bits(random) % (i % 200 == 0 ? 400 : 15));
        if (random_bits(random) % 20 == 0) {
            now.nearest = (int)(random_bits(random) % (GROUPS + 1)) - 1;
            now.nearest_mm = random_between(random, 0, 0.6);
        }
        if (random_bits(random) % 40 == 0)
            now.present = random_bits(random) % 8 != 0;
        if (random_bits(random) % 100 == 0)
            now.running = random_bits(random) % 8 != 0;
        for (int g = 0; g < 2; g++) {
            if (random_bits(random) % 30 == 0)
                now.has_force[g] = random_bits(random) % 4 != 0;
            if (random_bits(random) % 30 == 0)
                now.validity[g] = random_bits(random) % VALIDITY_COUNT;
            now.force_n[g] = random_between(random, -4, 9);
        }
        steps[i] = now;
    }
}

static void add_force(struct frame *frame, enum channel channel, const struct told *t, int g) {
    if (t->has_force[g])
        frame->samples[frame->count++] = (struct sample){.channel = channel,
                                                         .kind = SAMPLE_FORCE,
                                                         .validity = t->validity[g],
                                                         .time_ns = t->ms * MS,
                                                         .force_n = t->force_n[g]};
}

static void take(struct metrics *m, const struct told *t) {
    static struct session_input input;
    static struct session_output output;
    memset(&input, 0, sizeof input);
    memset(&output, 0, sizeof output);
    input.kind = INPUT_FRAME;
    input.time_ns = output.time_ns = t->ms * MS;
    output.state = t->running ? SESSION_RUNNING : SESSION_PAUSED;
    output.instruments[PROBE] =
        (struct instrument_output){.present = t->present,
                                   .T_mockup_tip = pose_identity(),
                                   .T_mockup_warped = pose_identity(),
                                   .warp = {.nearest = t->nearest, .nearest_mm = t->nearest_mm},
                                   .discrepancy = {.gain = 1, .gain_least = 1}};
    add_force(&input.frame, CHANNEL_PROBE, t, 0);
    add_force(&input.frame, CHANNEL_TIBIA, t, 1);
    metrics_step(m, &input, &output);
}

// ---- millisecond by millisecond -----------------------------------------------------------------

struct sums {
    int64_t ms[VALIDITY_COUNT];
    double sum_n, peak_n;
};

// Where the probe is at a step: a group, GROUPS: free, -1: unknown.
static int place_at(int step) {
    bool touching = false;
    int begin = step;
    while (begin > 0 && steps[begin].present && steps[begin].nearest >= 0 &&
           steps[begin].nearest_mm <= 0.4 && steps[begin].nearest_mm > 0.2)
        begin--; // between the two distances: as it was before
    touching = steps[begin].present && steps[begin].nearest >= 0 && steps[begin].nearest_mm <= 0.2;
    if (!steps[step].present)
        return -1;
    return touching ? steps[step].nearest : GROUPS;
}

// What gauge g says at a step; VALIDITY_COUNT: it has never said anything.
static enum validity gauge_at(int step, int g, double *out_n) {
    int last = step;
    while (last >= 0 && !steps[last].has_force[g])
        last--;
    if (last < 0)
        return VALIDITY_COUNT;
    *out_n = fabs(steps[last].force_n[g]);
    enum validity validity = steps[last].validity[g];
    if (steps[step].ms - steps[last].ms > 100)
        return VALIDITY_LOST;
    return last < step && validity == VALIDITY_OK ? VALIDITY_HELD : validity;
}

static void add(struct sums *s, enum validity validity, double force_n) {
    s->ms[validity]++;
    if (validity == VALIDITY_OK) {
        s->sum_n += force_n;
        s->peak_n = fmax(s->peak_n, force_n);
    }
}

static void sum_up(struct sums out[GROUPS + 2]) { // the groups, free, tibia
    double force_n = 0;
    for (int i = 0; i + 1 < STEPS; i++) {
        int place = place_at(i);
        int64_t end_ms = steps[i].ms + 100;
        for (int64_t ms = steps[i].ms; ms < end_ms && ms < steps[i + 1].ms; ms++) {
            if (!steps[i].running)
                continue;
            enum validity validity = gauge_at(i, 0, &force_n);
            if (validity < VALIDITY_COUNT && place >= 0)
                add(&out[place], validity, force_n);
            validity = gauge_at(i, 1, &force_n);
            if (validity < VALIDITY_COUNT)
                add(&out[GROUPS + 1], validity, force_n);
        }
    }
}

// ---- figures ------------------------------------------------------------------------------------

struct wanted {
    enum metric metric;
    int group;
    const char *owner;
    double value;
    bool below_floor;
    int count;
};

static void look(void *context, const struct metric_value *v) {
    struct wanted *w = context;
    if (v->metric != w->metric || v->group != w->group || !v->owner || strcmp(v->owner, w->owner))
        return;
    w->value = v->value;
    w->below_floor = v->below_floor;
    w->count++;
}

static double figure(const struct metrics *m, enum metric metric, const char *owner, int group) {
    struct wanted w = {.metric = metric, .group = group, .owner = owner};
    metrics_each(m, NULL, look, &w);
    assert_int_equal(w.count, 1);
    return w.value;
}

static double share(const struct sums *s, enum validity validity) {
    return (double)s->ms[validity] /
           (double)(s->ms[VALIDITY_OK] + s->ms[VALIDITY_HELD] + s->ms[VALIDITY_LOST]);
}

static void force_is_that_of_every_millisecond(void **state) {
    (void)state;
    static struct metrics m;
    for (uint64_t seed = 1; seed <= 5; seed++) {
        struct random random = {seed};
        struct sums sums[GROUPS + 2] = {0};
        make_steps(&random);
        sum_up(sums);
        metrics_init(&m, instruments_usual(), optic);
        for (int i = 0; i < STEPS; i++)
            take(&m, &steps[i]);
        for (int g = 0; g < GROUPS; g++) {
            const struct sums *s = &sums[g];
            double mean = s->sum_n / (double)s->ms[VALIDITY_OK];
            assert_true(s->ms[VALIDITY_OK] && s->ms[VALIDITY_HELD] && s->ms[VALIDITY_LOST]);
            assert_near(figure(&m, METRIC_FORCE_MEAN, "probe", g), mean, 1e-9);
            assert_near(figure(&m, METRIC_FORCE_PEAK, "probe", g), s->peak_n, 0);
            assert_near(figure(&m, METRIC_FORCE_OK, "probe", g), share(s, VALIDITY_OK), 1e-12);
            assert_near(figure(&m, METRIC_FORCE_HELD, "probe", g), share(s, VALIDITY_HELD), 1e-12);
            assert_near(figure(&m, METRIC_FORCE_LOST, "probe", g), share(s, VALIDITY_LOST), 1e-12);
        }
        const struct sums *free = &sums[GROUPS], *tibia = &sums[GROUPS + 1];
        assert_near(figure(&m, METRIC_FORCE_FREE_MEAN, "probe", -1),
                    free->sum_n / (double)free->ms[VALIDITY_OK], 1e-9);
        assert_near(figure(&m, METRIC_FORCE_FREE_PEAK, "probe", -1), free->peak_n, 0);
        assert_near(figure(&m, METRIC_BONE_FORCE_PEAK, "tibia", -1), tibia->peak_n, 0);
        assert_near(figure(&m, METRIC_BONE_FORCE_OK, "tibia", -1), share(tibia, VALIDITY_OK),
                    1e-12);
    }
}

// ---- what is not there --------------------------------------------------------------------------

static void look_for_force(void *context, const struct metric_value *v) {
    if (strstr(metric_kinds[v->metric].name, "force"))
        (*(int *)context)++;
}

static void without_a_gauge_nothing_is_said_of_force(void **state) {
    (void)state;
    static struct metrics m;
    int found = 0;
    metrics_init(&m, instruments_usual(), optic);
    for (int i = 0; i < 100; i++)
        take(&m, &(struct told){.ms = 10 * i, .present = true, .running = true, .nearest_mm = 0});
    metrics_each(&m, NULL, look_for_force, &found);
    assert_int_equal(found, 0);
}

// A gauge that was always lost says nothing of the force, and that it was lost.
static void a_lost_gauge_has_no_mean_and_no_peak(void **state) {
    (void)state;
    static struct metrics m;
    metrics_init(&m, instruments_usual(), optic);
    for (int i = 0; i < 200; i++) {
        struct told t = {.ms = 10 * i, .present = true, .running = true};
        t.has_force[0] = true;
        t.validity[0] = VALIDITY_LOST;
        t.force_n[0] = 7;
        take(&m, &t);
    }
    assert_true(isnan(figure(&m, METRIC_FORCE_MEAN, "probe", 0)));
    assert_true(isnan(figure(&m, METRIC_FORCE_PEAK, "probe", 0)));
    assert_true(isnan(figure(&m, METRIC_FORCE_FREE_PEAK, "probe", -1)));
    assert_near(figure(&m, METRIC_FORCE_LOST, "probe", 0), 1, 0);
}

static void a_force_of_less_than_a_second_is_below_its_floor(void **state) {
    (void)state;
    static struct metrics m;
    metrics_init(&m, instruments_usual(), optic);
    for (int i = 0; i <= 110; i++) {
        struct told t = {.ms = 10 * i, .present = true, .running = true};
        t.has_force[0] = true;
        t.force_n[0] = -3;
        take(&m, &t);
        if (i != 99 && i != 100)
            continue;
        struct wanted w = {.metric = METRIC_FORCE_MEAN, .owner = "probe"};
        metrics_each(&m, NULL, look, &w);
        assert_int_equal(w.below_floor, i == 99);
        assert_near(w.value, 3, 1e-12);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(force_is_that_of_every_millisecond),
        cmocka_unit_test(without_a_gauge_nothing_is_said_of_force),
        cmocka_unit_test(a_lost_gauge_has_no_mean_and_no_peak),
        cmocka_unit_test(a_force_of_less_than_a_second_is_below_its_floor),
    };
    return cmocka_run_group_tests_name("metrics_force", tests, NULL, NULL);
}
