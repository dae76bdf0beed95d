#include "case/gltf_scene.h"

#include "case/copy_out.hpp"
#include "case/gltf_parts.hpp"

#include <array>
#include <cstdlib>
#include <cstring>
#include <numeric>
#include <tiny_gltf.h>

namespace {

using matrix = std::array<double, 16>; // by columns

constexpr matrix identity = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

matrix multiply(const matrix &a, const matrix &b) {
    matrix out{};
    for (size_t column = 0; column < 4; column++)
        for (size_t row = 0; row < 4; row++)
            for (size_t i = 0; i < 4; i++)
                out[4 * column + row] += a[4 * i + row] * b[4 * column + i];
    return out;
}

double part_of(const std::vector<double> &values, size_t i, double otherwise) {
    return i < values.size() ? values[i] : otherwise;
}

// Translation, rotation and scale, or a matrix.
matrix transform_of(const tinygltf::Node &node) {
    matrix out = identity;
    if (node.matrix.size() == 16) {
        std::copy(node.matrix.begin(), node.matrix.end(), out.begin());
        return out;
    }
    double x = part_of(node.rotation, 0, 0), y = part_of(node.rotation, 1, 0);
    double z = part_of(node.rotation, 2, 0), w = part_of(node.rotation, 3, 1);
    const double turn[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
                               {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
                               {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}};
    for (size_t row = 0; row < 3; row++) {
        for (size_t column = 0; column < 3; column++)
            out[4 * column + row] = turn[row][column] * part_of(node.scale, column, 1);
        out[12 + row] = part_of(node.translation, row, 0);
    }
    return out;
}

bool is_mirror(const matrix &m) {
    return m[0] * (m[5] * m[10] - m[9] * m[6]) - m[4] * (m[1] * m[10] - m[9] * m[2]) +
               m[8] * (m[1] * m[6] - m[5] * m[2]) <
           0;
}

struct collected {
    const tinygltf::Model &model;
    uint32_t triangles_max;
    std::vector<double> positions;
    std::vector<uint32_t> triangles;
    std::vector<bool> seen; // nodes
};

void add_vertices(collected &to, const gltf_elements &from, const matrix &m) {
    for (size_t i = 0; i < from.count; i++) {
        float p[3];
        memcpy(p, from.first + i * from.stride, sizeof p);
        for (size_t row = 0; row < 3; row++)
            to.positions.push_back(m[row] * (double)p[0] + m[4 + row] * (double)p[1] +
                                   m[8 + row] * (double)p[2] + m[12 + row]);
    }
}

std::vector<uint32_t> corners_of(const collected &to, const tinygltf::Primitive &primitive,
                                 size_t vertices) {
    if (primitive.indices >= 0)
        return gltf_read_indices(to.model, primitive.indices, to.triangles_max);
    if (vertices % 3 != 0)
        throw gltf_refusal{RESULT_FORMAT, std::to_string(vertices) + " are not whole triangles"};
    std::vector<uint32_t> all(vertices);
    std::iota(all.begin(), all.end(), 0u);
    return all;
}

void add_primitive(collected &to, const tinygltf::Primitive &primitive, const matrix &m) {
    if (primitive.mode == TINYGLTF_MODE_TRIANGLE_STRIP ||
        primitive.mode == TINYGLTF_MODE_TRIANGLE_FAN)
        throw gltf_refusal{RESULT_REFUSED, "strips and fans of triangles are not read here"};
    auto found = primitive.attributes.find("POSITION");
    if (primitive.mode != TINYGLTF_MODE_TRIANGLES || found == primitive.attributes.end())
        return;
    size_t before = to.positions.size() / 3;
    gltf_elements from =
        gltf_locate_floats(to.model, found->second, TINYGLTF_TYPE_VEC3, "POSITION");
    if (from.count + before > 3 * (uint64_t)to.triangles_max)
        throw gltf_refusal{RESULT_LIMIT, "more vertices than are accepted"};
    std::vector<uint32_t> corners = corners_of(to, primitive, from.count);
    if ((to.triangles.size() + corners.size()) / 3 > to.triangles_max)
        throw gltf_refusal{RESULT_LIMIT,
                           "more than " + std::to_string(to.triangles_max) + " triangles"};
    add_vertices(to, from, m);
    for (size_t i = 0; i < corners.size(); i++) {
        uint32_t corner = corners[is_mirror(m) ? i - i % 3 + (3 - i % 3) % 3 : i];
        if (corner >= from.count)
            throw gltf_refusal{RESULT_FORMAT, "there is no vertex " + std::to_string(corner)};
        to.triangles.push_back((uint32_t)before + corner);
    }
}

void add_mesh(collected &to, const tinygltf::Node &node, const matrix &m) {
    if (node.mesh < 0)
        return;
    if ((size_t)node.mesh >= to.model.meshes.size())
        throw gltf_refusal{RESULT_FORMAT, "there is no mesh " + std::to_string(node.mesh)};
    for (const tinygltf::Primitive &primitive : to.model.meshes[node.mesh].primitives)
        add_primitive(to, primitive, m);
}

struct to_visit {
    int node;
    matrix parent;
};

void add_node(collected &to, const to_visit &visit, std::vector<to_visit> &next) {
    std::string what = "nodes[" + std::to_string(visit.node) + "]";
    if (visit.node < 0 || (size_t)visit.node >= to.model.nodes.size())
        throw gltf_refusal{RESULT_FORMAT, what + ": there is no such node"};
    if (to.seen[visit.node])
        throw gltf_refusal{RESULT_FORMAT, what + " has two parents"};
    to.seen[visit.node] = true;
    const tinygltf::Node &node = to.model.nodes[visit.node];
    matrix m = multiply(visit.parent, transform_of(node));
    try {
        add_mesh(to, node, m);
    } catch (const gltf_refusal &why) {
        throw gltf_refusal{why.code, what + " " + node.name.substr(0, 80) + ": " + why.text};
    }
    for (int child : node.children)
        next.push_back({child, m});
}

// The nodes of the scene that is shown; where there is no scene, all that are no child.
std::vector<int> roots_of(const tinygltf::Model &model) {
    size_t shown = model.defaultScene < 0 ? 0 : (size_t)model.defaultScene;
    if (shown < model.scenes.size())
        return model.scenes[shown].nodes;
    std::vector<bool> child(model.nodes.size());
    for (const tinygltf::Node &node : model.nodes)
        for (int index : node.children)
            if (index >= 0 && (size_t)index < child.size())
                child[index] = true;
    std::vector<int> roots;
    for (size_t i = 0; i < child.size(); i++)
        if (!child[i])
            roots.push_back((int)i);
    return roots;
}

void collect(const tinygltf::Model &model, collected &to) {
    std::vector<to_visit> next;
    for (int root : roots_of(model))
        next.push_back({root, identity});
    while (!next.empty()) {
        to_visit visit = next.back();
        next.pop_back();
        add_node(to, visit, next);
    }
    gltf_check_the_rest(model);
    if (to.triangles.empty())
        throw gltf_refusal{RESULT_FORMAT, "the scene holds no triangle"};
}

void read_scene(const uint8_t *bytes, size_t size, uint32_t triangles_max, gltf_scene &out) {
    tinygltf::Model model;
    gltf_load_model(bytes, size, model);
    collected all{model, triangles_max, {}, {}, std::vector<bool>(model.nodes.size())};
    collect(model, all);
    out.positions = copy_out(all.positions);
    out.triangles = copy_out(all.triangles);
    out.vertex_count = (uint32_t)(all.positions.size() / 3);
    out.triangle_count = (uint32_t)(all.triangles.size() / 3);
}

} // namespace

enum result gltf_read_scene(const uint8_t *bytes, size_t size, uint32_t triangles_max,
                            struct gltf_scene *out_scene, struct error *err) {
    *out_scene = {};
    enum result result = gltf_is_binary(bytes, size) ? gltf_check_envelope(bytes, size, err)
                                                     : gltf_check_text(bytes, size, err);
    if (result != RESULT_OK)
        return result;
    try {
        read_scene(bytes, size, triangles_max, *out_scene);
        return RESULT_OK;
    } catch (const gltf_refusal &why) {
        result = fail(err, why.code, "%s", why.text.c_str());
    } catch (const std::exception &why) {
        result = fail(err, RESULT_FORMAT, "not readable as glTF: %s", why.what());
    }
    free(out_scene->positions);
    *out_scene = {};
    return result;
}
