#include "cut/ray.h"
#include "cut/stage.h"

#include <stdlib.h>

// The winding number of the mesh along the edges of the blade is 1 inside it and 0 outside. Each
// piercing changes it by its sign, so one constant gives it everywhere.
struct winding {
    int at[CONVEX_VERTICES_MAX];
    uint32_t first[CONVEX_EDGES_MAX + 1]; // piercings of edge e: first[e] to first[e + 1] - 1
};

static int compare_piercings(const void *a, const void *b) {
    const struct piercing *p = a, *q = b;
    if (p->edge != q->edge)
        return p->edge < q->edge ? -1 : 1;
    if (p->t != q->t)
        return p->t < q->t ? -1 : 1;
    return p->vertex < q->vertex ? -1 : p->vertex > q->vertex;
}

static void sort_piercings(struct stage *stage, struct winding *winding) {
    if (stage->piercing_count)
        qsort(stage->piercings, stage->piercing_count, sizeof *stage->piercings, compare_piercings);
    uint32_t i = 0;
    for (int e = 0; e <= stage->blade.edge_count; e++) {
        while (i < stage->piercing_count && stage->piercings[i].edge < e)
            i++;
        winding->first[e] = i;
    }
}

static int sign_along(const struct stage *stage, const struct winding *winding, int edge) {
    int sum = 0;
    for (uint32_t i = winding->first[edge]; i < winding->first[edge + 1]; i++)
        sum += stage->piercings[i].sign;
    return sum;
}

// Relative to the blade's first vertex. Around each face the signs cancel, as every arc starts and
// ends on the face's border, so the way does not matter.
static void spread_winding(const struct stage *stage, struct winding *winding) {
    const struct convex *blade = &stage->blade;
    bool known[CONVEX_VERTICES_MAX] = {true};
    winding->at[0] = 0;
    for (bool more = true; more;) {
        more = false;
        for (int e = 0; e < blade->edge_count; e++) {
            int a = blade->edges[e].ends[0], b = blade->edges[e].ends[1];
            if (known[a] == known[b])
                continue;
            int sum = sign_along(stage, winding, e);
            winding->at[known[a] ? b : a] = known[a] ? winding->at[a] + sum : winding->at[b] - sum;
            known[a] = known[b] = more = true;
        }
    }
}

// ---- the constant ----

// The longest part of an edge without piercings: its middle, and the winding number there.
struct interval {
    double length;
    vec3 middle;
    int winding;
};

static void keep_longer(struct interval *longest, const struct convex *blade, int edge, double from,
                        double to, int winding) {
    vec3 a = blade->vertices[blade->edges[edge].ends[0]];
    vec3 b = blade->vertices[blade->edges[edge].ends[1]];
    double length = (to - from) * vec3_distance(a, b);
    if (length > longest->length)
        *longest = (struct interval){length, vec3_lerp(a, b, (from + to) / 2), winding};
}

static struct interval longest_interval(const struct stage *stage, const struct winding *winding) {
    struct interval longest = {0};
    for (int e = 0; e < stage->blade.edge_count; e++) {
        double from = 0;
        int w = winding->at[stage->blade.edges[e].ends[0]];
        for (uint32_t i = winding->first[e]; i < winding->first[e + 1]; i++) {
            keep_longer(&longest, &stage->blade, e, from, stage->piercings[i].t, w);
            from = stage->piercings[i].t;
            w += stage->piercings[i].sign;
        }
        keep_longer(&longest, &stage->blade, e, from, 1, w);
    }
    return longest;
}

static bool set_constant(struct cut_mesh *mesh, struct stage *stage, struct winding *winding) {
    int low = 0, high = 0;
    for (int v = 0; v < stage->blade.vertex_count; v++) {
        low = winding->at[v] < low ? winding->at[v] : low;
        high = winding->at[v] > high ? winding->at[v] : high;
    }
    int constant = -low;
    if (low == high) {
        struct interval longest = longest_interval(stage, winding);
        constant =
            ray_winding(mesh, &stage->slots, &stage->candidates, longest.middle) - longest.winding;
    }
    if (low + constant < 0 || high + constant > 1)
        return stage_refuse(stage, "the blade's edges go in and out of the mesh without order");
    for (int v = 0; v < stage->blade.vertex_count; v++)
        winding->at[v] += constant;
    return true;
}

// ---- parts of edges inside the mesh ----

static uint32_t next_of_sign(const struct stage *stage, const struct winding *winding, int edge,
                             int sign, uint32_t *i) {
    while (*i < winding->first[edge + 1] && stage->piercings[*i].sign != sign)
        ++*i;
    return *i < winding->first[edge + 1] ? stage->piercings[(*i)++].vertex : MESH_NONE;
}

// First in, first out, even where rounding has swapped two: each part is a border of the new
// surface on both faces, which lies to the other side seen from inside.
static bool pair_along(struct stage *stage, const struct winding *winding, const uint32_t *corners,
                       int edge) {
    const struct convex_edge *e = &stage->blade.edges[edge];
    uint32_t in = winding->first[edge], out = in;
    uint32_t from = winding->at[e->ends[0]] ? corners[e->ends[0]] : MESH_NONE;
    for (;; from = MESH_NONE) {
        if (from == MESH_NONE)
            from = next_of_sign(stage, winding, edge, 1, &in);
        uint32_t to = next_of_sign(stage, winding, edge, -1, &out);
        if (from == MESH_NONE && to == MESH_NONE)
            return true;
        if (to == MESH_NONE && winding->at[e->ends[1]])
            to = corners[e->ends[1]];
        if (from == MESH_NONE || to == MESH_NONE)
            return stage_refuse(stage, "an edge of the blade enters the mesh and does not leave");
        stage_add_segment(stage, e->left, to, from);
        stage_add_segment(stage, e->right, from, to);
    }
}

bool wind_blade(struct cut_mesh *mesh, struct stage *stage) {
    struct winding winding;
    uint32_t corners[CONVEX_VERTICES_MAX];
    sort_piercings(stage, &winding);
    spread_winding(stage, &winding);
    if (!set_constant(mesh, stage, &winding))
        return false;
    for (int v = 0; v < stage->blade.vertex_count; v++)
        corners[v] =
            winding.at[v] ? stage_take_vertex(mesh, stage, stage->blade.vertices[v]) : MESH_NONE;
    for (int e = 0; e < stage->blade.edge_count; e++)
        if (!pair_along(stage, &winding, corners, e))
            return false;
    return true;
}
