// Landmarks, and the joint at rest.
#include "base/check.h"
#include "case/case.h"

#include <string.h>

const struct case_landmark *case_landmark(const struct knee_case *knee, const char *name) {
    for (int i = 0; i < knee->landmark_count; i++)
        if (strcmp(knee->landmarks[i].name, name) == 0)
            return &knee->landmarks[i];
    return NULL;
}

enum result case_landmark_set(struct knee_case *knee, const struct case_landmark *landmark,
                              struct error *err) {
    CHECK(case_name_is_valid(landmark->name));
    const struct case_landmark *known = case_landmark(knee, landmark->name);
    if (known) {
        knee->landmarks[known - knee->landmarks] = *landmark;
        return RESULT_OK;
    }
    if (knee->landmark_count == CASE_LANDMARKS_MAX)
        return fail(err, RESULT_LIMIT, "more than %d landmarks", CASE_LANDMARKS_MAX);
    knee->landmarks[knee->landmark_count++] = *landmark;
    return RESULT_OK;
}

static struct joint_angles between(struct joint_angles a, struct joint_angles b,
                                   double flexion_deg) {
    double span = b.flexion_deg - a.flexion_deg;
    double t = span > 0 ? (flexion_deg - a.flexion_deg) / span : 0;
    return (struct joint_angles){flexion_deg,
                                 a.varus_deg + t * (b.varus_deg - a.varus_deg),
                                 a.internal_deg + t * (b.internal_deg - a.internal_deg),
                                 a.shift_mm + t * (b.shift_mm - a.shift_mm),
                                 a.drawer_mm + t * (b.drawer_mm - a.drawer_mm),
                                 a.distraction_mm + t * (b.distraction_mm - a.distraction_mm)};
}

// Recorded keys come in any order.
struct joint_angles case_rest(const struct knee_case *knee, double flexion_deg) {
    struct joint_angles low = {.flexion_deg = -INFINITY}, high = {.flexion_deg = INFINITY};
    for (int i = 0; i < knee->rest_count; i++) {
        struct joint_angles key = joint_from_pose(&knee->joint, knee->rest[i]);
        if (key.flexion_deg <= flexion_deg && key.flexion_deg > low.flexion_deg)
            low = key;
        if (key.flexion_deg >= flexion_deg && key.flexion_deg < high.flexion_deg)
            high = key;
    }
    if (knee->rest_count == 0)
        return (struct joint_angles){.flexion_deg = flexion_deg};
    if (isinf(low.flexion_deg))
        low = high;
    if (isinf(high.flexion_deg))
        high = low;
    return between(low, high, flexion_deg);
}

int case_loose_index(const struct knee_case *knee, const char *name) {
    for (int i = 0; i < knee->loose_count; i++)
        if (strcmp(knee->loose[i].name, name) == 0)
            return i;
    return -1;
}
