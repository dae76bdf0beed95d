// From the frame of a scan to that of its case: x to the right of the patient, y anterior, z
// proximal, the joint's centre at the origin.
//
// A scan that was moved, mirrored, turned by right angles or written in another unit gives the same
// case to the bit, as far as its numbers are the same to 1e-10 mm: coordinates are taken relative to
// a vertex of the knee and rounded to a grid of 2^-32 mm before anything else is done with them.
#pragma once

#include "base/pose.h"

#include <stdbool.h>

struct import_frame {
    mat3 R_case_common; // of -1, 0 and 1; a mirror where its determinant is -1
    vec3 vertex;        // of the knee: mm, turned as the case, the origin that of the scan
    vec3 centre;        // of the joint, from that vertex; on the grid
};

// The turn from three letters that say where x, y, z of the common frame point: R or L (right, left
// of the patient), A or P (anterior, posterior), S or I (superior, inferior). A left-handed frame,
// such as LAS, is a mirror. The origin stays. False for anything else.
bool import_axes(const char *letters, struct import_frame *out_frame);

// mm of the common frame to the case.
vec3 import_to_case(const struct import_frame *frame, vec3 common);

// A point that is turned already, with the scan's origin, to the case.
vec3 import_shift(const struct import_frame *frame, vec3 turned);

// Puts the origin of the case to a point that is given relative to frame->vertex.
void import_set_centre(struct import_frame *frame, vec3 centre);

// The same as a pose: takes mm of the common frame to the case. Where *out_mirrored, the x of the
// common frame changes its sign first.
pose import_frame_pose(const struct import_frame *frame, bool *out_mirrored);
