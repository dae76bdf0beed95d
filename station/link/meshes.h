// The meshes that a station follows: pieces into payloads, payloads into tissues, and what is to be
// answered (wire/PROTOCOL.md, Meshes). No sockets. The control thread calls all but the last two,
// which are for any thread.
#pragma once

#include "wire/tissue.h"
#include "wire/wire.h"

// A mesh that the link follows.
struct link_tissue {
    char group[64];
    uint32_t number; // 0: nothing yet, or it has to be asked for again
    uint64_t hash;
    uint32_t triangles;
    uint64_t bytes_received;
    uint64_t resyncs; // how often it was asked for again
};

struct meshes;

// Called on the control thread when a mesh has changed; number 0: there is none any more. The
// tissue is good until it returns.
typedef void meshes_changed(void *user, const char *group, const struct tissue *tissue);

struct meshes *meshes_create(meshes_changed *changed, void *user); // changed: NULL is fine
void meshes_destroy(struct meshes **meshes);

// What the session is on: all meshes of another case are void.
void meshes_set_case(struct meshes *meshes, uint64_t case_hash);

// The session is open: what to ask it for.
void meshes_ask(struct meshes *meshes, arthron_Control *out_ask);

// A decoded chunk. True where *out_answer is to be said.
bool meshes_hear(struct meshes *meshes, const arthron_MeshChunk *chunk,
                 arthron_Control *out_answer);

int meshes_get(struct meshes *meshes, struct link_tissue out_tissues[WIRE_MESH_GROUPS_MAX]);
bool meshes_copy(struct meshes *meshes, const char *group, struct tissue *out_tissue);
