#include "session/scene.h"

#include "base/check.h"

#include <stdlib.h>

enum result scene_create(struct knee_case **knee, struct scene **out_scene, struct error *err) {
    struct scene *scene = alloc(1, sizeof *scene);
    for (int i = 0; i < (*knee)->group_count; i++) {
        const struct case_group *group = &(*knee)->groups[i];
        enum result result = query_create(&group->mesh, &scene->queries[i], err);
        if (result != RESULT_OK) {
            scene_destroy(&scene);
            return fail_in(err, result, "case %s, group %s: ", (*knee)->name, group->name);
        }
        scene->surfaces[i] = (struct warp_surface){
            .mesh = &group->mesh,
            .query = scene->queries[i],
            .displacement = group->warp,
            .body = group->body,
        };
    }
    scene->knee = *knee;
    *knee = NULL;
    *out_scene = scene;
    return RESULT_OK;
}

void scene_destroy(struct scene **scene) {
    if (!*scene)
        return;
    for (int i = 0; i < CASE_GROUPS_MAX; i++)
        query_destroy(&(*scene)->queries[i]);
    case_destroy(&(*scene)->knee);
    free(*scene);
    *scene = NULL;
}

const struct knee_case *scene_case(const struct scene *scene) {
    return scene->knee;
}
