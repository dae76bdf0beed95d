// Meshes of any scan or model to a case.
//
// Each file has a frame of its own, T_common_file (millimetres), into one common frame: the scan's.
// From there an import_frame takes points to the case: x to the right of the patient, y anterior, z
// proximal, the joint's centre at the origin.
#pragma once

#include "case/case.h"
#include "import/frame.h"
#include "import/reader.h"
#include "import/repair.h"

struct import_source {
    const char *path;
    double mm_per_unit;               // of the file
    pose T_common_file;               // after scaling to mm
    const struct import_frame *frame; // NULL: the common frame is the case's
};

// Corners of an STL file, and of any other whose triangles share no vertex, as near as this are
// one.
#define IMPORT_SOUP_WELD_MM 1e-3
// Of a mesh's area: components with less are taken for islands of a segmentation.
#define IMPORT_ISLAND_SHARE 0.02

// Reads a PLY, OBJ, STL, OFF, VTK or glTF file (import/reader.h) that is not over the limits. The
// caller releases *out_arrays with import_arrays_fini.
enum result import_read(const char *path, const struct case_limits *limits,
                        struct import_arrays *out_arrays, struct error *err);

// Brings what was read into the case's frame and repairs it (import/repair.h). The caller releases
// *out_mesh with mesh_fini. The error names the path. Refuses a mesh that mesh_validate refuses,
// and one of which repair leaves nothing.
enum result import_make(const struct import_source *source, const struct import_arrays *arrays,
                        struct mesh *out_mesh, struct repair_report *out_report, struct error *err);

// Both.
enum result import_mesh(const struct import_source *source, const struct case_limits *limits,
                        struct mesh *out_mesh, struct repair_report *out_report, struct error *err);

// The default body of a group of this name: patella*: patella;
// *tibia*, *fibula*, meniscus*, acl, pcl, mcl, lcl: tibia; all others: femur.
enum body import_default_body(const char *group);

// The default other bone of a ligament: acl, pcl, mcl, lcl: femur, or tibia
// where they are of the femur's body; patellar_ligament, patellar_tendon, and the skin: tibia.
// BODY_COUNT: of no other.
enum body import_default_bridge(const char *group, enum body body);

// Of all its parts: RESULT_INVALID where a tibia or femur is too small or large for a knee: the
// middle one of the three sides of its box is 40 to 130 mm. The text names the unit, of mm, cm and
// m, that would fit a file read with mm_per_unit.
enum result import_check_bone(const struct case_group *bone, double mm_per_unit, struct error *err);

// Where the joint frame lies in the femur's frame, from the distal 35 mm of the femur in the case's
// frame: not turned; its origin in the middle from left to right, and r above the distal and before
// the posterior end, where r, 0.27 times the width, is the radius of the posterior condyles. Good
// to some millimetres. The femur must be there.
pose import_estimate_joint(struct knee_case *knee);
