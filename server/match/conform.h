// The touched surface S'' put onto the cut mesh T at equal volume. Each vertex moves freely, by a
// displacement of its own; match/match.h, the paper's way, has one number a vertex.
//
//     S''_i = S'_i + d_i
//
// After a cut the vertices around its new surface are fitted to T by a few Gauss-Newton steps, both
// ways: points of S'' to T, points of T to S''. T is left out where it is a film, thinner than
// 0.15 mm: S'' would cross itself there. Where the fit makes S'' cross itself all the same, that
// part is smoothed until it does not; at last it goes back to how it was before the cut. So S'' has
// no crossings where S' has none, whatever T is. The volume inside S'' becomes the wanted one.
//
// Where all of T is gone, with a piece of it perhaps, S'' has nothing to be fitted to. Who touches
// the mock-up there had better see the plateau touched. So what is 8 mm from T in plan (seen along
// z), and what is beside it, sinks onto the underside of S', to a fiftieth of its height: a sheet
// of about 0.1 mm, thicker or smoothed where it would cross itself. No vertex sinks farther than
// S'_max moves any. The sheet is in the volume of S''. A cut that is shorter leaves a gap, into
// which both sides of S'' draw back from one another.
//
// Loops are bounded. The same calls give the same bits on every x86-64 processor: sums have a fixed
// order, and of the mathematics library only what is exact is used. Millimetres. A call may
// allocate.
#pragma once

#include "base/kept.h"
#include "match/match.h"

struct conform;

// S'' = S'. Of the surface only S' counts. It must outlive it.
struct conform *conform_create(const struct match_surface *surface);
struct conform *
conform_copy(const struct conform *conform);    // of the same surface, equal to the bit
void conform_destroy(struct conform **conform); // NULL inside is fine
// Keeps it, or reads it into one of the same surface.
void conform_keep(struct conform *conform, struct kept *kept);

vec3 conform_vertex(const struct conform *conform, uint32_t vertex); // S''
const vec3 *conform_vertices(const struct conform *conform);         // all of it
double conform_volume(struct conform *conform);                      // inside S''
// Puts a vertex of S'' elsewhere. For conform_past it is a change by the last conform_to.
void conform_place(struct conform *conform, uint32_t vertex, vec3 place);

struct conform_target {
    const struct mesh *mesh; // T: closed, oriented, facing outwards, in the frame of S'
    const bool *fresh;       // its triangles that the cut made
    double volume_mm3;       // that S'' is to have, beside the sheet
    bool lays;               // S'' is laid down where nothing is left
    bool quickly;            // in fewer and rougher steps, to as good a fit
};

struct conform_report {
    double volume_mm3;        // inside S'' after it
    double left_mm3;          // volume_mm3 − target; the sheet where nothing was in the way
    double sheet_mm3;         // of S'' that is laid down
    uint32_t active_count;    // vertices that were free to move
    uint32_t crossings_first; // pairs of triangles that the fit alone made cross
    int repairs;              // rounds of smoothing
    uint32_t reverted_count;  // vertices that went back, in part or wholly
    uint32_t changed_count;
    const uint32_t *changed; // vertices that moved, ascending; valid until the next call
};

// Without a fresh triangle nothing moves.
void conform_to(struct conform *conform, const struct conform_target *target,
                struct conform_report *out_report);

// What the last conform_to changed, as it was before: some kB. Zeroed: nothing.
struct conform_past {
    uint32_t count;
    uint32_t *vertices; // ascending
    vec3 *positions;
    uint8_t *dirty;
    double *laid;
};

void conform_past(const struct conform *conform, struct conform_past *out_past);
void conform_past_fini(struct conform_past *past);
void conform_past_keep(const struct conform *conform, struct conform_past *past, struct kept *kept);
// The conform_to calls are taken back the last one first. It is then equal to the bit.
void conform_take_back(struct conform *conform, const struct conform_past *past);
