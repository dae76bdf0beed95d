#include "generate/loose_places.h"

#include "base/check.h"
#include "mesh/solid.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define CANDIDATES_MAX 400
#define STEP_MM 2.0
#define SHAFT_MM 2.0 // from the middle of a shaft to what it passes
#define NEAR_MM 42.0 // from the joint's origin
#define DEEP_MM 12.0 // past both portals
#define SKIN_MM 8.0  // along a portal nothing is in the way
#define APART_MM 3.0 // between two bodies
#define CLEAR_MM 0.5 // from what it does not lie on

static const double flexions[] = {20, 70, 45, 90};

struct candidate {
    enum body body;
    vec3 at, middle; // of the body's surface; of the loose body; in the frame of the bone
};

struct search {
    struct knee_case *knee;
    vec3 radii_mm;
    double widest;
    int solid_count;
    struct mesh meshes[CASE_GROUPS_MAX];
    struct solid solids[CASE_GROUPS_MAX];
    enum body bodies[CASE_GROUPS_MAX];
    bool are_bones[CASE_GROUPS_MAX];
    pose T_femur_body[BODY_COUNT];
    int count;
    struct candidate candidates[CANDIDATES_MAX];
};

// ---- room ---------------------------------------------------------------------------------------

// Whether a ball touches nothing.
static bool has_room(const struct search *s, vec3 p, double radius) {
    for (int i = 0; i < s->solid_count; i++) {
        uint32_t hint = MESH_NONE;
        if (solid_distance(&s->solids[i], pose_apply_inverse(s->T_femur_body[s->bodies[i]], p),
                           &hint) < radius)
            return false;
    }
    return true;
}

// On the way from a portal to a loose body, which touches what it lies on.
static bool is_open(const struct search *s, const struct case_portal *portal, vec3 to,
                    double radius) {
    vec3 way = vec3_sub(to, portal->position);
    double length = vec3_length(way);
    if (vec3_dot(way, portal->direction) < DEEP_MM)
        return false;
    for (double at = SKIN_MM; at < length; at += STEP_MM) {
        double left = length - at;
        vec3 p = vec3_add_scaled(portal->position, at / length, way);
        if (!has_room(s, p, fmin(radius, s->radii_mm.z + 0.25 * left - CLEAR_MM)))
            return false;
    }
    return true;
}

static bool fits(const struct search *s, const struct candidate *c, int tool, int scope) {
    vec3 middle = pose_apply(s->T_femur_body[c->body], c->middle);
    return has_room(s, middle, s->radii_mm.z - CLEAR_MM) &&
           is_open(s, &s->knee->portals[tool], middle, fmax(s->widest, SHAFT_MM)) &&
           is_open(s, &s->knee->portals[scope], middle, SHAFT_MM);
}

// ---- candidates ---------------------------------------------------------------------------------

static bool is_near(const struct search *s, enum body body, vec3 p) {
    pose T_body_joint =
        body == BODY_TIBIA ? s->knee->joint.T_tibia_joint : s->knee->joint.T_femur_joint;
    return vec3_distance(p, T_body_joint.translation) <= NEAR_MM;
}

static void gather(struct search *s) {
    for (int i = 0; i < s->solid_count; i++) {
        const struct mesh *mesh = &s->meshes[i];
        bool is_bone = s->are_bones[i] && s->bodies[i] != BODY_PATELLA;
        uint32_t near = 0, skip;
        for (uint32_t t = 0; t < mesh->triangle_count; t++)
            near += is_near(s, s->bodies[i], mesh_corner(mesh, t, 0));
        skip = near / (CANDIDATES_MAX / 2) + 1;
        near = 0;
        for (uint32_t t = 0; is_bone && t < mesh->triangle_count; t++) {
            vec3 at = mesh_corner(mesh, t, 0);
            if (!is_near(s, s->bodies[i], at) || near++ % skip || s->count == CANDIDATES_MAX)
                continue;
            vec3 middle = vec3_add_scaled(at, s->radii_mm.z, s->solids[i].face_normals[t]);
            s->candidates[s->count++] = (struct candidate){s->bodies[i], at, middle};
        }
    }
}

// Of those that fit, those that are farthest from one another, from the first on.
static bool choose(const struct search *s, int tool, int scope, int count,
                   struct loose_place *out) {
    double apart[CANDIDATES_MAX];
    int found = 0;
    for (int i = 0; i < s->count; i++)
        apart[i] = fits(s, &s->candidates[i], tool, scope) ? INFINITY : -1;
    for (; found < count; found++) {
        int best = 0;
        for (int i = 1; i < s->count; i++)
            best = apart[i] > apart[best] ? i : best;
        if (s->count == 0 || apart[best] < 2 * s->widest + APART_MM)
            return false;
        const struct candidate *c = &s->candidates[best];
        out[found] = (struct loose_place){c->body, c->at};
        vec3 p = pose_apply(s->T_femur_body[c->body], c->middle);
        for (int i = 0; i < s->count; i++)
            apart[i] =
                fmin(apart[i], vec3_distance(p, pose_apply(s->T_femur_body[s->candidates[i].body],
                                                           s->candidates[i].middle)));
    }
    return true;
}

// ---- the whole ----------------------------------------------------------------------------------

static void stand(struct search *s, double flexion_deg) {
    struct joint_angles rest = case_rest(s->knee, flexion_deg);
    s->T_femur_body[BODY_FEMUR] = pose_identity();
    s->T_femur_body[BODY_TIBIA] = joint_to_pose(&s->knee->joint, &rest);
    s->T_femur_body[BODY_PATELLA] = case_patella_pose(s->knee, flexion_deg);
}

static enum result begin(struct search *s, struct error *err) {
    enum result result = RESULT_OK;
    for (int i = 0; i < s->knee->group_count && result == RESULT_OK; i++) {
        const struct case_group *group = &s->knee->groups[i];
        if (group->bridges || !(case_group_is_bone(group) || group->tissue.has_zones))
            continue;
        int k = s->solid_count++;
        s->bodies[k] = group->body;
        s->are_bones[k] = case_group_is_bone(group);
        case_group_virtual(group, &s->meshes[k]);
        result = solid_init(&s->solids[k], &s->meshes[k], err);
    }
    return result;
}

static bool search(struct search *s, int count, struct loose_place *out_places) {
    int portals = s->knee->portal_count;
    for (size_t f = 0; f < sizeof flexions / sizeof *flexions; f++) {
        stand(s, flexions[f]);
        for (int tool = 0; tool < portals; tool++)
            for (int scope = 0; scope < portals; scope++)
                if (scope != tool && choose(s, tool, scope, count, out_places))
                    return true;
    }
    return false;
}

enum result loose_places_find(struct knee_case *knee, vec3 radii_mm, int count,
                              struct loose_place *out_places, struct error *err) {
    if (knee->portal_count < 2)
        return fail(err, RESULT_MISSING,
                    "the case has fewer than two portals: give body and at in place of count");
    struct search *s = alloc(1, sizeof *s);
    s->knee = knee;
    s->radii_mm = radii_mm;
    s->widest = fmax(radii_mm.x, fmax(radii_mm.y, radii_mm.z));
    enum result result = begin(s, err);
    if (result == RESULT_OK) {
        gather(s);
        if (!search(s, count, out_places))
            result = fail(err, RESULT_INVALID, "there are not %d places that hands reach", count);
    }
    for (int i = 0; i < s->solid_count; i++) {
        solid_fini(&s->solids[i]);
        mesh_fini(&s->meshes[i]);
    }
    free(s);
    return result;
}
