#include "drivers/recording.h"

#include "base/check.h"
#include "drivers/sequence.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LINE_MAX_BYTES 8192
#define COLUMNS_MAX 256

static const char *const joint_columns[] = {"flexion_deg", "varus_deg", "internal_deg",
                                            "shift_mm",    "drawer_mm", "distraction_mm"};
static const char *const tool_columns[] = {"tx_mm", "ty_mm", "tz_mm", "qw",
                                           "qx",    "qy",    "qz",    "valid"};
enum { JOINT_COLUMNS = 6, TOOL_COLUMNS = 8 };

struct csv {
    const char *path;
    FILE *file;
    int line;
    char text[LINE_MAX_BYTES], names[LINE_MAX_BYTES]; // `names` holds the first row
    char *fields[COLUMNS_MAX];
    char *columns[COLUMNS_MAX]; // their names
    int field_count, column_count;
    int time, joint[JOINT_COLUMNS];
    struct {
        int columns[TOOL_COLUMNS], opening, force; // opening, force -1: none
    } tools[CHANNEL_COUNT];
};

// ---- lines and columns --------------------------------------------------------------------------

// RESULT_MISSING at the end of the file.
static enum result next_row(struct csv *csv, struct error *err) {
    if (!fgets(csv->text, sizeof csv->text, csv->file))
        return ferror(csv->file) ? fail(err, RESULT_IO, "%s: %s", csv->path, strerror(errno))
                                 : RESULT_MISSING;
    csv->line++;
    size_t length = strlen(csv->text);
    if (length == sizeof csv->text - 1 && csv->text[length - 1] != '\n')
        return fail(err, RESULT_LIMIT, "%s:%d: longer than %zu bytes", csv->path, csv->line,
                    length);
    csv->text[strcspn(csv->text, "\r\n")] = 0;
    csv->field_count = 0;
    for (char *rest = csv->text; rest;) {
        if (csv->field_count == COLUMNS_MAX)
            return fail(err, RESULT_LIMIT, "%s:%d: more than %d columns", csv->path, csv->line,
                        COLUMNS_MAX);
        csv->fields[csv->field_count++] = strsep(&rest, ",");
    }
    return RESULT_OK;
}

static int find_column(const struct csv *csv, const char *prefix, const char *name) {
    char wanted[64];
    snprintf(wanted, sizeof wanted, "%s%s%s", prefix, *prefix ? "_" : "", name);
    for (int i = 0; i < csv->column_count; i++)
        if (!strcmp(csv->columns[i], wanted))
            return i;
    return -1;
}

// All `count` columns or none of them. *out_present tells which.
static enum result find_columns(const struct csv *csv, const char *prefix,
                                const char *const names[], int count, int *out_columns,
                                bool *out_present, struct error *err) {
    int found = 0, missing = 0;
    for (int i = 0; i < count; i++) {
        out_columns[i] = find_column(csv, prefix, names[i]);
        found += out_columns[i] >= 0;
        if (out_columns[i] < 0)
            missing = i;
    }
    *out_present = found == count;
    if (found && found < count)
        return fail(err, RESULT_FORMAT, "%s:1: column %s%s%s is missing", csv->path, prefix,
                    *prefix ? "_" : "", names[missing]);
    return RESULT_OK;
}

static enum result find_tool(struct csv *csv, const char *prefix, enum channel channel,
                             struct recording *r, struct error *err) {
    bool present;
    int at = r->tool_count;
    enum result result = find_columns(csv, prefix, tool_columns, TOOL_COLUMNS,
                                      csv->tools[at].columns, &present, err);
    if (result != RESULT_OK || !present)
        return result;
    int opening = find_column(csv, prefix, "opening"), force = find_column(csv, prefix, "force_n");
    csv->tools[at].opening = opening;
    csv->tools[at].force = force;
    r->tools[at] = (struct recording_tool){channel, opening >= 0, force >= 0, NULL};
    r->tool_count++;
    return RESULT_OK;
}

static enum result find_tools(struct csv *csv, enum channel unnamed, struct recording *r,
                              struct error *err) {
    if (unnamed != CHANNEL_COUNT) {
        enum result result = find_tool(csv, "", unnamed, r, err);
        if (result == RESULT_OK && !r->tool_count)
            return fail(err, RESULT_FORMAT, "%s:1: no columns tx_mm ... valid of a single tool",
                        csv->path);
        return result;
    }
    for (int i = CHANNEL_JOINT + 1; i < CHANNEL_COUNT; i++) {
        const char *name = channel_name((enum channel)i);
        enum result result = find_tool(csv, name, (enum channel)i, r, err);
        if (result != RESULT_OK)
            return result;
    }
    if (find_column(csv, "", "tx_mm") >= 0)
        return fail(err, RESULT_FORMAT, "%s:1: one tool without a name: its channel must be given",
                    csv->path);
    return RESULT_OK;
}

static enum result read_names(struct csv *csv, enum channel unnamed, struct recording *r,
                              bool *out_has_joint, struct error *err) {
    enum result result = next_row(csv, err);
    if (result == RESULT_MISSING)
        return fail(err, RESULT_FORMAT, "%s: is empty", csv->path);
    if (result != RESULT_OK)
        return result;
    memcpy(csv->names, csv->text, sizeof csv->names);
    csv->column_count = csv->field_count;
    for (int i = 0; i < csv->field_count; i++)
        csv->columns[i] = csv->names + (csv->fields[i] - csv->text);
    csv->time = find_column(csv, "", "t_seconds");
    if (csv->time < 0)
        return fail(err, RESULT_FORMAT, "%s:1: column t_seconds is missing", csv->path);
    result = find_columns(csv, "", joint_columns, JOINT_COLUMNS, csv->joint, out_has_joint, err);
    if (result == RESULT_OK)
        result = find_tools(csv, unnamed, r, err);
    if (result == RESULT_OK && !*out_has_joint && !r->tool_count)
        return fail(err, RESULT_FORMAT, "%s:1: neither joint nor tool columns", csv->path);
    return result;
}

// ---- rows ---------------------------------------------------------------------------------------

static enum result read_cell(const struct csv *csv, int column, double *out_value,
                             struct error *err) {
    const char *text = csv->fields[column];
    char *end;
    *out_value = strtod(text, &end);
    if (end == text || *end || !isfinite(*out_value))
        return fail(err, RESULT_FORMAT, "%s:%d: %s: \"%.40s\" is not a number", csv->path,
                    csv->line, csv->columns[column], text);
    return RESULT_OK;
}

static enum result read_cells(const struct csv *csv, const int *columns, int count,
                              double *out_values, struct error *err) {
    enum result result = RESULT_OK;
    for (int i = 0; i < count && result == RESULT_OK; i++)
        result = read_cell(csv, columns[i], &out_values[i], err);
    return result;
}

// Column -1: there is none, and the value stays.
static enum result read_within(const struct csv *csv, int column, double low, double high,
                               double *value, struct error *err) {
    enum result result = column < 0 ? RESULT_OK : read_cell(csv, column, value, err);
    if (result == RESULT_OK && (*value < low || *value > high))
        return fail(err, RESULT_FORMAT, "%s:%d: %s: %g is not from %g to %g", csv->path, csv->line,
                    csv->columns[column], *value, low, high);
    return result;
}

static enum result read_state(const struct csv *csv, int tool, struct recording_state *out_state,
                              struct error *err) {
    double n[TOOL_COLUMNS], opening = 0, force_n = 0;
    const int *columns = csv->tools[tool].columns;
    enum result result = read_cells(csv, columns, TOOL_COLUMNS, n, err);
    if (result == RESULT_OK)
        result = read_within(csv, csv->tools[tool].opening, 0, 1, &opening, err);
    if (result == RESULT_OK)
        result = read_within(csv, csv->tools[tool].force, -FORCE_MAX_N, FORCE_MAX_N, &force_n, err);
    if (result != RESULT_OK)
        return result;
    if (n[7] != 0 && n[7] != 1)
        return fail(err, RESULT_FORMAT, "%s:%d: %s: %g is neither 0 nor 1", csv->path, csv->line,
                    csv->columns[columns[7]], n[7]);
    *out_state = (struct recording_state){pose_identity(), opening, force_n, n[7] == 1};
    if (!out_state->valid)
        return RESULT_OK;
    double length = sqrt(n[3] * n[3] + n[4] * n[4] + n[5] * n[5] + n[6] * n[6]);
    if (fabs(length - 1) > 1e-2)
        return fail(err, RESULT_FORMAT, "%s:%d: %s: the quaternion's length is %g, not 1",
                    csv->path, csv->line, csv->columns[columns[3]], length);
    out_state->pose = (pose){quat_unit((quat){n[3], n[4], n[5], n[6]}), {n[0], n[1], n[2]}};
    return RESULT_OK;
}

static void make_rows(struct recording *r, bool has_joint, int rows) {
    size_t count = (size_t)rows;
    r->t_seconds = alloc_resize(r->t_seconds, count, sizeof *r->t_seconds);
    if (has_joint)
        r->joints = alloc_resize(r->joints, count, sizeof *r->joints);
    for (int i = 0; i < r->tool_count; i++)
        r->tools[i].states = alloc_resize(r->tools[i].states, count, sizeof *r->tools[i].states);
}

static enum result read_row(const struct csv *csv, struct recording *r, struct error *err) {
    int row = r->row_count;
    if (csv->field_count != csv->column_count)
        return fail(err, RESULT_FORMAT, "%s:%d: %d columns where the first row has %d", csv->path,
                    csv->line, csv->field_count, csv->column_count);
    enum result result = read_cell(csv, csv->time, &r->t_seconds[row], err);
    if (result == RESULT_OK && row && r->t_seconds[row] <= r->t_seconds[row - 1])
        return fail(err, RESULT_FORMAT, "%s:%d: t_seconds: %g does not follow %g", csv->path,
                    csv->line, r->t_seconds[row], r->t_seconds[row - 1]);
    if (result == RESULT_OK && r->joints) {
        double n[JOINT_COLUMNS];
        result = read_cells(csv, csv->joint, JOINT_COLUMNS, n, err);
        r->joints[row] = (struct joint_angles){n[0], n[1], n[2], n[3], n[4], n[5]};
    }
    for (int i = 0; i < r->tool_count && result == RESULT_OK; i++)
        result = read_state(csv, i, &r->tools[i].states[row], err);
    return result;
}

static enum result read_rows(struct csv *csv, struct recording *r, bool has_joint,
                             struct error *err) {
    int room = 0;
    enum result result;
    while ((result = next_row(csv, err)) == RESULT_OK) {
        if (r->row_count == RECORDING_ROWS_MAX)
            return fail(err, RESULT_LIMIT, "%s:%d: more than %d rows", csv->path, csv->line,
                        RECORDING_ROWS_MAX);
        if (r->row_count == room)
            make_rows(r, has_joint, room = room ? 2 * room : 1024);
        result = read_row(csv, r, err);
        if (result != RESULT_OK)
            return result;
        r->row_count++;
    }
    if (result != RESULT_MISSING)
        return result;
    return r->row_count ? RESULT_OK : fail(err, RESULT_FORMAT, "%s: has no rows", csv->path);
}

static enum result read_table(FILE *file, const char *path, const struct recording_tools *tools,
                              struct recording *r, struct error *err) {
    for (int i = 0; i < CHANNEL_COUNT; i++)
        if (*tools->names[i])
            return fail(err, RESULT_INVALID, "%s: is a table; tool.%s is for metafiles alone", path,
                        channel_name((enum channel)i));
    bool has_joint;
    struct csv *csv = alloc(1, sizeof *csv);
    csv->path = path;
    csv->file = file;
    enum result result = read_names(csv, tools->unnamed, r, &has_joint, err);
    if (result == RESULT_OK)
        result = read_rows(csv, r, has_joint, err);
    free(csv);
    return result;
}

enum result recording_read_tools(const char *path, const struct recording_tools *tools,
                                 struct recording *out_recording, struct error *err) {
    *out_recording = (struct recording){0};
    FILE *file = fopen(path, "re");
    if (!file)
        return fail(err, errno == ENOENT ? RESULT_MISSING : RESULT_IO, "%s: %s", path,
                    strerror(errno));
    enum result result = sequence_begins(file)
                             ? sequence_read(file, path, tools, out_recording, err)
                             : read_table(file, path, tools, out_recording, err);
    fclose(file);
    return result;
}

enum result recording_read(const char *path, enum channel unnamed, struct recording *out_recording,
                           struct error *err) {
    struct recording_tools tools = {.unnamed = unnamed};
    return recording_read_tools(path, &tools, out_recording, err);
}

void recording_fini(struct recording *r) {
    free(r->t_seconds);
    free(r->joints);
    for (int i = 0; i < r->tool_count; i++)
        free(r->tools[i].states);
    *r = (struct recording){0};
}

// ---- the value at a time ------------------------------------------------------------------------

double recording_period(const struct recording *r) {
    const double *t = r->t_seconds;
    int last = r->row_count - 1;
    return last ? t[last] - t[0] + (t[last] - t[0]) / last : 1;
}

int recording_row_at(const struct recording *r, double t_seconds) {
    int low = 0, high = r->row_count; // t[low] <= t_seconds < t[high], where they exist
    while (high - low > 1) {
        int middle = low + (high - low) / 2;
        if (r->t_seconds[middle] <= t_seconds)
            low = middle;
        else
            high = middle;
    }
    return low;
}

// How far t_seconds lies from `row` to the next one, 0 to 1.
static double fraction(const struct recording *r, int row, double t_seconds) {
    if (row + 1 == r->row_count)
        return 0;
    double t = (t_seconds - r->t_seconds[row]) / (r->t_seconds[row + 1] - r->t_seconds[row]);
    return fmax(0, t);
}

struct joint_angles recording_joint_at(const struct recording *r, double t_seconds) {
    int row = recording_row_at(r, t_seconds);
    double f = fraction(r, row, t_seconds);
    const struct joint_angles *a = &r->joints[row], *b = f > 0 ? a + 1 : a;
    return joint_interpolate(a, b, f);
}

struct recording_state recording_tool_at(const struct recording *r, int tool, double t_seconds) {
    int row = recording_row_at(r, t_seconds);
    double f = fraction(r, row, t_seconds);
    const struct recording_state *a = &r->tools[tool].states[row], *b = f > 0 ? a + 1 : a;
    if (!a->valid || !b->valid)
        return *a;
    return (struct recording_state){pose_interpolate(a->pose, b->pose, f),
                                    a->opening + f * (b->opening - a->opening),
                                    a->force_n + f * (b->force_n - a->force_n), true};
}
