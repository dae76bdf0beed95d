// What the reader and the writer of anatomy.glb share.
#pragma once

#include "case/gltf.h"

#include <cstddef>
#include <string>
#include <vector>

namespace tinygltf {
class Model;
}

constexpr double gltf_mm_per_m = 1000;
// Attributes: of a group that bridges; of one whose parts hide each other; of worn cartilage.
constexpr const char *gltf_other_share = "_OTHER_SHARE";
constexpr const char *gltf_covered = "_COVERED";
constexpr const char *gltf_wear = "_WEAR";

// Thrown inside of this room only: gltf_decode and gltf_encode make a result of it.
struct gltf_refusal {
    enum result code;
    std::string text;
};

struct gltf_elements {
    const unsigned char *first;
    size_t stride, count;
};

// All of these throw a gltf_refusal that says what is wrong with which accessor.
std::string gltf_accessor_name(const char *what, int index);
// Floats, of TINYGLTF_TYPE_VEC3 or TINYGLTF_TYPE_SCALAR.
gltf_elements gltf_locate_floats(const tinygltf::Model &model, int index, int type,
                                 const char *name);
// Of 16 or 32 bits; whole triangles.
std::vector<uint32_t> gltf_read_indices(const tinygltf::Model &model, int index,
                                        uint32_t triangles_max);
void gltf_load_model(const uint8_t *bytes, size_t size, tinygltf::Model &model);
// What no mesh uses must be sound too: a file that is broken there was not written with care.
void gltf_check_the_rest(const tinygltf::Model &model);
