#include "net/mesh_payload.h"

#include "base/check.h"
#include "wire/tissue.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct mesh_payload *mesh_payload_create(const char *group, uint32_t base, uint32_t number,
                                         size_t size) {
    struct mesh_payload *payload = alloc(1, sizeof *payload + size);
    atomic_init(&payload->references, 1);
    snprintf(payload->group, sizeof payload->group, "%s", group);
    payload->base = base;
    payload->number = number;
    payload->size = size;
    return payload;
}

void mesh_payload_seal(struct mesh_payload *payload) {
    payload->hash = tissue_payload_hash(payload->bytes, payload->size);
}

struct mesh_payload *mesh_payload_with_mismatch(const struct mesh_payload *changes,
                                                const uint8_t *mismatch, size_t size) {
    struct mesh_payload *payload =
        mesh_payload_create(changes->group, changes->base, changes->number, changes->size + size);
    payload->mismatch_size = size;
    memcpy(payload->bytes, changes->bytes, changes->size);
    memcpy(payload->bytes + changes->size, mismatch, size);
    mesh_payload_seal(payload);
    return payload;
}

struct mesh_payload *mesh_payload_hold(struct mesh_payload *payload) {
    atomic_fetch_add(&payload->references, 1);
    return payload;
}

void mesh_payload_release(struct mesh_payload **payload) {
    if (*payload && atomic_fetch_sub(&(*payload)->references, 1) == 1)
        free(*payload);
    *payload = NULL;
}
