// The displacement field of a case over its whole reachable space: folds, gain, jumps.
// Millimetres, in the scene's world.
#pragma once

#include "check/parallel.h"
#include "check/space.h"

// Where the displacements of two surfaces leave less than this of the gap between them, every field
// that keeps to both surfaces folds or nearly folds: a bump of 2 mm that fills a gap of 2 mm.
#define FILLED_SHARE 0.9
#define SECOND_GROUP_MM 0.5
#define JUMP_WAY_MM 0.01
#define JUMP_MM 0.05
#define MATTERS 0.01 // mm of W, or mm for each mm
#define GAIN_BINS 20000
#define GAIN_BIN 1e-3

// Triangles that are displaced at this pose, in the world. Beyond `reach_mm` of them W is 0.
struct moved {
    struct mesh mesh; // no triangles: nothing is
    struct query *query;
    double reach_mm;
};

// A displacement of at most 1e-6 mm is none. Of a surface with a mean in the smooth field, all
// triangles. In the integral field W goes on beyond, by some hundredths of a mm. For the gaussian
// field, whose reach has no end, it is the radius all the same. The caller releases it; RESULT_IO
// as query_create.
enum result moved_init(const struct warp_scene *scene, const struct field *field,
                       struct moved *out_moved, struct error *err);
void moved_fini(struct moved *moved);

struct box moved_box(const struct moved *moved); // with its reach; it has triangles

struct field_spot {
    double value;
    vec3 place;
    int nearest[2]; // surfaces, -1: none
    double gap_mm;  // between them there; 0 where they do not face each other
    double left_mm; // of it, after their displacements
};

// Nodes, except where it says otherwise. Spots have a meaning where their count is not 0.
struct field_figures {
    uint64_t looked;        // W is not 0: what the shares below are of
    uint64_t still;         // W is 0
    uint64_t close;         // left out: closer than SECOND_GROUP_MM to a second surface
    uint64_t folded;        // det(I + ∇W) <= 0; of these,
    uint64_t faded;         // those with one surface in reach, off which the field fades, and
    uint64_t filled;        // those where a gap is filled
    uint64_t jumped;        // pairs of neighbours between which W jumps
    struct field_spot gain; // the largest |∇W|
    // The least determinant where the field fades, where a gap is filled, and elsewhere.
    struct field_spot fading, filling, fold;
    struct field_spot jump;    // the largest change of W over JUMP_WAY_MM; nearest[0]: the surface
                               // whose part in it changes most
    uint64_t gains[GAIN_BINS]; // of |∇W|; the last: all beyond
};

// By |∇W| (largest singular value): change of warp for each millimetre of hand. A jump: W changes
// by more than JUMP_MM over JUMP_WAY_MM, and a surface's Δ by half of that or more, found by
// halving the way between neighbours that differ by more than both gradients explain. In the
// integral field only a ligament that bridges two bones has a Δ that may jump.
// aimed: NULL, or the same surfaces with displacements that the scene's are eased into. Then a
// place counts as it is at the share of the way that folds most, in sixteenths; one that folds from
// the beginning is left out, and jumps are not looked for. Figures are added to those that are
// there. Threads inside; the figures depend on none of it.
void field_walk(const struct warp_scene *scene, const struct warp_scene *aimed,
                const struct field *field, const struct moved *moved, const struct space *space,
                const struct progress *progress, struct field_figures *figures);

// Adds the counts, not the spots.
void field_counts_add(struct field_figures *sum, const struct field_figures *figures);

// Folds that neither a surface displaced by as much as the field reaches nor a filled gap explains:
// between sheets that are close the integral field is steeper than straight from one to the other.
static inline uint64_t field_own_folds(const struct field_figures *figures) {
    return figures->folded - figures->faded - figures->filled;
}

// Where the least determinant is; NULL where nothing folds.
const struct field_spot *field_worst_fold(const struct field_figures *figures);

// The gain that a share of what was looked at does not exceed; 0 where nothing was.
double field_gain_within(const struct field_figures *figures, double share);

// What is left of the gap between two contacts of a point that face each other across it, after
// their displacements; false where they do not.
bool field_gap(const struct warp_contact *a, const struct warp_contact *b, vec3 y, double *out_gap,
               double *out_left);

// Points exactly on displaced surfaces, where no second one is within SECOND_GROUP_MM: how far from
// where they should be.
struct touch_figures {
    uint64_t count;
    double sum_mm, largest_mm;
    int surface; // of the largest
    vec3 place;
};

// Added to what is there: the middles of all displaced triangles.
void field_touch(const struct warp_scene *scene, const struct field *field,
                 struct touch_figures *figures);
