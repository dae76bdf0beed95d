// Meshes on their way to peers. A chunk is cut out of its payload when the connection takes it.
#include "base/check.h"
#include "net/control_parts.h"

#include <string.h>

// Where a group's payload goes: in the place of an older one, else in a free place.
static struct delivery *place_for(struct peer_slot *slot, const char *group) {
    struct delivery *free_one = NULL;
    for (int i = 0; i < WIRE_MESH_GROUPS_MAX; i++) {
        struct delivery *delivery = &slot->deliveries[i];
        if (delivery->payload && !strcmp(delivery->payload->group, group))
            return delivery;
        if (!delivery->payload && !free_one)
            free_one = delivery;
    }
    return free_one;
}

bool control_send_mesh(struct control *control, struct control_peer handle,
                       struct mesh_payload *payload) {
    struct mesh_payload *older = NULL;
    bool wakes = false;
    pthread_mutex_lock(&control->lock);
    struct peer_slot *slot = control_find_slot(control, handle);
    struct delivery *place = slot && slot->meshes ? place_for(slot, payload->group) : NULL;
    if (place) {
        older = place->payload;
        *place = (struct delivery){.payload = mesh_payload_hold(payload)};
        wakes = control_wake_slot(control, slot);
    }
    pthread_mutex_unlock(&control->lock);
    mesh_payload_release(&older);
    if (wakes)
        ws_server_wake(control->server);
    return place != NULL;
}

static bool is_last(const struct delivery *delivery) {
    return (delivery->next + 1) * (size_t)WIRE_CHUNK_DATA >= delivery->payload->size;
}

// The next chunk of the groups in turn, with a reference to its payload. False: there is none.
static bool take_chunk(struct peer *peer, struct delivery *out) {
    struct peer_slot *slot = &peer->control->slots[peer->handle.index];
    bool taken = false;
    pthread_mutex_lock(&peer->control->lock);
    for (int i = 0; i < WIRE_MESH_GROUPS_MAX && !taken; i++) {
        struct delivery *delivery = &slot->deliveries[slot->turn++ % WIRE_MESH_GROUPS_MAX];
        if (!delivery->payload)
            continue;
        taken = true;
        *out = *delivery;
        if (is_last(delivery))
            delivery->payload = NULL;
        else
            mesh_payload_hold(delivery->payload);
        delivery->next++;
    }
    slot->turn %= WIRE_MESH_GROUPS_MAX;
    pthread_mutex_unlock(&peer->control->lock);
    return taken;
}

static void fill_chunk(const struct delivery *delivery, arthron_MeshChunk *out) {
    const struct mesh_payload *payload = delivery->payload;
    size_t from = delivery->next * (size_t)WIRE_CHUNK_DATA, left = payload->size - from;
    out->base = payload->base;
    out->number = payload->number;
    out->size = (uint32_t)payload->size;
    out->hash = payload->hash;
    out->index = delivery->next;
    out->data.size = (pb_size_t)(left < WIRE_CHUNK_DATA ? left : WIRE_CHUNK_DATA);
    memcpy(out->group, payload->group, sizeof out->group);
    memcpy(out->data.bytes, payload->bytes + from, out->data.size);
}

size_t control_next_chunk(struct peer *peer) {
    struct control *control = peer->control;
    struct delivery delivery;
    size_t size;
    if (!take_chunk(peer, &delivery))
        return 0;
    fill_chunk(&delivery, &control->chunk);
    mesh_payload_release(&delivery.payload);
    enum result result = wire_encode_chunk(&control->chunk, control->chunk_bytes.bytes,
                                           sizeof control->chunk_bytes.bytes, &size);
    CHECK(result == RESULT_OK); // every chunk fits WIRE_CHUNK_MAX
    return size;
}

void control_drop_meshes(struct peer_slot *slot) {
    for (int i = 0; i < WIRE_MESH_GROUPS_MAX; i++)
        mesh_payload_release(&slot->deliveries[i].payload);
}
