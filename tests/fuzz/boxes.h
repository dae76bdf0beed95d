// The scene of a knee of boxes (unit/case_knee.h), for targets that need one.
#pragma once

#include "base/check.h"
#include "step/session.h"
#include "unit/case_knee.h"

// Made once; it lives as long as the process.
static inline const struct scene *boxes(void) {
    static struct scene *scene;
    struct knee_case *knee;
    if (!scene) {
        knee = box_knee();
        CHECK(scene_create(&knee, &scene, NULL) == RESULT_OK);
    }
    return scene;
}
