#include "base/check.h"
#include "match/conform_parts.h"

#include <math.h>
#include <string.h>

// Vertices lie at rounded offsets from S' (conform_place): three whole numbers instead of three
// doubles.
#define PER_MM (1 << 20)

static bool is_whole(double start, double at, int32_t *out) {
    double offset = rint((at - start) * PER_MM);
    bool fits = fabs(offset) < INT32_MAX;
    *out = fits ? (int32_t)offset : 0;
    double again = start + (double)*out / PER_MM;
    return fits && !memcmp(&again, &at, sizeof at);
}

static bool is_rounded(vec3 start, vec3 at, int32_t out[3]) {
    bool x = is_whole(start.x, at.x, &out[0]), y = is_whole(start.y, at.y, &out[1]);
    return is_whole(start.z, at.z, &out[2]) && x && y;
}

static void keep_point(vec3 start, vec3 *at, struct kept *k) {
    int32_t offset[3] = {0};
    bool rounded = !k->reads && is_rounded(start, *at, offset);
    kept_flag(k, &rounded);
    if (!rounded) {
        kept_point(k, at);
        return;
    }
    kept_bytes(k, offset, sizeof offset);
    if (k->reads)
        *at = (vec3){start.x + (double)offset[0] / PER_MM, start.y + (double)offset[1] / PER_MM,
                     start.z + (double)offset[2] / PER_MM};
}

static void keep_shares(double *shares, uint32_t count, struct kept *k) {
    bool is_any = false;
    for (uint32_t i = 0; !k->reads && i < count; i++)
        is_any |= shares[i] != 0;
    kept_flag(k, &is_any);
    if (!is_any)
        return; // what is read into is 0
    kept_bytes(k, shares, count * sizeof *shares);
    for (uint32_t i = 0; k->reads && i < count; i++)
        kept_holds(k, shares[i] >= 0 && shares[i] <= 1);
}

void conform_keep(struct conform *conform, struct kept *k) {
    uint32_t count = conform->surface->vertex_count;
    conform->has_volume = conform->has_volume && !k->reads;
    for (uint32_t v = 0; v < count; v++)
        keep_point(conform->surface->start[v], &conform->positions[v], k);
    kept_bytes(k, conform->dirty, count);
    keep_shares(conform->laid, count, k);
}

void conform_past_keep(const struct conform *conform, struct conform_past *past, struct kept *k) {
    uint32_t vertices = conform->surface->vertex_count;
    kept_count(k, &past->count, vertices);
    kept_holds(k, past->count <= kept_left(k));
    if (k->reads) {
        uint32_t count = k->bad ? 0 : past->count;
        *past = (struct conform_past){
            count, alloc(count, sizeof *past->vertices), alloc(count, sizeof *past->positions),
            alloc(count, sizeof *past->dirty), alloc(count, sizeof *past->laid)};
    }
    kept_bytes(k, past->vertices, past->count * sizeof *past->vertices);
    for (uint32_t i = 0; k->reads && i < past->count; i++)
        kept_holds(k, past->vertices[i] < vertices);
    for (uint32_t i = 0; i < past->count && !k->bad; i++)
        keep_point(conform->surface->start[past->vertices[i]], &past->positions[i], k);
    kept_bytes(k, past->dirty, past->count);
    keep_shares(past->laid, past->count, k);
}
