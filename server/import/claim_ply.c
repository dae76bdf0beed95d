#include "base/number.h"
#include "import/claim_lines.h"

#include <endian.h>
#include <float.h>
#include <stdlib.h>
#include <string.h>

#define HEADER_LINES_MAX 1000
#define ELEMENTS_MAX 8
#define PROPERTIES_MAX 64
#define ROW_BYTES_MAX (8 * PROPERTIES_MAX)

static const struct type {
    const char *name;
    size_t size;
} types[] = {{"char", 1},  {"uchar", 1},   {"short", 2},  {"ushort", 2},
             {"int", 4},   {"uint", 4},    {"int8", 1},   {"uint8", 1},
             {"int16", 2}, {"uint16", 2},  {"int32", 4},  {"uint32", 4},
             {"float", 4}, {"float32", 4}, {"double", 8}, {"float64", 8}};

struct property {
    bool list, real;
    size_t size; // of a number, in a binary file
    int axis;    // of a vertex: 0, 1, 2 for x, y, z; else -1
};

struct element {
    bool vertex;
    uint32_t count;
    int property_count;
    struct property properties[PROPERTIES_MAX];
};

struct ply {
    bool text, big; // big endian
    int element_count;
    struct element elements[ELEMENTS_MAX];
    struct import_claim claim;
};

// ---- the header ---------------------------------------------------------------------------------

static size_t size_of_type(const char *word) {
    for (size_t i = 0; i < sizeof types / sizeof types[0]; i++)
        if (strcmp(word, types[i].name) == 0)
            return types[i].size;
    return 0;
}

// OpenMesh makes room for whatever it reads as a list's length: at most 16 bits, and no sign.
static bool is_length_type(const char *word) {
    return strcmp(word, "uchar") == 0 || strcmp(word, "uint8") == 0 ||
           strcmp(word, "ushort") == 0 || strcmp(word, "uint16") == 0;
}

static bool take_element(const char *name, const char *count, struct ply *ply) {
    if (strlen(count) >= 10 || strspn(count, "0123456789") != strlen(count) ||
        ply->element_count == ELEMENTS_MAX)
        return false;
    uint32_t value = (uint32_t)strtoul(count, NULL, 10);
    struct element *element = &ply->elements[ply->element_count++];
    element->count = value;
    element->vertex = strcmp(name, "vertex") == 0;
    if (element->vertex)
        ply->claim.vertices = value;
    if (strcmp(name, "face") == 0)
        ply->claim.faces = value;
    return true;
}

static bool take_property(const char *type, const char *name, bool list, struct ply *ply) {
    if (!ply->element_count || !size_of_type(type))
        return false;
    struct element *element = &ply->elements[ply->element_count - 1];
    if (element->property_count == PROPERTIES_MAX)
        return false;
    bool axis = element->vertex && !list && strlen(name) == 1 && *name >= 'x' && *name <= 'z';
    element->properties[element->property_count++] =
        (struct property){.list = list,
                          .real = *type == 'f' || *type == 'd',
                          .size = size_of_type(type),
                          .axis = axis ? *name - 'x' : -1};
    return true;
}

static bool take_format(const char *name, const char *version, struct ply *ply) {
    ply->text = strcmp(name, "ascii") == 0;
    ply->big = strcmp(name, "binary_big_endian") == 0;
    return strcmp(version, "1.0") == 0 &&
           (ply->text || ply->big || strcmp(name, "binary_little_endian") == 0);
}

static bool take_header_line(const char *line, struct ply *ply) {
    char word[4][64] = {""}, name[64];
    int count = sscanf(line, "%63s %63s %63s %63s %63s", word[0], word[1], word[2], word[3], name);
    if (count <= 0 || strcmp(word[0], "comment") == 0 || strcmp(word[0], "obj_info") == 0)
        return true;
    if (strcmp(word[0], "format") == 0)
        return count == 3 && take_format(word[1], word[2], ply);
    if (strcmp(word[0], "element") == 0)
        return count == 3 && take_element(word[1], word[2], ply);
    if (strcmp(word[0], "property") != 0)
        return false;
    if (strcmp(word[1], "list") == 0)
        return count == 5 && is_length_type(word[2]) && take_property(word[3], name, true, ply);
    return count == 3 && take_property(word[1], word[2], false, ply);
}

// ---- text ---------------------------------------------------------------------------------------

// Takes the line apart.
static bool is_row(char *line, const struct element *element, double out_point[3]) {
    char *rest, *word = strtok_r(line, " \t", &rest);
    for (int p = 0; p < element->property_count; p++) {
        const struct property *property = &element->properties[p];
        int64_t count = 1, whole = 0;
        double real = 0;
        if (property->list) {
            if (!word || !number_int(word, 0, UINT16_MAX, &count))
                return false;
            word = strtok_r(NULL, " \t", &rest);
        }
        for (; count > 0; count--, word = strtok_r(NULL, " \t", &rest))
            if (!word || !(property->real ? number_double(word, -FLT_MAX, FLT_MAX, &real)
                                          : number_int(word, INT32_MIN, INT32_MAX, &whole)))
                return false;
        if (property->axis >= 0)
            out_point[property->axis] = property->real ? real : (double)whole;
    }
    return word == NULL;
}

static enum result take_rows(struct line_reader *r, const char *path, struct ply *ply,
                             struct error *err) {
    uint64_t said = 0, lines = 0, end = 0; // end: of the element's rows
    int next = 0;
    for (int i = 0; i < ply->element_count; i++)
        said += ply->elements[i].count;
    while (claim_next_line(r)) {
        if (!*r->line)
            continue;
        while (lines == end && next < ply->element_count)
            end += ply->elements[next++].count;
        if (lines++ >= end)
            continue;
        const struct element *element = &ply->elements[next - 1];
        double point[3] = {0, 0, 0};
        if (!is_row(r->line, element, point))
            return fail(err, RESULT_FORMAT, "%s: line %u contradicts the header", path, r->number);
        if (element->vertex)
            claim_keep(r, &ply->claim, point);
    }
    if (lines != said)
        return fail(err, RESULT_FORMAT, "%s: %llu lines of data, where its header says %llu", path,
                    (unsigned long long)lines, (unsigned long long)said);
    return RESULT_OK;
}

// ---- binary -------------------------------------------------------------------------------------

// False where rows differ in size.
static bool measure_row(const struct element *element, size_t *out_bytes, size_t out_at[3]) {
    *out_bytes = 0;
    for (int p = 0; p < element->property_count; p++) {
        const struct property *property = &element->properties[p];
        if (property->list)
            return false;
        if (property->axis >= 0 && property->size == 8)
            out_at[property->axis] = *out_bytes;
        *out_bytes += property->size;
    }
    return true;
}

static double double_at(const char *bytes, bool big) {
    uint64_t bits;
    double value;
    memcpy(&bits, bytes, sizeof bits);
    bits = big ? be64toh(bits) : le64toh(bits);
    memcpy(&value, &bits, sizeof value);
    return value;
}

// The vertices, where they are doubles, and no list stands before them. A file that ends too early
// is left to the reader.
static void take_doubles(struct line_reader *r, struct ply *ply) {
    char row[ROW_BYTES_MAX];
    for (int i = 0; i < ply->element_count; i++) {
        const struct element *element = &ply->elements[i];
        size_t bytes, at[3] = {SIZE_MAX, SIZE_MAX, SIZE_MAX};
        if (!measure_row(element, &bytes, at))
            return;
        if (!bytes)
            continue;
        bool doubles = at[0] != SIZE_MAX && at[1] != SIZE_MAX && at[2] != SIZE_MAX;
        for (uint32_t k = 0; k < element->count; k++) {
            if (fread(row, bytes, 1, r->file) != 1)
                return;
            double point[3];
            for (int axis = 0; axis < 3 && doubles; axis++)
                point[axis] = double_at(row + at[axis], ply->big);
            if (doubles)
                claim_keep(r, &ply->claim, point);
        }
    }
}

enum result claim_of_ply(struct line_reader *r, const char *path, struct import_claim *out,
                         struct error *err) {
    struct ply ply = {0};
    bool ended = false, sound = true;
    while (sound && !ended && r->number < HEADER_LINES_MAX && claim_next_line(r)) {
        ended = strcmp(r->line, "end_header") == 0;
        sound = ended ||
                (r->number == 1 ? strcmp(r->line, "ply") == 0 : take_header_line(r->line, &ply));
    }
    if (!sound || !ended)
        return fail(err, RESULT_FORMAT, "%s: the PLY header %s line %u", path,
                    sound ? "does not end by" : "is not understood in", r->number);
    enum result result = RESULT_OK;
    if (ply.text)
        result = take_rows(r, path, &ply, err);
    else
        take_doubles(r, &ply);
    *out = ply.claim;
    return result;
}
