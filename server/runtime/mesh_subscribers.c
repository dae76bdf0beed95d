#include "runtime/mesh_subscribers.h"

#include <string.h>

static void free_entry(struct mesh_subscriber *subscriber) {
    mailbox_release(&subscriber->mailbox);
    memset(subscriber->cursors, 0, sizeof subscriber->cursors);
}

static void drop_left(struct mesh_subscribers *list) {
    for (int i = 0; i < MESH_SUBSCRIBERS_MAX; i++)
        if (list->all[i].mailbox && mailbox_is_left(list->all[i].mailbox))
            free_entry(&list->all[i]);
}

void mesh_subscribers_forget(struct mesh_subscribers *list) {
    drop_left(list);
    for (int i = 0; i < MESH_SUBSCRIBERS_MAX; i++)
        memset(list->all[i].cursors, 0, sizeof list->all[i].cursors);
}

void mesh_subscribers_fini(struct mesh_subscribers *list) {
    for (int i = 0; i < MESH_SUBSCRIBERS_MAX; i++)
        free_entry(&list->all[i]);
}

// The place of a mailbox, or a free one for NULL; NULL where there is none.
static struct mesh_subscriber *find_subscriber(struct mesh_subscribers *list,
                                               const struct mailbox *mailbox) {
    for (int i = 0; i < MESH_SUBSCRIBERS_MAX; i++)
        if (list->all[i].mailbox == mailbox)
            return &list->all[i];
    return NULL;
}

void mesh_subscribers_take(struct mesh_subscribers *list, const struct mesh_request *request,
                           const char *const groups[TISSUES_MAX], int count) {
    drop_left(list);
    if (mailbox_is_left(request->mailbox))
        return;
    struct mesh_subscriber *subscriber = find_subscriber(list, request->mailbox);
    if (!subscriber && (subscriber = find_subscriber(list, NULL)))
        subscriber->mailbox = mailbox_hold(request->mailbox);
    if (subscriber)
        subscriber->mismatch = request->mismatch;
    const struct mesh_words *words = &request->words;
    for (int i = 0; subscriber && i < count; i++) {
        if (words->asks)
            mesh_cursor_ask(&subscriber->cursors[i], groups[i], &words->ask);
        for (int k = 0; k < words->ack_count; k++)
            if (!strcmp(groups[i], words->acks[k].group))
                mesh_cursor_ack(&subscriber->cursors[i], &words->acks[k]);
    }
}

static void serve(struct mesh_subscriber *subscriber, const struct mesh_offer *offer, int tissue) {
    struct mesh_payload *payload =
        mesh_feed_next(offer->feeds[tissue], &subscriber->cursors[tissue]);
    if (payload && subscriber->mismatch)
        payload = mismatch_feed_add(offer->mismatch, offer->operation, tissue, payload);
    if (payload)
        mailbox_put(subscriber->mailbox, tissue, offer->session, payload);
    mesh_payload_release(&payload);
}

void mesh_subscribers_serve(struct mesh_subscribers *list, const struct mesh_offer *offer) {
    drop_left(list);
    for (int i = 0; i < MESH_SUBSCRIBERS_MAX; i++)
        for (int t = 0; list->all[i].mailbox && t < TISSUES_MAX; t++)
            if (offer->feeds[t])
                serve(&list->all[i], offer, t);
}
