// What a station's check found.
#include "tools/findings.h"

#include "test.h"

static void a_fault_for_which_there_is_no_room_makes_a_station_unready(void **state) {
    (void)state;
    static struct findings findings;
    for (int i = 0; i < FINDINGS_MAX; i++)
        findings_add(&findings, true, "probe", "", "%d", i);
    assert_true(findings_are_good(&findings));
    findings_add(&findings, false, "server", "start it", "does not answer");
    assert_int_equal(findings.count, FINDINGS_MAX);
    assert_false(findings_are_good(&findings));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_fault_for_which_there_is_no_room_makes_a_station_unready),
    };
    return cmocka_run_group_tests_name("findings", tests, NULL, NULL);
}
