#include "check/portal.h"

#include "check/contact.h"
#include "landmarks/landmarks.h"
#include "landmarks/local.h"

#include <string.h>

#define STEP_MM 1.0

static const double flexions[] = {20, 45, 70, 90}; // in which instruments work

// ---- the notch's opening ------------------------------------------------------------------------

#define TARGETS_MAX 120 // 3 across, 5 before each other, 8 above each other

struct targets {
    int count;
    vec3 all[TARGETS_MAX]; // femur's frame
};

static vec3 place_of_name(const struct knee_case *knee, const struct local *local,
                          const char *name) {
    const struct case_landmark *landmark = case_landmark(knee, name);
    return landmark ? to_local(local, landmark->at) : (vec3){NAN, NAN, NAN};
}

// Between the notch's roof and the plateaus, and before them.
static void spread_targets(const struct knee_case *knee, struct targets *out) {
    struct local local = local_of(knee);
    vec3 notch = place_of_name(knee, &local, "notch");
    vec3 plateau = vec3_lerp(place_of_name(knee, &local, "plateau_medial"),
                             place_of_name(knee, &local, "plateau_lateral"), 0.5);
    out->count = 0;
    for (int i = 0; i < TARGETS_MAX; i++) {
        double across = 4 * (i % 3 - 1), before = 3 * (i / 3 % 5 + 1), up = 0.1 * (i / 15 + 1);
        vec3 p = {notch.x + across, plateau.y + before, plateau.z + up * (notch.z - plateau.z)};
        if (vec3_is_finite(p))
            out->all[out->count++] = from_local(&local, p);
    }
}

// The case keeps the landmarks that it has.
static void find_targets(struct knee_case *knee, struct targets *out) {
    struct case_landmark kept[CASE_LANDMARKS_MAX];
    struct error none;
    int count = knee->landmark_count;
    memcpy(kept, knee->landmarks, sizeof kept);
    spread_targets(knee, out);
    if (out->count == 0 && landmarks_find(knee, NULL, &none) == RESULT_OK)
        spread_targets(knee, out);
    memcpy(knee->landmarks, kept, sizeof kept);
    knee->landmark_count = count;
}

// ---- ways ---------------------------------------------------------------------------------------

struct way {
    const struct knee_case *knee;
    const struct touching *touching;
    double flexion_deg;
    struct touching_hints hints[CASE_GROUPS_MAX];
};

static double distance_to_bone(struct way *way, vec3 p, int *out_group) {
    double least = INFINITY;
    for (int i = 0; i < way->knee->group_count; i++) {
        const struct case_group *group = &way->knee->groups[i];
        vec3 point;
        if (strcmp(group->name, body_name(group->body)) != 0)
            continue;
        pose T = contact_body_pose(way->knee, group->body, way->flexion_deg);
        double distance =
            touching_distance(&way->touching[i], pose_apply_inverse(T, p), &way->hints[i], &point);
        if (distance < least) {
            least = distance;
            *out_group = i;
        }
    }
    return least;
}

// Takes the way if it leaves more room than the best one.
static void try_way(struct way *way, vec3 from, vec3 to, struct portal_look *best) {
    double length = vec3_distance(from, to), least = PORTAL_ROOM_MM;
    struct portal_look found = *best;
    for (double at = length; at >= 0 && least > best->clear_mm;) { // the end has least room
        vec3 p = vec3_lerp(from, to, at / length);
        int group;
        double distance = distance_to_bone(way, p, &group);
        if (distance < least) {
            least = distance;
            found.clear_group = group;
            found.place = p;
        }
        at -= fmax(distance - least, STEP_MM); // nothing between is nearer than that
    }
    if (least <= best->clear_mm)
        return;
    found.clear_mm = least;
    found.flexion_deg = way->flexion_deg;
    *best = found;
}

static void look_for_way(const struct knee_case *knee, const struct touching *touching,
                         const struct targets *targets, vec3 from, struct portal_look *out) {
    struct way way = {.knee = knee, .touching = touching};
    for (int i = 0; i < knee->group_count; i++)
        touching_forget(&way.hints[i]);
    out->has_way = true;
    out->clear_mm = -INFINITY;
    for (size_t f = 0; f < sizeof flexions / sizeof *flexions; f++)
        for (int i = 0; i < targets->count && out->clear_mm < PORTAL_ROOM_MM; i++) {
            way.flexion_deg = flexions[f];
            try_way(&way, from, targets->all[i], out);
        }
}

// ---- portals ------------------------------------------------------------------------------------

static void look_inside(const struct knee_case *knee, const struct touching *touching,
                        vec3 position, struct portal_look *out) {
    for (int k = 0; k < knee->group_count; k++) {
        pose T = contact_body_pose(knee, knee->groups[k].body, 0);
        struct touching_hints hints;
        vec3 point;
        touching_forget(&hints);
        double depth =
            -touching_distance(&touching[k], pose_apply_inverse(T, position), &hints, &point);
        if (depth > out->depth_mm) {
            out->depth_mm = depth;
            out->depth_group = k;
        }
    }
}

// From behind and from above, bone lies before the notch.
static bool leads_to_notch(const struct case_portal *portal) {
    return strncmp(portal->name, "postero", 7) != 0 && strncmp(portal->name, "supero", 6) != 0;
}

void portals_look(struct knee_case *knee, const struct touching *touching,
                  struct portal_look out[CASE_PORTALS_MAX]) {
    struct targets targets = {0};
    if (knee->portal_count)
        find_targets(knee, &targets);
    for (int i = 0; i < knee->portal_count; i++) {
        out[i] = (struct portal_look){0};
        look_inside(knee, touching, knee->portals[i].position, &out[i]);
        if (out[i].depth_mm > 0 || !leads_to_notch(&knee->portals[i]))
            continue;
        if (targets.count)
            look_for_way(knee, touching, &targets, knee->portals[i].position, &out[i]);
        else
            out[i].has_no_notch = true;
    }
}

#define PORTAL_REMEDY                                                                              \
    "Move the portal to beside the patellar tendon at the joint line, or let arthron-case "        \
    "landmarks propose portals"

static void inspect_portal_way(const struct knee_case *knee, const struct case_portal *portal,
                               const struct portal_look *look, struct inspection *inspection) {
    const char *bone = knee->groups[look->clear_group].name;
    if (look->clear_mm < 0)
        inspection_note(
            inspection, FINDING_FAULT, portal->name,
            "no straight way from the portal to the notch is free of bone. At %g "
            "degrees the best one goes %.1f mm deep through %s (%.1f %.1f %.1f). " PORTAL_REMEDY,
            look->flexion_deg, -look->clear_mm, bone, look->place.x, look->place.y, look->place.z);
    else if (look->clear_mm < PORTAL_ROOM_MM)
        inspection_note(inspection, FINDING_WARNING, portal->name,
                        "an instrument needs %g mm beside its way to the notch. At %g degrees the "
                        "best way leaves %.1f mm beside %s (%.1f %.1f %.1f). " PORTAL_REMEDY,
                        PORTAL_ROOM_MM, look->flexion_deg, look->clear_mm, bone, look->place.x,
                        look->place.y, look->place.z);
}

void portals_inspect(const struct knee_case *knee, const struct portal_look *looks,
                     struct inspection *inspection) {
    for (int i = 0; i < knee->portal_count; i++) {
        const struct case_portal *portal = &knee->portals[i];
        if (looks[i].depth_mm > 0)
            inspection_note(inspection, FINDING_FAULT, portal->name,
                            "the portal is %.1f mm inside %s. " PORTAL_REMEDY, looks[i].depth_mm,
                            knee->groups[looks[i].depth_group].name);
        if (looks[i].has_way)
            inspect_portal_way(knee, portal, &looks[i], inspection);
        if (looks[i].has_no_notch)
            inspection_note(inspection, FINDING_NOTE, portal->name,
                            "the way to the notch is not examined, because the notch or a plateau "
                            "is not known. Give them with arthron-case landmarks --landmark");
    }
}
