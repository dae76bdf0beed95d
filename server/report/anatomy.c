#include "report/anatomy.h"

#include <string.h>

#define ANATOMY_CREASE_DEG 40
#define SIGHT_MM 62.0   // from the joint's centre: beyond, shafts may run out of the picture
#define EYE_HEIGHTS 4.0 // heights of the picture from which it is seen

static const struct colour anatomy_background = {1, 1, 1};

// ---- views ----

// Right knee: x lateral, y anterior, z proximal.
static const struct {
    const char *name;
    vec3 from, up;
} views[VIEWPOINT_COUNT] = {
    [VIEWPOINT_FRONT] = {"front", {0.1, 1, 0.15}, {0, 0, 1}},
    [VIEWPOINT_BACK] = {"back", {-0.1, -1, 0.15}, {0, 0, 1}},
    [VIEWPOINT_MEDIAL] = {"medial", {-1, 0.2, 0.15}, {0, 0, 1}},
    [VIEWPOINT_LATERAL] = {"lateral", {1, 0.2, 0.15}, {0, 0, 1}},
    [VIEWPOINT_TOP] = {"top", {0, 0, 1}, {0, 1, 0}},
};

const char *viewpoint_name(enum viewpoint view) {
    return views[view].name;
}

bool viewpoint_from_name(const char *name, enum viewpoint *out_view) {
    for (int i = 0; i < VIEWPOINT_COUNT; i++) {
        if (strcmp(views[i].name, name) == 0) {
            *out_view = (enum viewpoint)i;
            return true;
        }
    }
    return false;
}

void anatomy_choose(const struct knee_case *knee, enum viewpoint view,
                    bool out_shown[CASE_GROUPS_MAX]) {
    for (int i = 0; i < knee->group_count; i++) {
        const struct case_group *group = &knee->groups[i];
        bool plateau = group->body == BODY_TIBIA && !group->bridges &&
                       (case_group_is_bone(group) || group->tissue.kind == TISSUE_CARTILAGE ||
                        group->tissue.kind == TISSUE_MENISCUS || group->cuttable);
        out_shown[i] = view == VIEWPOINT_TOP ? plateau : !case_group_is_skin(group);
    }
}

// ---- colours ----

// A part of a bone may be its cartilage.
static bool is_cartilage(const struct case_group *group, uint32_t triangle) {
    for (int i = 0; group->tissue.kind == TISSUE_BONE && i < group->part_count; i++) {
        const struct case_part *part = &group->parts[i];
        if (triangle - part->first_triangle < part->triangle_count)
            return strstr(part->name, "cartilage") != NULL;
    }
    return false;
}

static struct colour colour_of(const struct case_group *group, uint32_t triangle) {
    double rgb[3];
    tissue_rgb(is_cartilage(group, triangle) ? tissue_colour(TISSUE_CARTILAGE)
                                             : group->tissue.colour,
               rgb);
    return (struct colour){rgb[0], rgb[1], rgb[2]};
}

static bool is_inside(const struct case_region *region, vec3 p) {
    for (int i = 0; i < region->part_count; i++)
        if (convex_contains(&region->parts[i], p))
            return true;
    return false;
}

static struct colour paint_anatomy(const void *context, const struct render_spot *spot) {
    const struct case_group *group = context;
    if (is_inside(&group->lesion.tear, spot->point))
        return (struct colour){0.55, 0.05, 0.08};
    if (is_inside(&group->lesion.damage, spot->point))
        return (struct colour){0.93, 0.52, 0.28};
    if (is_inside(&group->lesion.plan, spot->point))
        return (struct colour){0.95, 0.84, 0.42};
    return colour_of(group, spot->triangle);
}

// ---- what is shown ----

struct shown_groups {
    int count;
    struct mesh meshes[CASE_GROUPS_MAX];
    struct render_surface surfaces[CASE_GROUPS_MAX];
};

static void shown_add(struct shown_groups *shown, const struct case_group *group,
                      pose T_femur_body) {
    struct mesh *mesh = &shown->meshes[shown->count];
    case_group_virtual(group, mesh);
    shown->surfaces[shown->count++] = (struct render_surface){
        .mesh = mesh,
        .T_world_mesh = T_femur_body,
        .crease_deg = ANATOMY_CREASE_DEG,
        .opacity = case_group_is_skin(group) ? 0.25 : 1,
        .paint = paint_anatomy,
        .paint_context = group,
    };
}

static void shown_fini(struct shown_groups *shown) {
    for (int i = 0; i < shown->count; i++)
        mesh_fini(&shown->meshes[i]);
}

static struct box box_about(const struct shown_groups *shown, vec3 centre) {
    struct box box = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    for (int i = 0; i < shown->count; i++) {
        const struct render_surface *surface = &shown->surfaces[i];
        for (uint32_t v = 0; v < surface->mesh->vertex_count; v++) {
            vec3 p = pose_apply(surface->T_world_mesh, mesh_vertex(surface->mesh, v));
            if (vec3_distance(p, centre) < SIGHT_MM)
                box_include(&box, p);
        }
    }
    return box;
}

static vec3 from_of(enum viewpoint view, enum side side) {
    vec3 from = views[view].from;
    if (side == SIDE_LEFT)
        from.x = -from.x;
    return from;
}

enum result anatomy_picture(const struct knee_case *knee, const struct anatomy_view *view,
                            int width, int height, struct picture *out_picture, struct error *err) {
    struct joint_angles angles = {.flexion_deg = view->flexion_deg};
    pose T_femur_body[BODY_COUNT] = {
        [BODY_FEMUR] = pose_identity(),
        [BODY_TIBIA] = joint_to_pose(&knee->joint, &angles),
        [BODY_PATELLA] = case_patella_pose(knee, view->flexion_deg),
    };
    struct shown_groups shown = {0};
    for (int i = 0; i < knee->group_count; i++)
        if (view->shown[i])
            shown_add(&shown, &knee->groups[i], T_femur_body[knee->groups[i].body]);
    struct box box = box_about(&shown, knee->joint.T_femur_joint.translation);
    bool empty = !(box.min.x <= box.max.x);
    enum result result = RESULT_MISSING;
    if (empty) {
        fail(err, result, "no group that is shown has a point within %g mm of the joint", SIGHT_MM);
    } else {
        struct camera camera =
            camera_fit(&box, from_of(view->view, knee->joint.side), views[view->view].up,
                       (double)width / height, EYE_HEIGHTS);
        struct render_scene scene = {shown.surfaces, shown.count, camera, anatomy_background};
        result = render(&scene, width, height, out_picture, err);
    }
    shown_fini(&shown);
    return result;
}
