// What the reader and the writer of anatomy.glb share.
#pragma once

#include "case/gltf.h"

#include <string>

constexpr double gltf_mm_per_m = 1000;
constexpr const char *gltf_other_share = "_OTHER_SHARE"; // the attribute of a group that bridges

// Thrown inside of this room only: gltf_decode and gltf_encode make a result of it.
struct gltf_refusal {
    enum result code;
    std::string text;
};
