#include "import/frame.h"

#include <string.h>

#define GRID_PER_MM 0x1p32

static vec3 to_grid(vec3 p) {
    return (vec3){rint(p.x * GRID_PER_MM) / GRID_PER_MM, rint(p.y * GRID_PER_MM) / GRID_PER_MM,
                  rint(p.z * GRID_PER_MM) / GRID_PER_MM};
}

bool import_axes(const char *letters, struct import_frame *out_frame) {
    static const char directions[] = "RLAPSI"; // two for each axis of the case, forward first
    if (strlen(letters) != 3)
        return false;
    mat3 r = {0};
    for (int column = 0; column < 3; column++) {
        const char *found = strchr(directions, letters[column]);
        if (!found)
            return false;
        int which = (int)(found - directions);
        r.m[which / 2][column] = which % 2 == 0 ? 1 : -1;
    }
    if (mat3_determinant(r) == 0)
        return false;
    *out_frame = (struct import_frame){.R_case_common = r};
    return true;
}

vec3 import_shift(const struct import_frame *frame, vec3 turned) {
    return vec3_sub(to_grid(vec3_sub(turned, frame->vertex)), frame->centre);
}

vec3 import_to_case(const struct import_frame *frame, vec3 common) {
    return import_shift(frame, mat3_apply(frame->R_case_common, common));
}

void import_set_centre(struct import_frame *frame, vec3 centre) {
    frame->centre = to_grid(centre);
}

pose import_frame_pose(const struct import_frame *frame, bool *out_mirrored) {
    mat3 r = frame->R_case_common;
    *out_mirrored = mat3_determinant(r) < 0;
    for (int row = 0; *out_mirrored && row < 3; row++)
        r.m[row][0] = -r.m[row][0];
    vec3 shift = vec3_scale(-1, vec3_add(frame->vertex, frame->centre));
    return (pose){quat_from_mat3(r), shift};
}
