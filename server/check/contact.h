// Bones and menisci over flexion, the joint at rest: what overlaps, and what should touch and does
// not; portals and landmarks against them. Ligaments, skin and other soft tissue are left out: they
// are fixed in bone, or give way.
#pragma once

#include "check/inspect.h"
#include "check/landmark.h"
#include "check/parallel.h"
#include "check/portal.h"
#include "check/touch.h"

#define CONTACT_FLEXIONS 9 // 0 to 120 degrees
#define CONTACT_STEP_DEG 15
#define CONTACTS_MAX 64

struct contact_state {
    struct overlap overlap; // places in the femur's frame
    struct gap gap;         // INFINITY: a group has no inside or outside
};

// Two groups, a < b.
struct contact {
    int a, b;
    int count;    // of flexions; 1 for groups of one body
    bool has_gap; // they should touch
    struct contact_state states[CONTACT_FLEXIONS];
};

struct contacts {
    int count;
    struct contact all[CONTACTS_MAX];
    struct portal_look portals[CASE_PORTALS_MAX]; // of the case's
    double landmark_off_mm[CASE_LANDMARKS_MAX];   // of the case's
};

// T_femur_body with the joint at rest.
pose contact_body_pose(const struct knee_case *knee, enum body body, double flexion_deg);

// The bodies' own bones, and groups that are described as meniscus or cartilage. Threads inside;
// the figures depend on none of it. progress: NULL, or told. RESULT_IO where a search structure
// cannot be had.
enum result contacts_look(struct knee_case *knee, const struct progress *progress,
                          struct contacts *out_contacts, struct error *err);

// The worst of each pair, by the bounds of check/bounds.h; portals and landmarks.
void contacts_inspect(const struct knee_case *knee, const struct contacts *contacts,
                      struct inspection *inspection);
