// An animated scene as a GLB file (tinygltf behind this header). Millimetres in, metres in the
// file; times in seconds.
#pragma once

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#include "base/pose.h"
#include "base/result.h"
#include "mesh/mesh.h"

struct model;

struct model *model_create(void);
void model_destroy(struct model **model); // NULL inside is fine

// Materials, meshes, nodes and instants are numbered from 0 as they come.
int model_material(struct model *model, const char *name, const float rgba[4]);
int model_mesh(struct model *model, const char *name, const struct mesh *mesh, int material);
// With a texture coordinate for each corner of each triangle: 6 * triangle_count.
int model_textured_mesh(struct model *model, const char *name, const struct mesh *mesh,
                        const float *uv, int material);

#define MODEL_NONE (-1)

// parent, mesh: or MODEL_NONE.
int model_node(struct model *model, const char *name, int parent, int mesh);
void model_place(struct model *model, int node, pose T_parent_node);
void model_note(struct model *model, const char *key, const char *text); // extras of the file

// Instants for animations, rising and at least one.
int model_times(struct model *model, const float *seconds, uint32_t count);
// A pose for each instant, linear between them; q and -q are one rotation.
void model_move(struct model *model, int node, int times, const pose *poses, uint32_t count);
// Whether the node and all below it is there, from each instant on.
void model_show(struct model *model, int node, int times, const bool *shown, uint32_t count);

// The file. The caller frees *out_bytes. RESULT_LIMIT where glTF's 32-bit length does not suffice.
enum result model_encode(const struct model *model, uint8_t **out_bytes, size_t *out_size,
                         struct error *err);

#ifdef __cplusplus
}
#endif
