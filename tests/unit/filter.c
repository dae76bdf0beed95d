// The one-euro filter against closed forms and a plain transcription of its paper.

#include "samples/filter.h"

#include "base/clock.h"
#include "random.h"
#include "samples/runner.h"
#include "test.h"

#include <string.h>
#include <unistd.h>

static struct filter made(const char *text) {
    struct filter_settings settings;
    struct filter filter;
    assert_true(filter_parse(text, &settings));
    filter_init(&filter, &settings);
    return filter;
}

static struct sample posed(int64_t time_ns, vec3 translation, quat rotation) {
    return (struct sample){.channel = CHANNEL_PROBE,
                           .kind = SAMPLE_POSE,
                           .time_ns = time_ns,
                           .T_mockup_body = {rotation, translation}};
}

static const int64_t period_ns = 10 * NS_PER_MS;

// ---- lag ----------------------------------------------------------------------------------------

// Runs a steady motion of speeds that are multiples of `rate` a second, until the filter is
// settled.
static struct sample after_steady_motion(struct filter *f, enum sample_kind kind, double rate,
                                         double *out_t) {
    vec3 axis = vec3_unit_or((vec3){1, -2, 2}, (vec3){0});
    struct sample s = {0};
    for (int i = 1; i <= 3000; i++) {
        double t = *out_t = 1e-9 * (double)(i * period_ns), turn = rate * t * RAD_PER_DEG;
        vec3 place = vec3_scale(rate * t, axis);
        s = posed(i * period_ns, place, quat_from_axis_angle(axis, turn));
        s.kind = kind;
        if (kind == SAMPLE_JOINT)
            s.joint =
                (struct joint_angles){rate * t / 3, rate * t * 2 / 3, -rate * t * 2 / 3, rate * t};
        if (kind == SAMPLE_HANDLE)
            s.handle = (struct handle){rate * t / 100, 5};
        if (kind == SAMPLE_FORCE)
            s.force_n = rate * t;
        filter_apply(f, &s);
    }
    return s;
}

static void a_steady_motion_lags_by_the_latency_that_is_stated(void **state) {
    (void)state;
    const struct {
        const char *text;
        double rate, cutoff_hz;
    } rows[] = {{"one-euro 5 0", 3, 5}, {"one-euro 2 0.1 2", 3, 2.3}, {"one-euro 1 1", 2, 3}};
    vec3 axis = vec3_unit_or((vec3){1, -2, 2}, (vec3){0});
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        for (int kind = 0; kind < SAMPLE_KIND_COUNT; kind++) {
            struct filter f = made(rows[i].text);
            double t, lag = 1 / (2 * M_PI * rows[i].cutoff_hz), rate = rows[i].rate;
            struct sample s = after_steady_motion(&f, (enum sample_kind)kind, rate, &t);
            double behind = rate * (t - lag);
            assert_near(f.latency_s, lag, 1e-6);
            assert_int_equal(s.filter, FILTER_ONE_EURO);
            assert_near(s.filter_latency_us, fmin(UINT16_MAX, 1e6 * lag), 1);
            if (kind == SAMPLE_POSE) {
                assert_near(vec3_dot(s.T_mockup_body.translation, axis), behind, 1e-6);
                quat want = quat_from_axis_angle(axis, behind * RAD_PER_DEG);
                assert_near(quat_angle(s.T_mockup_body.rotation, want), 0, 1e-6);
            } else if (kind == SAMPLE_JOINT) {
                assert_near(s.joint.varus_deg, behind * 2 / 3, 1e-6);
                assert_near(s.joint.shift_mm, behind, 1e-6);
            } else if (kind == SAMPLE_FORCE) {
                assert_near(s.force_n, behind, 1e-6);
            } else {
                assert_near(s.handle.opening, behind / 100, 1e-8);
                assert_int_equal(s.handle.buttons, 5);
            }
        }
}

// ---- against the paper's algorithm --------------------------------------------------------------

struct scalar {
    double raw, smoothed, speed;
    int count;
};

static double scalar_share(double cutoff_hz, double rate_hz) {
    double tau = 1 / (2 * M_PI * cutoff_hz), te = 1 / rate_hz;
    return 1 / (1 + tau / te);
}

static double scalar_filter(struct scalar *f, double x, double rate_hz, double min_cutoff,
                            double beta, double dcutoff) {
    double dx = f->count ? (x - f->raw) * rate_hz : 0, a = scalar_share(dcutoff, rate_hz);
    f->speed = f->count ? a * dx + (1 - a) * f->speed : 0;
    a = scalar_share(min_cutoff + beta * fabs(f->speed), rate_hz);
    f->smoothed = f->count ? a * x + (1 - a) * f->smoothed : x;
    f->raw = x;
    f->count++;
    return f->smoothed;
}

static void along_one_axis_it_is_the_papers_filter(void **state) {
    (void)state;
    struct random random = {5};
    struct filter f = made("one-euro 1.5 0.02 0.7");
    struct scalar reference = {0};
    double x = 0;
    int64_t time_ns = NS_PER_S;
    for (int i = 0; i < 2000; i++) {
        int64_t step_ns = (int64_t)random_between(&random, 1e6, 2e8);
        time_ns += step_ns;
        x += random_between(&random, -3, 3.5);
        struct sample s = posed(time_ns, (vec3){0, x, 0}, quat_identity());
        filter_apply(&f, &s);
        double want = scalar_filter(&reference, x, 1e9 / (double)step_ns, 1.5, 0.02, 0.7);
        assert_near(s.T_mockup_body.translation.y, want, 1e-9 * (1 + fabs(want)));
    }
}

static void the_result_does_not_depend_on_how_the_axes_lie(void **state) {
    (void)state;
    struct random random = {6};
    struct filter f = made("one-euro 1 0.1"), turned = made("one-euro 1 0.1");
    quat q = quat_from_axis_angle(vec3_unit_or((vec3){3, 1, -2}, (vec3){0}), 2);
    vec3 p = {0};
    quat r = quat_identity();
    for (int i = 1; i < 1000; i++) {
        p = vec3_add_scaled(p, random_between(&random, 0, 2), random_direction(&random));
        r = quat_multiply(quat_from_axis_angle(random_direction(&random), 0.1), r);
        struct sample a = posed(i * period_ns, p, r);
        struct sample b = posed(i * period_ns, quat_rotate(q, p), quat_multiply(q, r));
        if (i % 3 == 0) // the same rotation
            b.T_mockup_body.rotation = quat_multiply((quat){-1, 0, 0, 0}, b.T_mockup_body.rotation);
        filter_apply(&f, &a);
        filter_apply(&turned, &b);
        assert_vec3_near(b.T_mockup_body.translation, quat_rotate(q, a.T_mockup_body.translation),
                         1e-9);
        assert_near(
            quat_angle(b.T_mockup_body.rotation, quat_multiply(q, a.T_mockup_body.rotation)), 0,
            1e-6);
    }
}

static void noise_at_rest_becomes_smaller_by_the_closed_form(void **state) {
    (void)state;
    struct random random = {7};
    struct filter f = made("one-euro 2 0");
    double sum = 0, raw_sum = 0, a = scalar_share(2, 100);
    for (int i = 1; i < 200000; i++) {
        double x = random_between(&random, -1, 1);
        struct sample s = posed(i * period_ns, (vec3){x, 0, 0}, quat_identity());
        filter_apply(&f, &s);
        raw_sum += x * x;
        sum += s.T_mockup_body.translation.x * s.T_mockup_body.translation.x;
    }
    assert_near(sum / raw_sum, a / (2 - a), 0.005);
}

// ---- beginnings ---------------------------------------------------------------------------------

static void after_a_pause_it_starts_anew(void **state) {
    (void)state;
    struct filter f = made("one-euro 1 0");
    for (int i = 1; i <= 20; i++) {
        struct sample s = posed(i * period_ns, (vec3){i, 0, 0}, quat_identity());
        filter_apply(&f, &s);
        assert_int_equal(i == 1, s.T_mockup_body.translation.x == i);
        assert_int_equal(i == 1, s.filter_latency_us == 0);
        assert_int_equal(i == 1, s.filter_latency_us != UINT16_MAX); // 159 ms
    }
    struct sample s = posed(20 * period_ns + FILTER_MEMORY_NS + 1, (vec3){700}, quat_identity());
    filter_apply(&f, &s);
    assert_near(s.T_mockup_body.translation.x, 700, 0);
}

static void none_leaves_all_as_it_is(void **state) {
    (void)state;
    struct filter f = made("none");
    for (int i = 1; i < 10; i++) {
        struct sample s = posed(i * period_ns, (vec3){i * i}, quat_identity()), before = s;
        filter_apply(&f, &s);
        assert_memory_equal(&s, &before, sizeof s);
    }
}

static void only_what_is_a_filter_is_taken_for_one(void **state) {
    (void)state;
    static const char *const wrong[] = {
        "",
        "one-euro",
        "one-euro 1",
        "one-euro 1 0 1 1",
        "one-euro 0 1",
        "one-euro 1 -1",
        "one-euro 1 0 0",
        "one-euro nan 1",
        "one-euro 1 1 x",
        "two-euro 1 0",
        "none 1",
        "one-euro 1 1x",
        "one-euro 1000000000000000000000000000000000000 1",
    };
    struct filter_settings s;
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++)
        if (filter_parse(wrong[i], &s))
            fail_msg("\"%s\" was taken", wrong[i]);
    assert_true(filter_parse("one-euro  1.5\t0.25", &s));
    assert_near(s.min_cutoff_hz, 1.5, 0);
    assert_near(s.beta, 0.25, 0);
    assert_near(s.dcutoff_hz, 1, 0);
}

// ---- in a station -------------------------------------------------------------------------------

static void a_station_states_it_in_samples_and_status(void **state) {
    (void)state;
    const struct device_option options[] = {{"driver", "simulated"}, {"filter", "one-euro 4 0"}};
    struct device_config config = {"arm", options, 2};
    struct runner *runner;
    struct error err;
    struct device_status status;
    assert_int_equal(RESULT_OK, runner_create(&config, 1, &runner, &err));
    do {
        usleep(2000);
        runner_status(runner, 0, &status);
    } while (status.filter_latency_ms == 0);
    assert_int_equal(FILTER_ONE_EURO, status.filter);
    assert_near(status.filter_latency_ms, 1e3 / (2 * M_PI * 4), 1e-6);
    struct frame frame = {.number = 1};
    runner_collect(runner, clock_now_ns(), &frame);
    for (int i = 0; i < frame.count; i++) {
        assert_int_equal(FILTER_ONE_EURO, frame.samples[i].filter);
        assert_int_equal(39789, frame.samples[i].filter_latency_us);
    }
    runner_destroy(&runner);
}

static void a_station_refuses_what_is_no_filter(void **state) {
    (void)state;
    const struct device_option options[] = {{"driver", "simulated"}, {"filter", "kalman"}};
    struct device_config config = {"arm", options, 2};
    struct runner *runner = NULL;
    struct error err;
    assert_int_equal(RESULT_INVALID, runner_create(&config, 1, &runner, &err));
    assert_non_null(strstr(err.text, "[device arm] filter: \"kalman\""));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_steady_motion_lags_by_the_latency_that_is_stated),
        cmocka_unit_test(along_one_axis_it_is_the_papers_filter),
        cmocka_unit_test(the_result_does_not_depend_on_how_the_axes_lie),
        cmocka_unit_test(noise_at_rest_becomes_smaller_by_the_closed_form),
        cmocka_unit_test(after_a_pause_it_starts_anew),
        cmocka_unit_test(none_leaves_all_as_it_is),
        cmocka_unit_test(only_what_is_a_filter_is_taken_for_one),
        cmocka_unit_test(a_station_states_it_in_samples_and_status),
        cmocka_unit_test(a_station_refuses_what_is_no_filter),
    };
    return cmocka_run_group_tests_name("filter", tests, NULL, NULL);
}
