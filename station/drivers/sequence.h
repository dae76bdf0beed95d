// Reads the header of a sequence metafile, as PlusLib, fCal and 3D Slicer write it (.igs.mha,
// .igs.mhd): for each frame a time stamp, and for each tool a matrix "PROBEToTrackerTransform", in
// millimetres, with its status. The images behind the header are not read.
// https://pluslib.readthedocs.io/en/latest/file-formats/FileSequenceFile.html
#pragma once

#include "drivers/recording.h"

#include <stdio.h>

// Whether the file begins as a metafile does. It is at its beginning again.
bool sequence_begins(FILE *file);

// The tools are those of `tools`; where it names none, those that are called as a channel, in any
// case of letters, or with `unnamed` the one that there is.
//
// A tool that a frame lacks, and one whose status is not OK, is not valid there. Errors name the
// line: RESULT_FORMAT where a frame has no time or one that does not rise, where frames do not
// follow each other, where a matrix that is OK is no rotation and translation, or where a
// transform that was named never comes; RESULT_LIMIT as for a table.
enum result sequence_read(FILE *file, const char *path, const struct recording_tools *tools,
                          struct recording *out_recording, struct error *err);
