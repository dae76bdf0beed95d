#include "rehearsal/forecast.h"

#include "base/check.h"

#include <stdlib.h>
#include <string.h>

static const int servo_rounds = 4;

struct forecast {
    const struct scene *scene;
    int group, tissue; // -1: it cannot be cut
    struct session_settings settings;
    struct scene_stance stance;
    struct warp_surface surfaces[WARP_SURFACES_MAX];
    struct surface_blocks *blocks;
    float *displacement;
    struct surface_integral *integral;
};

static int tissue_of(const struct scene *scene, int group) {
    int tissue = scene_tissue_count(scene) - 1;
    while (tissue >= 0 && scene_tissue_group(scene, tissue) != group)
        tissue--;
    return tissue;
}

struct forecast *forecast_create(const struct scene *scene, int group) {
    struct forecast *f = alloc(1, sizeof *f);
    f->scene = scene;
    f->group = group;
    f->tissue = tissue_of(scene, group);
    f->settings = session_settings_default();
    scene_stand(scene, f->settings.adaptive, &(struct joint_angles){0}, &f->stance);
    const struct mesh *mesh = f->stance.warp.surfaces[f->group].mesh;
    f->blocks = surface_blocks_create(mesh);
    f->displacement = alloc(3 * (size_t)mesh->vertex_count, sizeof *f->displacement);
    return f;
}

void forecast_destroy(struct forecast **forecast) {
    struct forecast *f = *forecast;
    if (!f)
        return;
    surface_integral_destroy(&f->integral);
    surface_blocks_destroy(&f->blocks);
    free(f->displacement);
    free(f);
    *forecast = NULL;
}

static void take_touch(struct forecast *f, const struct operation *operation) {
    struct warp_surface *surface = &f->surfaces[f->group];
    for (uint32_t v = 0; v < surface->mesh->vertex_count; v++) {
        vec3 d =
            vec3_sub(operation_touched(operation, f->tissue, v), mesh_vertex(surface->mesh, v));
        float *out = &f->displacement[3 * (size_t)v];
        out[0] = (float)d.x;
        out[1] = (float)d.y;
        out[2] = (float)d.z;
    }
    surface_integral_destroy(&f->integral);
    f->integral = surface_integral_create(f->blocks, f->displacement);
    surface->displacement = f->displacement;
    surface->integral = f->integral;
}

void forecast_take(struct forecast *f, const struct operation *operation,
                   const struct joint_angles *joint) {
    scene_stand(f->scene, f->settings.adaptive, joint, &f->stance);
    memcpy(f->surfaces, f->stance.warp.surfaces,
           (size_t)f->stance.warp.surface_count * sizeof *f->surfaces);
    if (f->tissue >= 0 && operation_touch_width(operation, f->tissue))
        take_touch(f, operation);
    f->stance.warp.surfaces = f->surfaces;
}

pose forecast_body(const struct forecast *f) {
    enum body body = scene_case(f->scene)->groups[f->group].body;
    return pose_compose(f->stance.correction[body], f->stance.T_femur_body[body]);
}

pose forecast_tool(const struct forecast *f, enum channel tool, vec3 portal, pose T_mockup_tip) {
    const struct instrument_body *shape = &f->settings.bodies[tool - CHANNEL_FIRST_INSTRUMENT];
    struct avatar_body body = {f->settings.avatar, shape->points, shape->point_count};
    struct avatar_memory memory;
    struct avatar avatar;
    avatar_memory_init(&memory);
    avatar_warp(&f->stance.warp, &f->settings.field, &body, portal, T_mockup_tip, &memory, &avatar);
    return pose_compose(pose_inverse(forecast_body(f)), avatar.T_world_warped);
}

vec3 forecast_aim(const struct forecast *f, const struct plan *plan, const struct hand *hand,
                  double roll, vec3 image) {
    vec3 tip = image;
    for (int i = 0; i < servo_rounds; i++) {
        pose T = plan_tool_pose(plan, hand, tip, roll);
        pose T_mesh_tip = forecast_tool(f, hand->channel, hand->portal.position, T);
        vec3 seen = pose_apply(forecast_body(f), T_mesh_tip.translation);
        tip = vec3_add(tip, vec3_sub(image, seen));
    }
    return tip;
}
