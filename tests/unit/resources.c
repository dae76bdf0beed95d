// What is said at the start where a system gives too little for its stations.
#include "sessions/resources.h"

#include "test.h"

#include <string.h>

#define GB UINT64_C(1000000000)

static void a_system_that_gives_enough_is_not_spoken_of(void **state) {
    (void)state;
    struct error err;
    assert_int_equal(resources_reckon(4096, &(struct resource_limits){80 * GB, 8704}, &err),
                     RESULT_OK);
    assert_int_equal(resources_reckon(0, &(struct resource_limits){GB, 512}, &err), RESULT_OK);
}

static void what_is_short_is_named_with_its_figures(void **state) {
    (void)state;
    struct error err;
    assert_int_equal(resources_reckon(1000, &(struct resource_limits){80 * GB, 1024}, &err),
                     RESULT_LIMIT);
    assert_non_null(strstr(err.text, "gives 1024 descriptors, and 1000 stations may need 2512"));
    assert_int_equal(resources_reckon(1000, &(struct resource_limits){8 * GB, 4096}, &err),
                     RESULT_LIMIT);
    assert_non_null(strstr(err.text, "1000 stations need 2.6 GB of memory, and 17.3 GB while all"));
    assert_non_null(strstr(err.text, "The system gives 8.0 GB"));
}

static void the_machine_gives_something(void **state) {
    (void)state;
    struct resource_limits limits;
    resources_look(&limits);
    assert_true(limits.bytes > 100 << 20);
    assert_true(limits.descriptors > 16);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_system_that_gives_enough_is_not_spoken_of),
        cmocka_unit_test(what_is_short_is_named_with_its_figures),
        cmocka_unit_test(the_machine_gives_something),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
