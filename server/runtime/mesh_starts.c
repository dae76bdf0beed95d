#include "runtime/mesh_starts.h"

#include "base/check.h"
#include "base/log.h"
#include "runtime/tissue_delta.h"

#include <stdlib.h>

void mesh_starts_fini(struct mesh_starts *starts) {
    for (int i = 0; i < starts->count; i++)
        mesh_feed_destroy(&starts->all[i].feed);
    free(starts->all);
    *starts = (struct mesh_starts){0};
}

static struct mesh_feed *make(const struct scene *scene, int tissue) {
    const char *group = scene_case(scene)->groups[scene_tissue_group(scene, tissue)].name;
    struct mesh_feed *feed;
    struct mesh_delta whole;
    struct error err;
    tissue_delta_whole(scene_tissue_mesh(scene, tissue), &whole);
    if (mesh_feed_create(group, &whole, &feed, &err) != RESULT_OK)
        log_error("meshes", "%s: its mesh cannot be sent: %s", group, err.text);
    mesh_delta_fini(&whole);
    return feed;
}

const struct mesh_feed *mesh_starts_of(struct mesh_starts *starts, const struct scene *scene,
                                       int tissue) {
    for (int i = 0; i < starts->count; i++)
        if (starts->all[i].scene == scene && starts->all[i].tissue == tissue)
            return starts->all[i].feed;
    starts->all = alloc_resize(starts->all, (size_t)starts->count + 1, sizeof *starts->all);
    struct mesh_start *start = &starts->all[starts->count++];
    *start = (struct mesh_start){scene, tissue, make(scene, tissue)};
    return start->feed;
}
