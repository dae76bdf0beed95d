// One virtual patient: the anatomy of the physical mock-up (S), what takes it to the patient (S'),
// and the joint. A case is a folder with case.json (manifest) and anatomy.glb
// (docs/ARCHITECTURE.md).
//
// In memory: millimetres; each mesh in the frame of its body; the frames of all bodies coincide
// with the femur's in the rest pose (extension). In the files: glTF in metres; glTF's y up
// is not imposed: nodes have no transform, the numbers are those of the memory over 1000.
#pragma once

#include "base/joint.h"
#include "base/result.h"
#include "case/tissue.h"
#include "mesh/convex.h"

#define CASE_NAME_MAX 64
#define CASE_GROUPS_MAX 32
#define CASE_PARTS_MAX 8
#define CASE_PORTALS_MAX 8
#define CASE_REGION_PARTS_MAX 32
#define CASE_LIGAMENTS_MAX 8 // torn ones
#define CASE_KEYS_MAX 32     // of all of them together; also of the rest path
#define CASE_LANDMARKS_MAX 64
#define CASE_LOOSE_MAX 8 // loose bodies

enum body { BODY_FEMUR, BODY_TIBIA, BODY_PATELLA, BODY_COUNT };

const char *body_name(enum body body);
bool body_from_name(const char *name, enum body *out_body);

// One mesh of a group inside the group's joined arrays.
struct case_part {
    char name[CASE_NAME_MAX];
    uint32_t first_vertex, vertex_count;
    uint32_t first_triangle, triangle_count;
};

// A union of convex polyhedra in the frame of a group's virtual mesh (S').
struct case_region {
    int part_count; // at most CASE_REGION_PARTS_MAX
    struct convex *parts;
};

// The damage of a cuttable group, and the planned treatment. All members may be empty.
struct case_lesion {
    struct case_region tear;   // the cleft: missing from the virtual mesh from the start
    struct case_region damage; // the damaged tissue around it
    struct case_region plan;   // the planned resection
};

// The International Cartilage Repair Society's grades of a cartilage: 0 whole, 1 soft or with
// cracks in its surface, 2 fissured to less than half of its depth, 3 deeper, 4 down to the bone.
#define CASE_WEAR_MOST 4.0

struct case_group {
    char name[CASE_NAME_MAX]; // tibia, femur, patella, meniscus_medial, meniscus_lateral, acl,
                              // pcl, mcl, lcl, skin; others are allowed
    enum body body;
    struct case_tissue tissue; // by its name, until something describes it
    bool bridges;              // from its body to other_body, as a ligament does
    enum body other_body;
    float *other_share; // where it bridges: for each vertex, 0 at its body .. 1 at the other
                        // (generate/bridge.h); else NULL
    float *covered; // for each vertex: 1 where the group's other parts hide all of its triangles
                    // (import/cover.h), else 0; NULL where none is
    float *wear;    // for each vertex: how worn the cartilage is, the ICRS grade of 0 (whole) to 4
                    // (bare bone); NULL where all is whole
    bool cuttable;  // must be one closed, manifold, oriented part that bridges nothing
    struct mesh mesh; // all parts, joined
    float *warp;      // 3 * vertex_count, mm: S' − S; NULL where nothing is displaced
    float *maxcut;    // 3 * vertex_count, mm: what a whole resection adds to S + warp; or NULL
    struct case_lesion lesion;
    int part_count;
    struct case_part parts[CASE_PARTS_MAX];
};

struct case_portal {
    char name[CASE_NAME_MAX];
    vec3 position;  // in the skin, femur's frame
    vec3 direction; // unit, into the joint
};

// A place of the anatomy that motions, reports and people name (landmarks/landmarks.h).
struct case_landmark {
    char name[CASE_NAME_MAX];
    enum body body;
    vec3 at;         // on or in the mock-up (S), in the frame of the body
    double error_mm; // how far off it may be: of a fit, its residual
    bool by_hand;    // given by a person, who knows better than a proposal
};

// A key pose of a torn ligament: the tibia of the mock-up is here, with that ligament held against
// its end, and the virtual one appears there (warp/adaptive.h). T_femur_tibia both. Whether the
// keys of a case go together so that each is met, only the warp can tell: scene_create
// (step/scene.h) refuses a case where one is not.
struct case_key {
    int ligament; // index into the case's torn ligaments
    pose physical, target;
};

// A loose body: a rigid ellipsoid of cartilage that nothing holds. It is the patient's alone.
struct case_loose {
    char name[CASE_NAME_MAX];
    enum body body;
    vec3 at; // on the patient's surface (S') of a bone or a meniscus, in the frame of the body
    vec3 radii_mm; // its half axes, each within the bounds below; it lies on the side of the last
};

#define CASE_LOOSE_RADIUS_LEAST_MM 1.0
#define CASE_LOOSE_RADIUS_MOST_MM 6.0

struct knee_case {
    char name[CASE_NAME_MAX];
    char title[128];
    uint64_t hash; // XXH3 of both files' bytes, set by case_load and case_save
    struct joint_frame joint;
    bool has_scan;      // an imported case: how the scan lay
    bool scan_mirrored; // its x changes its sign first
    pose T_case_scan;   // then takes mm of the scan to the femur's frame
    int group_count;
    struct case_group groups[CASE_GROUPS_MAX];
    int portal_count;
    struct case_portal portals[CASE_PORTALS_MAX];
    int landmark_count;
    struct case_landmark landmarks[CASE_LANDMARKS_MAX];
    int loose_count;
    struct case_loose loose[CASE_LOOSE_MAX];
    int patella_key_count; // rising flexion; 0: the patella stays in the rest pose
    struct patella_key patella_keys[PATELLA_KEYS_MAX];
    int rest_count; // T_femur_tibia of the mock-up at rest over flexion; 0: that of the joint's
                    // axes
    pose rest[CASE_KEYS_MAX];
    int torn_count;
    char torn[CASE_LIGAMENTS_MAX][CASE_NAME_MAX]; // directions in which the joint gives way
    int key_count;
    struct case_key keys[CASE_KEYS_MAX];
};

// Limits of a case's files. Larger ones are refused.
struct case_limits {
    size_t file_bytes;        // of each file
    uint32_t group_triangles; // of each group
    uint64_t hash;            // of the case, or else RESULT_CORRUPT; 0: any
};

struct case_limits case_limits_default(void); // 512 MiB, 2 000 000 triangles

// Reads, bounds-checks and validates a case folder. Refuses everything that case_validate refuses,
// accessors out of bounds, unknown keys in the manifest, and an anatomy with another hash than the
// manifest's. The error names file, group and accessor. On success the caller destroys *out_case.
// limits: NULL for the default ones.
enum result case_load(const char *dir, const struct case_limits *limits,
                      struct knee_case **out_case, struct error *err);

// Reads a case elsewhere, where a fault does no harm, and gives its hash.
typedef enum result (*case_checker)(const char *dir, uint64_t *out_hash, struct error *err);

// The same as case_load with the default limits, of a case that `check` has let through and that
// has not changed since. NULL: nothing checks it.
enum result case_load_checked(const char *dir, case_checker check, struct knee_case **out_case,
                              struct error *err);

// Refused: a missing tibia or femur; a cuttable group that is not one closed, manifold, oriented
// component facing outwards; a lesion of a group that is not cuttable, or a part of it that lies
// beside the virtual mesh; a displacement, pose, portal or patella key that is not finite or out of
// order; a landmark without a valid and new name or with a place or error that is none; a loose
// body without a valid and new name or with a place or radii that are none; shares outside 0 to 1,
// or of a bridge from a body to itself; a group of which all or something that can be cut is
// covered; wear of what does not wear, or beyond 0 to 4; a torn ligament without a key or with
// another's name, or a key of none; a group without a mesh. The error names group or key.
enum result case_validate(const struct knee_case *knee, struct error *err);

// Writes both files into `dir` (made where missing, with its parents) and sets the hash. The case
// must pass case_validate. Both files are complete on the disk before either takes its place; a
// crash between the two is noticed by case_load. Coordinates are rounded to float metres: the
// first load may differ by that, every later one is equal bit for bit.
enum result case_save(struct knee_case *knee, const char *dir, struct error *err);

// Letters, digits and "_-.", 1 to CASE_NAME_MAX - 1 of them: names of cases, groups, parts,
// portals, ligaments.
bool case_name_is_valid(const char *name);

// The name must be valid; a title too long is cut. The joint frames are the identity.
struct knee_case *case_create(const char *name, const char *title);
void case_destroy(struct knee_case **knee); // NULL inside is fine; *knee becomes NULL

// Appends an empty group, or returns NULL where there are CASE_GROUPS_MAX. The name must be valid
// and new; its tissue is the usual one. Earlier pointers to groups stay good.
struct case_group *case_add_group(struct knee_case *knee, const char *name, enum body body);

// Joins a mesh to a group as a part (copied). Displacements, shares, covers and wear get zeros
// where the group has them. A part may bear its group's name: its node in the file is then `group`,
// otherwise `group/part`. Refused: what mesh_validate refuses, a bad or second name, more than
// CASE_PARTS_MAX.
enum result case_add_part(struct case_group *group, const char *name, const struct mesh *mesh,
                          struct error *err);

struct case_group *case_group(struct knee_case *knee, const char *name); // NULL: no such group

// What a group is where nothing describes it: by its name, and a ligament where it bridges.
struct case_tissue case_group_usual(const struct case_group *group);

bool case_group_is_bone(const struct case_group *group); // the bone that its body is named after
bool case_group_wears(const struct case_group *group);   // bone or cartilage that stays uncut
bool case_group_is_skin(const struct case_group *group); // what surrounds the knee and gives way
struct case_group *case_skin(struct knee_case *knee);    // NULL: there is none

// The first meniscus of the side; NULL: there is none.
struct case_group *case_meniscus(struct knee_case *knee, enum tissue_side side);

// The outer surface of a group, which instruments can touch: its mesh without the triangles of
// which all corners are covered. All vertices stay. The caller releases it with mesh_fini.
void case_group_surface(const struct case_group *group, struct mesh *out_mesh);

// The displacement arrays of a group, made of zeros where there is none. The group has a part.
float *case_group_need_warp(struct case_group *group);
float *case_group_need_maxcut(struct case_group *group);
float *case_group_need_covered(struct case_group *group); // as these
float *case_group_need_wear(struct case_group *group);
void case_group_make_whole(struct case_group *group); // nothing of it is worn any more

// Makes the group bridge from its body to another one, with shares of 0. It must not do so yet. Of
// no other kind it is a ligament from now on.
void case_group_bridge(struct case_group *group, enum body other);

// S' = S + warp, allocated; the caller releases it with mesh_fini.
void case_group_virtual(const struct case_group *group, struct mesh *out_mesh);

// Adds the polyhedron of the half-spaces to a region. RESULT_LIMIT where it has
// CASE_REGION_PARTS_MAX parts already; otherwise what convex_create refuses.
enum result case_region_add(struct case_region *region, const struct plane *planes, int count,
                            struct error *err);

// The patella's pose at a flexion: between the keys, constant past the outer ones.
pose case_patella_pose(const struct knee_case *knee, double flexion_deg);

// The joint at rest at a flexion: between the keys of the rest path, straight in each coordinate,
// constant past the outer ones; where there is none, that of the joint's axes.
struct joint_angles case_rest(const struct knee_case *knee, double flexion_deg);

int case_loose_index(const struct knee_case *knee, const char *name); // -1: no such loose body

// NULL: no such landmark.
const struct case_landmark *case_landmark(const struct knee_case *knee, const char *name);

// Adds a landmark with a valid name, or replaces that of the name. RESULT_LIMIT where there are
// CASE_LANDMARKS_MAX.
enum result case_landmark_set(struct knee_case *knee, const struct case_landmark *landmark,
                              struct error *err);
