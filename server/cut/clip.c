#include "cut/clip.h"

// Sutherland and Hodgman: by one plane after another. On a plane is inside.
static void clip_by(const struct clip *in, const double *sides, int plane, struct clip *out) {
    out->count = 0;
    for (int i = 0; i < in->count; i++) {
        int next = i + 1 < in->count ? i + 1 : 0;
        bool inside = sides[i] <= 0, next_inside = sides[next] <= 0;
        if (inside) {
            out->points[out->count] = in->points[i];
            out->labels[out->count++] = in->labels[i];
        }
        if (inside == next_inside)
            continue;
        double t = sides[i] / (sides[i] - sides[next]);
        out->points[out->count] = vec3_lerp(in->points[i], in->points[next], t);
        out->labels[out->count++] = inside ? plane : in->labels[i];
    }
}

// A convex polygon crosses a plane twice. Where rounding has bent it, what is outside is what hangs
// together with the corner that is farthest outside.
static void straighten(double *sides, int count) {
    int farthest = 0, first, last;
    for (int i = 1; i < count; i++)
        farthest = sides[i] > sides[farthest] ? i : farthest;
    for (first = farthest; sides[(first + count - 1) % count] > 0;)
        first = (first + count - 1) % count;
    for (last = farthest; sides[(last + 1) % count] > 0;)
        last = (last + 1) % count;
    for (int i = (last + 1) % count; i != first; i = (i + 1) % count)
        sides[i] = fmin(sides[i], 0);
}

void clip_triangle(const struct convex *blade, const vec3 corners[3], const double *const values[3],
                   uint64_t planes, struct clip *out) {
    struct clip other;
    struct clip *now = out, *then = &other;
    double sides[CLIP_MAX];
    for (int i = 0; i < 3; i++) {
        now->points[i] = corners[i];
        now->labels[i] = CLIP_SIDE + i;
    }
    now->count = 3;
    bool whole = true; // its points are the corners still
    for (uint64_t rest = planes; rest && now->count; rest &= rest - 1) {
        int plane = __builtin_ctzll(rest), inside = 0;
        const struct plane *p = &blade->planes[plane];
        for (int i = 0; i < now->count; i++) {
            sides[i] = whole ? values[i][plane] : vec3_dot(p->normal, now->points[i]) - p->offset;
            inside += sides[i] <= 0;
        }
        if (inside == now->count)
            continue;
        if (inside)
            straighten(sides, now->count);
        clip_by(now, sides, plane, then);
        whole = false;
        struct clip *swap = now;
        now = then;
        then = swap;
    }
    if (now != out)
        *out = *now;
}
