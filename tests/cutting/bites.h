// Blades and sequences of cuts, random and the same for one seed.
#pragma once

#include "cut/cut.h"
#include "random.h"

struct bite {
    int part_count;
    struct convex parts[CUT_PARTS_MAX];
};

// ---- single blades ----

void convex_box(pose T_mesh_box, vec3 half, struct convex *out);
// Bounded by 8 to 60 planes that touch, or come near, a ball.
void convex_random(struct random *random, vec3 centre, double radius, struct convex *out);
// The same polyhedron elsewhere.
void convex_move(const struct convex *convex, pose T_to_from, struct convex *out);

// ---- sequences ----

// What a sequence is made of, and its share.
enum bite_kind {
    BITE_NIBBLE,  // 78 %: less than 3 mm at the surface, one part in most, up to four in some
    BITE_NEARLY,  // 14 %: the last bite again, or so nearly that faces almost coincide, or flush
                  // beside it
    BITE_THROUGH, //  5 %: a thin rod through the middle
    BITE_SPLIT,   //  3 %: a sheet behind what protrudes most in some direction, which comes off
    BITE_KINDS
};

struct biter {
    struct random random;
    struct bite last;
    enum bite_kind kind; // of the last one
};

void biter_init(struct biter *biter, uint64_t seed);
// The next bite is biter->last. The mesh has triangles.
void biter_next(struct biter *biter, const struct cut_mesh *mesh);
