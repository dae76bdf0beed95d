#include "cutting/change.h"

#include "base/check.h"
#include "cutting/inside.h"
#include "mesh/topology.h"

#include <stdlib.h>
#include <string.h>

// Of a volume that was summed twice in other orders, and of a piece's whose vertices became floats.
#define SUM_ERROR 1e-9
#define FLOAT_ERROR 1e-5
// Vertices that a cut made may merge with others nearer than 1e-3 mm.
#define MERGE_MM 1e-3
// Those that shape nothing go where that moves the surface by less than 1e-4 mm.
#define FLAT_MM 2e-4
// All that a cut takes, cleaning up included, it says.
#define ADD_UP_MM3 1e-6
// Blades are moved by about 1e-5 mm where they do not fit.
#define SHIFT_MM 5e-5

// ---- ids ----------------------------------------------------------------------------------------

static bool ascends(const uint32_t *ids, uint32_t count, uint32_t bound) {
    for (uint32_t i = 0; i < count; i++)
        if (ids[i] >= bound || (i > 0 && ids[i] <= ids[i - 1]))
            return false;
    return true;
}

static bool *mark(const uint32_t *ids, uint32_t count, uint32_t bound) {
    bool *marks = alloc(bound, sizeof *marks);
    for (uint32_t i = 0; i < count; i++)
        marks[ids[i]] = true;
    return marks;
}

static bool was_vertex(const struct snapshot *before, uint32_t v) {
    return v < before->vertex_bound && before->vertex_alive[v];
}

static bool was_triangle(const struct snapshot *before, uint32_t t) {
    return t < before->triangle_bound && snapshot_has(before, t);
}

static const char *vertices_fault(const struct cut_tried *tried, const bool *is_new) {
    const struct snapshot *before = tried->before, *after = tried->after;
    for (uint32_t v = 0; v < after->vertex_bound; v++) {
        if (is_new[v] && (v < tried->original || !after->vertex_alive[v]))
            return "a new vertex is not alive, or has an id of the original mesh";
        if (!after->vertex_alive[v] || is_new[v])
            continue;
        if (!was_vertex(before, v))
            return "a vertex is new, and the change does not say so";
        if (memcmp(&before->vertices[v], &after->vertices[v], sizeof(vec3)))
            return "a vertex was moved";
    }
    return NULL;
}

static bool has_marked_corner(const uint32_t *corners, const bool *marks) {
    return marks[corners[0]] || marks[corners[1]] || marks[corners[2]];
}

// The same three corners in the same turn, whichever comes first.
static bool same_corners(const uint32_t *a, const uint32_t *b) {
    for (int i = 0; i < 3; i++)
        if (a[0] == b[i] && a[1] == b[(i + 1) % 3] && a[2] == b[(i + 2) % 3])
            return true;
    return false;
}

static const char *triangles_fault(const struct cut_tried *tried, const bool *is_new_vertex,
                                   const bool *is_made, const bool *is_freed) {
    const struct snapshot *before = tried->before, *after = tried->after;
    for (uint32_t t = 0; t < after->triangle_bound; t++) {
        const uint32_t *corners = after->triangles + 3 * (size_t)t;
        bool was = was_triangle(before, t), is = snapshot_has(after, t);
        if (is_freed[t] != (was && !is))
            return "the freed triangles are not those that are gone";
        if (!is && is_made[t])
            return "a triangle that was made is not alive";
        if (!is)
            continue;
        bool changed = !was || has_marked_corner(corners, is_new_vertex) ||
                       !same_corners(corners, before->triangles + 3 * (size_t)t);
        if (changed && !is_made[t])
            return "a triangle is new or has other corners, and the change does not say so";
        if (!is_made[t] && before->labels[t] != after->labels[t])
            return "a triangle that was left alone has another label";
    }
    return NULL;
}

static const char *ids_fault(const struct cut_tried *tried, const struct cut_change *change) {
    uint32_t vertices = tried->after->vertex_bound, triangles = tried->after->triangle_bound;
    if (!ascends(change->freed, change->freed_count, triangles) ||
        !ascends(change->made, change->made_count, triangles) ||
        !ascends(change->vertices, change->vertex_count, vertices))
        return "ids do not ascend, or reach past their bound";
    bool *is_new = mark(change->vertices, change->vertex_count, vertices);
    bool *is_made = mark(change->made, change->made_count, triangles);
    bool *is_freed = mark(change->freed, change->freed_count, triangles);
    const char *fault = vertices_fault(tried, is_new);
    if (!fault)
        fault = triangles_fault(tried, is_new, is_made, is_freed);
    free(is_new);
    free(is_made);
    free(is_freed);
    return fault;
}

// ---- volumes ------------------------------------------------------------------------------------

static const char *piece_fault(const struct cut_piece *piece, double stayed) {
    struct error err;
    if (mesh_validate(&piece->mesh, &err) != RESULT_OK)
        return "a piece is no valid mesh";
    struct topology topology = topology_of(&piece->mesh);
    if (!topology.closed || !topology.manifold || !topology.oriented || topology.unused_vertices)
        return "a piece is not closed, manifold and oriented";
    if (!(piece->volume > 0 && piece->volume <= stayed * (1 + SUM_ERROR)))
        return "a piece has no volume, or more than what stayed";
    double rounding = FLOAT_ERROR * mesh_area(&piece->mesh);
    if (fabs(mesh_volume(&piece->mesh) - piece->volume) > rounding)
        return "a piece's volume is not its mesh's";
    struct box box = mesh_bounds(&piece->mesh);
    vec3 c = piece->centroid, middle = vec3_lerp(box.min, box.max, 0.5);
    vec3 half = vec3_scale(0.5, vec3_sub(box.max, box.min));
    if (!(fabs(c.x - middle.x) <= half.x + FLOAT_ERROR &&
          fabs(c.y - middle.y) <= half.y + FLOAT_ERROR &&
          fabs(c.z - middle.z) <= half.z + FLOAT_ERROR))
        return "a piece's centroid lies outside of it";
    return NULL;
}

static double box_area(struct box box) {
    vec3 size = vec3_sub(box.max, box.min);
    return 2 * (size.x * size.y + size.y * size.z + size.z * size.x);
}

static const char *volumes_fault(const struct cut_tried *tried, const struct cut_change *change) {
    double after = snapshot_volume(tried->after), most = 0, sum = change->removed_mm3;
    double rounding = SUM_ERROR * tried->volume_before;
    for (int i = 0; i < tried->part_count; i++)
        most += tried->parts[i].volume + SHIFT_MM * box_area(tried->parts[i].box);
    if (!(change->removed_mm3 >= 0 && change->removed_mm3 <= most + rounding))
        return "less than nothing was removed, or more than the blade holds";
    if (!(fabs(change->volume_mm3 - after) <= rounding))
        return "the volume after the cut is not the mesh's";
    for (int i = 0; i < change->piece_count; i++) {
        const char *fault = piece_fault(&change->pieces[i], after);
        if (fault)
            return fault;
        sum += change->pieces[i].volume;
    }
    if (!(fabs(tried->volume_before - after - sum) <= ADD_UP_MM3))
        return "the volumes do not add up";
    return NULL;
}

// ---- surface ------------------------------------------------------------------------------------

static double area_of(const struct snapshot *surface, uint32_t triangle) {
    vec3 c[3];
    snapshot_corners(surface, triangle, c);
    return 0.5 * vec3_length(vec3_cross(vec3_sub(c[1], c[0]), vec3_sub(c[2], c[0])));
}

static const char *labels_fault(const struct cut_tried *tried, const struct cut_change *change) {
    double area = 0, patches = 0;
    struct box box = parts_box(tried->parts, tried->part_count);
    double reach = vec3_distance(box.min, box.max);
    for (uint32_t t = 0; t < tried->after->triangle_bound; t++) {
        if (!snapshot_has(tried->after, t))
            continue;
        if (tried->after->labels[t] > change->number)
            return "a label names a cut that is yet to come";
        if (tried->after->labels[t] == change->number)
            area += area_of(tried->after, t);
    }
    for (int i = 0; i < change->patch_count; i++) {
        const struct cut_patch *patch = &change->patches[i];
        patches += patch->area;
        if (!(patch->area > 0 && patch->extent <= reach + MERGE_MM) ||
            !vec3_is_finite(patch->centroid))
            return "a patch has no area, or reaches farther than the blade";
    }
    if (!(fabs(area - patches) <= SUM_ERROR * (1 + area)))
        return "the patches have not the area of the new surface";
    return NULL;
}

// ---- place --------------------------------------------------------------------------------------

static bool is_near(const struct snapshot *surface, uint32_t triangle, struct box box) {
    vec3 c[3];
    snapshot_corners(surface, triangle, c);
    return fmax(c[0].x, fmax(c[1].x, c[2].x)) >= box.min.x - 10 * MERGE_MM &&
           fmin(c[0].x, fmin(c[1].x, c[2].x)) <= box.max.x + 10 * MERGE_MM &&
           fmax(c[0].y, fmax(c[1].y, c[2].y)) >= box.min.y - 10 * MERGE_MM &&
           fmin(c[0].y, fmin(c[1].y, c[2].y)) <= box.max.y + 10 * MERGE_MM &&
           fmax(c[0].z, fmax(c[1].z, c[2].z)) >= box.min.z - 10 * MERGE_MM &&
           fmin(c[0].z, fmin(c[1].z, c[2].z)) <= box.max.z + 10 * MERGE_MM;
}

// The vertices of triangles that touch the box.
static bool *mark_near(const struct snapshot *surface, struct box box) {
    bool *marks = alloc(surface->vertex_bound, sizeof *marks);
    for (uint32_t t = 0; t < surface->triangle_bound; t++)
        for (size_t i = 0; i < 3 && snapshot_has(surface, t) && is_near(surface, t, box); i++)
            marks[surface->triangles[3 * (size_t)t + i]] = true;
    return marks;
}

static bool lies_on(const struct snapshot *before, const struct snapshot *after,
                    uint32_t triangle) {
    vec3 c[3];
    snapshot_corners(after, triangle, c);
    for (int i = 0; i < 3; i++)
        if (snapshot_distance(before, vec3_lerp(c[i], c[(i + 1) % 3], 0.5)) > FLAT_MM)
            return false;
    return true;
}

// Vertices that shape nothing may go, and the triangles around them be others; the surface stays.
static const char *place_fault(const struct cut_tried *tried, const struct cut_change *change) {
    bool *near = mark_near(tried->after, parts_box(tried->parts, tried->part_count));
    const char *fault = NULL;
    for (uint32_t i = 0; i < change->made_count && !fault; i++) {
        uint32_t made = change->made[i];
        if (!has_marked_corner(tried->after->triangles + 3 * (size_t)made, near) &&
            !lies_on(tried->before, tried->after, made))
            fault = "the surface away from the blade is another";
    }
    free(near);
    return fault;
}

const char *change_fault(const struct cut_tried *tried, const struct cut_mesh *mesh,
                         const struct cut_change *change) {
    int bodies = 0;
    const char *fault = snapshot_fault(tried->after, &bodies);
    if (!fault && bodies != 1)
        fault = "what is left is not one body";
    if (!fault && cut_mesh_triangle_count(mesh) != tried->after->triangle_count)
        fault = "the number of triangles is not that of the living ones";
    if (!fault)
        fault = ids_fault(tried, change);
    if (!fault)
        fault = volumes_fault(tried, change);
    if (!fault)
        fault = labels_fault(tried, change);
    if (!fault)
        fault = place_fault(tried, change);
    return fault;
}
