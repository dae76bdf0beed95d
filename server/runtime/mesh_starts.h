// The meshes of the cases before any cut: what the feeds of all sessions of a cut worker begin
// with. One thread.
#pragma once

#include "net/mesh_feed.h"
#include "step/scene.h"

struct mesh_starts { // zeroed: none yet
    int count;
    struct mesh_start {
        const struct scene *scene;
        int tissue;
        struct mesh_feed *feed; // NULL: it cannot be sent
    } * all;
};

void mesh_starts_fini(struct mesh_starts *starts);

// Of that tissue of the scene, which must outlive the starts. NULL: it cannot be sent, and the log
// has said so.
const struct mesh_feed *mesh_starts_of(struct mesh_starts *starts, const struct scene *scene,
                                       int tissue);
