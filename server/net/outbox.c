#include "net/outbox.h"

#include "base/check.h"

#include <stdlib.h>
#include <string.h>

#define LENGTH 64
#define RESERVE 16 // of it, for what must not be missed

struct outbox {
    struct ring *queue; // of struct outgoing
    int figures_count;
    arthron_Resection figures[WIRE_MESH_GROUPS_MAX]; // of different groups, the oldest first
};

void outgoing_encode(const arthron_Control *message, struct outgoing *out) {
    size_t size;
    enum result result = wire_encode_control(message, out->bytes, sizeof out->bytes, &size);
    CHECK(result == RESULT_OK); // every message of the schema fits WIRE_CONTROL_MAX
    out->size = (uint32_t)size;
    out->last = false;
}

struct outbox *outbox_create(void) {
    struct outbox *outbox = alloc(1, sizeof *outbox);
    outbox->queue = ring_create(LENGTH, sizeof(struct outgoing));
    return outbox;
}

void outbox_destroy(struct outbox **outbox) {
    if (*outbox)
        ring_destroy(&(*outbox)->queue);
    free(*outbox);
    *outbox = NULL;
}

// ---- figures ------------------------------------------------------------------------------------

// False where there is no place.
static bool keep_figures(struct outbox *outbox, const arthron_Resection *figures) {
    int i = 0;
    while (i < outbox->figures_count && strcmp(outbox->figures[i].group, figures->group) != 0)
        i++;
    if (i == WIRE_MESH_GROUPS_MAX)
        return false;
    outbox->figures[i] = *figures;
    outbox->figures_count += i == outbox->figures_count;
    return true;
}

// There is one.
static void take_figures(struct outbox *outbox, struct outgoing *out) {
    arthron_Control message = {.which_message = arthron_Control_resection_tag};
    message.message.resection = outbox->figures[0];
    outgoing_encode(&message, out);
    outbox->figures_count--;
    memmove(outbox->figures, outbox->figures + 1,
            (size_t)outbox->figures_count * sizeof *outbox->figures);
}

// What is told of the session before it changes is not told behind the change.
static bool queue_figures(struct outbox *outbox) {
    struct outgoing out;
    while (outbox->figures_count) {
        take_figures(outbox, &out);
        if (!ring_push(outbox->queue, &out))
            return false;
    }
    return true;
}

// ---- putting and taking -------------------------------------------------------------------------

// What comes again anyway.
static bool may_be_missed(const arthron_Control *message) {
    return message->which_message == arthron_Control_reply_tag ||
           message->which_message == arthron_Control_ping_tag ||
           message->which_message == arthron_Control_pong_tag;
}

enum outbox_put outbox_put(struct outbox *outbox, const arthron_Control *message,
                           const struct outgoing *encoded) {
    if (may_be_missed(message)) {
        bool room = ring_count(outbox->queue) < LENGTH - RESERVE;
        return room && ring_push(outbox->queue, encoded) ? OUTBOX_QUEUED : OUTBOX_DROPPED;
    }
    if (message->which_message == arthron_Control_resection_tag &&
        keep_figures(outbox, &message->message.resection))
        return OUTBOX_QUEUED;
    if (message->which_message == arthron_Control_session_change_tag && !queue_figures(outbox))
        return OUTBOX_OVERFLOWN;
    return ring_push(outbox->queue, encoded) ? OUTBOX_QUEUED : OUTBOX_OVERFLOWN;
}

bool outbox_take(struct outbox *outbox, pthread_mutex_t *lock, struct outgoing *out) {
    if (ring_pop(outbox->queue, out))
        return true;
    pthread_mutex_lock(lock);
    bool any = outbox->figures_count > 0;
    if (any)
        take_figures(outbox, out);
    pthread_mutex_unlock(lock);
    return any;
}
