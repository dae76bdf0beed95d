#include "motion/place.h"

#include "landmarks/landmarks.h"

#include <stdio.h>

static bool is_known(const struct knee_case *knee, const struct motion_place *place) {
    return !place->landmark[0] || case_landmark(knee, place->landmark);
}

enum result place_prepare(struct knee_case *knee, const struct motion_script *script,
                          struct error *err) {
    bool complete = knee->portal_count > 0;
    for (int i = 0; i < script->step_count && complete; i++)
        complete = is_known(knee, &script->steps[i].from) && is_known(knee, &script->steps[i].to);
    return complete ? RESULT_OK : motion_prepare(knee, true, err);
}

enum result motion_prepare(struct knee_case *knee, bool landmarks, struct error *err) {
    double clear_mm[2];
    enum result result = landmarks ? landmarks_find(knee, NULL, err) : RESULT_OK;
    if (result == RESULT_OK && knee->portal_count == 0)
        result = landmarks_find_portals(knee, clear_mm, err);
    if (result != RESULT_OK)
        return fail_in(err, result, "the case lacks landmarks or portals, and none are found: ");
    return RESULT_OK;
}

static vec3 mirrored(const struct knee_case *knee, vec3 p) {
    return (vec3){knee->joint.side == SIDE_LEFT ? -p.x : p.x, p.y, p.z};
}

enum result place_find(const struct knee_case *knee, const struct motion_place *place,
                       vec3 *out_point, struct error *err) {
    *out_point = mirrored(knee, place->at);
    if (!place->landmark[0])
        return RESULT_OK;
    const struct case_landmark *landmark = case_landmark(knee, place->landmark);
    if (!landmark)
        return fail(err, RESULT_MISSING, "the case has no landmark %s", place->landmark);
    quat axes = knee->joint.T_femur_joint.rotation;
    *out_point = vec3_add(landmark->at, quat_rotate(axes, *out_point));
    return RESULT_OK;
}

const char *place_name(const struct motion_place *place, char out_text[PLACE_NAME_MAX]) {
    vec3 p = place->at;
    if (place->landmark[0])
        snprintf(out_text, PLACE_NAME_MAX, "%s", place->landmark);
    else
        snprintf(out_text, PLACE_NAME_MAX, "%.1f %.1f %.1f", p.x, p.y, p.z);
    return out_text;
}
