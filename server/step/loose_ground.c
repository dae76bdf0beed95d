#include "step/loose_ground.h"

#include "base/check.h"
#include "step/loose.h"

#include <stdlib.h>

// ---- contacts -----------------------------------------------------------------------------------

double loose_reach(vec3 radii_mm, quat rotation, vec3 direction) {
    vec3 n = quat_rotate(quat_conjugate(rotation), direction);
    return vec3_length((vec3){radii_mm.x * n.x, radii_mm.y * n.y, radii_mm.z * n.z});
}

static bool is_far(const struct box *box, vec3 p) {
    return p.x < box->min.x - LOOSE_FAR_MM || p.x > box->max.x + LOOSE_FAR_MM ||
           p.y < box->min.y - LOOSE_FAR_MM || p.y > box->max.y + LOOSE_FAR_MM ||
           p.z < box->min.z - LOOSE_FAR_MM || p.z > box->max.z + LOOSE_FAR_MM;
}

void loose_hints_init(struct loose_hints *hints) {
    for (int i = 0; i < CASE_GROUPS_MAX; i++) {
        hints->triangle[i] = MESH_NONE;
        hints->distance[i] = NAN;
    }
}

static double least_gap(const struct loose_hints *hints, int surface, vec3 radii_mm, vec3 p) {
    double widest = fmax(radii_mm.x, fmax(radii_mm.y, radii_mm.z));
    return hints->distance[surface] - vec3_distance(hints->at[surface], p) - widest;
}

struct loose_contact loose_contact_with(const struct loose_ground *ground, int surface,
                                        const pose T_frame_body[BODY_COUNT], vec3 radii_mm, pose T,
                                        double wanted_mm, struct loose_hints *hints) {
    const struct loose_surface *s = &ground->surfaces[surface];
    const pose *T_frame_surface = &T_frame_body[s->body];
    vec3 p = pose_apply_inverse(*T_frame_surface, T.translation);
    struct closest c;
    if (is_far(&s->solid.box, p) || least_gap(hints, surface, radii_mm, p) > wanted_mm ||
        !query_closest(s->solid.query, p, INFINITY, hints->triangle[surface], &c))
        return (struct loose_contact){-1, INFINITY, {0, 0, 1}};
    double distance = solid_signed(&s->solid, p, &c);
    hints->triangle[surface] = c.triangle;
    hints->distance[surface] = distance;
    hints->at[surface] = p;
    vec3 way = vec3_scale(distance < 0 ? -1 : 1, vec3_sub(p, c.point));
    vec3 normal = vec3_unit_or(way, s->solid.face_normals[c.triangle]);
    normal = quat_rotate(T_frame_surface->rotation, normal);
    return (struct loose_contact){surface, distance - loose_reach(radii_mm, T.rotation, normal),
                                  normal};
}

struct loose_contact loose_nearest(const struct loose_ground *ground, uint32_t cut,
                                   const pose T_frame_body[BODY_COUNT], vec3 radii_mm, pose T,
                                   struct loose_hints *hints) {
    struct loose_contact nearest = {-1, INFINITY, {0, 0, 1}};
    for (int i = 0; i < ground->count; i++) {
        if (cut >> ground->surfaces[i].group & 1)
            continue;
        struct loose_contact c =
            loose_contact_with(ground, i, T_frame_body, radii_mm, T, nearest.gap, hints);
        if (c.gap < nearest.gap)
            nearest = c;
    }
    return nearest;
}

quat loose_laid(quat rotation, vec3 normal) {
    vec3 axis = quat_rotate(rotation, (vec3){0, 0, 1});
    double along = vec3_dot(axis, normal);
    if (along < 0)
        normal = vec3_scale(-1, normal);
    vec3 turn = vec3_cross(axis, normal);
    quat to = quat_unit((quat){1 + fabs(along), turn.x, turn.y, turn.z});
    return quat_unit(quat_multiply(to, rotation));
}

// ---- the ground of a case -----------------------------------------------------------------------

static bool carries(const struct case_group *group) {
    return !group->bridges && (case_group_is_bone(group) || group->tissue.has_zones);
}

static enum result add_surface(struct loose_ground *ground, const struct case_group *group,
                               int index, struct error *err) {
    struct loose_surface *s = &ground->surfaces[ground->count++];
    s->group = index;
    s->body = group->body;
    case_group_virtual(group, &s->mesh);
    return solid_init(&s->solid, &s->mesh, err);
}

// The surface of its own body that is nearest to the point, which lies on it.
static enum result lay_down(struct loose_ground *ground, const struct case_loose *loose, int index,
                            struct error *err) {
    double least = LOOSE_AWAY_MM;
    const struct loose_surface *under = NULL;
    struct closest on = {0};
    for (int i = 0; i < ground->count; i++) {
        struct closest c;
        const struct loose_surface *s = &ground->surfaces[i];
        if (s->body != loose->body ||
            !query_closest(s->solid.query, loose->at, least, MESH_NONE, &c) || c.distance >= least)
            continue;
        least = c.distance;
        on = c;
        under = s;
    }
    if (!under)
        return fail(err, RESULT_INVALID, "loose body %s: no surface of the %s within %g mm",
                    loose->name, body_name(loose->body), LOOSE_AWAY_MM);
    vec3 normal = under->solid.face_normals[on.triangle];
    ground->first[index] = (pose){loose_laid(quat_identity(), normal),
                                  vec3_add_scaled(on.point, loose->radii_mm.z, normal)};
    return RESULT_OK;
}

enum result loose_ground_create(const struct knee_case *knee, struct loose_ground **out_ground,
                                struct error *err) {
    enum result result = RESULT_OK;
    *out_ground = NULL;
    if (!knee->loose_count)
        return RESULT_OK;
    struct loose_ground *ground = alloc(1, sizeof *ground);
    for (int i = 0; i < knee->group_count && result == RESULT_OK; i++)
        if (carries(&knee->groups[i]))
            result = add_surface(ground, &knee->groups[i], i, err);
    for (int i = 0; i < knee->loose_count && result == RESULT_OK; i++)
        result = lay_down(ground, &knee->loose[i], i, err);
    if (result != RESULT_OK)
        loose_ground_destroy(&ground);
    *out_ground = ground;
    return result;
}

void loose_ground_destroy(struct loose_ground **ground) {
    if (!*ground)
        return;
    for (int i = 0; i < (*ground)->count; i++) {
        solid_fini(&(*ground)->surfaces[i].solid);
        mesh_fini(&(*ground)->surfaces[i].mesh);
    }
    free(*ground);
    *ground = NULL;
}
