// The space that the tip of an instrument can reach at one pose of the joint, as nodes of a grid:
// inside the skin, or inside given planes where there is none, and outside of all solids. Of a
// closed surface, inside is where its winding number is positive; of an open one, where of the six
// ways along the axes at least two more meet its back first than its front. Millimetres, in the
// scene's world.
#pragma once

#include "mesh/convex.h"
#include "warp/warp.h"

enum space_role { SPACE_SOLID, SPACE_SKIN };

struct space_surface {
    enum space_role role;
    bool open;                // not closed or not oriented (mesh/topology.h)
    const struct mesh *whole; // what bounds it, or NULL: the surface of the scene
};

struct space_setup {
    const struct warp_scene *scene;       // the physical surfaces, where its bodies are
    const struct space_surface *surfaces; // of each of the scene's
    const struct plane *planes;           // for a scene without a skin: the space ends at each of
    int plane_count;                      // them
    struct box box;                       // nothing else is looked at
    double spacing_mm;
};

enum space_place {
    PLACE_FREE,
    PLACE_OUTSIDE, // of the skin, or of a plane
    PLACE_SOLID,
    PLACE_POCKET, // free, but shut in by solids on all sides
    PLACE_COUNT
};

// Node (i, j, k) is node[i + size[0] * (j + size[1] * k)], at origin + spacing (i, j, k). Zeroed:
// none.
struct space {
    int size[3]; // at least 1 each
    vec3 origin;
    double spacing_mm;
    uint8_t *places; // enum space_place
};

#define SPACE_NODES_MAX 200000000

// RESULT_LIMIT: the box has more than SPACE_NODES_MAX nodes. The caller releases it.
enum result space_init(const struct space_setup *setup, struct space *out_space, struct error *err);
void space_fini(struct space *space);

// Marks what is shut in. Free nodes at the border of the box count as open to the outside.
void space_find_pockets(struct space *space);

size_t space_count(const struct space *space);

static inline size_t space_node(const struct space *space, int i, int j, int k) {
    return (size_t)i + (size_t)space->size[0] * ((size_t)j + (size_t)space->size[1] * (size_t)k);
}

static inline vec3 space_at(const struct space *space, int i, int j, int k) {
    return vec3_add_scaled(space->origin, space->spacing_mm,
                           (vec3){(double)i, (double)j, (double)k});
}
