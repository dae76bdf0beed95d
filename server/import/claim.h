// The content that a surface file declares, for comparison with the result of a reader. Counts
// lines and headers, and checks their form.
#pragma once

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#include "base/result.h"

#define IMPORT_UNKNOWN UINT32_MAX

struct import_claim {
    uint32_t vertices; // STL does not say: IMPORT_UNKNOWN
    uint32_t faces;    // STL's reader leaves out those with two corners in one place
    uint32_t
        repeated; // of the faces of an OBJ: with a repeated corner, which its reader leaves out
    // The vertices as the file has them, 3 numbers each; those of an STL for each facet anew. NULL
    // where they are floats: in a binary STL, and a binary PLY whose vertices are no doubles.
    double *positions;
    uint32_t position_count;
};

// By the ending of the name: .ply, .obj, .stl, .off. At most points_max positions are kept, those
// beyond are passed over. The caller releases *out_claim with import_claim_fini, also after an
// error. Refused, with the path and where it can be
// told the line: what OpenMesh misreads or reads on for ever. That is a PLY header that does not
// end or has lines of another form; text with more, fewer or other lines of data than its header
// says; list lengths with a sign or over 16 bits; lines of an OFF that are neither a vertex nor a
// face; lines of an OBJ that are continued, faces whose corners are not numbers, and materials
// outside of its folder; zero bytes in a text; an STL whose size is not that of its triangles,
// whose facets are not three vertices of three numbers, whose solids do not end, or with numbers
// that are none.
enum result import_claim_of(const char *path, uint32_t points_max, struct import_claim *out_claim,
                            struct error *err);
void import_claim_fini(struct import_claim *claim);

#ifdef __cplusplus
}
#endif
