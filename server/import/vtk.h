// Legacy VTK PolyData (.vtk) to arrays, text and binary, of versions 1 to 5.
//
// Read: POINTS of float or double, POLYGONS (as fans) and TRIANGLE_STRIPS, in the form before
// version 5 and in that of OFFSETS and CONNECTIVITY. VERTICES, LINES, METADATA, FIELD, and
// everything from POINT_DATA or CELL_DATA on is passed over. Refused, with the path and what: other
// data sets, other types, counts beyond the file's size or the limits, indices out of range,
// coordinates that are no numbers, lists that do not add up, sections that come twice.
//
// XML PolyData (.vtp) is not read: it needs XML, base64 and a decompressor, and every program that
// writes it also writes .vtk. The VTK library itself would bring some hundred packages.
#pragma once

#include "import/reader.h"

#ifdef __cplusplus
extern "C" {
#endif

// As import_reader_read. On an error the arrays may be filled in part: release them.
enum result vtk_read(const char *path, uint32_t triangles_max, struct import_arrays *out_arrays,
                     struct error *err);

#ifdef __cplusplus
}
#endif
