// Any glTF scene to one mesh: the surfaces that a person exported from another program.
#pragma once

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#include "base/result.h"

struct gltf_scene {
    uint32_t vertex_count, triangle_count;
    double *positions;   // 3 * vertex_count, metres; not checked to be finite
    uint32_t *triangles; // 3 * triangle_count, all below vertex_count
};

// Binary glTF, or text whose buffer is inside of it. The triangles of all nodes of the scene, each
// with the transforms of its node and those above it. Lines, points, materials, normals, morphs,
// skins and cameras are passed over. Refused, with the node: what gltf_decode (case/gltf.h) refuses
// of accessors and files, strips and fans, nodes that are their own parent, and more than
// triangles_max. Both arrays are released with free(); zeroed after an error.
enum result gltf_read_scene(const uint8_t *bytes, size_t size, uint32_t triangles_max,
                            struct gltf_scene *out_scene, struct error *err);

#ifdef __cplusplus
}
#endif
