// What waits for peers: their slots, and the queues in them.
#include "base/check.h"
#include "net/control_parts.h"

#include <stdio.h>

void control_send_urgent(struct peer *peer, const arthron_Control *message, bool last) {
    if (peer->closing)
        return;
    peer->closing = last;
    outgoing_encode(message, &peer->urgent);
    peer->urgent.last = last;
    if (last)
        lws_set_timer_usecs(peer->wsi, LWS_USEC_PER_SEC);
    lws_callback_on_writable(peer->wsi);
}

bool control_take_slot(struct peer *peer) {
    struct control *control = peer->control;
    struct outbox *outbox = outbox_create();
    int index = 0;
    pthread_mutex_lock(&control->lock);
    while (index < control->slot_count && control->slots[index].peer)
        index++;
    if (index < control->slot_count) {
        struct peer_slot *slot = &control->slots[index];
        *slot = (struct peer_slot){.generation = slot->generation + 1,
                                   .wakes = slot->wakes,
                                   .peer = peer,
                                   .outbox = outbox,
                                   .meshes = peer->meshes,
                                   .until_s = peer->identity.until_s};
        peer->handle = (struct control_peer){index, slot->generation};
    }
    pthread_mutex_unlock(&control->lock);
    if (index == control->slot_count)
        outbox_destroy(&outbox);
    return index < control->slot_count;
}

void control_free_slot(struct peer *peer) {
    struct peer_slot *slot = &peer->control->slots[peer->handle.index];
    pthread_mutex_lock(&peer->control->lock);
    slot->peer = NULL;
    pthread_mutex_unlock(&peer->control->lock);
    outbox_destroy(&slot->outbox);
    control_drop_meshes(slot);
}

struct peer_slot *control_find_slot(struct control *control, struct control_peer handle) {
    CHECK(handle.index >= 0 && handle.index < control->slot_count);
    struct peer_slot *slot = &control->slots[handle.index];
    return slot->peer && slot->generation == handle.generation ? slot : NULL;
}

int64_t control_certificate_end(struct control *control, struct control_peer handle) {
    pthread_mutex_lock(&control->lock);
    const struct peer_slot *slot = control_find_slot(control, handle);
    int64_t until_s = slot ? slot->until_s : 0;
    pthread_mutex_unlock(&control->lock);
    return until_s;
}

bool control_wake_slot(struct control *control, struct peer_slot *slot) {
    if (slot->wakes)
        return false;
    slot->wakes = true;
    control->woken[control->woken_count++] = (int)(slot - control->slots);
    return control->woken_count == 1;
}

bool control_send(struct control *control, struct control_peer handle,
                  const arthron_Control *message) {
    enum outbox_put put = OUTBOX_DROPPED;
    bool wakes = false;
    struct outgoing out;
    outgoing_encode(message, &out);
    pthread_mutex_lock(&control->lock);
    struct peer_slot *slot = control_find_slot(control, handle);
    if (slot) {
        put = outbox_put(slot->outbox, message, &out);
        slot->overflown |= put == OUTBOX_OVERFLOWN;
        wakes = control_wake_slot(control, slot);
    }
    pthread_mutex_unlock(&control->lock);
    if (slot && put == OUTBOX_DROPPED && message->which_message == arthron_Control_reply_tag)
        atomic_fetch_add(&control->replies_dropped, 1);
    if (wakes)
        ws_server_wake(control->server);
    return put == OUTBOX_QUEUED;
}

bool control_move(struct control *control, struct control_peer handle, const char *server) {
    bool wakes = false;
    pthread_mutex_lock(&control->lock);
    struct peer_slot *slot = control_find_slot(control, handle);
    if (slot) {
        snprintf(slot->server, sizeof slot->server, "%s", server);
        wakes = control_wake_slot(control, slot);
    }
    pthread_mutex_unlock(&control->lock);
    if (wakes)
        ws_server_wake(control->server);
    return slot != NULL;
}

bool control_has_more(struct peer *peer) {
    if (peer->urgent.size || peer->closing || !peer->agreed)
        return true;
    pthread_mutex_lock(&peer->control->lock);
    const struct peer_slot *slot = &peer->control->slots[peer->handle.index];
    bool more = outbox_waits(slot->outbox);
    for (int i = 0; i < WIRE_MESH_GROUPS_MAX; i++)
        more |= slot->deliveries[i].payload != NULL;
    pthread_mutex_unlock(&peer->control->lock);
    return more;
}

void control_end_soon(struct peer *peer) {
    peer->closing = true;
    lws_set_timer_usecs(peer->wsi, 1);
}

// At once where nothing waits before it and the connection takes it: no turn of the thread then.
void control_send_from_here(struct peer *peer, const arthron_Control *message) {
    struct control *control = peer->control;
    struct outgoing out;
    outgoing_encode(message, &out);
    if (!control_has_more(peer) && !lws_send_pipe_choked(peer->wsi)) {
        if (lws_write(peer->wsi, out.bytes, out.size, LWS_WRITE_BINARY) < (int)out.size)
            control_end_soon(peer);
        return;
    }
    pthread_mutex_lock(&control->lock);
    outbox_put(control->slots[peer->handle.index].outbox, message, &out);
    pthread_mutex_unlock(&control->lock);
    lws_callback_on_writable(peer->wsi);
}

bool control_next_message(struct peer *peer, struct outgoing *out) {
    if (peer->urgent.size) {
        *out = peer->urgent;
        peer->urgent.size = 0;
        return true;
    }
    if (!peer->agreed || peer->closing)
        return false;
    pthread_mutex_lock(&peer->control->lock);
    bool any = outbox_take(peer->control->slots[peer->handle.index].outbox, out);
    pthread_mutex_unlock(&peer->control->lock);
    return any;
}
