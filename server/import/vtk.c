#include "import/vtk.h"

#include "base/check.h"
#include "base/number.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#define WORD_MAX 64
#define ARRAYS_MAX 1000 // of a FIELD

struct reader {
    const char *path;
    struct error *err;
    const char *at, *end;
    bool binary, new_form; // new_form: OFFSETS and CONNECTIVITY
    uint32_t triangles_max;
    uint64_t room; // for triangles
    struct import_arrays *out;
};

struct number_type {
    const char *name;
    size_t size; // in a binary file, most significant byte first
    enum { SIGNED, UNSIGNED, REAL } kind;
};

static const struct number_type number_types[] = {
    {"char", 1, SIGNED},         {"unsigned_char", 1, UNSIGNED},
    {"short", 2, SIGNED},        {"unsigned_short", 2, UNSIGNED},
    {"int", 4, SIGNED},          {"unsigned_int", 4, UNSIGNED},
    {"long", 8, SIGNED},         {"unsigned_long", 8, UNSIGNED},
    {"vtktypeint64", 8, SIGNED}, {"vtkIdType", 4, SIGNED},
    {"float", 4, REAL},          {"double", 8, REAL}};

static enum result refuse(struct reader *r, enum result code, const char *what, const char *which) {
    return fail(r->err, code, "%s: %s%s%s", r->path, what, which[0] ? ": " : "", which);
}

// ---- words and numbers --------------------------------------------------------------------------

static bool is_blank(char c) {
    return c == ' ' || c == '\t' || c == '\r' || c == '\n';
}

static bool next_word(struct reader *r, char out_word[WORD_MAX]) {
    size_t length = 0;
    while (r->at < r->end && is_blank(*r->at))
        r->at++;
    for (; r->at < r->end && !is_blank(*r->at); r->at++) {
        if (length + 1 == WORD_MAX || *r->at == '\0')
            return false;
        out_word[length++] = *r->at;
    }
    out_word[length] = '\0';
    return length > 0;
}

// Without its end; cut where it is longer.
static bool next_line(struct reader *r, char *out_line, size_t size) {
    size_t length = 0;
    if (r->at == r->end)
        return false;
    for (; r->at < r->end && *r->at != '\n'; r->at++)
        if (length + 1 < size && *r->at != '\r')
            out_line[length++] = *r->at;
    out_line[length] = '\0';
    r->at += r->at < r->end;
    return true;
}

static bool next_count(struct reader *r, uint64_t *out_count) {
    char word[WORD_MAX];
    int64_t count = 0;
    bool good = next_word(r, word) && number_int(word, 0, INT64_MAX, &count);
    *out_count = (uint64_t)count;
    return good;
}

static const struct number_type *next_type(struct reader *r) {
    char word[WORD_MAX];
    if (!next_word(r, word))
        return NULL;
    for (size_t i = 0; i < sizeof number_types / sizeof number_types[0]; i++)
        if (strcasecmp(word, number_types[i].name) == 0)
            return &number_types[i];
    return NULL;
}

// Binary numbers begin behind the end of the line. False where the file has fewer.
static bool begin_numbers(struct reader *r, const struct number_type *type, uint64_t count) {
    char rest[WORD_MAX];
    if (!r->binary)
        return count <= ((uint64_t)(r->end - r->at) + 1) / 2;
    return (count == 0 || next_line(r, rest, sizeof rest)) &&
           count <= (uint64_t)(r->end - r->at) / type->size;
}

static double binary_number(struct reader *r, const struct number_type *type) {
    uint64_t bits = 0;
    for (size_t i = 0; i < type->size; i++)
        bits = bits << 8 | (uint8_t)*r->at++;
    if (type->kind == REAL && type->size == 8) {
        double value;
        memcpy(&value, &bits, sizeof value);
        return value;
    }
    if (type->kind == REAL) {
        uint32_t narrow = (uint32_t)bits;
        float value;
        memcpy(&value, &narrow, sizeof value);
        return (double)value;
    }
    unsigned spare = 64 - 8 * (unsigned)type->size;
    return type->kind == SIGNED ? (double)((int64_t)(bits << spare) >> spare) : (double)bits;
}

static bool next_number(struct reader *r, const struct number_type *type, double *out) {
    char word[WORD_MAX];
    if (!r->binary)
        return next_word(r, word) && number_double(word, -1e30, 1e30, out);
    *out = binary_number(r, type);
    return fabs(*out) <= 1e30; // not so for NaN
}

// `count` whole numbers from 0 to 2^32 - 1, which the caller frees; NULL where they are not that.
static uint32_t *next_indices(struct reader *r, const struct number_type *type, uint64_t count) {
    if (type->kind == REAL || !begin_numbers(r, type, count))
        return NULL;
    uint32_t *indices = alloc(count + 1, sizeof *indices);
    for (uint64_t i = 0; i < count; i++) {
        double value;
        if (!next_number(r, type, &value) || !(value >= 0 && value < UINT32_MAX) ||
            value != floor(value)) {
            free(indices);
            return NULL;
        }
        indices[i] = (uint32_t)value;
    }
    return indices;
}

// ---- sections -----------------------------------------------------------------------------------

static enum result read_points(struct reader *r) {
    uint64_t count;
    const struct number_type *type;
    if (r->out->positions)
        return refuse(r, RESULT_FORMAT, "POINTS comes twice", "");
    if (!next_count(r, &count) || !(type = next_type(r)) || count > UINT32_MAX)
        return refuse(r, RESULT_FORMAT, "POINTS without a count and a type", "");
    if (count > 3 * (uint64_t)r->triangles_max)
        return refuse(r, RESULT_LIMIT, "more triangles or vertices than are accepted", "");
    if (!begin_numbers(r, type, 3 * count))
        return refuse(r, RESULT_FORMAT, "fewer POINTS than it says", "");
    r->out->vertex_count = (uint32_t)count;
    r->out->positions = alloc(3 * count + 1, sizeof(double));
    for (uint64_t i = 0; i < 3 * count; i++)
        if (!next_number(r, type, &r->out->positions[i]))
            return fail(r->err, RESULT_INVALID, "%s: point %llu: a coordinate is no number",
                        r->path, (unsigned long long)i / 3);
    return RESULT_OK;
}

static bool add_triangle(struct reader *r, uint32_t a, uint32_t b, uint32_t c) {
    struct import_arrays *out = r->out;
    if (a == b || b == c || c == a) {
        out->dropped++;
        return true;
    }
    if (out->triangle_count == r->triangles_max)
        return false;
    if (out->triangle_count == r->room) {
        r->room = r->room ? 2 * r->room : 1024;
        out->triangles = alloc_resize(out->triangles, 3 * r->room, sizeof *out->triangles);
    }
    uint32_t *corners = out->triangles + 3 * (size_t)out->triangle_count++;
    corners[0] = a;
    corners[1] = b;
    corners[2] = c;
    return true;
}

static bool add_face(struct reader *r, const uint32_t *corners, uint32_t count, bool strip) {
    bool fits = true;
    r->out->dropped += count < 3;
    for (uint32_t i = 2; i < count && fits; i++) {
        if (!strip)
            fits = add_triangle(r, corners[0], corners[i - 1], corners[i]);
        else // every other one runs the other way round
            fits = add_triangle(r, corners[i - 2 + i % 2], corners[i - 1 - i % 2], corners[i]);
    }
    return fits;
}

// A cell is its number of corners and the corners.
static enum result add_old_cells(struct reader *r, uint64_t cells, const uint32_t *values,
                                 uint64_t size, bool strips) {
    uint64_t at = 0;
    for (uint64_t cell = 0; cell < cells; cell++) {
        if (at >= size || values[at] > size - at - 1)
            return refuse(r, RESULT_FORMAT, "the lists of corners do not add up", "");
        if (!add_face(r, values + at + 1, values[at], strips))
            return refuse(r, RESULT_LIMIT, "more triangles or vertices than are accepted", "");
        at += values[at] + 1;
    }
    return at == size ? RESULT_OK
                      : refuse(r, RESULT_FORMAT, "the lists of corners do not add up", "");
}

static enum result add_new_cells(struct reader *r, uint64_t offsets_count, const uint32_t *offsets,
                                 const uint32_t *values, uint64_t size, bool strips) {
    for (uint64_t i = 0; i + 1 < offsets_count; i++) {
        if (offsets[i] > offsets[i + 1] || offsets[i + 1] > size)
            return refuse(r, RESULT_FORMAT, "the offsets of corners do not rise", "");
        if (!add_face(r, values + offsets[i], offsets[i + 1] - offsets[i], strips))
            return refuse(r, RESULT_LIMIT, "more triangles or vertices than are accepted", "");
    }
    return RESULT_OK;
}

// "OFFSETS type" or "CONNECTIVITY type", and the numbers.
static uint32_t *next_array(struct reader *r, const char *name, uint64_t count) {
    char word[WORD_MAX];
    const struct number_type *type;
    if (!next_word(r, word) || strcmp(word, name) != 0 || !(type = next_type(r)))
        return NULL;
    return next_indices(r, type, count);
}

static enum result read_cells(struct reader *r, const char *section) {
    static const struct number_type plain = {"int", 4, SIGNED};
    bool strips = strcmp(section, "TRIANGLE_STRIPS") == 0;
    bool wanted = strips || strcmp(section, "POLYGONS") == 0;
    uint64_t count, size;
    if (!next_count(r, &count) || !next_count(r, &size))
        return refuse(r, RESULT_FORMAT, "a section without its two counts", section);
    uint32_t *offsets = r->new_form ? next_array(r, "OFFSETS", count) : NULL;
    uint32_t *values = r->new_form ? offsets ? next_array(r, "CONNECTIVITY", size) : NULL
                                   : next_indices(r, &plain, size);
    enum result result = RESULT_OK;
    if (!values)
        result = refuse(r, RESULT_FORMAT, "fewer numbers than it says, or others", section);
    else if (wanted && r->new_form)
        result = add_new_cells(r, count, offsets, values, size, strips);
    else if (wanted)
        result = add_old_cells(r, count, values, size, strips);
    free(offsets);
    free(values);
    return result;
}

static void skip_metadata(struct reader *r) {
    char line[8];
    next_line(r, line, sizeof line);
    while (next_line(r, line, sizeof line) && line[0])
        continue;
}

// "FIELD name n", then for each array its name, components, tuples, type, and numbers.
static enum result skip_field(struct reader *r) {
    char name[WORD_MAX];
    uint64_t arrays, components, tuples;
    if (!next_word(r, name) || !next_count(r, &arrays) || arrays > ARRAYS_MAX)
        return refuse(r, RESULT_FORMAT, "a FIELD without a name and a count", "");
    for (uint64_t i = 0; i < arrays; i++) {
        const struct number_type *type;
        double value;
        if (!next_word(r, name))
            return refuse(r, RESULT_FORMAT, "the file ends in a FIELD", "");
        if (strcmp(name, "METADATA") == 0) {
            skip_metadata(r);
            i--;
            continue;
        }
        if (!next_count(r, &components) || !next_count(r, &tuples) || components > 1000 ||
            tuples > UINT32_MAX || !(type = next_type(r)) ||
            !begin_numbers(r, type, components * tuples))
            return refuse(r, RESULT_FORMAT, "an array of a FIELD is not understood", name);
        for (uint64_t k = 0; k < components * tuples; k++)
            next_number(r, type, &value);
    }
    return RESULT_OK;
}

// ---- the file -----------------------------------------------------------------------------------

static enum result read_header(struct reader *r) {
    char line[256], word[WORD_MAX], set[WORD_MAX];
    int major;
    if (!next_line(r, line, sizeof line) ||
        sscanf(line, "# vtk DataFile Version %d.", &major) != 1 || major < 1 || major > 5)
        return refuse(r, RESULT_FORMAT, "not a legacy VTK file of version 1 to 5", "");
    r->new_form = major == 5;
    next_line(r, line, sizeof line); // the title
    if (!next_word(r, word) || (strcmp(word, "ASCII") != 0 && strcmp(word, "BINARY") != 0))
        return refuse(r, RESULT_FORMAT, "line 3 is neither ASCII nor BINARY", "");
    r->binary = word[0] == 'B';
    if (!next_word(r, word) || strcmp(word, "DATASET") != 0 || !next_word(r, set))
        return refuse(r, RESULT_FORMAT, "there is no DATASET", "");
    if (strcmp(set, "POLYDATA") != 0)
        return refuse(r, RESULT_FORMAT, "only POLYDATA is read, which this is not", set);
    return RESULT_OK;
}

static enum result read_section(struct reader *r, const char *name) {
    static const char *const cells[] = {"VERTICES", "LINES", "POLYGONS", "TRIANGLE_STRIPS"};
    if (strcmp(name, "POINTS") == 0)
        return read_points(r);
    if (strcmp(name, "FIELD") == 0)
        return skip_field(r);
    for (int i = 0; i < 4; i++)
        if (strcmp(name, cells[i]) == 0)
            return read_cells(r, name);
    if (strcmp(name, "METADATA") != 0)
        return refuse(r, RESULT_FORMAT, "an unknown section", name);
    skip_metadata(r);
    return RESULT_OK;
}

// Up to the data of points and cells.
static enum result read_sections(struct reader *r) {
    char word[WORD_MAX];
    enum result result = read_header(r);
    while (result == RESULT_OK && next_word(r, word)) {
        if (strcmp(word, "POINT_DATA") == 0 || strcmp(word, "CELL_DATA") == 0)
            return RESULT_OK;
        result = read_section(r, word);
    }
    if (result == RESULT_OK && r->at != r->end)
        return refuse(r, RESULT_FORMAT, "what follows the last section is the name of none", "");
    return result;
}

static enum result read_file(struct reader *r) {
    enum result result = read_sections(r);
    if (result != RESULT_OK)
        return result;
    for (size_t i = 0; i < 3 * (size_t)r->out->triangle_count; i++)
        if (r->out->triangles[i] >= r->out->vertex_count)
            return fail(r->err, RESULT_FORMAT, "%s: triangle %zu: there is no vertex %u", r->path,
                        i / 3, r->out->triangles[i]);
    return r->out->triangle_count ? RESULT_OK : refuse(r, RESULT_FORMAT, "holds no triangle", "");
}

static char *read_bytes(const char *path, size_t *out_size) {
    struct stat status;
    FILE *file = fopen(path, "rb");
    char *bytes = NULL;
    if (file && fstat(fileno(file), &status) == 0) {
        bytes = alloc((size_t)status.st_size + 1, 1);
        *out_size = fread(bytes, 1, (size_t)status.st_size, file);
    }
    if (bytes && ferror(file)) {
        free(bytes);
        bytes = NULL;
    }
    if (file)
        fclose(file);
    return bytes;
}

enum result vtk_read(const char *path, uint32_t triangles_max, struct import_arrays *out_arrays,
                     struct error *err) {
    size_t size = 0;
    char *bytes = read_bytes(path, &size);
    *out_arrays = (struct import_arrays){0};
    if (!bytes)
        return fail(err, RESULT_IO, "%s: cannot be read", path);
    struct reader reader = {.path = path,
                            .err = err,
                            .at = bytes,
                            .end = bytes + size,
                            .triangles_max = triangles_max,
                            .out = out_arrays};
    enum result result = read_file(&reader);
    free(bytes);
    return result;
}
