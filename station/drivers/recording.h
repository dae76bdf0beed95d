// Reads the files that are played: sequence metafiles (drivers/sequence.h) and tables (CSV). A
// table is a motion file (joint columns; for each tool NAME_tx_mm, NAME_ty_mm, NAME_tz_mm, NAME_qw,
// NAME_qx, NAME_qy, NAME_qz, NAME_valid and perhaps NAME_opening and NAME_force_n) or the recording
// of one tool (the same columns without a name). The first row names the columns; t_seconds is one
// of them and rises. Columns that are not known are ignored.
#pragma once

#include "base/result.h"
#include "base/sample.h"

#include <stdbool.h>

#define RECORDING_ROWS_MAX 1000000
#define RECORDING_NAME_MAX 64

struct recording_state {
    pose pose;      // in the frame that the file is about; the identity where not valid
    double opening; // 0 to 1
    double force_n;
    bool valid;
};

struct recording_tool {
    enum channel channel;
    bool has_opening, has_force;
    struct recording_state *states; // one a row
};

struct recording {
    int row_count; // at least 1
    double *t_seconds;
    struct joint_angles *joints; // one a row; NULL: the file has none
    int tool_count;
    struct recording_tool tools[CHANNEL_COUNT];
};

// Which tools of a file are which channels.
struct recording_tools {
    enum channel unnamed; // of the one tool of a recording; CHANNEL_COUNT where tools have names
    // Of a metafile: the transform of each channel, "ProbeToTracker" or "Probe" for short; "":
    // none.
    char names[CHANNEL_COUNT][RECORDING_NAME_MAX];
};

// `unnamed` is the channel of the one tool of a recording; CHANNEL_COUNT where a motion file is
// expected. Errors name the file, the line and the column: a missing file (RESULT_MISSING), a
// missing column, a row of other length, a value that is no number, a time that does not rise, a
// quaternion that is not of unit length, a file without joint and tools (RESULT_FORMAT), too many
// rows or too long lines (RESULT_LIMIT). Release with recording_fini in any case.
enum result recording_read(const char *path, enum channel unnamed, struct recording *out_recording,
                           struct error *err);
// The same with names. RESULT_INVALID where a table is given names.
enum result recording_read_tools(const char *path, const struct recording_tools *tools,
                                 struct recording *out_recording, struct error *err);
void recording_fini(struct recording *recording);

// From the first row to where the first row comes again when the file is played in a loop.
double recording_period(const struct recording *recording);

// The newest row at t seconds (of the file's own time); 0 before the first.
int recording_row_at(const struct recording *recording, double t_seconds);

// Between two rows that are valid: straight in translation and angles, slerp in rotation. Where one
// of the two is not valid: the newest row. Outside the file: the first or the last row.
struct joint_angles recording_joint_at(const struct recording *recording, double t_seconds);
struct recording_state recording_tool_at(const struct recording *recording, int tool,
                                         double t_seconds);
