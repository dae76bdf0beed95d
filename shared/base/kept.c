#include "base/kept.h"

#include "base/check.h"

#include <math.h>
#include <string.h>

#define UNIT_WITHIN 1e-2 // more than poses of frames differ, one after another

struct kept kept_into(uint8_t *data, size_t size) {
    return (struct kept){.data = data, .size = size};
}

struct kept kept_growing(void) {
    return (struct kept){.grows = true};
}

// It is only read.
struct kept kept_from(const uint8_t *data, size_t size) {
    return (struct kept){.data = (uint8_t *)(uintptr_t)data, .size = size, .reads = true};
}

static bool make_room(struct kept *k, size_t size) {
    if (k->bad || size > SIZE_MAX / 4 - k->used)
        return false;
    if (k->used + size <= k->size)
        return true;
    if (!k->grows)
        return false;
    k->size = 2 * (k->used + size);
    k->data = alloc_resize(k->data, k->size, 1);
    return true;
}

void kept_bytes(struct kept *k, void *bytes, size_t size) {
    bool there = k->reads ? size <= kept_left(k) : make_room(k, size);
    k->bad |= !there;
    if (!size)
        return;
    if (there && k->reads)
        memcpy(bytes, k->data + k->used, size);
    else if (there)
        memcpy(k->data + k->used, bytes, size);
    else if (k->reads)
        memset(bytes, 0, size);
    k->used += there ? size : 0;
}

void kept_flag(struct kept *k, bool *flag) {
    uint8_t value = *flag;
    kept_bytes(k, &value, sizeof value);
    kept_holds(k, value <= 1);
    *flag = value == 1;
}

void kept_int(struct kept *k, int *value, int least, int most) {
    kept_bytes(k, value, sizeof *value);
    kept_holds(k, *value >= least && *value <= most);
    if (k->bad && k->reads)
        *value = least;
}

void kept_count(struct kept *k, uint32_t *count, uint32_t most) {
    kept_bytes(k, count, sizeof *count);
    kept_holds(k, *count <= most);
    if (k->bad && k->reads)
        *count = 0;
}

void kept_u64(struct kept *k, uint64_t *value) {
    kept_bytes(k, value, sizeof *value);
}

void kept_time(struct kept *k, int64_t *time_ns) {
    kept_bytes(k, time_ns, sizeof *time_ns);
    kept_holds(k, *time_ns >= -(INT64_MAX / 4) && *time_ns <= INT64_MAX / 4);
}

void kept_real(struct kept *k, double *value, double least, double most) {
    kept_bytes(k, value, sizeof *value);
    kept_holds(k, *value >= least && *value <= most);
}

void kept_point(struct kept *k, vec3 *point) {
    kept_real(k, &point->x, -KEPT_FAR_MM, KEPT_FAR_MM);
    kept_real(k, &point->y, -KEPT_FAR_MM, KEPT_FAR_MM);
    kept_real(k, &point->z, -KEPT_FAR_MM, KEPT_FAR_MM);
}

void kept_pose(struct kept *k, pose *p) {
    quat *q = &p->rotation;
    kept_bytes(k, q, sizeof *q);
    double square = q->w * q->w + q->x * q->x + q->y * q->y + q->z * q->z;
    kept_holds(k, fabs(square - 1) <= UNIT_WITHIN);
    kept_point(k, &p->translation);
}

void *kept_array(struct kept *k, const void *array, size_t count, size_t size) {
    if (!k->reads) {
        kept_bytes(k, (void *)(uintptr_t)array, count * size);
        return NULL;
    }
    k->bad |= count > kept_left(k) / size;
    if (k->bad || !count)
        return NULL;
    void *made = alloc(count, size);
    kept_bytes(k, made, count * size);
    return made;
}
