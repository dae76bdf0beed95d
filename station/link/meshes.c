#include "link/meshes.h"

#include "base/check.h"
#include "base/log.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#define FAILURES_MAX 3 // in a row; a server that goes on sending the same would be asked for ever

// One group. All but tissue and counts is the control thread's alone.
struct followed {
    char group[sizeof((arthron_MeshChunk){0}.group)];
    struct tissue tissue;
    uint64_t bytes_received, resyncs;
    uint8_t *payload; // being collected; NULL: none
    uint32_t base, number, size, next;
    uint64_t hash;
    bool asked; // what comes before the next first piece belongs to what was given up
    int failures;
};

struct meshes {
    meshes_changed *changed;
    void *user;
    uint64_t case_hash;
    pthread_mutex_t lock; // for count, tissues and their counts
    int count;
    struct followed groups[WIRE_MESH_GROUPS_MAX];
};

// ---- life ---------------------------------------------------------------------------------------

struct meshes *meshes_create(meshes_changed *changed, void *user) {
    struct meshes *meshes = alloc(1, sizeof *meshes);
    meshes->changed = changed;
    meshes->user = user;
    pthread_mutex_init(&meshes->lock, NULL);
    return meshes;
}

static void give_up_payload(struct followed *followed) {
    free(followed->payload);
    followed->payload = NULL;
}

static void tell(const struct meshes *meshes, const struct followed *followed) {
    if (meshes->changed)
        meshes->changed(meshes->user, followed->group, &followed->tissue);
}

static void forget_all(struct meshes *meshes) {
    pthread_mutex_lock(&meshes->lock);
    for (int i = 0; i < meshes->count; i++) {
        give_up_payload(&meshes->groups[i]);
        tissue_fini(&meshes->groups[i].tissue);
        tell(meshes, &meshes->groups[i]);
        meshes->groups[i] = (struct followed){0};
    }
    meshes->count = 0;
    pthread_mutex_unlock(&meshes->lock);
}

void meshes_destroy(struct meshes **meshes) {
    forget_all(*meshes);
    pthread_mutex_destroy(&(*meshes)->lock);
    free(*meshes);
    *meshes = NULL;
}

void meshes_set_case(struct meshes *meshes, uint64_t case_hash) {
    if (meshes->case_hash != case_hash)
        forget_all(meshes);
    meshes->case_hash = case_hash;
}

// ---- what to say --------------------------------------------------------------------------------

static arthron_MeshState state_of(const struct followed *followed) {
    arthron_MeshState state = {.number = followed->tissue.number, .hash = followed->tissue.hash};
    memcpy(state.group, followed->group, sizeof state.group);
    return state;
}

static void fill_ask(const struct meshes *meshes, arthron_Control *out) {
    *out = (arthron_Control){.which_message = arthron_Control_mesh_ask_tag};
    arthron_MeshAsk *ask = &out->message.mesh_ask;
    for (int i = 0; i < meshes->count; i++)
        if (meshes->groups[i].tissue.number)
            ask->have[ask->have_count++] = state_of(&meshes->groups[i]);
}

void meshes_ask(struct meshes *meshes, arthron_Control *out_ask) {
    for (int i = 0; i < meshes->count; i++) {
        give_up_payload(&meshes->groups[i]);
        meshes->groups[i].asked = false;
        meshes->groups[i].failures = 0;
    }
    fill_ask(meshes, out_ask);
}

static bool ask_again(struct meshes *meshes, struct followed *followed, const char *why,
                      arthron_Control *out) {
    bool asks = followed->failures++ < FAILURES_MAX;
    log_warning("link", "mesh %s: %s: %s", followed->group, why,
                asks ? "asked for again" : "given up until the session opens again");
    give_up_payload(followed);
    followed->asked = true;
    pthread_mutex_lock(&meshes->lock);
    followed->resyncs += asks;
    pthread_mutex_unlock(&meshes->lock);
    fill_ask(meshes, out);
    return asks;
}

static bool acknowledge(const struct followed *followed, arthron_Control *out) {
    *out = (arthron_Control){.which_message = arthron_Control_mesh_ack_tag};
    out->message.mesh_ack = state_of(followed);
    return true;
}

// ---- pieces -------------------------------------------------------------------------------------

static struct followed *find(struct meshes *meshes, const char *group) {
    for (int i = 0; i < meshes->count; i++)
        if (!strcmp(meshes->groups[i].group, group))
            return &meshes->groups[i];
    return NULL;
}

static struct followed *add(struct meshes *meshes, const char *group) {
    if (meshes->count == WIRE_MESH_GROUPS_MAX)
        return NULL;
    struct followed *followed = &meshes->groups[meshes->count];
    memcpy(followed->group, group, sizeof followed->group);
    pthread_mutex_lock(&meshes->lock);
    meshes->count++;
    pthread_mutex_unlock(&meshes->lock);
    return followed;
}

static void begin_mesh(struct followed *followed, const arthron_MeshChunk *chunk) {
    give_up_payload(followed);
    followed->payload = alloc(chunk->size, 1);
    followed->base = chunk->base;
    followed->number = chunk->number;
    followed->size = chunk->size;
    followed->hash = chunk->hash;
    followed->next = 0;
    followed->asked = false;
}

static bool is_next(const struct followed *followed, const arthron_MeshChunk *chunk) {
    return followed->payload && chunk->index == followed->next && chunk->base == followed->base &&
           chunk->number == followed->number && chunk->size == followed->size &&
           chunk->hash == followed->hash;
}

static bool collect(struct meshes *meshes, struct followed *followed,
                    const arthron_MeshChunk *chunk) {
    if (chunk->index == 0)
        begin_mesh(followed, chunk);
    if (!is_next(followed, chunk))
        return false;
    memcpy(followed->payload + (size_t)chunk->index * WIRE_CHUNK_DATA, chunk->data.bytes,
           chunk->data.size);
    followed->next++;
    pthread_mutex_lock(&meshes->lock);
    followed->bytes_received += chunk->data.size;
    pthread_mutex_unlock(&meshes->lock);
    return true;
}

// ---- payloads -----------------------------------------------------------------------------------

static enum result change_tissue(struct meshes *meshes, struct followed *followed,
                                 struct error *err) {
    pthread_mutex_lock(&meshes->lock);
    struct tissue *tissue = &followed->tissue;
    enum result result = tissue_apply(tissue, followed->payload, followed->size, err);
    if (result == RESULT_OK && tissue->number != followed->number) {
        tissue_fini(tissue);
        result = fail(err, RESULT_CORRUPT, "its changes lead to another number");
    }
    pthread_mutex_unlock(&meshes->lock);
    return result;
}

static bool take_payload(struct meshes *meshes, struct followed *followed, arthron_Control *out) {
    struct error err;
    uint32_t here = followed->tissue.number;
    if (tissue_payload_hash(followed->payload, followed->size) != followed->hash)
        return ask_again(meshes, followed, "its bytes do not have the hash that the server sent",
                         out);
    bool passed = followed->base && followed->base != here && followed->number <= here;
    if (!passed && change_tissue(meshes, followed, &err) != RESULT_OK)
        return ask_again(meshes, followed, err.text, out);
    if (!passed)
        tell(meshes, followed);
    give_up_payload(followed);
    followed->failures = 0;
    return acknowledge(followed, out);
}

bool meshes_hear(struct meshes *meshes, const arthron_MeshChunk *chunk, arthron_Control *out) {
    struct followed *followed = find(meshes, chunk->group);
    if (!followed)
        followed = add(meshes, chunk->group);
    if (!followed) {
        if (chunk->index == 0)
            log_warning("link", "mesh %s: ignored, because the station follows no more meshes",
                        chunk->group);
        return false;
    }
    if (!collect(meshes, followed, chunk))
        return !followed->asked && ask_again(meshes, followed, "a piece is missing", out);
    bool complete = (size_t)followed->next * WIRE_CHUNK_DATA >= followed->size;
    return complete && take_payload(meshes, followed, out);
}

// ---- any thread ---------------------------------------------------------------------------------

int meshes_get(struct meshes *meshes, struct link_tissue out[WIRE_MESH_GROUPS_MAX]) {
    pthread_mutex_lock(&meshes->lock);
    int count = meshes->count;
    for (int i = 0; i < count; i++) {
        const struct followed *followed = &meshes->groups[i];
        out[i] = (struct link_tissue){.number = followed->tissue.number,
                                      .hash = followed->tissue.hash,
                                      .triangles = followed->tissue.triangle_count,
                                      .bytes_received = followed->bytes_received,
                                      .resyncs = followed->resyncs};
        memcpy(out[i].group, followed->group, sizeof out[i].group);
    }
    pthread_mutex_unlock(&meshes->lock);
    return count;
}

bool meshes_copy(struct meshes *meshes, const char *group, struct tissue *out_tissue) {
    pthread_mutex_lock(&meshes->lock);
    const struct followed *followed = find(meshes, group);
    if (followed)
        tissue_copy(out_tissue, &followed->tissue);
    pthread_mutex_unlock(&meshes->lock);
    return followed;
}
