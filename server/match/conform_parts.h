// The inside of a conform: one call of conform_to, in stages.
#pragma once

#include "match/conform.h"
#include "match/soup.h"
#include "match/surface.h"

// A symmetric matrix.
struct sym3 {
    double xx, xy, xz, yy, yz, zz;
};

static inline void sym3_add(struct sym3 *sum, double s, struct sym3 m) {
    sum->xx += s * m.xx;
    sum->xy += s * m.xy;
    sum->xz += s * m.xz;
    sum->yy += s * m.yy;
    sum->yz += s * m.yz;
    sum->zz += s * m.zz;
}

static inline struct sym3 sym3_outer(vec3 n) {
    return (struct sym3){n.x * n.x, n.x * n.y, n.x * n.z, n.y * n.y, n.y * n.z, n.z * n.z};
}

static inline struct sym3 sym3_identity(double s) {
    return (struct sym3){.xx = s, .yy = s, .zz = s};
}

static inline vec3 sym3_apply(struct sym3 m, vec3 v) {
    return (vec3){m.xx * v.x + m.xy * v.y + m.xz * v.z, m.xy * v.x + m.yy * v.y + m.yz * v.z,
                  m.xz * v.x + m.yz * v.y + m.zz * v.z};
}

// x, y, z, 0: one register of four doubles, where there are such.
typedef double quad __attribute__((vector_size(32), aligned(8)));

struct columns3 {
    quad of[3];
};

// A point of S'' on a live triangle, and what it was last closest to in T.
struct pull {
    uint32_t target; // index in T's soup, or MESH_NONE
    vec3 found_at;   // where the point was when it was looked for
};

#define PULLS_PER_TRIANGLE 4

// A point of T and what it was last closest to in S''.
struct sample {
    vec3 point, normal;
    double area;
    uint32_t source; // a triangle of S'', or MESH_NONE
    vec3 found_at;   // the point of S'' that was found
    bool fresh, out; // out: it lies on a triangle that does not move
};

// Two sides of thin tissue: a vertex or a triangle's middle, and the point across.
struct contact {
    uint32_t slots[6]; // of the corners on both sides, or MESH_NONE
    double shares[6];  // positive here, negative across
    vec3 normal;       // of this side
    double thickness, weight, push;
};

// Of one triangle's rows: corners 0, 1, 2 with one another.
struct triangle_rows {
    struct sym3 pairs[6]; // 00, 01, 02, 11, 12, 22
    vec3 gradient[3];
};

// One Gauss-Newton step, and how exactly it is solved.
struct conform_pass {
    double stiffness; // of the step
    double energy;    // conjugate gradients end at this share of their first energy
    int pulls;        // of each live triangle, the middle's at least
};

#define PASSES_MAX 5

struct conform_plan {
    double beside_mm, beside_edges; // around all that may move, the larger of both
    int pass_count;
    struct conform_pass passes[PASSES_MAX];
    struct conform_pass soft; // of repairs
    double way_energy;        // as a pass's, of the way to equal volume
};

// T of the last call, and what was left of it without films.
struct films_before {
    struct soup_triangle *whole, *target;
    uint32_t *parts; // as conform's
    uint32_t whole_count, whole_room, target_room, part_room;
    // By triangle of it: whether T still has it.
    bool *stays;
    uint32_t stays_room;
    uint32_t *same; // by triangle of T: the triangle that it was, or MESH_NONE
    uint32_t same_room;
    uint32_t *table, table_room; // scratch
};

struct conform {
    const struct match_surface *surface;
    const struct conform_plan *plan; // of the call that runs
    vec3 *positions;                 // S''
    uint8_t *dirty;                  // cuts for which a vertex that has moved is looked at again
    double *laid;     // how much of the way down to the sheet a vertex has gone: 0 to 1
    uint32_t *firsts; // of S', of the cells of its plan: see conform_sheet.c
    uint32_t first_count, first_room;
    double volume; // inside S'', once it was asked for
    bool has_volume;

    // The call that runs. By vertex:
    vec3 *before; // S'' before it,
    uint8_t *dirty_before;
    double *laid_before;
    vec3 *sound;    // S'' when it last had no crossing
    vec3 *kept;     // S'' at some stage
    double *factor; // of a way back
    vec3 *normals;  // of vertices near it, unit
    uint32_t *slot; // among the active ones, or MESH_NONE
    double *trust;  // of data: 1, less where S'' is repaired
    double *bend;   // smoothing: 0, more where S'' is repaired
    double *reach;  // along edges from a seed, mm
    uint8_t *ring;  // from a seed
    uint8_t *tied;  // 1: crosses
    uint8_t *off;   // sides of the zone that it is beyond, one bit for each
    // By triangle:
    uint32_t *live_of; // index among the live ones, or MESH_NONE

    uint32_t *active; // vertices that may move, ascending
    uint32_t *live;   // triangles with an active corner, ascending
    uint32_t *near;   // triangles of S'' around the cut, ascending
    uint32_t *changed;
    uint32_t active_count, live_count, near_count;
    bool is_made;      // self and normals have what is near and live: only its places are old
    uint8_t *moves;    // by vertex: a corner of a live triangle
    uint32_t *beside;  // of what is near, the triangles with such a corner, ascending
    uint32_t *self_of; // of a live triangle, its index in self
    uint32_t beside_count;
    struct box zone;
    vec3 origin;              // of volumes
    struct soup target, self; // T without films, S'' near it
    struct soup whole_target; // T with films
    // By triangle of whole_target, and one more: the first of target that is of it.
    uint32_t *parts, part_room;
    struct films_before films; // of the last call
    uint32_t *across;          // of whole_target, what may make a triangle a film
    uint32_t across_count, across_room;
    uint32_t *queue; // scratch, a vertex each

    struct pull *pulls; // PULLS_PER_TRIANGLE for each live triangle
    struct sample *samples;
    struct contact *contacts;
    uint32_t sample_count, sample_room, contact_count, contact_room;

    // The system: by active vertex, then by the sides of its fan.
    uint32_t *first, *columns; // columns: slots, or MESH_NONE
    struct sym3 *blocks, *diagonal, *inverse, *bending;
    vec3 *gradient, *step, *along, *bent;
    // Of conjugate gradients, by the same:
    struct columns3 *block_columns, *diagonal_columns, *inverse_columns, *bending_columns;
    quad *solution, *residual, *preconditioned, *direction, *product;
    quad *others; // of what is multiplied: the sums of a fan's far ends
    uint32_t block_room;
    struct triangle_rows *rows; // by live triangle
};

// ---- where: conform_zone.c ----
bool conform_gather(struct conform *c, const struct conform_target *target); // false: nothing near
// Live triangles have left the zone: it grows, and more of S'' is near.
void conform_widen(struct conform *c);
void conform_make_self(struct conform *c); // the soup of S'' near the cut, and its normals
// What is live in that soup; normals, and what else has become near, wait for conform_make_self.
void conform_move_self(struct conform *c);
void conform_seed(struct conform *c); // the active vertices and live triangles
void conform_activate(struct conform *c);

// Near the active ones, which have been chosen.
void conform_gather_active(struct conform *c);

// ---- where nothing is left: conform_sheet.c ----
bool conform_lay(struct conform *c, const struct mesh *tissue); // whether any may have moved
double conform_sheet(const struct conform *c);                  // mm³ in the sheet

// ---- films: conform_films.c ----
// Before whole_target is filled.
void conform_keep_films(struct conform *c);
// Fills c->target from c->whole_target.
void conform_leave_out_films(struct conform *c);
void films_before_fini(struct films_before *films);

// ---- rows: conform_rows.c ----
void conform_take_samples(struct conform *c);
// The system's matrix and gradient.
void conform_find_rows(struct conform *c, const struct conform_pass *pass);

// ---- thin tissue: conform_contacts.c ----
void conform_find_contacts(struct conform *c);
void conform_limit(struct conform *c, vec3 *step); // 1 mm, and no tissue closed up

// ---- the system: conform_solve.c, conform_gradients.h ----
void conform_begin_system(struct conform *c);
void conform_clear_system(struct conform *c);
void conform_add_rows(struct conform *c);
void conform_add_smoothing(struct conform *c, double stiffness);
// out: matrix⁻¹ right, by conjugate gradients, to a share of their first energy. right and out: by
// active vertex.
void conform_solve(struct conform *c, const vec3 *right, double energy, vec3 *out);

// ---- equal volume: conform_volume.c ----
double conform_live_volume(const struct conform *c); // mm³ under the live triangles
// Along the way that the last system takes for more volume; where trust is 0 nothing moves.
void conform_settle(struct conform *c, double wanted_mm3, double tolerance_mm3);

// ---- no crossings: conform_untangle.c ----
struct conform_goal {
    double live_mm3, tolerance_mm3; // of the volume under the live triangles
};
void conform_advance(struct conform *c, const struct conform_pass *pass,
                     const struct conform_goal *goal);
void conform_untangle(struct conform *c, const struct conform_goal *goal,
                      struct conform_report *out_report);

// The neighbours of what is tied, ring by ring.
void conform_spread(struct conform *c, int rings);

// Back towards the sound S'' where it crosses: half of the way some times, then all of it, at last
// everywhere. How many vertices went. It is then sound.
uint32_t conform_go_back(struct conform *c, int halvings);

// ---- crossings: conform_cross.c ----
// Pairs of triangles that run through one another, one of them live; their vertices get tied.
uint32_t conform_cross(struct conform *c);

static inline uint32_t conform_degree(const struct conform *c, uint32_t vertex) {
    return c->surface->first[vertex + 1] - c->surface->first[vertex];
}

static inline void conform_corners(const struct conform *c, uint32_t triangle, vec3 out[3]) {
    for (int i = 0; i < 3; i++)
        out[i] = c->positions[c->surface->triangles[3 * (size_t)triangle + (size_t)i]];
}
