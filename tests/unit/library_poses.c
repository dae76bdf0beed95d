#include "library_poses.h"

#include "test.h"

static void assert_place(const float position[3], pose p) {
    vec3 place = {(double)position[0], (double)position[1], (double)position[2]};
    assert_vec3_near(place, p.translation, 2e-5);
}

void assert_library_matrix(const struct library_tool *tool, pose p) {
    mat3 r = quat_to_mat3(p.rotation);
    assert_place(tool->position, p);
    for (int i = 0; i < 9; i++)
        assert_near((double)tool->matrix[i / 3][i % 3], r.m[i / 3][i % 3], 1e-6);
}

void assert_library_quaternion(const struct library_tool *tool, pose p) {
    const float *q = tool->quaternion;
    const double found[] = {(double)q[3], (double)q[0], (double)q[1], (double)q[2]};
    const double wanted[] = {p.rotation.w, p.rotation.x, p.rotation.y, p.rotation.z};
    double same = 0;
    for (int i = 0; i < 4; i++)
        same += found[i] * wanted[i];
    assert_place(tool->position, p);
    for (int i = 0; i < 4; i++)
        assert_near(found[i], same < 0 ? -wanted[i] : wanted[i], 1e-6);
}
