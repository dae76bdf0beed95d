// The inside of struct scene, for this room only: what session.c asks the warp for.
#pragma once

#include "session/session.h"

_Static_assert(CASE_GROUPS_MAX <= WARP_SURFACES_MAX, "every group of a case is a surface");

struct scene {
    struct knee_case *knee;
    struct query *queries[CASE_GROUPS_MAX];
    struct warp_surface surfaces[CASE_GROUPS_MAX];
};
