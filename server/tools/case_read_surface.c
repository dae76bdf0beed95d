#include "case_read_surface.h"

#include "base/check.h"
#include "case_commands.h"
#include "confine/confine.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Enough for a file of 512 MB with 2 million triangles.
static const struct confine_limits limits = {.memory_mb = 2048, .cpu_s = 300};

// What comes before the two arrays.
struct answer_head {
    uint32_t vertex_count, triangle_count, dropped;
    char space[4];
};

// The other process.
int command_read_surface(int argc, char **argv) {
    struct case_limits files = case_limits_default();
    struct import_arrays arrays;
    struct error err = {""};
    if (argc != 2) {
        fputs("arthron-case read-surface: import alone uses this command\n", stderr);
        return EXIT_USAGE;
    }
    confine_self(&limits);
    enum result result = import_read(argv[1], &files, &arrays, &err);
    if (result != RESULT_OK)
        return confine_answer(result, &err, NULL, 0);
    struct answer_head head = {arrays.vertex_count, arrays.triangle_count, arrays.dropped, ""};
    memcpy(head.space, arrays.space, sizeof head.space);
    const struct confine_piece pieces[] = {
        {&head, sizeof head},
        {arrays.positions, 3 * (size_t)arrays.vertex_count * sizeof *arrays.positions},
        {arrays.triangles, 3 * (size_t)arrays.triangle_count * sizeof *arrays.triangles},
    };
    int code = confine_answer_pieces(pieces, 3);
    import_arrays_fini(&arrays);
    return code;
}

// What import_arrays promises. A reader that was taken over may answer anything.
static bool keeps_its_word(const struct import_arrays *a) {
    for (size_t i = 0; i < 3 * (size_t)a->vertex_count; i++)
        if (!isfinite(a->positions[i]))
            return false;
    for (size_t i = 0; i < 3 * (size_t)a->triangle_count; i++)
        if (a->triangles[i] >= a->vertex_count)
            return false;
    return memchr(a->space, 0, sizeof a->space);
}

static bool take(const uint8_t *bytes, size_t size, struct import_arrays *out) {
    struct answer_head head;
    if (size < sizeof head)
        return false;
    memcpy(&head, bytes, sizeof head);
    size_t positions = 3 * (size_t)head.vertex_count * sizeof *out->positions;
    size_t triangles = 3 * (size_t)head.triangle_count * sizeof *out->triangles;
    if (!head.vertex_count || !head.triangle_count || size != sizeof head + positions + triangles)
        return false;
    out->vertex_count = head.vertex_count;
    out->triangle_count = head.triangle_count;
    out->dropped = head.dropped;
    memcpy(out->space, head.space, sizeof out->space);
    out->positions = alloc(positions, 1);
    out->triangles = alloc(triangles, 1);
    memcpy(out->positions, bytes + sizeof head, positions);
    memcpy(out->triangles, bytes + sizeof head + positions, triangles);
    return keeps_its_word(out);
}

enum result read_surface_apart(const char *path, struct import_arrays *out_arrays,
                               struct error *err) {
    const uint32_t most = case_limits_default().group_triangles;
    const char *const arguments[] = {"arthron-case", "read-surface", path, NULL};
    const size_t size_max = sizeof(struct answer_head) + (size_t)most * (3 * 24 + 12);
    uint8_t *answer;
    size_t size;
    *out_arrays = (struct import_arrays){0};
    enum result result = confine_run(arguments, &limits, size_max, &answer, &size, err);
    if (result != RESULT_OK)
        return strstr(err->text, path) ? result : fail_in(err, result, "%s: ", path);
    if (!take(answer, size, out_arrays)) {
        import_arrays_fini(out_arrays);
        result = fail(err, RESULT_FORMAT, "%s: its reader gave no surface", path);
    }
    free(answer);
    return result;
}
