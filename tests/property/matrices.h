// Matrices in assertions.
#pragma once

#include "base/pose.h"
#include "test.h"

static inline void assert_mat3_near(mat3 a, mat3 b, double tolerance) {
    for (int row = 0; row < 3; row++)
        for (int column = 0; column < 3; column++)
            assert_near(a.m[row][column], b.m[row][column], tolerance);
}
