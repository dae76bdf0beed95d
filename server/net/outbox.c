#include "net/outbox.h"

#include "base/check.h"

#include <stdlib.h>
#include <string.h>

#define LENGTH 64
#define RESERVE 16 // of it, for what must not be missed
#define ROOM_FIRST 1024

// Each message is its size and its bytes. They lie one behind the other, and at the begin again as
// soon as none waits.
struct outbox {
    int count;
    uint8_t *bytes;
    size_t first, end, room;
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
    outbox->room = ROOM_FIRST;
    outbox->bytes = alloc(outbox->room, 1);
    return outbox;
}

void outbox_destroy(struct outbox **outbox) {
    if (*outbox)
        free((*outbox)->bytes);
    free(*outbox);
    *outbox = NULL;
}

// ---- the queue ----------------------------------------------------------------------------------

// No more than twice what LENGTH messages take.
static void make_room(struct outbox *outbox, size_t size) {
    size_t used = outbox->end - outbox->first;
    if (size <= outbox->room - outbox->end)
        return;
    memmove(outbox->bytes, outbox->bytes + outbox->first, used);
    outbox->first = 0;
    outbox->end = used;
    while (size > outbox->room - outbox->end)
        outbox->room *= 2;
    outbox->bytes = alloc_resize(outbox->bytes, outbox->room, 1);
}

static bool push(struct outbox *outbox, const struct outgoing *out) {
    if (outbox->count == LENGTH)
        return false;
    make_room(outbox, sizeof out->size + out->size);
    memcpy(outbox->bytes + outbox->end, &out->size, sizeof out->size);
    memcpy(outbox->bytes + outbox->end + sizeof out->size, out->bytes, out->size);
    outbox->end += sizeof out->size + out->size;
    outbox->count++;
    return true;
}

static bool pop(struct outbox *outbox, struct outgoing *out) {
    if (!outbox->count)
        return false;
    memcpy(&out->size, outbox->bytes + outbox->first, sizeof out->size);
    memcpy(out->bytes, outbox->bytes + outbox->first + sizeof out->size, out->size);
    out->last = false;
    outbox->first += sizeof out->size + out->size;
    if (!--outbox->count)
        outbox->first = outbox->end = 0;
    return true;
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
        if (!push(outbox, &out))
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
        bool room = outbox->count < LENGTH - RESERVE;
        return room && push(outbox, encoded) ? OUTBOX_QUEUED : OUTBOX_DROPPED;
    }
    if (message->which_message == arthron_Control_resection_tag &&
        keep_figures(outbox, &message->message.resection))
        return OUTBOX_QUEUED;
    if (message->which_message == arthron_Control_session_change_tag && !queue_figures(outbox))
        return OUTBOX_OVERFLOWN;
    return push(outbox, encoded) ? OUTBOX_QUEUED : OUTBOX_OVERFLOWN;
}

bool outbox_waits(const struct outbox *outbox) {
    return outbox->count || outbox->figures_count;
}

bool outbox_take(struct outbox *outbox, struct outgoing *out) {
    if (pop(outbox, out))
        return true;
    bool any = outbox->figures_count > 0;
    if (any)
        take_figures(outbox, out);
    return any;
}
