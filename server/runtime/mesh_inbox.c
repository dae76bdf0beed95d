#include "runtime/mesh_inbox.h"

#include <string.h>

#define ASKS_HZ 1
#define ASKS_BURST 10

void mesh_inbox_init(struct mesh_inbox *inbox) {
    memset(inbox, 0, sizeof *inbox);
    pthread_mutex_init(&inbox->lock, NULL);
}

void mesh_inbox_fini(struct mesh_inbox *inbox) {
    pthread_mutex_destroy(&inbox->lock);
}

void mesh_words_ask(struct mesh_words *words, const arthron_MeshAsk *ask) {
    words->asks = true;
    words->ask = *ask;
    words->ack_count = 0;
}

void mesh_words_ack(struct mesh_words *words, const arthron_MeshState *ack) {
    int at = 0;
    while (at < words->ack_count && strcmp(words->acks[at].group, ack->group) != 0)
        at++;
    if (at == TISSUES_MAX) {
        memmove(words->acks, words->acks + 1, (TISSUES_MAX - 1) * sizeof *words->acks);
        at = --words->ack_count;
    }
    words->ack_count += at == words->ack_count;
    words->acks[at] = *ack;
}

void mesh_inbox_put(struct mesh_inbox *inbox, struct control_peer peer,
                    const arthron_Control *message) {
    struct mesh_words *words = &inbox->words;
    pthread_mutex_lock(&inbox->lock);
    words->peer = peer;
    if (message->which_message == arthron_Control_mesh_ask_tag)
        mesh_words_ask(words, &message->message.mesh_ask);
    else
        mesh_words_ack(words, &message->message.mesh_ack);
    inbox->filled = true;
    pthread_mutex_unlock(&inbox->lock);
}

void mesh_inbox_leave(struct mesh_inbox *inbox) {
    pthread_mutex_lock(&inbox->lock);
    inbox->words = (struct mesh_words){.left = true};
    inbox->filled = true;
    pthread_mutex_unlock(&inbox->lock);
}

bool mesh_inbox_take(struct mesh_inbox *inbox, int64_t now_ns, struct mesh_words *out_words) {
    pthread_mutex_lock(&inbox->lock);
    bool filled = inbox->filled &&
                  (!inbox->words.asks || bucket_take(&inbox->asks, ASKS_HZ, ASKS_BURST, now_ns));
    if (filled) {
        *out_words = inbox->words;
        inbox->words = (struct mesh_words){.left = false};
        inbox->filled = false;
    }
    pthread_mutex_unlock(&inbox->lock);
    return filled;
}
