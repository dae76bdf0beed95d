#include "anatomy.h"

#include <string.h>

#define REACH_MM 15.0
#define MOVED_MM 1e-3

enum result anatomy_init(struct anatomy *out, struct knee_case **knee, struct error *err) {
    enum result result = RESULT_OK;
    *out = (struct anatomy){0};
    for (int i = 0; result == RESULT_OK && i < (*knee)->group_count; i++) {
        const struct case_group *group = &(*knee)->groups[i];
        result = query_create(&group->mesh, &out->queries[i], err);
        out->hollow |= case_group_is_skin(group) ? 1u << i : 0;
    }
    if (result != RESULT_OK) {
        anatomy_fini(out);
        return result;
    }
    out->knee = *knee;
    *knee = NULL;
    out->scene =
        (struct warp_scene){out->surfaces, out->knee->group_count, out->T_world_body, NULL};
    anatomy_displace(out);
    anatomy_flex(out, 0);
    return RESULT_OK;
}

void anatomy_fini(struct anatomy *anatomy) {
    for (int i = 0; i < CASE_GROUPS_MAX; i++) {
        surface_integral_destroy(&anatomy->integrals[i]);
        surface_blocks_destroy(&anatomy->blocks[i]);
        surface_mean_destroy(&anatomy->means[i]);
        surface_tree_destroy(&anatomy->trees[i]);
        query_destroy(&anatomy->queries[i]);
    }
    case_destroy(&anatomy->knee);
}

void anatomy_displace(struct anatomy *a) {
    a->solid = (struct warp_scene){a->solids, 0, a->T_world_body, NULL};
    for (int i = 0; i < a->knee->group_count; i++) {
        const struct case_group *group = &a->knee->groups[i];
        surface_mean_destroy(&a->means[i]);
        surface_integral_destroy(&a->integrals[i]);
        if (!a->blocks[i])
            a->blocks[i] = surface_blocks_create(&group->mesh);
        a->integrals[i] = surface_integral_create(a->blocks[i], group->warp);
        if (group->warp && !a->trees[i])
            a->trees[i] = surface_tree_create(&group->mesh);
        if (group->warp)
            a->means[i] = surface_mean_create(a->trees[i], group->warp);
        a->surfaces[i] = (struct warp_surface){.mesh = &group->mesh,
                                               .query = a->queries[i],
                                               .displacement = group->warp,
                                               .body = (int)group->body,
                                               .mean = a->means[i],
                                               .integral = a->integrals[i]};
        if (!(a->hollow >> i & 1))
            a->solids[a->solid.surface_count++] = a->surfaces[i];
    }
}

void anatomy_flex(struct anatomy *anatomy, double flexion_deg) {
    struct joint_angles angles = {.flexion_deg = flexion_deg};
    anatomy->T_world_body[BODY_FEMUR] = pose_identity();
    anatomy->T_world_body[BODY_TIBIA] = joint_to_pose(&anatomy->knee->joint, &angles);
    anatomy->T_world_body[BODY_PATELLA] = case_patella_pose(anatomy->knee, flexion_deg);
}

// ---- its extent ---------------------------------------------------------------------------------

vec3 anatomy_delta(const struct warp_scene *scene, int surface, uint32_t triangle, int corner) {
    struct closest contact = {.point = mesh_corner(scene->surfaces[surface].mesh, triangle, corner),
                              .triangle = triangle,
                              .weights = {corner == 0, corner == 1, corner == 2},
                              .feature = FEATURE_VERTEX,
                              .corner = corner};
    return warp_of_contact(scene, surface, &contact);
}

static void include(struct box *box, vec3 p) {
    box->min = (vec3){fmin(box->min.x, p.x), fmin(box->min.y, p.y), fmin(box->min.z, p.z)};
    box->max = (vec3){fmax(box->max.x, p.x), fmax(box->max.y, p.y), fmax(box->max.z, p.z)};
}

double anatomy_largest(const struct warp_scene *scene, struct box *out_box) {
    double longest = 0;
    *out_box = (struct box){{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    for (int k = 0; k < scene->surface_count; k++) {
        const struct warp_surface *s = &scene->surfaces[k];
        for (uint32_t t = 0; t < s->mesh->triangle_count; t++)
            for (int i = 0; i < 3; i++) {
                double length = vec3_length(anatomy_delta(scene, k, t, i));
                longest = fmax(longest, length);
                if (length > MOVED_MM)
                    include(out_box,
                            pose_apply(scene->T_world_body[s->body], mesh_corner(s->mesh, t, i)));
            }
    }
    return longest;
}

// ---- where one can be ---------------------------------------------------------------------------

static bool shows_front(const struct mesh *mesh, vec3 p, const struct closest *c) {
    vec3 from = mesh_corner(mesh, c->triangle, 0);
    vec3 across = vec3_cross(vec3_sub(mesh_corner(mesh, c->triangle, 1), from),
                             vec3_sub(mesh_corner(mesh, c->triangle, 2), from));
    return vec3_dot(vec3_sub(p, c->point), across) >= 0;
}

bool anatomy_reaches(const struct warp_scene *scene, uint32_t hollow, vec3 y) {
    double nearest = INFINITY;
    bool front = true;
    int near = 0;
    for (int k = 0; k < scene->surface_count; k++) {
        const struct warp_surface *s = &scene->surfaces[k];
        struct closest c;
        vec3 p = pose_apply_inverse(scene->T_world_body[s->body], y);
        if (!query_closest(s->query, p, fmin(nearest + ANATOMY_CLEAR_MM, REACH_MM), MESH_NONE, &c))
            continue;
        near += c.distance < ANATOMY_CLEAR_MM;
        if (c.distance < nearest) {
            nearest = c.distance;
            front = shows_front(s->mesh, p, &c) != (hollow >> k & 1);
        }
    }
    return front && near < 2;
}

double anatomy_gap(const struct warp_scene *scene, uint32_t hollow, vec3 y) {
    double gap = INFINITY;
    for (int k = 0; k < scene->surface_count; k++) {
        const struct warp_surface *s = &scene->surfaces[k];
        struct closest c;
        vec3 p = pose_apply_inverse(scene->T_world_body[s->body], y);
        bool solid = !(hollow >> k & 1);
        if (solid && query_closest(s->query, p, fmin(REACH_MM, fabs(gap)), MESH_NONE, &c))
            gap = shows_front(s->mesh, p, &c) ? c.distance : -c.distance;
    }
    return gap;
}

void anatomy_hull(const struct warp_scene *scene, struct hull *out) {
    for (int i = 0; i < HULL_PLANES; i++) { // evenly over the sphere, along a spiral
        double z = 1 - (2 * i + 1.0) / HULL_PLANES, turn = 2.399963229728653 * i;
        double across = sqrt(1 - z * z);
        out->normals[i] = (vec3){across * cos(turn), across * sin(turn), z};
        out->heights[i] = -INFINITY;
    }
    for (int k = 0; k < scene->surface_count; k++) {
        const struct warp_surface *s = &scene->surfaces[k];
        for (uint32_t v = 0; v < s->mesh->vertex_count; v++) {
            vec3 p = pose_apply(scene->T_world_body[s->body], mesh_vertex(s->mesh, v));
            for (int i = 0; i < HULL_PLANES; i++)
                out->heights[i] = fmax(out->heights[i], vec3_dot(p, out->normals[i]));
        }
    }
}

bool hull_holds(const void *context, vec3 p) {
    const struct hull *hull = context;
    for (int i = 0; i < HULL_PLANES; i++)
        if (vec3_dot(p, hull->normals[i]) > hull->heights[i] + HULL_BEYOND_MM)
            return false;
    return true;
}
