// Surface files to arrays: PLY, OBJ, STL and OFF (OpenMesh's readers behind this header), VTK
// PolyData (vtk.h), and scenes of glTF (case/gltf_scene.h), whose unit is the metre. Coordinates
// are those of the file in double precision: text, and binary files of doubles.
#pragma once

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#include "base/result.h"

struct import_arrays {
    uint32_t vertex_count, triangle_count;
    double *positions;   // 3 * vertex_count, in the file's unit; finite
    uint32_t *triangles; // 3 * triangle_count, all below vertex_count, the three distinct
    uint32_t dropped;    // triangles with a repeated corner, faces with fewer than three; left out
    char space[4];       // the axes that the file declares, as 3D Slicer does: "LPS"; or empty
};

// The format is that of the name's ending. Polygons become fans of triangles; STL's corners with
// equal coordinates become one vertex, other formats keep their vertices. Both arrays are released
// with free(). Refused, with the path: other endings, a file that the reader does not understand
// or that holds no triangle, an index out of range, more than triangles_max, and a misreading: what
// arrives is not what the file says (import/claim.h). The readers trust counts inside of the file:
// cap its size first.
enum result import_reader_read(const char *path, uint32_t triangles_max,
                               struct import_arrays *out_arrays, struct error *err);
void import_arrays_fini(struct import_arrays *arrays); // zeroed arrays are fine; they are zeroed

#ifdef __cplusplus
}
#endif
