#include "cut/clip.h"
#include "cut/stage.h"

// ---- edges: once, so that both triangles see the same crossings ----

static const double *values_of(const struct stage *stage, uint32_t vertex) {
    return stage->values + (size_t)stage->blade.plane_count * vertex;
}

// Along a to b, the blade is entered at the last of the planes that a is outside of, and left at
// the first of those that b is outside of.
static struct edge_trace trace_edge(struct cut_mesh *mesh, struct stage *stage, uint32_t a,
                                    uint32_t b) {
    struct edge_trace trace = {{MESH_NONE, 0}, {MESH_NONE, 0}};
    uint64_t outside_a = stage->vertices[a].outside, outside_b = stage->vertices[b].outside;
    if (outside_a & outside_b)
        return trace;
    const double *s_a = values_of(stage, a), *s_b = values_of(stage, b);
    double enter = -1, leave = 2;
    for (uint64_t rest = outside_a; rest; rest &= rest - 1) {
        int plane = __builtin_ctzll(rest);
        double t = s_a[plane] / (s_a[plane] - s_b[plane]);
        if (t > enter) {
            enter = t;
            trace.enter.plane = plane;
        }
    }
    for (uint64_t rest = outside_b; rest; rest &= rest - 1) {
        int plane = __builtin_ctzll(rest);
        double t = s_a[plane] / (s_a[plane] - s_b[plane]);
        if (t < leave) {
            leave = t;
            trace.leave.plane = plane;
        }
    }
    if (outside_a && outside_b && !(enter < leave))
        return trace;
    vec3 p_a = mesh->points[stage->vertices[a].id], p_b = mesh->points[stage->vertices[b].id];
    if (outside_a)
        trace.enter.vertex = stage_take_vertex(mesh, stage, vec3_lerp(p_a, p_b, enter));
    if (outside_b)
        trace.leave.vertex = stage_take_vertex(mesh, stage, vec3_lerp(p_a, p_b, leave));
    return trace;
}

static void trace_side(struct cut_mesh *mesh, struct stage *stage, uint32_t slot, int i) {
    struct near_triangle *near = &stage->triangles[slot];
    uint32_t side = 3 * near->id + (uint32_t)i, twin = mesh->twins[side];
    uint32_t other =
        stamped_set_has(&stage->slots, twin / 3) ? stamped_set_get(&stage->slots, twin / 3) : slot;
    if (other < slot) {
        near->edges[i] = stage->triangles[other].edges[twin % 3];
        return;
    }
    uint32_t a = near->corners[i], b = near->corners[(i + 1) % 3];
    stage->edges =
        array_grow(stage->edges, &stage->edge_room, stage->edge_count + 1, sizeof *stage->edges);
    struct edge_trace trace =
        side < twin ? trace_edge(mesh, stage, a, b) : trace_edge(mesh, stage, b, a);
    near->edges[i] = stage->edge_count;
    stage->edges[stage->edge_count++] = trace;
}

static void trace_edges(struct cut_mesh *mesh, struct stage *stage) {
    stamped_set_begin(&stage->slots, mesh->triangle_room);
    for (uint32_t k = 0; k < stage->triangle_count; k++)
        stamped_set_put(&stage->slots, stage->triangles[k].id, k);
    for (uint32_t k = 0; k < stage->triangle_count; k++)
        for (int i = 0; i < 3; i++)
            trace_side(mesh, stage, k, i);
}

// ---- arcs: across faces of the blade, from where a side leaves it to where one enters it ----

// The shortest way from one face to another over the blade's edges, both ends among it.
static int dual_path(const struct stage *stage, int from, int to, int out_path[]) {
    int8_t before[CONVEX_PLANES_MAX];
    int queue[CONVEX_PLANES_MAX], head = 0, tail = 0;
    uint64_t seen = UINT64_C(1) << to;
    for (queue[tail++] = to; head < tail && queue[head] != from; head++)
        for (uint64_t rest = stage->beside[queue[head]] & ~seen; rest; rest &= rest - 1) {
            int face = __builtin_ctzll(rest);
            before[face] = (int8_t)queue[head];
            seen |= UINT64_C(1) << face;
            queue[tail++] = face;
        }
    int count = 0;
    for (int face = from; face != to; face = before[face])
        out_path[count++] = face;
    out_path[count++] = to;
    return count;
}

static vec3 onto_edge(const struct convex *blade, int edge, vec3 p, double *out_t) {
    vec3 a = blade->vertices[blade->edges[edge].ends[0]];
    vec3 d = vec3_sub(blade->vertices[blade->edges[edge].ends[1]], a);
    double t = vec3_dot(vec3_sub(p, a), d) / vec3_dot(d, d);
    *out_t = t > 0 ? t < 1 ? t : 1 : 0; // NaN is 0
    return vec3_add_scaled(a, *out_t, d);
}

// Where an arc has come to as it is drawn.
struct face_arc {
    uint32_t last; // vertex; MESH_NONE: it has none yet
    int face;
};

static void step_over(struct cut_mesh *mesh, struct stage *stage, struct face_arc *arc, int face,
                      vec3 near) {
    int edge = stage->edge_between[arc->face][face];
    struct piercing piercing = {.edge = edge};
    vec3 point = onto_edge(&stage->blade, edge, near, &piercing.t);
    // Counter-clockwise in the triangle, from the left face to the right: the edge comes out.
    piercing.sign = stage->blade.edges[edge].left == arc->face ? -1 : 1;
    piercing.vertex = stage_take_vertex(mesh, stage, point);
    stage_add_piercing(stage, piercing);
    if (arc->last != MESH_NONE)
        stage_add_segment(stage, arc->face, arc->last, piercing.vertex);
    ids_push(&stage->pierced, piercing.vertex);
    arc->last = piercing.vertex;
    arc->face = face;
}

// To a face that is beside the arc's, or where rounding took what lies between them, near it.
static void step_to(struct cut_mesh *mesh, struct stage *stage, struct face_arc *arc, int face,
                    vec3 near) {
    int path[CONVEX_PLANES_MAX];
    int count = dual_path(stage, arc->face, face, path);
    for (int i = 1; i < count; i++)
        step_over(mesh, stage, arc, path[i], near);
}

// What one meets on a walk around a triangle.
struct walk_event {
    enum { EVENT_CORNER, EVENT_ENTER, EVENT_LEAVE } kind; // corners outside only
    uint32_t vertex;
    int plane, side;
};

// The run of planes in the clip polygon between two of the triangle's sides: labels first to end -
// 1, modulo their count; empty where rounding left none.
struct run {
    int first, end;
};

static int find_label(const struct clip *clip, int label) {
    for (int k = 0; k < clip->count; k++)
        if (clip->labels[k] == label)
            return k;
    return -1;
}

// Behind the side that the arc leaves from; where so little of that lies inside that it is lost,
// behind the one before it; where all are lost, all around.
static struct run find_run(const struct clip *clip, const struct walk_event *leave) {
    int start = -1;
    for (int i = 3; i > 0 && start < 0; i--)
        start = find_label(clip, CLIP_SIDE + (leave->side + i) % 3);
    if (start < 0) {
        start = find_label(clip, leave->plane);
        return start < 0 ? (struct run){0, 0} : (struct run){start, start + clip->count};
    }
    int end = start + 1;
    while (end < start + clip->count && clip->labels[end % clip->count] < CLIP_SIDE)
        end++;
    return (struct run){start + 1, end};
}

// The events know better than the run by which planes it starts and ends: where two planes are as
// near, it may have them the other way round.
static struct run trim_run(const struct clip *clip, struct run run, int first, int last) {
    if (run.end - run.first > 1 && clip->labels[(run.first + 1) % clip->count] == first)
        run.first++;
    if (run.end - run.first > 1 && clip->labels[(run.end - 2) % clip->count] == last)
        run.end--;
    return run;
}

// ---- triangles ----

static int walk_around(const struct cut_mesh *mesh, const struct stage *stage,
                       const struct near_triangle *near, struct walk_event out[9]) {
    int count = 0;
    for (int i = 0; i < 3; i++) {
        const struct near_vertex *corner = &stage->vertices[near->corners[i]];
        if (corner->outside)
            out[count++] = (struct walk_event){EVENT_CORNER, corner->id, 0, i};
        const struct edge_trace *edge = &stage->edges[near->edges[i]];
        uint32_t side = 3 * near->id + (uint32_t)i;
        bool along = side < mesh->twins[side];
        struct edge_crossing enter = along ? edge->enter : edge->leave;
        struct edge_crossing leave = along ? edge->leave : edge->enter;
        if (enter.vertex != MESH_NONE)
            out[count++] = (struct walk_event){EVENT_ENTER, enter.vertex, enter.plane, i};
        if (leave.vertex != MESH_NONE)
            out[count++] = (struct walk_event){EVENT_LEAVE, leave.vertex, leave.plane, i};
    }
    return count;
}

static vec3 normal_of(const struct cut_mesh *mesh, uint32_t triangle) {
    vec3 p[3];
    triangle_points(mesh, mesh->corners + 3 * (size_t)triangle, p);
    return vec3_cross(vec3_sub(p[1], p[0]), vec3_sub(p[2], p[0]));
}

static void draw_arc(struct cut_mesh *mesh, struct stage *stage, const struct clip *clip,
                     const struct walk_event *leave, const struct walk_event *enter) {
    struct face_arc arc = {leave->vertex, leave->plane};
    struct run run = trim_run(clip, find_run(clip, leave), leave->plane, enter->plane);
    vec3 p_leave = mesh->points[leave->vertex], p_enter = mesh->points[enter->vertex];
    vec3 last = run.first < run.end ? p_enter : vec3_lerp(p_leave, p_enter, 0.5);
    stage->pierced.count = 0;
    for (int k = run.first; k < run.end; k++)
        step_to(mesh, stage, &arc, clip->labels[k % clip->count], clip->points[k % clip->count]);
    step_to(mesh, stage, &arc, enter->plane, last);
    stage_add_segment(stage, arc.face, arc.last, enter->vertex);
}

// What is left of a triangle between a leaving event and the next entering one.
static void outside_polygon(struct cut_mesh *mesh, struct stage *stage, const struct clip *clip,
                            const struct near_triangle *near, const struct walk_event *events,
                            int count, int leave) {
    stage_add_region(stage, mesh->labels[near->id], normal_of(mesh, near->id));
    stage_begin_ring(stage);
    stage_add_to_ring(stage, events[leave].vertex);
    int k = (leave + 1) % count;
    for (; events[k].kind == EVENT_CORNER; k = (k + 1) % count)
        stage_add_to_ring(stage, events[k].vertex);
    CHECK(events[k].kind == EVENT_ENTER);
    stage_add_to_ring(stage, events[k].vertex);
    draw_arc(mesh, stage, clip, &events[leave], &events[k]);
    for (uint32_t i = stage->pierced.count; i-- > 0;)
        stage_add_to_ring(stage, stage->pierced.at[i]);
}

// The blade goes through the inside of a triangle and touches none of its sides.
static void pierced_through(struct cut_mesh *mesh, struct stage *stage, const struct clip *clip,
                            struct near_triangle *near) {
    struct face_arc arc = {MESH_NONE, clip->labels[0]};
    stage->pierced.count = 0;
    for (int k = 0; k < clip->count; k++)
        if (clip->labels[k] >= CLIP_SIDE)
            return;
    for (int k = 1; k <= clip->count; k++)
        step_to(mesh, stage, &arc, clip->labels[k % clip->count], clip->points[k % clip->count]);
    if (!stage->pierced.count)
        return;
    stage_add_segment(stage, clip->labels[0], arc.last, stage->pierced.at[0]);
    stage_add_region(stage, mesh->labels[near->id], normal_of(mesh, near->id));
    stage_begin_ring(stage);
    for (int i = 0; i < 3; i++)
        stage_add_to_ring(stage, stage->vertices[near->corners[i]].id);
    stage_begin_ring(stage);
    for (uint32_t i = stage->pierced.count; i-- > 0;)
        stage_add_to_ring(stage, stage->pierced.at[i]);
    near->goes = true;
}

static void trace_triangle(struct cut_mesh *mesh, struct stage *stage, struct near_triangle *near) {
    struct walk_event events[9];
    struct clip clip;
    int count = walk_around(mesh, stage, near, events);
    near->goes = count != 3 || events[0].kind != EVENT_CORNER || events[1].kind != EVENT_CORNER ||
                 events[2].kind != EVENT_CORNER;
    if (!count)
        return;
    vec3 corners[3];
    const double *values[3];
    uint64_t planes = 0;
    for (int i = 0; i < 3; i++) {
        const struct near_vertex *corner = &stage->vertices[near->corners[i]];
        corners[i] = mesh->points[corner->id];
        values[i] = values_of(stage, near->corners[i]);
        planes |= corner->outside;
    }
    clip_triangle(&stage->blade, corners, values, planes, &clip);
    for (int i = 0; near->goes && i < count; i++)
        if (events[i].kind == EVENT_LEAVE)
            outside_polygon(mesh, stage, &clip, near, events, count, i);
    if (!near->goes && clip.count >= 3)
        pierced_through(mesh, stage, &clip, near);
}

void trace_triangles(struct cut_mesh *mesh, struct stage *stage) {
    trace_edges(mesh, stage);
    for (uint32_t k = 0; k < stage->triangle_count; k++)
        trace_triangle(mesh, stage, &stage->triangles[k]);
}
