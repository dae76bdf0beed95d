// Where a case's portals lie, and whether instruments can go through them to the notch.
#pragma once

#include "check/inspect.h"
#include "check/touch.h"

// Of one portal. Places in the femur's frame, millimetres.
struct portal_look {
    double depth_mm; // in a group, at rest in extension; 0: in none
    int depth_group;
    // Of the straight way to the notch's opening that leaves most room; of all portals but those
    // whose names begin with postero or supero.
    bool has_way;       // looked for: the notch and both plateaus are known or found
    bool has_no_notch;  // not looked for, as they are not
    double clear_mm;    // to the nearest bone, PORTAL_ROOM_MM or less; negative: through it
    int clear_group;    // the bone
    double flexion_deg; // of 20 to 90 degrees
    vec3 place;         // where the way is narrowest
};

#define PORTAL_ROOM_MM 2.0 // half of an instrument's width

// touching: of each group. Landmarks that the case does not have are looked for.
void portals_look(struct knee_case *knee, const struct touching *touching,
                  struct portal_look out[CASE_PORTALS_MAX]);

// Faults: a portal inside a group, or without a way that is clear of bone. A warning: less room
// than PORTAL_ROOM_MM. A note: no way was looked for, though one should be.
void portals_inspect(const struct knee_case *knee, const struct portal_look *looks,
                     struct inspection *inspection);
