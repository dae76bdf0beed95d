// What a job changes of the touched surface S'', and its bytes in a trace.
#pragma once

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// Offsets are multiples of 1 mm / TOUCH_PER_MM.
#define TOUCH_PER_MM (1 << 20)
// Farther vertices and longer changes have no bytes.
#define TOUCH_FARTHEST_MM 30
#define TOUCH_BYTES_MAX ((size_t)1 << 20)

// Vertices of S'' that moved, by the match of the session's rules (step/settings.h).
struct touch_change {
    int width; // numbers for each vertex. 1: its blend. 3: its offset S'' − S', in mm
    uint32_t count;
    uint32_t *vertices; // ascending
    double *values;
    // Of offsets: the same as bytes (trace/FORMAT.md, touch). 0 where nothing moved, and beyond the
    // limits above.
    size_t size;
    uint8_t *bytes;
};

void touch_change_make_room(struct touch_change *touch, int width, uint32_t count);
void touch_change_fini(struct touch_change *touch); // zeroed is fine

// To the nearest multiple; of two the even one.
static inline double touch_rounded(double mm) {
    const double whole = 0x1.8p52; // beyond 2^52 doubles have no fraction; rint would be a call
    double units = mm * TOUCH_PER_MM;
    units = fabs(units) < 0x1p51 ? (units + whole) - whole : rint(units);
    return units / TOUCH_PER_MM + 0.0; // no -0
}

// Sets bytes and size. The values are rounded offsets.
void touch_encode(struct touch_change *touch);

// False if the bytes are not those of touch_encode. The caller releases *out_touch, which has a
// copy of them.
bool touch_decode(const uint8_t *bytes, size_t size, struct touch_change *out_touch);

// XXH3 (64 bits) of the bytes; 0 if there are none.
uint64_t touch_hash(const struct touch_change *touch);
