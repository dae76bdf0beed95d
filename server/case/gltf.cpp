#include "case/gltf_parts.hpp"

#include <cstring>
#include <set>
#include <tiny_gltf.h>

struct gltf {
    struct loaded_node {
        gltf_node view;
        std::vector<float> positions, warp, maxcut, other_share, covered, wear;
        std::vector<uint32_t> triangles;
    };
    std::vector<loaded_node> nodes;
};

namespace {

using loaded_node = gltf::loaded_node;

float to_mm(float metres) {
    return (float)((double)metres * gltf_mm_per_m);
}

gltf_elements locate_vectors(const tinygltf::Model &model, int index, const char *name) {
    return gltf_locate_floats(model, index, TINYGLTF_TYPE_VEC3, name);
}

std::vector<float> read_vectors(const gltf_elements &from) {
    std::vector<float> values(3 * from.count);
    for (size_t i = 0; i < from.count; i++) {
        float metres[3];
        memcpy(metres, from.first + i * from.stride, sizeof metres);
        for (size_t axis = 0; axis < 3; axis++)
            values[3 * i + axis] = to_mm(metres[axis]);
    }
    return values;
}

void read_target(const tinygltf::Model &model, const std::map<std::string, int> &target,
                 const std::string &name, loaded_node &node) {
    std::vector<float> *values = name == "warp"     ? &node.warp
                                 : name == "maxcut" ? &node.maxcut
                                                    : nullptr;
    if (!values)
        throw gltf_refusal{RESULT_REFUSED,
                           "morph target \"" + name.substr(0, 80) + "\": neither warp nor maxcut"};
    if (!values->empty())
        throw gltf_refusal{RESULT_FORMAT, "morph target " + name + ": there are two"};
    auto position = target.find("POSITION");
    if (position == target.end())
        throw gltf_refusal{RESULT_FORMAT, "morph target " + name + ": no POSITION"};
    gltf_elements from = locate_vectors(model, position->second, ("morph target " + name).c_str());
    if (from.count != node.view.vertex_count)
        throw gltf_refusal{RESULT_FORMAT, "morph target " + name + " (accessor " +
                                              std::to_string(position->second) +
                                              "): " + std::to_string(from.count) + " vectors for " +
                                              std::to_string(node.view.vertex_count) + " vertices"};
    *values = read_vectors(from);
}

void read_targets(const tinygltf::Model &model, const tinygltf::Mesh &mesh, loaded_node &node) {
    const auto &targets = mesh.primitives[0].targets;
    if (targets.empty())
        return;
    const tinygltf::Value &names =
        mesh.extras.IsObject() ? mesh.extras.Get("targetNames") : mesh.extras;
    if (!names.IsArray() || names.ArrayLen() != targets.size())
        throw gltf_refusal{RESULT_FORMAT, "extras.targetNames does not name the morph targets"};
    for (size_t i = 0; i < targets.size(); i++) {
        const tinygltf::Value &name = names.Get((int)i);
        read_target(model, targets[i], name.IsString() ? name.Get<std::string>() : "", node);
    }
}

// One float for each vertex; nothing where there is no such attribute.
std::vector<float> read_attribute(const tinygltf::Model &model,
                                  const tinygltf::Primitive &primitive, const char *name,
                                  uint32_t vertex_count) {
    auto attribute = primitive.attributes.find(name);
    if (attribute == primitive.attributes.end())
        return {};
    int index = attribute->second;
    gltf_elements from = gltf_locate_floats(model, index, TINYGLTF_TYPE_SCALAR, name);
    if (from.count != vertex_count)
        throw gltf_refusal{RESULT_FORMAT, gltf_accessor_name(name, index) + ": " +
                                              std::to_string(from.count) + " numbers for " +
                                              std::to_string(vertex_count) + " vertices"};
    std::vector<float> values(from.count);
    for (size_t i = 0; i < from.count; i++)
        memcpy(&values[i], from.first + i * from.stride, sizeof(float));
    return values;
}

void refuse_transform(const tinygltf::Node &node) {
    static const std::vector<double> identity = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    auto differs = [](const std::vector<double> &value, const std::vector<double> &from) {
        return !value.empty() && value != from;
    };
    if (differs(node.matrix, identity) || differs(node.translation, {0, 0, 0}) ||
        differs(node.rotation, {0, 0, 0, 1}) || differs(node.scale, {1, 1, 1}))
        throw gltf_refusal{RESULT_REFUSED, "the node has a transform; apply it to the mesh"};
}

const tinygltf::Primitive &only_primitive(const tinygltf::Mesh &mesh) {
    if (mesh.primitives.size() != 1)
        throw gltf_refusal{RESULT_REFUSED, std::to_string(mesh.primitives.size()) +
                                               " primitives where one is needed"};
    const tinygltf::Primitive &primitive = mesh.primitives[0];
    if (primitive.mode != TINYGLTF_MODE_TRIANGLES)
        throw gltf_refusal{RESULT_REFUSED, "the primitive is not made of triangles"};
    if (primitive.indices < 0)
        throw gltf_refusal{RESULT_REFUSED, "the primitive has no indices"};
    if (!primitive.attributes.count("POSITION"))
        throw gltf_refusal{RESULT_FORMAT, "the primitive has no POSITION"};
    return primitive;
}

void read_node(const tinygltf::Model &model, const tinygltf::Node &from, uint32_t triangles_max,
               loaded_node &node) {
    refuse_transform(from);
    if (from.mesh < 0 || (size_t)from.mesh >= model.meshes.size())
        throw gltf_refusal{RESULT_FORMAT, "there is no mesh " + std::to_string(from.mesh)};
    const tinygltf::Mesh &mesh = model.meshes[from.mesh];
    const tinygltf::Primitive &primitive = only_primitive(mesh);
    node.triangles = gltf_read_indices(model, primitive.indices, triangles_max);
    int index = primitive.attributes.at("POSITION");
    gltf_elements positions = locate_vectors(model, index, "POSITION");
    if (positions.count > 3 * (uint64_t)triangles_max || positions.count > UINT32_MAX / 3)
        throw gltf_refusal{RESULT_LIMIT, gltf_accessor_name("POSITION", index) + ": " +
                                             std::to_string(positions.count) +
                                             " vertices are too many"};
    node.positions = read_vectors(positions);
    node.view.vertex_count = (uint32_t)positions.count;
    node.view.triangle_count = (uint32_t)(node.triangles.size() / 3);
    read_targets(model, mesh, node);
    node.other_share = read_attribute(model, primitive, gltf_other_share, node.view.vertex_count);
    node.covered = read_attribute(model, primitive, gltf_covered, node.view.vertex_count);
    node.wear = read_attribute(model, primitive, gltf_wear, node.view.vertex_count);
}

void publish(loaded_node &node) {
    node.view.positions = node.positions.data();
    node.view.triangles = node.triangles.data();
    node.view.warp = node.warp.empty() ? nullptr : node.warp.data();
    node.view.maxcut = node.maxcut.empty() ? nullptr : node.maxcut.data();
    node.view.other_share = node.other_share.empty() ? nullptr : node.other_share.data();
    node.view.covered = node.covered.empty() ? nullptr : node.covered.data();
    node.view.wear = node.wear.empty() ? nullptr : node.wear.data();
}

// A mesh for two nodes would cost memory that the file's size does not bound.
const std::vector<size_t> nodes_with_mesh(const tinygltf::Model &model, uint32_t nodes_max) {
    std::vector<size_t> nodes;
    std::set<int> meshes;
    for (size_t i = 0; i < model.nodes.size(); i++) {
        const tinygltf::Node &node = model.nodes[i];
        if (!node.children.empty())
            throw gltf_refusal{RESULT_REFUSED, "nodes[" + std::to_string(i) + "] has children"};
        if (node.mesh < 0)
            continue;
        if (!meshes.insert(node.mesh).second)
            throw gltf_refusal{RESULT_REFUSED, "nodes[" + std::to_string(i) + "]: mesh " +
                                                   std::to_string(node.mesh) + " is used twice"};
        nodes.push_back(i);
    }
    if (nodes.size() > nodes_max)
        throw gltf_refusal{RESULT_LIMIT, std::to_string(nodes.size()) +
                                             " nodes with a mesh, more than " +
                                             std::to_string(nodes_max)};
    return nodes;
}

} // namespace

static void decode(const uint8_t *bytes, size_t size, const gltf_limits &limits, gltf &out) {
    tinygltf::Model model;
    gltf_load_model(bytes, size, model);
    size_t budget = size;
    for (size_t index : nodes_with_mesh(model, limits.nodes)) {
        const tinygltf::Node &from = model.nodes[index];
        loaded_node node{};
        try {
            if (from.name.empty() || from.name.size() >= GLTF_NAME_MAX)
                throw gltf_refusal{RESULT_FORMAT, "its name is empty or too long"};
            memcpy(node.view.name, from.name.c_str(), from.name.size() + 1);
            read_node(model, from, limits.triangles, node);
        } catch (const gltf_refusal &why) {
            throw gltf_refusal{why.code, "nodes[" + std::to_string(index) + "] " +
                                             from.name.substr(0, 80) + ": " + why.text};
        }
        // Accessors that share bytes must not multiply them; 16-bit indices double theirs.
        size_t used = (node.positions.size() + node.warp.size() + node.maxcut.size() +
                       node.other_share.size() + node.covered.size() + node.wear.size()) *
                          4 +
                      node.triangles.size() * 2;
        if (used > budget)
            throw gltf_refusal{RESULT_LIMIT, "its accessors use the same bytes again and again"};
        budget -= used;
        out.nodes.push_back(std::move(node));
    }
    gltf_check_the_rest(model);
    for (loaded_node &node : out.nodes)
        publish(node);
}

enum result gltf_decode(const uint8_t *bytes, size_t size, const struct gltf_limits *limits,
                        struct gltf **out_gltf, struct error *err) {
    *out_gltf = nullptr;
    enum result result = gltf_check_envelope(bytes, size, err);
    if (result != RESULT_OK)
        return result;
    gltf *made = nullptr;
    try {
        made = new gltf;
        decode(bytes, size, *limits, *made);
        *out_gltf = made;
        return RESULT_OK;
    } catch (const gltf_refusal &why) {
        result = fail(err, why.code, "%s", why.text.c_str());
    } catch (const std::bad_alloc &) {
        result = fail(err, RESULT_LIMIT, "reading it takes more memory than there is");
    } catch (const std::exception &why) {
        result = fail(err, RESULT_FORMAT, "not readable as glTF: %s", why.what());
    }
    delete made;
    return result;
}

void gltf_destroy(struct gltf **gltf) {
    delete *gltf;
    *gltf = nullptr;
}

uint32_t gltf_node_count(const struct gltf *gltf) {
    return (uint32_t)gltf->nodes.size();
}

const struct gltf_node *gltf_at(const struct gltf *gltf, uint32_t index) {
    return &gltf->nodes.at(index).view;
}
