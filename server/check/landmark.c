#include "check/landmark.h"

#include "landmarks/local.h"

#include <string.h>

#define ERRORS 2.0  // an error may be passed so many times
#define SIDE_MM 3.0 // the joint's centre may be off by that

enum side_of { MEDIAL = -1, MIDDLE, LATERAL };

// near_mm: how far off the surface a place of this name may lie, besides its error.
static const struct named {
    const char *name;
    enum tissue_side meniscus; // on that one; TISSUE_NO_SIDE: on the body's bone
    enum body body;
    enum side_of side;
    double near_mm;
    bool within; // it may lie inside
} landmark_names[] = {
    {"condyle_medial", TISSUE_NO_SIDE, BODY_FEMUR, MEDIAL, 3, false},
    {"condyle_lateral", TISSUE_NO_SIDE, BODY_FEMUR, LATERAL, 3, false},
    {"trochlea", TISSUE_NO_SIDE, BODY_FEMUR, MIDDLE, 3, false},
    {"notch", TISSUE_NO_SIDE, BODY_FEMUR, MIDDLE, 3, false},
    {"acl_femur", TISSUE_NO_SIDE, BODY_FEMUR, MIDDLE, 6,
     false}, // the end of a mesh may lie in bone
    {"pcl_femur", TISSUE_NO_SIDE, BODY_FEMUR, MIDDLE, 6, false},
    {"acl_tibia", TISSUE_NO_SIDE, BODY_TIBIA, MIDDLE, 6, false},
    {"pcl_tibia", TISSUE_NO_SIDE, BODY_TIBIA, MIDDLE, 6, false},
    {"plateau_medial", TISSUE_NO_SIDE, BODY_TIBIA, MEDIAL, 3, false},
    {"plateau_lateral", TISSUE_NO_SIDE, BODY_TIBIA, LATERAL, 3, false},
    {"root_anterior_medial", TISSUE_MEDIAL, BODY_TIBIA, MIDDLE, 3, true},
    {"horn_anterior_medial", TISSUE_MEDIAL, BODY_TIBIA, MEDIAL, 3, true},
    {"body_medial", TISSUE_MEDIAL, BODY_TIBIA, MEDIAL, 3, true},
    {"horn_posterior_medial", TISSUE_MEDIAL, BODY_TIBIA, MEDIAL, 3, true},
    {"root_posterior_medial", TISSUE_MEDIAL, BODY_TIBIA, MIDDLE, 3, true},
    {"root_anterior_lateral", TISSUE_LATERAL, BODY_TIBIA, MIDDLE, 3, true},
    {"horn_anterior_lateral", TISSUE_LATERAL, BODY_TIBIA, LATERAL, 3, true},
    {"body_lateral", TISSUE_LATERAL, BODY_TIBIA, LATERAL, 3, true},
    {"horn_posterior_lateral", TISSUE_LATERAL, BODY_TIBIA, LATERAL, 3, true},
    {"root_posterior_lateral", TISSUE_LATERAL, BODY_TIBIA, MIDDLE, 3, true},
    {"patella", TISSUE_NO_SIDE, BODY_PATELLA, MIDDLE, 3, true},
};

static const struct named *named(const char *name) {
    for (size_t i = 0; i < sizeof landmark_names / sizeof *landmark_names; i++)
        if (!strcmp(landmark_names[i].name, name))
            return &landmark_names[i];
    return NULL;
}

// ---- distances ----------------------------------------------------------------------------------

static bool is_on(const struct named *n, const struct case_group *group) {
    if (n->meniscus == TISSUE_NO_SIDE)
        return group->body == n->body && case_group_is_bone(group);
    return group->tissue.kind == TISSUE_MENISCUS && group->tissue.side == n->meniscus;
}

static double off_of(const struct knee_case *knee, const struct touching *touching,
                     const struct case_landmark *landmark) {
    const struct named *n = named(landmark->name);
    for (int i = 0; n && n->body == landmark->body && i < knee->group_count; i++) {
        struct touching_hints hints;
        vec3 point;
        if (!is_on(n, &knee->groups[i]) || !touching[i].shell_count)
            continue;
        touching_forget(&hints);
        double distance = touching_distance(&touching[i], landmark->at, &hints, &point);
        return n->within ? fmax(distance, 0) : fabs(distance);
    }
    return NAN;
}

void landmarks_look(const struct knee_case *knee, const struct touching *touching,
                    double out_off_mm[CASE_LANDMARKS_MAX]) {
    for (int i = 0; i < knee->landmark_count; i++)
        out_off_mm[i] = off_of(knee, touching, &knee->landmarks[i]);
}

// ---- findings -----------------------------------------------------------------------------------

#define LANDMARK_REMEDY                                                                            \
    ". Give it by hand (arthron-case landmarks --landmark). Or take it out of case.json, and let " \
    "that command find it"

static const char *surface_name(const struct named *n) {
    return n->meniscus == TISSUE_MEDIAL    ? "medial meniscus"
           : n->meniscus == TISSUE_LATERAL ? "lateral meniscus"
                                           : body_name(n->body);
}

static void inspect_one(const struct case_landmark *landmark, double off_mm, vec3 local,
                        struct inspection *inspection) {
    const struct named *n = named(landmark->name);
    if (!n)
        return;
    if (n->body != landmark->body)
        inspection_note(inspection, FINDING_FAULT, n->name,
                        "is on the %s, not on the %s" LANDMARK_REMEDY, body_name(landmark->body),
                        body_name(n->body));
    double beyond = off_mm - n->near_mm - ERRORS * landmark->error_mm;
    if (beyond > 0)
        inspection_note(
            inspection, beyond > LANDMARK_FAR_MM ? FINDING_FAULT : FINDING_WARNING, n->name,
            "lies %.1f mm off the %s (%.1f %.1f %.1f), and its error is %.1f mm" LANDMARK_REMEDY,
            off_mm, surface_name(n), landmark->at.x, landmark->at.y, landmark->at.z,
            landmark->error_mm);
    if (n->side * local.x < -SIDE_MM)
        inspection_note(
            inspection, FINDING_FAULT, n->name,
            "lies %.1f mm to the %s side of the joint's centre (%.1f %.1f %.1f)" LANDMARK_REMEDY,
            fabs(local.x), local.x > 0 ? "lateral" : "medial", landmark->at.x, landmark->at.y,
            landmark->at.z);
}

// The first one lies farther along the axis than the second one: x lateral, y anterior, z proximal.
static const struct order {
    const char *name, *before;
    char axis;
} orders[] = {
    {"horn_anterior_medial", "body_medial", 'y'},
    {"body_medial", "horn_posterior_medial", 'y'},
    {"root_anterior_medial", "root_posterior_medial", 'y'},
    {"horn_anterior_lateral", "body_lateral", 'y'},
    {"body_lateral", "horn_posterior_lateral", 'y'},
    {"root_anterior_lateral", "root_posterior_lateral", 'y'},
    {"root_anterior_lateral", "root_anterior_medial", 'x'},
    {"root_posterior_lateral", "root_posterior_medial", 'x'},
    {"acl_tibia", "pcl_tibia", 'y'},
    {"acl_femur", "pcl_femur", 'x'},
    {"condyle_lateral", "notch", 'x'},
    {"notch", "condyle_medial", 'x'},
    {"trochlea", "notch", 'y'},
    {"notch", "condyle_medial", 'z'},
    {"notch", "condyle_lateral", 'z'},
};

static double along(vec3 p, char axis) {
    return axis == 'x' ? p.x : axis == 'y' ? p.y : p.z;
}

static void inspect_order(const struct knee_case *knee, const struct local *local,
                          const struct order *order, struct inspection *inspection) {
    const struct case_landmark *a = case_landmark(knee, order->name);
    const struct case_landmark *b = case_landmark(knee, order->before);
    if (!a || !b ||
        along(to_local(local, a->at), order->axis) > along(to_local(local, b->at), order->axis))
        return;
    inspection_note(inspection, FINDING_FAULT, a->name,
                    "lies %s %s (%.1f %.1f %.1f): are the two exchanged?" LANDMARK_REMEDY,
                    order->axis == 'x'   ? "medial of"
                    : order->axis == 'y' ? "behind"
                                         : "below",
                    b->name, a->at.x, a->at.y, a->at.z);
}

void landmarks_inspect(const struct knee_case *knee, const double *off_mm,
                       struct inspection *inspection) {
    struct local local = local_of(knee);
    for (int i = 0; i < knee->landmark_count; i++)
        inspect_one(&knee->landmarks[i], off_mm[i], to_local(&local, knee->landmarks[i].at),
                    inspection);
    for (size_t i = 0; i < sizeof orders / sizeof *orders; i++)
        inspect_order(knee, &local, &orders[i], inspection);
}
