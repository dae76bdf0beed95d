// What every C test includes: cmocka with the headers it asks for.
#pragma once

#include "base/result.h" // before cmocka, whose macro is named fail too

// clang-format off
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
// clang-format on

#include <math.h>

// RESULT_OK from a call that leaves its error in `err`, a struct error of the caller.
#define assert_ok(call)                                                                            \
    do {                                                                                           \
        if ((call) != RESULT_OK)                                                                   \
            fail_msg("%s: %s", #call, err.text);                                                   \
    } while (0)

// |a - b| <= tolerance, and neither is NaN.
#define assert_near(a, b, tolerance)                                                               \
    do {                                                                                           \
        double near_a = (a), near_b = (b);                                                         \
        if (!(fabs(near_a - near_b) <= (tolerance)))                                               \
            fail_msg("%s = %.17g, %s = %.17g: differ by %g, more than %g", #a, near_a, #b, near_b, \
                     fabs(near_a - near_b), (double)(tolerance));                                  \
    } while (0)

#define assert_vec3_near(a, b, tolerance)                                                          \
    do {                                                                                           \
        vec3 vec_a = (a), vec_b = (b);                                                             \
        assert_near(vec_a.x, vec_b.x, tolerance);                                                  \
        assert_near(vec_a.y, vec_b.y, tolerance);                                                  \
        assert_near(vec_a.z, vec_b.z, tolerance);                                                  \
    } while (0)
