// A knee of boxes, and files of tests.
#pragma once

#include "case/case.h"
#include "folder.h"

// Right knee "boxes": tibia (parts bone and cartilage, with a warp), femur, patella,
// meniscus_medial (cuttable, with a maxcut, a tear of one part and a plan of two), lcl (bridges to
// the femur), one portal, two patella keys, two poses at rest, mcl and acl torn with two keys and
// one. Passes case_validate.
struct knee_case *box_knee(void);

// A closed box with 8 vertices and 12 triangles facing outwards.
void box_mesh(vec3 centre, vec3 half, struct mesh *out_mesh);

void write_file(const char *dir, const char *name, const void *bytes, size_t size);
// The caller frees it; *out_size may be NULL; a zero byte follows the bytes.
char *read_file(const char *dir, const char *name, size_t *out_size);
