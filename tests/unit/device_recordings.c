// Real trackers' recordings, through the guard as the runner uses it.

#include "base/clock.h"
#include "drivers/recording.h"
#include "samples/slot.h"
#include "test.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static bool load(const char *name, struct recording *out) {
    const char *data = getenv("ARTHRON_DATA");
    char path[512];
    struct error err;
    snprintf(path, sizeof path, "%s/tracker/%s", data ? data : DATA, name);
    enum result result = recording_read(path, CHANNEL_PROBE, out, &err);
    if (result != RESULT_OK && result != RESULT_MISSING)
        fail_msg("%s", err.text);
    return result == RESULT_OK;
}

struct counts {
    int used, silent, jumps, noisy, malformed, losses;
    int jump_row; // the last one
};

static struct counts play(const struct recording *r) {
    struct slot slot;
    struct counts counts = {0};
    slot_init(&slot, CHANNEL_PROBE, SAMPLE_POSE, 0, 100, SLOT_JUMP_MM);
    for (int i = 0; i < r->row_count; i++) {
        const struct recording_state *s = &r->tools[0].states[i];
        struct sample sample = {.channel = CHANNEL_PROBE,
                                .kind = SAMPLE_POSE,
                                .validity = s->valid ? VALIDITY_OK : VALIDITY_LOST,
                                .time_ns = (int64_t)((r->t_seconds[i] + 1) * NS_PER_S),
                                .T_mockup_body = s->pose};
        counts.losses += slot_age(&slot, sample.time_ns);
        switch (slot_take(&slot, &sample, sample.time_ns)) {
        case SLOT_USED:
            counts.used++;
            break;
        case SLOT_NOISY:
            counts.noisy++;
            break;
        case SLOT_SILENT:
            counts.silent++;
            break;
        case SLOT_JUMP:
            counts.jumps++;
            counts.jump_row = i;
            break;
        case SLOT_MALFORMED:
            counts.malformed++;
            break;
        }
    }
    return counts;
}

static void the_real_glitch_is_caught_and_nothing_else(void **state) {
    (void)state;
    struct recording r;
    assert_true(load("optical50_reference_glitch.csv", &r));
    struct counts counts = play(&r);
    assert_int_equal(1, counts.jumps);
    assert_int_equal(7, counts.jump_row); // at 0.141 s
    assert_int_equal(499, counts.used);
    assert_int_equal(0, counts.malformed);
    assert_int_equal(0, counts.losses);
    recording_fini(&r);
}

static void real_hands_do_not_jump(void **state) {
    (void)state;
    static const struct {
        const char *file;
        int used, silent;
    } rows[] = {
        {"em_watertank_probe.csv", 5000, 0},
        {"em_watertank_probe_raw_timestamps.csv", 5000, 0},
        {"em_watertank_stylus_static.csv", 5000, 0},
        {"stylus_landmarks.csv", 1000, 0},
        {"stylus_landmarks_reference.csv", 1000, 0},
        {"optical50_probe.csv", 499, 1},
        {"nwire_probe.csv", 97, 0},
        {"nwire_stylus_out_of_view.csv", 0, 97},
        {"mocap100_handheld_fr1xyz.csv", 3000, 0},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct recording r;
        assert_true(load(rows[i].file, &r));
        struct counts counts = play(&r);
        if (counts.jumps || counts.noisy || counts.malformed || counts.used != rows[i].used ||
            counts.silent != rows[i].silent)
            fail_msg(
                "%s: %d used, %d silent, %d jumps (the last at row %d), %d noisy, %d malformed",
                rows[i].file, counts.used, counts.silent, counts.jumps, counts.jump_row,
                counts.noisy, counts.malformed);
        recording_fini(&r);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_real_glitch_is_caught_and_nothing_else),
        cmocka_unit_test(real_hands_do_not_jump),
    };
    struct recording r;
    bool there = load("optical50_reference_glitch.csv", &r);
    recording_fini(&r);
    if (!there) {
        printf("skipped: no shared data (ARTHRON_DATA)\n");
        return 77;
    }
    return cmocka_run_group_tests_name("device_recordings", tests, NULL, NULL);
}
