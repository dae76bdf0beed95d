// How far touch and sight differ (match/mismatch.h), behind the payloads of pages that ask for it.
// It is computed once for each mesh that such a page gets, and the whole mesh is put together with
// it once. One thread at a time.
#pragma once

#include "net/mesh_payload.h"
#include "step/operation.h"

struct mismatch_feed { // zeroed: nothing
    struct mismatch_bytes {
        uint32_t number; // of the mesh; 0: none
        size_t size;
        uint8_t *bytes;
        struct mesh_payload *whole; // with these; NULL: nobody has needed it
    } of[TISSUES_MAX];
};

void mismatch_feed_fini(struct mismatch_feed *feed); // zeroes it

// payload: of the tissue as the operation has it now. Takes the caller's reference, and returns one
// to a payload with the mismatch.
struct mesh_payload *mismatch_feed_add(struct mismatch_feed *feed,
                                       const struct operation *operation, int tissue,
                                       struct mesh_payload *payload);
