#include "wire/mismatch.h"

#include "base/check.h"
#include "wire/varint.h"

#include <math.h>

#define HEAD_MAX 5
#define VERTEX_MAX 8 // bytes of its gap and its value

size_t wire_mismatch_bound(uint32_t count) {
    return HEAD_MAX + (size_t)count * VERTEX_MAX;
}

static int32_t steps_of(double mm) {
    CHECK(fabs(mm) <= WIRE_MISMATCH_MAX_MM);
    return (int32_t)round(mm / WIRE_MISMATCH_STEP_MM);
}

size_t wire_mismatch_encode(const double *mm, uint32_t count, uint8_t *data, size_t size) {
    struct writer w = {data, size, 0, false};
    uint32_t next = 0;
    write_varint(&w, (uint32_t)round(1000 * WIRE_MISMATCH_STEP_MM));
    for (uint32_t id = 0; id < count; id++) {
        int32_t steps = steps_of(mm[id]);
        if (!steps)
            continue;
        write_varint(&w, id - next);
        write_varint(&w, zigzag((uint32_t)steps));
        next = id + 1;
    }
    CHECK(!w.overflow);
    return w.used;
}
