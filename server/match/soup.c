#include "match/soup.h"

#include "base/check.h"
#include "match/room.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define AREA2_MIN 1e-10 // mm²: less is no area

void soup_fini(struct soup *soup) {
    free(soup->at);
    free(soup->planes);
    free(soup->lanes);
    free(soup->order);
    free(soup->blocks);
    free(soup->middles);
    *soup = (struct soup){0};
}

void soup_clear(struct soup *soup) {
    soup->count = 0;
}

static void set_corners(struct soup_triangle *t, const vec3 corners[3]) {
    vec3 area2 = soup_area2(corners);
    double length = vec3_length(area2);
    memcpy(t->corners, corners, sizeof t->corners);
    t->area2 = length;
    t->normal = length > AREA2_MIN ? vec3_scale(1 / length, area2) : (vec3){0};
}

void soup_add(struct soup *soup, const vec3 corners[3], uint32_t id, bool mark) {
    room_for(&soup->at, &soup->room, soup->count + 1);
    struct soup_triangle *t = &soup->at[soup->count++];
    set_corners(t, corners);
    t->id = id;
    t->mark = mark;
}

// ---- boxes --------------------------------------------------------------------------------------

static struct box box_of(const vec3 c[3]) {
    return (struct box){{lower(c[0].x, lower(c[1].x, c[2].x)), lower(c[0].y, lower(c[1].y, c[2].y)),
                         lower(c[0].z, lower(c[1].z, c[2].z))},
                        {higher(c[0].x, higher(c[1].x, c[2].x)),
                         higher(c[0].y, higher(c[1].y, c[2].y)),
                         higher(c[0].z, higher(c[1].z, c[2].z))}};
}

// Of a cube around the normal, the face that it looks through.
static int32_t face_of(vec3 n) {
    double x = fabs(n.x), y = fabs(n.y), z = fabs(n.z);
    if (x >= y && x >= z)
        return n.x > 0 ? 1 : 2;
    return y >= z ? n.y > 0 ? 4 : 8 : n.z > 0 ? 16 : 32;
}

static void place_sphere(struct soup_plane *out, struct box box, const vec3 corners[3]) {
    double most = 0;
    out->middle = vec3_scale(0.5, vec3_add(box.min, box.max));
    for (int i = 0; i < 3; i++) {
        vec3 off = vec3_sub(corners[i], out->middle);
        most = higher(most, vec3_dot(off, off));
    }
    out->radius = sqrt(most);
}

// Its own box, its plane and its sphere.
static void place(struct soup *soup, uint32_t index) {
    const struct soup_triangle *t = &soup->at[index];
    struct soup_boxes *boxes = &soup->blocks[soup->lanes[index] / EIGHT];
    uint32_t lane = soup->lanes[index] % EIGHT;
    struct box box = box_of(t->corners);
    const double *low = &box.min.x, *high = &box.max.x, *origin = &soup->origin.x;
    bool has_area = vec3_dot(t->normal, t->normal) > 0;
    soup->planes[index].normal = has_area ? t->normal : (vec3){NAN, NAN, NAN};
    soup->planes[index].offset = vec3_dot(t->normal, t->corners[0]);
    boxes->faces[lane] = face_of(t->normal);
    place_sphere(&soup->planes[index], box, t->corners);
    for (int i = 0; i < 3; i++) {
        double middle = 0.5 * (low[i] + high[i]) - origin[i], half = 0.5 * (high[i] - low[i]);
        boxes->middle[i][lane] = (float)middle;
        boxes->half[i][lane] = (float)half;
        soup->reach = higher(soup->reach, fabs(middle) + half);
    }
}

// Around the eight of a block.
static void box_block(struct soup_boxes *out, uint32_t lane, const struct soup_boxes *of) {
    for (int i = 0; i < 3; i++) {
        float low = INFINITY, high = -INFINITY;
        for (int k = 0; k < EIGHT; k++) {
            float bottom = of->middle[i][k] - of->half[i][k];
            float top = of->middle[i][k] + of->half[i][k];
            low = of->faces[k] && bottom < low ? bottom : low;
            high = of->faces[k] && top > high ? top : high;
        }
        out->middle[i][lane] = 0.5f * (low + high);
        out->half[i][lane] = 0.5f * (high - low);
    }
    out->faces[lane] = 0;
    for (int k = 0; k < EIGHT; k++)
        out->faces[lane] |= of->faces[k];
}

void soup_settle(struct soup *soup) {
    for (int level = 1; level < soup->level_count; level++)
        for (uint32_t i = 0; i < soup->counts[level]; i++)
            box_block(&soup->blocks[soup->starts[level] + i / EIGHT], i % EIGHT,
                      &soup->blocks[soup->starts[level - 1] + i]);
}

static void make_levels(struct soup *soup) {
    uint32_t blocks = 0, boxes = soup->count;
    for (soup->level_count = 0; !soup->level_count || boxes > 1; boxes = eights_count(boxes)) {
        CHECK(soup->level_count < SOUP_LEVELS_MAX);
        soup->starts[soup->level_count] = blocks;
        soup->counts[soup->level_count++] = boxes;
        blocks += eights_count(boxes);
    }
    room_for(&soup->blocks, &soup->block_room, blocks);
    memset(soup->blocks, 0, blocks * sizeof *soup->blocks);
}

static void order(struct soup *soup) {
    room_for(&soup->order, &soup->order_room, soup->count);
    room_for(&soup->lanes, &soup->lane_room, soup->count);
    room_for(&soup->planes, &soup->plane_room, soup->count);
    room_for(&soup->middles, &soup->middle_room, 3 * soup->count);
    soup->origin = soup->at[0].corners[0];
    for (uint32_t t = 0; t < soup->count; t++) {
        struct box box = box_of(soup->at[t].corners);
        for (int i = 0; i < 3; i++)
            soup->middles[3 * (size_t)t + (size_t)i] =
                (float)(0.5 * ((&box.min.x)[i] + (&box.max.x)[i]) - (&soup->origin.x)[i]);
    }
    eights_order(soup->middles, soup->count, soup->order);
    for (uint32_t i = 0; i < soup->count; i++)
        soup->lanes[soup->order[i].number] = i;
}

void soup_build(struct soup *soup) {
    if (!soup->count)
        return;
    order(soup);
    make_levels(soup);
    soup->reach = 0;
    for (uint32_t t = 0; t < soup->count; t++)
        place(soup, t);
    soup_settle(soup);
}

void soup_move(struct soup *soup, uint32_t index, const vec3 corners[3]) {
    set_corners(&soup->at[index], corners);
    place(soup, index);
}
