// What `arthron-case landmarks` says: as text, as JSON, and as a page with pictures.
#pragma once

#include "landmarks/landmarks.h"

struct landmarks_kept {
    bool joint, rest, patella, portals;
};

struct landmarks_said {
    struct knee_case *knee; // with the proposals
    struct landmarks_kept kept;
    bool has_fit; // with a joint that is kept, the fit may fail
    struct joint_fit joint;
    struct path_fit path; // without points where the rest path was kept
    struct landmarks_notes notes;
    double clear_mm[2];             // of the portals proposed
    bool by_hand[CASE_PORTALS_MAX]; // portals
};

void landmarks_print(const struct landmarks_said *said);
void landmarks_print_json(const struct landmarks_said *said);

// Replaces a file that is there. The error names the path.
enum result landmarks_report(const struct landmarks_said *said, const char *path,
                             struct error *err);
