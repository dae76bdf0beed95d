#include "case_landmarks_picture.h"

#include "report/html.h"
#include "report/render.h"
#include "report/rods.h"

#include <string.h>

#define WIDTH 640
#define HEIGHT 480

static const double rod_mm = 1.2, cross_mm = 1.5, shaft_mm = 60, sight_mm = 42;
static const struct colour by_hand = {0.1, 0.5, 0.9}, proposed = {0.85, 0.1, 0.1},
                           portal_colour = {0.1, 0.6, 0.2}, bone = {0.93, 0.89, 0.8},
                           soft = {0.7, 0.78, 0.85};

struct shot {
    const char *name, *caption;
    double flexion_deg;
    vec3 from, up; // in the joint's frame
    bool tibia_only;
};

static const struct shot shots[] = {
    {"front",
     "From the front, in extension. Red: proposed landmarks, blue: given by hand, green: "
     "portals.",
     0,
     {0, 1, 0.1},
     {0, 0, 1},
     false},
    {"flexed",
     "From the front and above, at 70 degrees of flexion.",
     70,
     {0.2, 1, 0.3},
     {0, 0, 1},
     false},
    {"top", "On top of the tibia, front above.", 0, {0, 0, 1}, {0, 1, 0}, true},
};

// Surfaces: groups, then three meshes of rods.
struct stage {
    pose T_femur_body[BODY_COUNT];
    struct render_surface surfaces[CASE_GROUPS_MAX + 3];
    struct mesh rods[3];
    int count, rod_count;
};

static bool is_shown(const struct case_group *group, const struct shot *shot) {
    if (case_group_is_skin(group))
        return false;
    return !shot->tibia_only || (group->body == BODY_TIBIA && !group->bridges);
}

static void add_groups(struct stage *stage, const struct knee_case *knee, const struct shot *shot) {
    for (int i = 0; i < knee->group_count; i++) {
        const struct case_group *group = &knee->groups[i];
        enum body unused;
        if (is_shown(group, shot))
            stage->surfaces[stage->count++] = (struct render_surface){
                .mesh = &group->mesh,
                .T_world_mesh = stage->T_femur_body[group->body],
                .crease_deg = 40,
                .opacity = body_from_name(group->name, &unused) ? 0.55 : 0.75,
                .colour = body_from_name(group->name, &unused) ? bone : soft};
    }
}

static void add_rods(struct stage *stage, const struct rod *rods, size_t count,
                     struct colour colour) {
    if (count == 0)
        return;
    struct mesh *mesh = &stage->rods[stage->rod_count++];
    rods_mesh(rods, count, rod_mm, mesh);
    stage->surfaces[stage->count++] = (struct render_surface){
        .mesh = mesh, .T_world_mesh = pose_identity(), .opacity = 1, .colour = colour};
}

static void add_landmarks(struct stage *stage, const struct knee_case *knee,
                          const struct shot *shot, bool hand) {
    struct rod rods[3 * CASE_LANDMARKS_MAX];
    size_t count = 0;
    for (int i = 0; i < knee->landmark_count; i++) {
        const struct case_landmark *l = &knee->landmarks[i];
        if (l->by_hand != hand || (shot->tibia_only && l->body != BODY_TIBIA))
            continue;
        vec3 p = pose_apply(stage->T_femur_body[l->body], l->at);
        for (int axis = 0; axis < 3; axis++) {
            vec3 d = {axis == 0, axis == 1, axis == 2};
            rods[count++] =
                (struct rod){vec3_add_scaled(p, -cross_mm, d), vec3_add_scaled(p, cross_mm, d)};
        }
    }
    add_rods(stage, rods, count, hand ? by_hand : proposed);
}

static void add_portals(struct stage *stage, const struct knee_case *knee,
                        const struct shot *shot) {
    struct rod rods[CASE_PORTALS_MAX];
    size_t count = 0;
    for (int i = 0; i < knee->portal_count && !shot->tibia_only; i++) {
        const struct case_portal *p = &knee->portals[i];
        rods[count++] =
            (struct rod){p->position, vec3_add_scaled(p->position, shaft_mm, p->direction)};
    }
    add_rods(stage, rods, count, portal_colour);
}

static struct camera camera_for(const struct knee_case *knee, const struct shot *shot) {
    pose T = knee->joint.T_femur_joint;
    vec3 centre = T.translation;
    struct box box = {vec3_sub(centre, (vec3){sight_mm, sight_mm, sight_mm}),
                      vec3_add(centre, (vec3){sight_mm, sight_mm, sight_mm})};
    return camera_fit(&box, quat_rotate(T.rotation, shot->from), quat_rotate(T.rotation, shot->up),
                      (double)WIDTH / HEIGHT, INFINITY);
}

static enum result picture_of(FILE *file, struct knee_case *knee, const struct shot *shot,
                              struct error *err) {
    struct joint_angles angles = case_rest(knee, shot->flexion_deg);
    struct stage stage = {.T_femur_body = {pose_identity(), joint_to_pose(&knee->joint, &angles),
                                           case_patella_pose(knee, shot->flexion_deg)}};
    add_groups(&stage, knee, shot);
    add_landmarks(&stage, knee, shot, false);
    add_landmarks(&stage, knee, shot, true);
    add_portals(&stage, knee, shot);
    struct render_scene scene = {stage.surfaces, stage.count, camera_for(knee, shot), {1, 1, 1}};
    struct picture picture = {0};
    enum result result = render(&scene, WIDTH, HEIGHT, &picture, err);
    if (result == RESULT_OK)
        result = html_picture(file, &picture, shot->name, shot->caption, err);
    picture_fini(&picture);
    for (int i = 0; i < stage.rod_count; i++)
        mesh_fini(&stage.rods[i]);
    return result;
}

enum result landmarks_pictures(FILE *file, struct knee_case *knee, struct error *err) {
    enum result result = RESULT_OK;
    for (size_t i = 0; i < sizeof shots / sizeof *shots && result == RESULT_OK; i++)
        result = picture_of(file, knee, &shots[i], err);
    return result;
}
