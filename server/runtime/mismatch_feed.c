#include "runtime/mismatch_feed.h"

#include "base/check.h"
#include "wire/mismatch.h"

#include <stdlib.h>

void mismatch_feed_fini(struct mismatch_feed *feed) {
    for (int i = 0; i < TISSUES_MAX; i++) {
        free(feed->of[i].bytes);
        mesh_payload_release(&feed->of[i].whole);
    }
    *feed = (struct mismatch_feed){0};
}

static void measure(struct mismatch_bytes *b, const struct operation *operation, int tissue) {
    uint32_t count = cut_mesh_vertex_bound(operation_mesh(operation, tissue));
    double *mm = alloc(count, sizeof *mm);
    operation_mismatch(operation, tissue, mm);
    size_t bound = wire_mismatch_bound(count);
    b->bytes = alloc_resize(b->bytes, bound, 1);
    b->size = wire_mismatch_encode(mm, count, b->bytes, bound);
    free(mm);
}

struct mesh_payload *mismatch_feed_add(struct mismatch_feed *feed,
                                       const struct operation *operation, int tissue,
                                       struct mesh_payload *payload) {
    struct mismatch_bytes *b = &feed->of[tissue];
    if (b->number != payload->number) {
        measure(b, operation, tissue);
        mesh_payload_release(&b->whole);
        b->number = payload->number;
    }
    bool whole = payload->base == 0;
    struct mesh_payload *both = whole && b->whole
                                    ? mesh_payload_hold(b->whole)
                                    : mesh_payload_with_mismatch(payload, b->bytes, b->size);
    if (whole && !b->whole)
        b->whole = mesh_payload_hold(both);
    mesh_payload_release(&payload);
    return both;
}
