#include "import/claim.h"

#include "base/check.h"
#include "base/number.h"
#include "import/claim_lines.h"

#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <sys/types.h>

#define STL_HEADER 84
#define STL_TRIANGLE 50

bool claim_next_line(struct line_reader *r) {
    ssize_t length = getline(&r->buffer, &r->room, r->file);
    if (length < 0)
        return false;
    size_t used = strcspn(r->buffer, "\r\n");
    r->foul = used + strspn(r->buffer + used, "\r\n") != (size_t)length;
    if (r->foul)
        return false;
    r->buffer[used] = '\0';
    r->line = r->buffer + strspn(r->buffer, " \t");
    r->number++;
    return true;
}

// The room is the next power of two.
void claim_keep(const struct line_reader *r, struct import_claim *out, const double point[3]) {
    uint32_t count = out->position_count;
    if (count >= r->points_max)
        return;
    if ((count & (count - 1)) == 0)
        out->positions =
            alloc_resize(out->positions, count ? 6 * (size_t)count : 3, sizeof *out->positions);
    memcpy(out->positions + 3 * (size_t)count, point, 3 * sizeof *point);
    out->position_count++;
}

const char *claim_three_numbers(const char *text, double out[3]) {
    for (int i = 0; i < 3; i++) {
        char *end;
        out[i] = strtod(text, &end);
        if (!isfinite(out[i]) || end == text)
            return NULL;
        text = end;
    }
    return text;
}

static bool starts_with_word(const char *line, const char *word) {
    size_t length = strlen(word);
    return strncasecmp(line, word, length) == 0 &&
           (isspace((unsigned char)line[length]) || !line[length]);
}

// ---- OFF and OBJ --------------------------------------------------------------------------------

// Numbers up to the line's end, at most so many and none beyond a limit: -1 for anything else. A
// word that a stream cannot read into a number would end all of OpenMesh's reading, unnoticed by
// it.
static int count_numbers(const char *at, int most, double limit) {
    int count = 0;
    for (size_t size; *(at += strspn(at, " \t\r")); at += size, count++) {
        char *end;
        size = strcspn(at, " \t\r");
        bool plain = strspn(at, "0123456789+-.eE") >= size;
        if (!plain || count == most || !(fabs(strtod(at, &end)) <= limit) || end != at + size)
            return -1;
    }
    return count;
}

// Three coordinates, then perhaps a normal, a colour and texture coordinates.
static bool is_off_vertex(const char *line) {
    return count_numbers(line, 12, 1e30) >= 3;
}

// How many vertices, faces and edges. OpenMesh reads what follows as the number that is missing.
// Takes the line apart.
static bool take_off_counts(char *line, struct import_claim *out) {
    int64_t counts[3];
    char *rest, *word = strtok_r(line, " \t", &rest);
    for (int i = 0; i < 3; i++, word = strtok_r(NULL, " \t", &rest))
        if (!word || !number_int(word, 0, INT32_MAX, &counts[i]))
            return false;
    out->vertices = (uint32_t)counts[0];
    out->faces = (uint32_t)counts[1];
    return word == NULL;
}

// The header says that there are colours: else OpenMesh takes a face's colour for the next face.
static bool off_is_coloured(const char *header) {
    return header[strncmp(header, "ST", 2) == 0 ? 2 : 0] == 'C';
}

// The number of corners, so many vertices that are there, then perhaps a colour of up to four
// parts.
static bool is_off_face(const char *line, unsigned vertices, bool coloured) {
    char *end;
    long count = strtol(line, &end, 10);
    bool sound = end != line && count > 0;
    for (long i = 0; sound && i < count; i++) {
        const char *at = end;
        long vertex = strtol(at, &end, 10);
        sound = end != at && vertex >= 0 && (unsigned long)vertex < vertices &&
                (!*end || isspace((unsigned char)*end));
    }
    return sound && count_numbers(end, coloured ? 4 : 0, 255) >= 0;
}

static enum result claim_of_off(struct line_reader *r, const char *path, struct import_claim *out,
                                struct error *err) {
    bool sound = claim_next_line(r) && strstr(r->line, "OFF") && !strstr(r->line, "BINARY");
    bool coloured = sound && off_is_coloured(r->line);
    while (sound && (sound = claim_next_line(r)) && !*r->line)
        continue;
    if (!sound || !take_off_counts(r->line, out))
        return fail(err, RESULT_FORMAT, "%s: line %u: not the header of a text OFF file", path,
                    r->number);
    uint64_t lines = 0, said = (uint64_t)out->vertices + out->faces;
    while (claim_next_line(r)) {
        if (!*r->line || (*r->line == '#' && lines == said)) // OpenMesh reads comments as data
            continue;
        bool face = lines++ >= out->vertices;
        double point[3];
        if (!face && claim_three_numbers(r->line, point))
            claim_keep(r, out, point);
        if (!(face ? is_off_face(r->line, out->vertices, coloured) : is_off_vertex(r->line)))
            return fail(err, RESULT_FORMAT, "%s: line %u: neither a vertex nor a face%s", path,
                        r->number,
                        coloured ? "" : " (colours of faces are read in a COFF file only)");
    }
    if (lines != said)
        return fail(err, RESULT_FORMAT, "%s: %llu lines of data, where its header says %llu", path,
                    (unsigned long long)lines, (unsigned long long)said);
    return RESULT_OK;
}

// "1", "1/2", "1//3" or "1/2/3": its vertex, and what follows; NULL for anything else.
static const char *take_corner(const char *at, long *out_vertex) {
    char *end;
    *out_vertex = strtol(at, &end, 10);
    if (end == at || *out_vertex == 0 || *out_vertex < -INT32_MAX || *out_vertex > INT32_MAX)
        return NULL;
    for (int i = 0; i < 2 && *end == '/'; i++)
        if (isspace((unsigned char)*++end) == 0)
            strtol(end, &end, 10);
    return *end && !isspace((unsigned char)*end) ? NULL : end + strspn(end, " \t");
}

static bool take_face(const char *line, bool *out_repeated) {
    long corners[8], corner;
    int count = 0;
    *out_repeated = false;
    for (const char *at = line + 1 + strspn(line + 1, " \t"); *at;) {
        at = take_corner(at, &corner);
        if (!at)
            return false;
        for (int i = 0; i < count; i++)
            *out_repeated |= corners[i] == corner;
        if (count < 8)
            corners[count++] = corner;
    }
    return true;
}

static enum result claim_of_obj(struct line_reader *r, const char *path, struct import_claim *out,
                                struct error *err) {
    while (claim_next_line(r)) {
        size_t length = strlen(r->line);
        if (length > 0 && r->line[length - 1] == '\\')
            return fail(err, RESULT_REFUSED, "%s: line %u: continued lines are not read here", path,
                        r->number);
        if (starts_with_word(r->line, "mtllib") && strstr(r->line, ".."))
            return fail(err, RESULT_REFUSED, "%s: line %u: a file outside of its folder", path,
                        r->number);
        if (starts_with_word(r->line, "v")) {
            double point[3];
            if (claim_three_numbers(r->line + 1, point))
                claim_keep(r, out, point);
            out->vertices++;
        }
        if (!starts_with_word(r->line, "f"))
            continue;
        bool repeated;
        if (!take_face(r->line, &repeated))
            return fail(err, RESULT_FORMAT, "%s: line %u: not a face of numbers of vertices", path,
                        r->number);
        out->faces++;
        out->repeated += repeated;
    }
    return RESULT_OK;
}

// ---- STL ----------------------------------------------------------------------------------------

static enum result claim_of_stl_text(struct line_reader *r, const char *path,
                                     struct import_claim *out, struct error *err) {
    uint64_t vertices = 0, ends = 0, solids = 0;
    while (claim_next_line(r)) {
        if (starts_with_word(r->line, "vertex")) {
            double point[3];
            const char *end = claim_three_numbers(r->line + strlen("vertex"), point);
            if (!end || end[strspn(end, " \t")])
                return fail(err, RESULT_FORMAT, "%s: line %u: not a vertex with three numbers",
                            path, r->number);
            claim_keep(r, out, point);
            vertices++;
        }
        out->faces += starts_with_word(r->line, "facet");
        ends += starts_with_word(r->line, "endfacet");
        solids += starts_with_word(r->line, "solid");
        solids -= starts_with_word(r->line, "endsolid");
    }
    if (ends != out->faces || vertices != 3 * (uint64_t)out->faces)
        return fail(err, RESULT_FORMAT, "%s: %u facets begin, %llu end, with %llu vertices", path,
                    out->faces, (unsigned long long)ends, (unsigned long long)vertices);
    if (solids != 0)
        return fail(err, RESULT_FORMAT, "%s: a solid does not end by line %u", path, r->number);
    return RESULT_OK;
}

// Twelve floats for each triangle, the normal first.
static enum result check_stl_numbers(FILE *file, const char *path, uint32_t faces,
                                     struct error *err) {
    char bytes[STL_TRIANGLE];
    float numbers[12];
    for (uint32_t i = 0; i < faces; i++) {
        if (fread(bytes, sizeof bytes, 1, file) != 1)
            return fail(err, RESULT_IO, "%s: cannot be read", path);
        memcpy(numbers, bytes, sizeof numbers);
        for (int k = 3; k < 12; k++)
            if (!isfinite(numbers[k]))
                return fail(err, RESULT_INVALID, "%s: triangle %u: a coordinate is no number", path,
                            i);
    }
    return RESULT_OK;
}

static enum result claim_of_stl(struct line_reader *r, const char *path, struct import_claim *out,
                                struct error *err) {
    struct stat status;
    char header[STL_HEADER] = "";
    out->vertices = IMPORT_UNKNOWN;
    size_t got = fread(header, 1, sizeof header, r->file);
    uint32_t faces;
    memcpy(&faces, header + 80, sizeof faces);
    if (fstat(fileno(r->file), &status) != 0)
        return fail(err, RESULT_IO, "%s: cannot be read", path);
    if (got == sizeof header &&
        (uint64_t)status.st_size == STL_HEADER + (uint64_t)faces * STL_TRIANGLE) {
        out->faces = faces;
        return check_stl_numbers(r->file, path, faces, err);
    }
    rewind(r->file);
    header[sizeof header - 1] = '\0';
    if (starts_with_word(header + strspn(header, " \t\r\n"), "solid"))
        return claim_of_stl_text(r, path, out, err);
    return fail(err, RESULT_FORMAT,
                "%s: neither a text STL, nor are its %lld bytes those of %u "
                "triangles",
                path, (long long)status.st_size, faces);
}

enum result import_claim_of(const char *path, uint32_t points_max, struct import_claim *out_claim,
                            struct error *err) {
    static const struct {
        const char *ending;
        enum result (*claim)(struct line_reader *, const char *, struct import_claim *,
                             struct error *);
    } formats[] = {{".ply", claim_of_ply},
                   {".off", claim_of_off},
                   {".obj", claim_of_obj},
                   {".stl", claim_of_stl}};
    const char *dot = strrchr(path, '.');
    *out_claim = (struct import_claim){0};
    for (size_t i = 0; dot && i < sizeof formats / sizeof formats[0]; i++) {
        if (strcasecmp(dot, formats[i].ending) != 0)
            continue;
        struct line_reader reading = {.file = fopen(path, "rb"), .points_max = points_max};
        if (!reading.file)
            return fail(err, RESULT_IO, "%s: cannot be opened", path);
        enum result result = formats[i].claim(&reading, path, out_claim, err);
        if (reading.foul)
            result = fail(err, RESULT_FORMAT, "%s: line %u: not a line of text", path,
                          reading.number + 1);
        if (ferror(reading.file))
            result = fail(err, RESULT_IO, "%s: cannot be read", path);
        free(reading.buffer);
        fclose(reading.file);
        return result;
    }
    if (dot && strcasecmp(dot, ".vtp") == 0)
        return fail(err, RESULT_FORMAT, "%s: XML PolyData is not read; save it as legacy .vtk",
                    path);
    return fail(err, RESULT_FORMAT,
                "%s: its name ends neither in .ply, .obj, .stl, .off, .vtk, .glb nor .gltf", path);
}

void import_claim_fini(struct import_claim *claim) {
    free(claim->positions);
    *claim = (struct import_claim){0};
}
