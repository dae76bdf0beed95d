// Recorded hands at several rates: noise is noticed, and a hand is not taken for it.
#include "bench/noise_table.h"
#include "test.h"

#include <stdio.h>
#include <stdlib.h>

static struct noise_row rows[NOISE_ROWS];
static int row_count;

static void no_recording_is_missing(void **state) {
    (void)state;
    assert_int_equal(row_count, NOISE_ROWS);
}

static void no_pose_of_a_hand_is_taken_for_noise(void **state) {
    (void)state;
    for (int i = 0; i < row_count; i++)
        if (rows[i].clean > 0)
            fail_msg("%s at %g Hz: %g of the poses", rows[i].file, rows[i].rate_hz, rows[i].clean);
}

static void noise_of_2_mm_is_noticed_at_each_rate(void **state) {
    (void)state;
    for (int i = 0; i < row_count; i++)
        if (rows[i].noisy < 0.5)
            fail_msg("%s at %g Hz: only %g of the poses", rows[i].file, rows[i].rate_hz,
                     rows[i].noisy);
}

int main(void) {
    const char *data = getenv("ARTHRON_DATA");
    row_count = noise_table(data ? data : DATA, rows);
    if (!row_count) {
        puts("skipped: the recordings are not there");
        return 77;
    }
    for (int i = 0; i < row_count; i++)
        printf("%-40s %5g Hz  clean %.3f  2 mm %.3f\n", rows[i].file, rows[i].rate_hz,
               rows[i].clean, rows[i].noisy);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_recording_is_missing),
        cmocka_unit_test(no_pose_of_a_hand_is_taken_for_noise),
        cmocka_unit_test(noise_of_2_mm_is_noticed_at_each_rate),
    };
    return cmocka_run_group_tests_name("noise_rates", tests, NULL, NULL);
}
