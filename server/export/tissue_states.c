#include "export/tissue_states.h"

#include "base/check.h"
#include "export/landings.h"

#include <stdlib.h>

struct reading {
    const struct scene *scene;
    struct tissue_states *states;
};

static void take_mesh(const struct operation *operation, int tissue, struct mesh *out_mesh) {
    mesh_fini(out_mesh);
    cut_mesh_flatten(operation_mesh(operation, tissue), out_mesh, NULL, NULL);
}

static void take_start(void *context, const struct operation *operation) {
    struct reading *r = context;
    for (int i = 0; i < scene_tissue_count(r->scene); i++)
        take_mesh(operation, i, &r->states->before[i]);
}

static void take_landing(void *context, struct landing *landing,
                         const struct operation *operation) {
    struct tissue_states *states = ((struct reading *)context)->states;
    int tissue = landing->result->tissue;
    if (!landing->wanted)
        return take_mesh(operation, tissue, &states->before[tissue]);
    states->cuts = alloc_resize(states->cuts, (size_t)states->cut_count + 1, sizeof *states->cuts);
    struct cut_mesh_state *cut = &states->cuts[states->cut_count++];
    *cut = (struct cut_mesh_state){.step = landing->step, .tissue = tissue};
    take_mesh(operation, tissue, &cut->mesh);
}

enum result tissue_states_read(struct walk *walk, struct tissue_states *out_states,
                               struct error *err) {
    struct reading reading = {walk->request->scene, out_states};
    struct landing_watcher watcher = {&reading, take_start, take_landing};
    return landings_run(walk, &watcher, err);
}

void tissue_states_fini(struct tissue_states *states) {
    for (int i = 0; i < TISSUES_MAX; i++)
        mesh_fini(&states->before[i]);
    for (int i = 0; i < states->cut_count; i++)
        mesh_fini(&states->cuts[i].mesh);
    free(states->cuts);
    *states = (struct tissue_states){0};
}
