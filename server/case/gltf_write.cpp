#include "case/gltf_parts.hpp"

#include <cstdlib>
#include <cstring>
#include <limits>
#include <sstream>
#include <tiny_gltf.h>

namespace {

float to_metres(float mm) {
    return (float)((double)mm / gltf_mm_per_m);
}

int add_view(tinygltf::Model &model, const void *bytes, size_t size, int target) {
    std::vector<unsigned char> &data = model.buffers[0].data;
    tinygltf::BufferView view;
    view.buffer = 0;
    view.byteOffset = data.size();
    view.byteLength = size;
    view.target = target;
    const unsigned char *first = static_cast<const unsigned char *>(bytes);
    data.insert(data.end(), first, first + size);
    model.bufferViews.push_back(view);
    return (int)model.bufferViews.size() - 1;
}

int add_accessor(tinygltf::Model &model, tinygltf::Accessor &accessor) {
    accessor.byteOffset = 0;
    model.accessors.push_back(accessor);
    return (int)model.accessors.size() - 1;
}

int add_vectors(tinygltf::Model &model, const float *mm, size_t count) {
    std::vector<float> metres(3 * count);
    tinygltf::Accessor accessor;
    accessor.minValues.assign(3, std::numeric_limits<double>::infinity());
    accessor.maxValues.assign(3, -std::numeric_limits<double>::infinity());
    for (size_t i = 0; i < metres.size(); i++) {
        metres[i] = to_metres(mm[i]);
        accessor.minValues[i % 3] = std::min(accessor.minValues[i % 3], (double)metres[i]);
        accessor.maxValues[i % 3] = std::max(accessor.maxValues[i % 3], (double)metres[i]);
    }
    accessor.bufferView = add_view(model, metres.data(), metres.size() * sizeof metres[0],
                                   TINYGLTF_TARGET_ARRAY_BUFFER);
    accessor.componentType = TINYGLTF_COMPONENT_TYPE_FLOAT;
    accessor.type = TINYGLTF_TYPE_VEC3;
    accessor.count = count;
    return add_accessor(model, accessor);
}

template <typename Number>
int add_numbers(tinygltf::Model &model, const Number *values, size_t count, int type, int target) {
    tinygltf::Accessor accessor;
    accessor.bufferView = add_view(model, values, count * sizeof *values, target);
    accessor.componentType = type;
    accessor.type = TINYGLTF_TYPE_SCALAR;
    accessor.count = count;
    return add_accessor(model, accessor);
}

int add_floats(tinygltf::Model &model, const float *values, size_t count) {
    return add_numbers(model, values, count, TINYGLTF_COMPONENT_TYPE_FLOAT,
                       TINYGLTF_TARGET_ARRAY_BUFFER);
}

int add_indices(tinygltf::Model &model, const uint32_t *indices, size_t count) {
    return add_numbers(model, indices, count, TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT,
                       TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER);
}

void add_targets(tinygltf::Model &model, const gltf_node &node, tinygltf::Mesh &mesh) {
    tinygltf::Value::Array names;
    auto add = [&](const char *name, const float *values) {
        if (!values)
            return;
        names.push_back(tinygltf::Value(std::string(name)));
        mesh.primitives[0].targets.push_back(
            {{"POSITION", add_vectors(model, values, node.vertex_count)}});
        mesh.weights.push_back(0);
    };
    add("warp", node.warp);
    add("maxcut", node.maxcut);
    if (!names.empty())
        mesh.extras = tinygltf::Value(
            tinygltf::Value::Object{{"targetNames", tinygltf::Value(std::move(names))}});
}

void add_node(tinygltf::Model &model, const gltf_node &from) {
    tinygltf::Mesh mesh;
    mesh.name = from.name;
    mesh.primitives.resize(1);
    tinygltf::Primitive &primitive = mesh.primitives[0];
    primitive.mode = TINYGLTF_MODE_TRIANGLES;
    primitive.attributes["POSITION"] = add_vectors(model, from.positions, from.vertex_count);
    primitive.indices = add_indices(model, from.triangles, 3 * (size_t)from.triangle_count);
    add_targets(model, from, mesh);
    if (from.other_share)
        primitive.attributes[gltf_other_share] =
            add_floats(model, from.other_share, from.vertex_count);
    if (from.covered)
        primitive.attributes[gltf_covered] = add_floats(model, from.covered, from.vertex_count);
    if (from.wear)
        primitive.attributes[gltf_wear] = add_floats(model, from.wear, from.vertex_count);
    model.meshes.push_back(std::move(mesh));
    tinygltf::Node node;
    node.name = from.name;
    node.mesh = (int)model.meshes.size() - 1;
    model.nodes.push_back(std::move(node));
    model.scenes[0].nodes.push_back((int)model.nodes.size() - 1);
}

std::string encode(const gltf_node *nodes, uint32_t count) {
    uint64_t total = 0;
    for (uint32_t i = 0; i < count; i++)
        total += 12 * ((uint64_t)nodes[i].triangle_count +
                       nodes[i].vertex_count * (uint64_t)(1 + !!nodes[i].warp + !!nodes[i].maxcut +
                                                          !!nodes[i].other_share +
                                                          !!nodes[i].covered + !!nodes[i].wear));
    if (total > UINT32_MAX - (64u << 20))
        throw gltf_refusal{RESULT_LIMIT, "more than 4 GiB"};
    tinygltf::Model model;
    model.asset.version = "2.0";
    model.asset.generator = "Arthron " ARTHRON_VERSION;
    model.buffers.resize(1);
    model.buffers[0].data.reserve(total);
    model.scenes.resize(1);
    model.defaultScene = 0;
    for (uint32_t i = 0; i < count; i++)
        add_node(model, nodes[i]);
    std::ostringstream stream;
    tinygltf::TinyGLTF writer;
    if (!writer.WriteGltfSceneToStream(&model, stream, false, true))
        throw gltf_refusal{RESULT_IO, "could not be made"};
    return stream.str();
}

} // namespace

enum result gltf_encode(const struct gltf_node *nodes, uint32_t count, uint8_t **out_bytes,
                        size_t *out_size, struct error *err) {
    try {
        std::string made = encode(nodes, count);
        *out_bytes = static_cast<uint8_t *>(malloc(made.size()));
        if (!*out_bytes)
            return fail(err, RESULT_LIMIT, "%zu bytes are more than the memory", made.size());
        memcpy(*out_bytes, made.data(), made.size());
        *out_size = made.size();
        return RESULT_OK;
    } catch (const gltf_refusal &why) {
        return fail(err, why.code, "%s", why.text.c_str());
    } catch (const std::exception &why) {
        return fail(err, RESULT_LIMIT, "%s", why.what());
    }
}
