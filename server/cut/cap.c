#include "cut/flat.h"
#include "cut/stage.h"

#include <stdlib.h>

// ---- segments into loops: on each face, every vertex has one segment to it and one from it ----

static int compare_segments(const void *a, const void *b) {
    const struct segment *s = a, *t = b;
    if (s->face != t->face)
        return s->face - t->face;
    return s->from < t->from ? -1 : s->from > t->from;
}

// The loop of a vertex as a ring of the last region.
static bool follow(struct stage *stage, uint32_t end, uint32_t start) {
    uint32_t i = start;
    stage_begin_ring(stage);
    do {
        struct segment *segment = &stage->segments[i];
        stage_add_to_ring(stage, segment->from);
        segment->face = -1; // done
        if (!stamped_set_has(&stage->slots, segment->to))
            return stage_refuse(stage, "a border on a face of the blade has an end");
        i = stamped_set_get(&stage->slots, segment->to);
    } while (i < end && stage->segments[i].face >= 0);
    return i == start ? true : stage_refuse(stage, "borders on a face of the blade meet");
}

static bool face_loops(struct cut_mesh *mesh, struct stage *stage, uint32_t start, uint32_t end) {
    stamped_set_begin(&stage->slots, mesh->vertex_bound);
    for (uint32_t i = start; i < end; i++) {
        if (stamped_set_has(&stage->slots, stage->segments[i].from))
            return stage_refuse(stage, "borders on a face of the blade part");
        stamped_set_put(&stage->slots, stage->segments[i].from, i);
    }
    for (uint32_t i = start; i < end; i++)
        if (stage->segments[i].face >= 0 && !follow(stage, end, i))
            return false;
    return true;
}

// ---- loops into regions: each hole goes to the smallest loop around it ----
//
// Where the body crosses itself a hole may lie in none. It then goes to the largest: the area, and
// with it the volume, is right with any.

#define LOST_MM2 1e-6 // so small a hole may lie where it will

static double ring_area(const struct cut_mesh *mesh, const struct stage *stage,
                        const struct flat *flat, const struct vertex_ring *ring) {
    const uint32_t *v = stage->ring_vertices.at + ring->first;
    double sum = 0;
    struct flat_point a = flat_of(flat, mesh->points[v[ring->count - 1]]);
    for (uint32_t i = 0; i < ring->count; i++) {
        struct flat_point b = flat_of(flat, mesh->points[v[i]]);
        sum += a.x * b.y - a.y * b.x;
        a = b;
    }
    return sum / 2;
}

static bool ring_holds(const struct cut_mesh *mesh, const struct stage *stage,
                       const struct flat *flat, const struct vertex_ring *ring,
                       struct flat_point p) {
    const uint32_t *v = stage->ring_vertices.at + ring->first;
    bool inside = false;
    struct flat_point a = flat_of(flat, mesh->points[v[ring->count - 1]]);
    for (uint32_t i = 0; i < ring->count; i++) {
        struct flat_point b = flat_of(flat, mesh->points[v[i]]);
        if ((a.y > p.y) != (b.y > p.y) && p.x < a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x))
            inside = !inside;
        a = b;
    }
    return inside;
}

static uint32_t largest_loop(const struct face_loop *loops, uint32_t count) {
    uint32_t largest = 0;
    for (uint32_t i = 1; i < count; i++)
        if (loops[i].area > loops[largest].area)
            largest = i;
    return largest;
}

static void find_owner(const struct cut_mesh *mesh, const struct stage *stage,
                       const struct flat *flat, uint32_t count, uint32_t k) {
    struct face_loop *loops = stage->loops;
    loops[k].owner = k;
    if (loops[k].area >= 0)
        return;
    struct flat_point p = flat_of(flat, mesh->points[stage->ring_vertices.at[loops[k].ring.first]]);
    for (uint32_t i = 0; i < count; i++)
        if (loops[i].area > 0 && ring_holds(mesh, stage, flat, &loops[i].ring, p) &&
            (loops[k].owner == k || loops[i].area < loops[loops[k].owner].area))
            loops[k].owner = i;
    if (loops[k].owner == k && loops[largest_loop(loops, count)].area > 0)
        loops[k].owner = largest_loop(loops, count);
}

// The rings of the last region, a whole face, as loops; and the region is no more.
static uint32_t take_loops(const struct cut_mesh *mesh, struct stage *stage) {
    struct region whole = stage->regions[--stage->region_count];
    uint32_t count = whole.ring_count;
    struct vertex_ring *rings = stage->rings + whole.first_ring;
    struct flat flat = flat_on(whole.normal, mesh->points[stage->ring_vertices.at[rings->first]]);
    stage->loops = array_grow(stage->loops, &stage->loop_room, count, sizeof *stage->loops);
    for (uint32_t k = 0; k < count; k++)
        stage->loops[k] = (struct face_loop){rings[k], ring_area(mesh, stage, &flat, &rings[k]), k};
    for (uint32_t k = 0; k < count; k++)
        find_owner(mesh, stage, &flat, count, k);
    stage->ring_count = whole.first_ring;
    return count;
}

static void add_loop(struct stage *stage, struct vertex_ring ring) {
    stage->rings =
        array_grow(stage->rings, &stage->ring_room, stage->ring_count + 1, sizeof *stage->rings);
    stage->rings[stage->ring_count++] = ring;
    stage->regions[stage->region_count - 1].ring_count++;
}

static bool split_into_regions(const struct cut_mesh *mesh, struct stage *stage, vec3 normal) {
    uint32_t count = take_loops(mesh, stage);
    for (uint32_t k = 0; k < count; k++) {
        if (stage->loops[k].owner != k)
            continue;
        if (stage->loops[k].area < -LOST_MM2)
            return stage_refuse(stage, "new surface that is nothing but a hole");
        stage_add_region(stage, stage->number, normal);
        add_loop(stage, stage->loops[k].ring);
        for (uint32_t i = 0; i < count; i++)
            if (i != k && stage->loops[i].owner == k)
                add_loop(stage, stage->loops[i].ring);
    }
    return true;
}

bool cap_faces(struct cut_mesh *mesh, struct stage *stage) {
    if (stage->segment_count)
        qsort(stage->segments, stage->segment_count, sizeof *stage->segments, compare_segments);
    for (uint32_t start = 0, end; start < stage->segment_count; start = end) {
        int face = stage->segments[start].face;
        for (end = start; end < stage->segment_count && stage->segments[end].face == face;)
            end++;
        vec3 normal = vec3_scale(-1, stage->blade.planes[face].normal);
        stage_add_region(stage, stage->number, normal);
        if (!face_loops(mesh, stage, start, end) || !split_into_regions(mesh, stage, normal))
            return false;
    }
    return true;
}
