// Finds on a case's meshes what nobody should have to type in: the axes of the joint, its path over
// flexion, the patella's path, portals, and places of the anatomy. Each with a residual.
//
// All looks at the mock-up (S) in the rest pose. Where the case's joint frame tells about where the
// knee is and which way its axes point, within some 15 degrees and 10 mm, the rest follows from
// the meshes. A moved or mirrored case gets moved or mirrored proposals.
#pragma once

#include "case/case.h"

enum compartment { COMPARTMENT_MEDIAL, COMPARTMENT_LATERAL, COMPARTMENT_COUNT };

// A circle in the sagittal plane, fitted to the posterior arc of a condyle's ridge.
struct condyle_fit {
    vec3 centre; // femur's frame, in the middle of the ridge
    double radius_mm, rms_mm;
};

// The flexion axis is the line through both centres, the joint's origin midway between them, and
// its z axis as near to the case's as that lets.
struct joint_fit {
    struct condyle_fit condyles[COMPARTMENT_COUNT];
    pose T_femur_joint;
    double turned_deg, moved_mm; // against the case's joint frame
};

// RESULT_INVALID where the femur has no two condyles about the case's joint.
enum result landmarks_fit_joint(struct knee_case *knee, struct joint_fit *out_fit,
                                struct error *err);

// The patella's keys and the rest path go so far, in such steps.
#define LANDMARKS_FLEXION_MAX 120
#define LANDMARKS_FLEXION_STEP 5
#define LANDMARKS_PATH_MAX 25

struct path_point {
    double flexion_deg;
    double axes_gap_mm[COMPARTMENT_COUNT]; // of femur and tibia, about the fixed axis; negative:
                                           // overlap
    double gap_mm[COMPARTMENT_COUNT];      // on the path
    double distraction_mm, varus_deg;      // that the path adds
    double patella_gap_mm;                 // of femur and patella on the path; NAN without patella
};

struct path_fit {
    int count;
    struct path_point points[LANDMARKS_PATH_MAX];
};

// Both compartments keep the gap that they have in extension, but 0.2 mm at least: the tibia moves
// along its axis and turns in varus as much as that takes. Sets the case's rest path, and
// patella_gap_mm to NAN. RESULT_INVALID as landmarks_fit_joint, or where a condyle has no surface
// that meets the tibia at a flexion of the path.
enum result landmarks_fit_rest(struct knee_case *knee, struct path_fit *fit, struct error *err);

// The patella turns about the trochlea's axis by half of the flexion, and keeps the gap that it has
// in extension, but 0.3 mm at least. Sets the case's patella keys; none without a patella.
// RESULT_INVALID as landmarks_fit_joint, or where the femur has no trochlea.
enum result landmarks_fit_patella(struct knee_case *knee, struct path_fit *fit, struct error *err);

// What could not be found, and why; more is left out.
#define LANDMARKS_NOTES_MAX 32

struct landmarks_notes {
    int count;
    char texts[LANDMARKS_NOTES_MAX][192];
};

// Adds a note, cut at the text's end. notes: NULL is fine.
void landmarks_note(struct landmarks_notes *notes, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

// Finds the landmarks of which the meshes are there and puts them into the case; those by hand
// stay. Notes those that it does not find; notes: NULL is fine. RESULT_INVALID as
// landmarks_fit_joint: then only the landmarks that need no condyles are found.
enum result landmarks_find(struct knee_case *knee, struct landmarks_notes *notes,
                           struct error *err);

// Anterolateral and anteromedial, beside the patellar tendon at the joint line, towards the notch,
// where the straight line from outside to the notch is clear of all bones by 2 mm or else as far as
// it can. out_clear_mm: how far, of both. Replaces the case's portals.
// RESULT_MISSING without the landmarks notch, plateau_medial and plateau_lateral; RESULT_INVALID
// where no bone lies about them.
enum result landmarks_find_portals(struct knee_case *knee, double out_clear_mm[2],
                                   struct error *err);
