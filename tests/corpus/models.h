// glTF files of the shared data: the collections of Khronos' validator and of tinygltf.
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define MODELS_MAX 512

struct model {
    char path[512], name[128]; // the name is the path inside of the collection
    int errors;                // that the validator found; -1: it was not asked
    char codes[160];           // of its errors
};

struct model_bytes {
    uint8_t *data;
    size_t size;
};

bool models_are_here(void);

// All .gltf and .glb, by name; their number.
size_t models_find(struct model *out_models);

struct model_bytes model_read(const struct model *model); // the caller frees the data

// The same model as a GLB without what hides it from a reader of GLB: its first buffer is inside
// (of zeros where it has no URI or holds its bytes as text), and each mesh that has no node gets
// one, each node a name. Where its JSON cannot be read, its bytes as the JSON chunk. The caller
// frees the data.
struct model_bytes model_complete(const struct model_bytes *bytes, const char *path);
