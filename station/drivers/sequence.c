#include "drivers/sequence.h"

#include "base/check.h"

#include <ctype.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#define LINE_MAX_BYTES 8192
#define SEEN_BYTES 160
#define RIGID_TOLERANCE 1e-2 // as of a table's quaternions

struct tool_frame {
    bool there, refused; // it has a matrix; its status is not OK
    double matrix[16];   // row by row
};

struct sequence {
    const char *path;
    FILE *file;
    int line, room;
    char text[LINE_MAX_BYTES];
    const struct recording_tools *tools;
    bool names_tools;                              // by the config
    char names[CHANNEL_COUNT][RECORDING_NAME_MAX]; // of the recording's tools: "ProbeToTracker"
    struct tool_frame frames[CHANNEL_COUNT];       // by tool, of the frame that is being read
    double t_seconds;                              // NAN: not told yet
    char seen[SEEN_BYTES];                         // transforms that are not read
};

static const char begins[] = "ObjectType";

bool sequence_begins(FILE *file) {
    char text[sizeof begins - 1];
    bool same =
        fread(text, 1, sizeof text, file) == sizeof text && !memcmp(text, begins, sizeof text);
    rewind(file);
    return same;
}

static enum result wrong(const struct sequence *s, struct error *err, const char *text) {
    return fail(err, RESULT_FORMAT, "%s:%d: %s", s->path, s->line, text);
}

// ---- tools --------------------------------------------------------------------------------------

static bool ends_with(const char *text, const char *end) {
    size_t length = strlen(text), tail = strlen(end);
    return length > tail && !strcmp(text + length - tail, end);
}

// "Probe" is short for "ProbeToTracker".
static bool is_called(const char *transform, const char *name) {
    size_t length = strlen(name);
    return !strncmp(transform, name, length) &&
           (!transform[length] || !strcmp(transform + length, "ToTracker"));
}

static bool is_named_as_channel(const char *transform, enum channel channel) {
    const char *name = channel_name(channel);
    size_t length = strlen(name);
    return !strncasecmp(transform, name, length) && !strcmp(transform + length, "ToTracker");
}

// The channel of a transform; CHANNEL_COUNT where it is none of those that are read.
static enum channel channel_of(const struct sequence *s, const char *transform) {
    if (!s->names_tools && s->tools->unnamed != CHANNEL_COUNT)
        return ends_with(transform, "ToTracker") ? s->tools->unnamed : CHANNEL_COUNT;
    for (int i = CHANNEL_JOINT + 1; i < CHANNEL_COUNT; i++)
        if (s->names_tools ? *s->tools->names[i] && is_called(transform, s->tools->names[i])
                           : is_named_as_channel(transform, (enum channel)i))
            return (enum channel)i;
    return CHANNEL_COUNT;
}

static void note_seen(struct sequence *s, const char *transform) {
    size_t used = strlen(s->seen);
    if (!strstr(s->seen, transform) && used + strlen(transform) + 3 < sizeof s->seen)
        snprintf(s->seen + used, sizeof s->seen - used, "%s%s", used ? ", " : "", transform);
}

static void forget_state(struct recording_state *state) {
    *state = (struct recording_state){.pose = pose_identity()};
}

// -1: it is not read, or an error is in *out_result.
static int tool_of(struct sequence *s, struct recording *r, const char *transform,
                   enum result *out_result, struct error *err) {
    for (int i = 0; i < r->tool_count; i++)
        if (!strcmp(s->names[i], transform))
            return i;
    enum channel channel = channel_of(s, transform);
    if (channel == CHANNEL_COUNT) {
        note_seen(s, transform);
        return -1;
    }
    for (int i = 0; i < r->tool_count; i++)
        if (r->tools[i].channel == channel) {
            *out_result =
                fail(err, RESULT_FORMAT, "%s:%d: both %s and %s are the %s: tool.%s must name one",
                     s->path, s->line, s->names[i], transform, channel_name(channel),
                     channel_name(channel));
            return -1;
        }
    int tool = r->tool_count++;
    snprintf(s->names[tool], sizeof s->names[tool], "%s", transform);
    r->tools[tool] = (struct recording_tool){
        .channel = channel, .states = alloc((size_t)s->room, sizeof *r->tools[tool].states)};
    for (int row = 0; row < s->room; row++)
        forget_state(&r->tools[tool].states[row]);
    return tool;
}

// ---- frames -------------------------------------------------------------------------------------

static bool read_numbers(const char *text, double *out_numbers, int count) {
    for (int i = 0; i < count; i++) {
        char *end;
        out_numbers[i] = strtod(text, &end);
        if (end == text || !isfinite(out_numbers[i]) || (*end && !isspace((unsigned char)*end)))
            return false;
        text = end;
    }
    return !text[strspn(text, " \t")];
}

// A matrix without scale and shear that is no mirror.
static bool pose_of(const double m[16], pose *out_pose) {
    mat3 rotation = {{{m[0], m[1], m[2]}, {m[4], m[5], m[6]}, {m[8], m[9], m[10]}}};
    quat q = quat_unit(quat_from_mat3(rotation));
    mat3 again = quat_to_mat3(q);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            if (!(fabs(again.m[i][k] - rotation.m[i][k]) <= RIGID_TOLERANCE))
                return false;
    *out_pose = (pose){q, {m[3], m[7], m[11]}};
    return m[12] == 0 && m[13] == 0 && m[14] == 0 && m[15] == 1 && pose_is_valid(*out_pose);
}

static enum result end_frame(struct sequence *s, struct recording *r, struct error *err) {
    int row = r->row_count - 1;
    if (row < 0)
        return RESULT_OK;
    if (isnan(s->t_seconds))
        return fail(err, RESULT_FORMAT, "%s:%d: frame %d has no Timestamp", s->path, s->line, row);
    if (row && s->t_seconds <= r->t_seconds[row - 1])
        return fail(err, RESULT_FORMAT, "%s:%d: frame %d: the time %g does not follow %g", s->path,
                    s->line, row, s->t_seconds, r->t_seconds[row - 1]);
    r->t_seconds[row] = s->t_seconds;
    for (int i = 0; i < r->tool_count; i++) {
        struct recording_state *state = &r->tools[i].states[row];
        if (!s->frames[i].there || s->frames[i].refused)
            continue;
        state->valid = pose_of(s->frames[i].matrix, &state->pose);
        if (!state->valid)
            return fail(err, RESULT_FORMAT,
                        "%s:%d: frame %d: %s is not a rotation and a translation", s->path, s->line,
                        row, s->names[i]);
    }
    return RESULT_OK;
}

static void make_room(struct sequence *s, struct recording *r) {
    if (r->row_count < s->room)
        return;
    int before = s->room;
    s->room = s->room ? 2 * s->room : 1024;
    r->t_seconds = alloc_resize(r->t_seconds, (size_t)s->room, sizeof *r->t_seconds);
    for (int i = 0; i < r->tool_count; i++) {
        struct recording_tool *t = &r->tools[i];
        t->states = alloc_resize(t->states, (size_t)s->room, sizeof *t->states);
        for (int row = before; row < s->room; row++)
            forget_state(&t->states[row]);
    }
}

// Frames come one after the other, so that memory grows with the file and not with a number in it.
static enum result enter_frame(struct sequence *s, struct recording *r, unsigned long frame,
                               struct error *err) {
    if (r->row_count && frame == (unsigned long)r->row_count - 1)
        return RESULT_OK;
    if (frame != (unsigned long)r->row_count)
        return fail(err, RESULT_FORMAT, "%s:%d: frame %lu does not follow %d frames", s->path,
                    s->line, frame, r->row_count);
    enum result result = end_frame(s, r, err);
    if (result != RESULT_OK)
        return result;
    if (r->row_count == RECORDING_ROWS_MAX)
        return fail(err, RESULT_LIMIT, "%s:%d: more than %d frames", s->path, s->line,
                    RECORDING_ROWS_MAX);
    make_room(s, r);
    r->row_count++;
    s->t_seconds = NAN;
    memset(s->frames, 0, sizeof s->frames);
    return RESULT_OK;
}

// ---- fields -------------------------------------------------------------------------------------

static enum result take_matrix(struct sequence *s, struct recording *r, const char *transform,
                               const char *value, struct error *err) {
    enum result result = RESULT_OK;
    int tool = tool_of(s, r, transform, &result, err);
    if (tool < 0)
        return result;
    if (strcasestr(value, "nan")) // some write this of a pose that is not known
        return RESULT_OK;
    s->frames[tool].there = read_numbers(value, s->frames[tool].matrix, 16);
    return s->frames[tool].there ? RESULT_OK : wrong(s, err, "a matrix has 16 numbers");
}

static enum result take_status(struct sequence *s, struct recording *r, const char *transform,
                               const char *value, struct error *err) {
    enum result result = RESULT_OK;
    int tool = tool_of(s, r, transform, &result, err);
    if (tool >= 0 && strcmp(value, "OK"))
        s->frames[tool].refused = true;
    return result;
}

// The name without its ending, where it has that and fits.
static bool take_ending(const char *name, const char *ending, char out[RECORDING_NAME_MAX]) {
    size_t length = strlen(name) - strlen(ending);
    if (!ends_with(name, ending) || length >= RECORDING_NAME_MAX)
        return false;
    memcpy(out, name, length);
    out[length] = 0;
    return true;
}

static enum result take_field(struct sequence *s, struct recording *r, const char *name,
                              const char *value, struct error *err) {
    char transform[RECORDING_NAME_MAX];
    if (!strcmp(name, "Timestamp"))
        return read_numbers(value, &s->t_seconds, 1) ? RESULT_OK
                                                     : wrong(s, err, "Timestamp: no number");
    if (take_ending(name, "Transform", transform))
        return take_matrix(s, r, transform, value, err);
    if (take_ending(name, "TransformStatus", transform))
        return take_status(s, r, transform, value, err);
    return RESULT_OK;
}

// "Seq_Frame0012_NAME": the number and the name. Fields of the whole file are passed over.
static enum result take_line(struct sequence *s, struct recording *r, const char *key,
                             const char *value, struct error *err) {
    static const char prefix[] = "Seq_Frame";
    if (strncmp(key, prefix, sizeof prefix - 1))
        return RESULT_OK;
    const char *digits = key + sizeof prefix - 1;
    char *end;
    if (!isdigit((unsigned char)*digits))
        return wrong(s, err, "a frame has no number");
    unsigned long frame = strtoul(digits, &end, 10);
    if (*end != '_')
        return wrong(s, err, "a field of a frame has no name");
    enum result result = enter_frame(s, r, frame, err);
    return result == RESULT_OK ? take_field(s, r, end + 1, value, err) : result;
}

// ---- the header ---------------------------------------------------------------------------------

static char *trimmed(char *text) {
    text += strspn(text, " \t");
    size_t length = strlen(text);
    while (length && strchr(" \t\r\n", text[length - 1]))
        text[--length] = 0;
    return text;
}

// RESULT_CLOSED after the last line of the header.
static enum result next_line(struct sequence *s, struct recording *r, struct error *err) {
    if (!fgets(s->text, sizeof s->text, s->file))
        return ferror(s->file)
                   ? fail(err, RESULT_IO, "%s: %s", s->path, strerror(errno))
                   : fail(err, RESULT_FORMAT, "%s: ends before ElementDataFile", s->path);
    s->line++;
    if (!strchr(s->text, '\n') && strlen(s->text) == sizeof s->text - 1)
        return fail(err, RESULT_LIMIT, "%s:%d: longer than %d bytes", s->path, s->line,
                    LINE_MAX_BYTES - 1);
    char *value = strchr(s->text, '=');
    if (!value)
        return wrong(s, err, "a line is NAME = VALUE");
    *value++ = 0;
    char *key = trimmed(s->text);
    value = trimmed(value);
    if (!strcmp(key, begins) && strcmp(value, "Image"))
        return wrong(s, err, "ObjectType is not Image");
    if (!strcmp(key, "ElementDataFile"))
        return RESULT_CLOSED;
    return take_line(s, r, key, value, err);
}

static const char *missing_tool(const struct sequence *s, const struct recording *r) {
    for (int i = 0; i < CHANNEL_COUNT; i++) {
        bool found = !*s->tools->names[i];
        for (int k = 0; k < r->tool_count; k++)
            found = found || r->tools[k].channel == (enum channel)i;
        if (!found)
            return s->tools->names[i];
    }
    return NULL;
}

static enum result check_whole(const struct sequence *s, const struct recording *r,
                               struct error *err) {
    const char *missing = missing_tool(s, r), *seen = *s->seen ? s->seen : "none";
    if (!r->row_count)
        return fail(err, RESULT_FORMAT, "%s: has no frames", s->path);
    if (missing)
        return fail(err, RESULT_FORMAT, "%s: has no transform %s; others: %s", s->path, missing,
                    seen);
    if (!r->tool_count)
        return fail(err, RESULT_FORMAT,
                    "%s: no transform is called as a channel: tool.CHANNEL must name one of %s",
                    s->path, seen);
    return RESULT_OK;
}

enum result sequence_read(FILE *file, const char *path, const struct recording_tools *tools,
                          struct recording *r, struct error *err) {
    struct sequence *s = alloc(1, sizeof *s);
    *s = (struct sequence){.path = path, .file = file, .tools = tools, .t_seconds = NAN};
    for (int i = 0; i < CHANNEL_COUNT; i++)
        s->names_tools |= *tools->names[i] != 0;
    enum result result;
    while ((result = next_line(s, r, err)) == RESULT_OK) {
    }
    if (result == RESULT_CLOSED)
        result = end_frame(s, r, err);
    if (result == RESULT_OK)
        result = check_whole(s, r, err);
    free(s);
    return result;
}
