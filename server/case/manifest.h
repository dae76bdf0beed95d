// case.json, the manifest of a case: everything but the meshes.
//
//     { "format": 2, "name": "knee_a", "title": "…", "side": "left",
//       "anatomy_xxh3": "16 hex digits",
//       "joint": { "T_femur_joint": [x, y, z, qw, qx, qy, qz], "T_tibia_joint": […] },
//       "scan": { "mirrored": false, "T_case_scan": [x, y, z, qw, qx, qy, qz] },
//       "groups": [ { "name": "tibia", "body": "tibia", "cuttable": false },
//                   { "name": "mcl", "body": "tibia", "bridges": "femur", "cuttable": false },
//                   { "name": "meniscus_medial", "body": "tibia", "cuttable": true,
//                     "lesion": { "tear": [ [ [nx, ny, nz, offset], … ], … ],
//                                 "damage": […], "plan": […] } },
//                   { "name": "plica", "body": "femur", "cuttable": true, "tissue": "synovium",
//                     "label": "Medial plica", "colour": "#f0a69e", "side": "medial",
//                     "zones": false }, … ],
//       "portals": [ { "name": "anterolateral", "position": [x, y, z], "direction": […] }, … ],
//       "landmarks": [ { "name": "notch", "body": "femur", "at": [x, y, z], "error_mm": 1.5,
//                        "by": "proposal" }, … ],
//       "loose": [ { "name": "loose_1", "body": "femur", "at": [x, y, z],
//                    "radii_mm": [3.5, 3, 2] }, … ],
//       "rest": [ [x, y, z, qw, qx, qy, qz], … ],
//       "torn": [ { "ligament": "mcl",
//                   "keys": [ { "physical": [x, y, z, qw, …], "target": […] }, … ] }, … ],
//       "patella": [ { "flexion_deg": 0, "T_femur_patella": [x, y, z, qw, qx, qy, qz] }, … ] }
//
// Millimetres and unit quaternions. A landmark is by "proposal" or by "hand". A region of a lesion
// is a list of convex parts (up to 32), a part a list of planes (up to 64): inside where n · p <=
// offset, in the frame of the group's virtual mesh (S'). T_case_scan takes a point of the scan that
// was imported to the femur's frame; where mirrored, its x changes its sign before. tissue, label,
// colour, side and zones describe a group; what is absent follows from its name (case/tissue.h),
// and is not written. title, scan, bridges, cuttable, lesion and its regions, portals, landmarks,
// loose, rest, torn, patella and anatomy_xxh3 may be absent. Remove anatomy_xxh3 after you have
// edited anatomy.glb on purpose. Other keys are refused.
#pragma once

#include "case/case.h"

// Format 2 has scan and landmarks besides, format 3 descriptions of groups, format 4 loose bodies.
// A manifest is written in the lowest format that holds it, which older programs read; of a higher
// one they say that it is of another version.
#define MANIFEST_FORMAT 4

// Makes a case with groups that have no mesh yet. The error names the key's path. The caller
// destroys *out_case. *out_anatomy_hash is 0 where the manifest has none.
enum result manifest_read(const char *text, size_t size, struct knee_case **out_case,
                          uint64_t *out_anatomy_hash, struct error *err);

// The text, which the caller frees with free(); its length is strlen.
char *manifest_write(const struct knee_case *knee, uint64_t anatomy_hash);
