// anatomy.glb: bytes to named triangle meshes and back (tinygltf behind this header).
//
// Only what a case needs is read: one buffer inside the file; for each node with a mesh one
// primitive of indexed triangles, float positions, u16 or u32 indices, the attributes
// `_OTHER_SHARE`, `_COVERED` and `_WEAR` (one float each), and the morph targets `warp` and
// `maxcut` (mesh.extras.targetNames) as differences. Materials, normals, cameras, lights are passed
// over. Refused, with node and accessor: sparse or quantised accessors, required extensions (Draco
// and the like), anything outside of the file, images, nodes with a transform or a parent, and
// whatever does not lie within its buffer view, read or not. Files are in metres, memory in
// millimetres.
#pragma once

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#include "base/result.h"

#define GLTF_NAME_MAX 160

// One node and its mesh.
struct gltf_node {
    char name[GLTF_NAME_MAX];
    uint32_t vertex_count, triangle_count;
    const float *positions;     // 3 * vertex_count, mm; not checked to be finite
    const uint32_t *triangles;  // 3 * triangle_count; not checked against vertex_count
    const float *warp, *maxcut; // 3 * vertex_count, mm; NULL where there is no such target
    const float *other_share;   // vertex_count, not checked; NULL where there is no such attribute
    const float *covered;       // the same
    const float *wear;          // the same
};

struct gltf;

// Limits of a file, checked before anything of its size is allocated.
struct gltf_limits {
    uint32_t nodes;     // with a mesh
    uint32_t triangles; // of each; a mesh may have three vertices for each
};

// The bytes may go once it returns. The caller destroys *out_gltf.
enum result gltf_decode(const uint8_t *bytes, size_t size, const struct gltf_limits *limits,
                        struct gltf **out_gltf, struct error *err);
void gltf_destroy(struct gltf **gltf); // NULL inside is fine; *gltf becomes NULL
uint32_t gltf_node_count(const struct gltf *gltf);
const struct gltf_node *gltf_at(const struct gltf *gltf, uint32_t index); // lives with gltf

// The file for these nodes. The caller frees *out_bytes with free(). RESULT_LIMIT where glTF's
// 32-bit length does not suffice.
enum result gltf_encode(const struct gltf_node *nodes, uint32_t count, uint8_t **out_bytes,
                        size_t *out_size, struct error *err);

// Checks a file before tinygltf reads it: version 2, chunks within their bounds and one of each
// type, JSON that is not nested deeply, lists that are lists, exactly one buffer inside the file,
// no images, no required extension. tinygltf's own checks have gaps: it reads a BIN chunk 8 bytes
// past its end, copies it for each listed buffer, takes images from unchecked views, recurses
// without bound, and takes a negative offset as 0.
enum result gltf_check_envelope(const uint8_t *bytes, size_t size, struct error *err);

// The same of a text file, whose buffer is a data: URI in it.
enum result gltf_check_text(const uint8_t *bytes, size_t size, struct error *err);
bool gltf_is_binary(const uint8_t *bytes, size_t size);

#ifdef __cplusplus
}
#endif
