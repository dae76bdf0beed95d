#include "check/eased.h"

#include "base/check.h"

#include <stdlib.h>

struct eased {
    struct warp_surface aimed[CASE_GROUPS_MAX], changed[CASE_GROUPS_MAX];
    float *displacements[CASE_GROUPS_MAX];
    struct surface_blocks *blocks[CASE_GROUPS_MAX];
    struct surface_integral *integrals[CASE_GROUPS_MAX];
};

static bool gives_way(const struct case_group *group) {
    return group->cuttable && group->maxcut;
}

static void aim(struct eased *eased, int index, const struct case_group *group) {
    size_t count = 3 * (size_t)group->mesh.vertex_count;
    float *displacement = alloc(count, sizeof *displacement);
    for (size_t i = 0; i < count; i++)
        displacement[i] = (group->warp ? group->warp[i] : 0) + group->maxcut[i];
    struct warp_surface *aimed = &eased->aimed[index];
    eased->displacements[index] = displacement;
    eased->blocks[index] = surface_blocks_create(aimed->mesh);
    eased->integrals[index] = surface_integral_create(eased->blocks[index], displacement);
    aimed->displacement = displacement;
    aimed->integral = eased->integrals[index];
    aimed->mean = NULL;
}

struct eased *eased_create(const struct scene *scene) {
    const struct knee_case *knee = scene_case(scene);
    struct joint_angles straight = {0};
    struct scene_stance stance;
    bool any = false;
    for (int i = 0; i < knee->group_count; i++)
        any = any || gives_way(&knee->groups[i]);
    if (!any)
        return NULL;
    struct eased *eased = alloc(1, sizeof *eased);
    scene_stand(scene, ADAPTIVE_HINGE, &straight, &stance);
    for (int i = 0; i < knee->group_count; i++) {
        const struct case_group *group = &knee->groups[i];
        eased->aimed[i] = eased->changed[i] = stance.warp.surfaces[i];
        eased->changed[i].displacement = gives_way(group) ? group->maxcut : NULL;
        if (gives_way(group))
            aim(eased, i, group);
    }
    return eased;
}

void eased_destroy(struct eased **eased) {
    struct eased *e = *eased;
    if (!e)
        return;
    for (int i = 0; i < CASE_GROUPS_MAX; i++) {
        surface_integral_destroy(&e->integrals[i]);
        surface_blocks_destroy(&e->blocks[i]);
        free(e->displacements[i]);
    }
    free(e);
    *eased = NULL;
}

void eased_stand(const struct eased *eased, const struct scene_stance *stance,
                 struct warp_scene *out_aimed, struct warp_scene *out_changed) {
    *out_aimed = *out_changed = stance->warp;
    out_aimed->surfaces = eased->aimed;
    out_changed->surfaces = eased->changed;
    out_changed->correction = NULL;
}
