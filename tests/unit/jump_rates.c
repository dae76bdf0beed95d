// Recorded hands at several rates, as they are, said again and again, and in coarse steps: none of
// their poses is taken for a jump, and a pose that lies away is, by the same hand's measure.

#include "base/clock.h"
#include "drivers/recording.h"
#include "random.h"
#include "samples/guard.h"
#include "samples/slot.h"
#include "test.h"

#include <stdio.h>
#include <stdlib.h>

enum { POSES_MAX = 1500, REPEATS = 5, AWAY_EVERY = 25 };
enum { LEARNT = 4 }; // poses, until it is known that each is said several times

static const char *const files[] = {
    "em_watertank_probe.csv",      "em_watertank_probe_raw_timestamps.csv",
    "stylus_landmarks.csv",        "stylus_landmarks_reference.csv",
    "optical50_probe.csv",         "nwire_probe.csv",
    "mocap100_handheld_fr1xyz.csv"};
static const double rates_hz[] = {10, 12, 15, 20, 30, 60, 100, 300};
enum { FILES = sizeof files / sizeof *files, RATES = sizeof rates_hz / sizeof *rates_hz };

static struct recording recordings[FILES];

struct variant {
    int repeats;    // how often each pose is said
    double step_mm; // 0: not coarse
    double away_mm; // of some poses; 0: of none
};

struct share {
    int clean, clean_caught, away, away_caught;
};

static double rounded(double value, double step) {
    return step > 0 ? step * round(value / step) : value;
}

static struct share play(const struct recording *r, double rate_hz, const struct variant *v) {
    struct guard guard;
    struct random random = {11};
    struct share share = {0};
    double last_s = r->t_seconds[r->row_count - 1];
    guard_init(&guard, &guard_hand, SLOT_JUMP_MM, SLOT_JUMP_DEG);
    for (int i = 0; i < POSES_MAX && r->t_seconds[0] + i / rate_hz <= last_s; i++) {
        double t = r->t_seconds[0] + i / rate_hz;
        struct recording_state s = recording_tool_at(r, 0, t);
        vec3 *at = &s.pose.translation;
        bool away = v->away_mm > 0 && i % AWAY_EVERY == AWAY_EVERY - 1;
        if (!s.valid)
            continue;
        *at = (vec3){rounded(at->x, v->step_mm), rounded(at->y, v->step_mm),
                     rounded(at->z, v->step_mm)};
        if (away)
            *at = vec3_add_scaled(*at, v->away_mm, random_direction(&random));
        for (int k = 0; k < v->repeats; k++) {
            double said_s = t + 1 + k / (rate_hz * v->repeats);
            bool caught = !guard_takes(&guard, (int64_t)(said_s * NS_PER_S), s.pose);
            share.away += away;
            share.away_caught += away && caught;
            share.clean += !away;
            share.clean_caught += !away && caught && (v->repeats == 1 || i >= LEARNT);
        }
    }
    return share;
}

static void expect(const struct variant *v, double from_hz) {
    for (int f = 0; f < FILES; f++)
        for (int i = 0; i < RATES; i++) {
            struct share s = play(&recordings[f], rates_hz[i], v);
            if (rates_hz[i] >= from_hz && (s.clean_caught || s.away_caught < s.away))
                fail_msg("%s at %g Hz, said %d times, steps of %g mm: %d of %d caught, and %d of "
                         "%d that lie %g mm away",
                         files[f], rates_hz[i], v->repeats, v->step_mm, s.clean_caught, s.clean,
                         s.away_caught, s.away, v->away_mm);
        }
}

static void no_pose_of_a_hand_is_taken_for_a_jump_at_any_rate(void **state) {
    (void)state;
    expect(&(struct variant){1, 0, 0}, 10);
}

static void nor_where_the_source_says_each_several_times(void **state) {
    (void)state;
    expect(&(struct variant){REPEATS, 0, 0}, 10);
}

static void nor_in_coarse_steps(void **state) {
    (void)state;
    expect(&(struct variant){1, 5, 0}, 10);
    expect(&(struct variant){REPEATS, 5, 0}, 10);
}

// The slower the source, the farther a hand comes between two poses.
static void a_pose_that_no_hand_reaches_is_caught(void **state) {
    (void)state;
    expect(&(struct variant){1, 0, 400}, 10);
    expect(&(struct variant){1, 0, 100}, 30);
    expect(&(struct variant){1, 0, 40}, 60);
    expect(&(struct variant){1, 5, 40}, 60);
    expect(&(struct variant){1, 0, 30}, 300);
}

// From rest to 2 m/s within 0.2 s and to rest again, at all rates, said once and several times.
static void a_fast_reach_is_no_jump(void **state) {
    (void)state;
    for (int i = 0; i < RATES; i++)
        for (int repeats = 1; repeats <= REPEATS; repeats += REPEATS - 1) {
            struct guard guard;
            guard_init(&guard, &guard_hand, SLOT_JUMP_MM, SLOT_JUMP_DEG);
            for (int k = 0; k < 3 * rates_hz[i] * repeats; k++) {
                double said_s = k / rates_hz[i] / repeats;
                double t = floor(said_s * rates_hz[i] + 1e-9) / rates_hz[i];
                double phase = fabs(fmod(t, 3) - 1.5) - 0.5, way = fmax(0, fmin(0.4, phase)) / 0.4;
                pose p = {quat_identity(), {400 * (way - sin(2 * M_PI * way) / (2 * M_PI)), 0, 0}};
                p.translation.y = 0.01 * sin(1000 * t); // a source that measures
                bool taken = guard_takes(&guard, (int64_t)((said_s + 1) * NS_PER_S), p);
                if (!taken && t * rates_hz[i] > LEARNT)
                    fail_msg("%g Hz, said %d times, at %g s", rates_hz[i], repeats, t);
            }
        }
}

// A joint's encoder at rest, of whole degrees, saves up no motion.
static void a_leap_after_a_rest_is_caught(void **state) {
    (void)state;
    for (int i = 4; i < RATES; i++) {
        struct guard guard;
        double turn_deg = 0;
        guard_init(&guard, &guard_joint, SLOT_JUMP_MM, SLOT_JUMP_DEG);
        for (int k = 0; k < 5 * rates_hz[i]; k++) {
            double t = k / rates_hz[i];
            turn_deg = t < 2 ? round(20 * t) : t < 4 ? 40 : 100;
            pose p = {quat_from_axis_angle((vec3){1, 0, 0}, turn_deg * RAD_PER_DEG), {0, 0, 0}};
            assert_int_equal(guard_takes(&guard, (int64_t)((t + 1) * NS_PER_S), p), t < 4);
        }
    }
}

int main(void) {
    const char *data = getenv("ARTHRON_DATA");
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_pose_of_a_hand_is_taken_for_a_jump_at_any_rate),
        cmocka_unit_test(nor_where_the_source_says_each_several_times),
        cmocka_unit_test(nor_in_coarse_steps),
        cmocka_unit_test(a_pose_that_no_hand_reaches_is_caught),
        cmocka_unit_test(a_fast_reach_is_no_jump),
        cmocka_unit_test(a_leap_after_a_rest_is_caught),
    };
    for (int f = 0; f < FILES; f++) {
        char path[512];
        snprintf(path, sizeof path, "%s/tracker/%s", data ? data : DATA, files[f]);
        if (recording_read(path, CHANNEL_PROBE, &recordings[f], NULL) != RESULT_OK) {
            puts("skipped: the recordings are not there");
            return 77;
        }
    }
    int failed = cmocka_run_group_tests_name("jump_rates", tests, NULL, NULL);
    for (int f = 0; f < FILES; f++)
        recording_fini(&recordings[f]);
    return failed;
}
