#include "runtime/mailbox.h"

#include "base/check.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>

struct mailbox_entry {
    uint64_t session;
    struct mesh_payload *payload;
};

struct mailbox {
    atomic_int references;
    atomic_bool left;
    pthread_mutex_t notify_lock; // held over `notify`
    void (*notify)(void *user);
    void *user;
    _Atomic(struct mailbox_entry *) entries[TISSUES_MAX];
};

struct mailbox *mailbox_create(void (*notify)(void *user), void *user) {
    struct mailbox *mailbox = alloc(1, sizeof *mailbox);
    atomic_init(&mailbox->references, 1);
    pthread_mutex_init(&mailbox->notify_lock, NULL);
    mailbox->notify = notify;
    mailbox->user = user;
    return mailbox;
}

struct mailbox *mailbox_hold(struct mailbox *mailbox) {
    atomic_fetch_add(&mailbox->references, 1);
    return mailbox;
}

static void clear(struct mailbox_entry *entry) {
    if (entry)
        mesh_payload_release(&entry->payload);
    free(entry);
}

void mailbox_release(struct mailbox **mailbox) {
    struct mailbox *t = *mailbox;
    *mailbox = NULL;
    if (!t || atomic_fetch_sub(&t->references, 1) > 1)
        return;
    for (int i = 0; i < TISSUES_MAX; i++)
        clear(atomic_load(&t->entries[i]));
    pthread_mutex_destroy(&t->notify_lock);
    free(t);
}

void mailbox_leave(struct mailbox *mailbox) {
    pthread_mutex_lock(&mailbox->notify_lock);
    atomic_store(&mailbox->left, true);
    pthread_mutex_unlock(&mailbox->notify_lock);
}

bool mailbox_is_left(const struct mailbox *mailbox) {
    return atomic_load(&mailbox->left);
}

void mailbox_put(struct mailbox *mailbox, int tissue, uint64_t session,
                 struct mesh_payload *payload) {
    struct mailbox_entry *entry = alloc(1, sizeof *entry);
    *entry = (struct mailbox_entry){session, mesh_payload_hold(payload)};
    clear(atomic_exchange(&mailbox->entries[tissue], entry));
    pthread_mutex_lock(&mailbox->notify_lock);
    if (!mailbox_is_left(mailbox))
        mailbox->notify(mailbox->user);
    pthread_mutex_unlock(&mailbox->notify_lock);
}

struct mesh_payload *mailbox_take(struct mailbox *mailbox, int tissue, uint64_t *out_session) {
    struct mailbox_entry *entry = atomic_exchange(&mailbox->entries[tissue], NULL);
    if (!entry)
        return NULL;
    struct mesh_payload *payload = entry->payload;
    *out_session = entry->session;
    free(entry);
    return payload;
}
