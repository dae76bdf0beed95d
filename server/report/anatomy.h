// Pictures of a case in the colours of its tissues (case/tissue.h), and cartilage what a part of a
// bone calls so. What is shown is the patient (S'). The tear is dark red, damage orange, and the
// planned resection yellow.
#pragma once

#include "case/case.h"
#include "report/render.h"

enum viewpoint {
    VIEWPOINT_FRONT,
    VIEWPOINT_BACK,
    VIEWPOINT_MEDIAL,
    VIEWPOINT_LATERAL,
    VIEWPOINT_TOP,
    VIEWPOINT_COUNT
};

const char *viewpoint_name(enum viewpoint view); // "front", "back", ...
bool viewpoint_from_name(const char *name, enum viewpoint *out_view);

struct anatomy_view {
    enum viewpoint view; // top: on the tibia's plateau, front above
    double flexion_deg;
    bool shown[CASE_GROUPS_MAX]; // by the index of the group
};

// All but the skin; from the top the tibia, its cartilage, and what can be cut of it.
void anatomy_choose(const struct knee_case *knee, enum viewpoint view,
                    bool out_shown[CASE_GROUPS_MAX]);

// The skin is translucent. The caller releases *out_picture. RESULT_MISSING where nothing is shown.
enum result anatomy_picture(const struct knee_case *knee, const struct anatomy_view *view,
                            int width, int height, struct picture *out_picture, struct error *err);
