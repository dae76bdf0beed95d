// Exports of a trace for other programs: a table (CSV.md), an image (EXR.md), an animated scene
// (GLTF.md) and a recording (MCAP.md). The record stays the truth.
#pragma once

#include "trace/trace.h"

#include <stdio.h>

struct export_request {
    const char *trace;
    double from_s, to_s; // of the session; steps outside are left out
    const char *columns; // of a table: names or patterns with *, commas between; NULL: the usual
    void (*known_column)(const char *name); // or NULL; each column, if `columns` has an unknown one
    const struct scene *scene; // of the case that it was recorded with; NULL where the kind of
                               // export says so
    void (*progress)(uint64_t done, uint64_t all); // or NULL
};

// All of these: RESULT_OK if the trace is whole. If not, RESULT_MISSING, RESULT_CORRUPT or
// RESULT_FORMAT with the error of trace_read: all that could be read is written. Any other result
// makes no file, also RESULT_MISSING if no step is in the time asked for or the folder does not
// exist. An existing file is replaced once the new one is complete.

// A row for each step. Without a scene the names of groups are left out. RESULT_INVALID where there
// is no such column.
enum result export_csv(const struct export_request *request, FILE *out, struct error *err);

// A row for each marker whose time is in the part that is asked for, in the order in which they
// came.
enum result export_markers(const struct export_request *request, FILE *out, struct error *err);

// Without a scene the maps of cuts are left out. RESULT_LIMIT where there are more steps than an
// image has pixels.
enum result export_exr(const struct export_request *request, const char *path, struct error *err);

// The seen world, and the mock-up beside it, as an animated scene (GLTF.md). Needs the scene.
// RESULT_REFUSED where that is of another case, RESULT_LIMIT where the file would be too large,
// RESULT_MISSING also where there is no step in the time asked for.
enum result export_gltf(const struct export_request *request, const char *path, struct error *err);

// Poses, joint, events, figures and meshes as messages with their times (MCAP.md). Without a scene
// the meshes are left out. RESULT_REFUSED where that is of another case.
enum result export_mcap(const struct export_request *request, const char *path, struct error *err);
