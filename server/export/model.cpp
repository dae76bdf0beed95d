#include "export/model.h"

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <sstream>
#include <tiny_gltf.h>

// All of its memory is the file's: without it there is nothing to be done, as in base/check.h.
struct model {
    tinygltf::Model gltf;
    bool too_large;
};

namespace {

constexpr double mm_per_m = 1000;
constexpr size_t bytes_max = UINT32_MAX - (64u << 20); // with room for the text

float to_metres(double mm) {
    return (float)(mm / mm_per_m);
}

int add_view(model &m, const void *bytes, size_t size, int target) {
    std::vector<unsigned char> &data = m.gltf.buffers[0].data;
    if (size > bytes_max - data.size()) {
        m.too_large = true;
        size = 0;
    }
    tinygltf::BufferView view;
    view.buffer = 0;
    view.byteOffset = data.size();
    view.byteLength = size;
    view.target = target;
    const unsigned char *first = static_cast<const unsigned char *>(bytes);
    data.insert(data.end(), first, first + size);
    m.gltf.bufferViews.push_back(view);
    return (int)m.gltf.bufferViews.size() - 1;
}

// With the least and the largest, as positions and times must have.
int add_floats(model &m, const std::vector<float> &values, int type, int target) {
    size_t axes = (size_t)tinygltf::GetNumComponentsInType((uint32_t)type);
    tinygltf::Accessor accessor;
    accessor.bufferView = add_view(m, values.data(), values.size() * sizeof(float), target);
    accessor.componentType = TINYGLTF_COMPONENT_TYPE_FLOAT;
    accessor.type = type;
    accessor.count = values.size() / axes;
    accessor.minValues.assign(axes, std::numeric_limits<double>::infinity());
    accessor.maxValues.assign(axes, -std::numeric_limits<double>::infinity());
    for (size_t i = 0; i < values.size(); i++) {
        accessor.minValues[i % axes] = std::min(accessor.minValues[i % axes], (double)values[i]);
        accessor.maxValues[i % axes] = std::max(accessor.maxValues[i % axes], (double)values[i]);
    }
    m.gltf.accessors.push_back(accessor);
    return (int)m.gltf.accessors.size() - 1;
}

int add_indices(model &m, const std::vector<uint32_t> &indices) {
    tinygltf::Accessor accessor;
    accessor.bufferView = add_view(m, indices.data(), indices.size() * sizeof(uint32_t),
                                   TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER);
    accessor.componentType = TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
    accessor.type = TINYGLTF_TYPE_SCALAR;
    accessor.count = indices.size();
    m.gltf.accessors.push_back(accessor);
    return (int)m.gltf.accessors.size() - 1;
}

int add_mesh(model &m, const char *name, const std::vector<float> &positions,
             const std::vector<uint32_t> &indices, const std::vector<float> &uv, int material) {
    tinygltf::Primitive primitive;
    primitive.mode = TINYGLTF_MODE_TRIANGLES;
    primitive.material = material;
    primitive.attributes["POSITION"] =
        add_floats(m, positions, TINYGLTF_TYPE_VEC3, TINYGLTF_TARGET_ARRAY_BUFFER);
    if (!uv.empty())
        primitive.attributes["TEXCOORD_0"] =
            add_floats(m, uv, TINYGLTF_TYPE_VEC2, TINYGLTF_TARGET_ARRAY_BUFFER);
    primitive.indices = add_indices(m, indices);
    tinygltf::Mesh mesh;
    mesh.name = name;
    mesh.primitives.push_back(primitive);
    m.gltf.meshes.push_back(mesh);
    return (int)m.gltf.meshes.size() - 1;
}

void push_metres(std::vector<float> &out, const float mm[3]) {
    for (int axis = 0; axis < 3; axis++)
        out.push_back(to_metres((double)mm[axis]));
}

void add_channel(model &m, int node, const char *path, int input, int output,
                 const char *interpolation) {
    tinygltf::Animation &animation = m.gltf.animations[0];
    tinygltf::AnimationSampler sampler;
    sampler.input = input;
    sampler.output = output;
    sampler.interpolation = interpolation;
    animation.samplers.push_back(sampler);
    tinygltf::AnimationChannel channel;
    channel.sampler = (int)animation.samplers.size() - 1;
    channel.target_node = node;
    channel.target_path = path;
    animation.channels.push_back(channel);
}

// glTF's order is x, y, z, w, and it wants the length 1 to the last bits of a float.
void push_rotation(std::vector<float> &out, quat q, double sign) {
    double length = std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
    for (double value : {q.x, q.y, q.z, q.w})
        out.push_back((float)(sign * value / length));
}

double dot(quat a, quat b) {
    return a.w * b.w + a.x * b.x + a.y * b.y + a.z * b.z;
}

} // namespace

struct model *model_create(void) {
    struct model *m = new struct model();
    m->gltf.asset.version = "2.0";
    m->gltf.asset.generator = "Arthron " ARTHRON_VERSION;
    m->gltf.asset.extras = tinygltf::Value(tinygltf::Value::Object{});
    m->gltf.buffers.resize(1);
    m->gltf.scenes.resize(1);
    m->gltf.defaultScene = 0;
    m->gltf.animations.resize(1);
    m->gltf.animations[0].name = "session";
    return m;
}

void model_destroy(struct model **m) {
    delete *m;
    *m = nullptr;
}

int model_material(struct model *m, const char *name, const float rgba[4]) {
    tinygltf::Material material;
    material.name = name;
    material.pbrMetallicRoughness.baseColorFactor = {(double)rgba[0], (double)rgba[1],
                                                     (double)rgba[2], (double)rgba[3]};
    material.pbrMetallicRoughness.metallicFactor = 0;
    material.pbrMetallicRoughness.roughnessFactor = 0.6;
    material.alphaMode = rgba[3] < 1 ? "BLEND" : "OPAQUE";
    m->gltf.materials.push_back(material);
    return (int)m->gltf.materials.size() - 1;
}

int model_mesh(struct model *m, const char *name, const struct mesh *mesh, int material) {
    std::vector<float> positions;
    positions.reserve(3 * (size_t)mesh->vertex_count);
    for (size_t i = 0; i < mesh->vertex_count; i++)
        push_metres(positions, mesh->positions + 3 * i);
    std::vector<uint32_t> indices(mesh->triangles,
                                  mesh->triangles + 3 * (size_t)mesh->triangle_count);
    return add_mesh(*m, name, positions, indices, {}, material);
}

int model_textured_mesh(struct model *m, const char *name, const struct mesh *mesh, const float *uv,
                        int material) {
    size_t corners = 3 * (size_t)mesh->triangle_count;
    std::vector<float> positions;
    std::vector<uint32_t> indices(corners);
    positions.reserve(3 * corners);
    for (size_t i = 0; i < corners; i++) {
        push_metres(positions, mesh->positions + 3 * (size_t)mesh->triangles[i]);
        indices[i] = (uint32_t)i;
    }
    return add_mesh(*m, name, positions, indices, std::vector<float>(uv, uv + 2 * corners),
                    material);
}

int model_node(struct model *m, const char *name, int parent, int mesh) {
    tinygltf::Node node;
    node.name = name;
    node.mesh = mesh;
    m->gltf.nodes.push_back(node);
    int index = (int)m->gltf.nodes.size() - 1;
    if (parent == MODEL_NONE)
        m->gltf.scenes[0].nodes.push_back(index);
    else
        m->gltf.nodes[(size_t)parent].children.push_back(index);
    return index;
}

void model_place(struct model *m, int node, pose T) {
    quat q = T.rotation;
    m->gltf.nodes[(size_t)node].rotation = {q.x, q.y, q.z, q.w};
    m->gltf.nodes[(size_t)node].translation = {
        T.translation.x / mm_per_m, T.translation.y / mm_per_m, T.translation.z / mm_per_m};
}

void model_note(struct model *m, const char *key, const char *text) {
    m->gltf.asset.extras.Get<tinygltf::Value::Object>()[key] = tinygltf::Value(std::string(text));
}

int model_times(struct model *m, const float *seconds, uint32_t count) {
    return add_floats(*m, std::vector<float>(seconds, seconds + count), TINYGLTF_TYPE_SCALAR, 0);
}

void model_move(struct model *m, int node, int times, const pose *poses, uint32_t count) {
    std::vector<float> translations, rotations;
    double sign = 1;
    for (uint32_t i = 0; i < count; i++) {
        const vec3 t = poses[i].translation;
        if (i > 0 && dot(poses[i - 1].rotation, poses[i].rotation) < 0)
            sign = -sign;
        for (double mm : {t.x, t.y, t.z})
            translations.push_back(to_metres(mm));
        push_rotation(rotations, poses[i].rotation, sign);
    }
    add_channel(*m, node, "translation", times, add_floats(*m, translations, TINYGLTF_TYPE_VEC3, 0),
                "LINEAR");
    add_channel(*m, node, "rotation", times, add_floats(*m, rotations, TINYGLTF_TYPE_VEC4, 0),
                "LINEAR");
}

void model_show(struct model *m, int node, int times, const bool *shown, uint32_t count) {
    std::vector<float> scales;
    for (uint32_t i = 0; i < count; i++)
        scales.insert(scales.end(), 3, shown[i] ? 1.0F : 0.0F);
    add_channel(*m, node, "scale", times, add_floats(*m, scales, TINYGLTF_TYPE_VEC3, 0), "STEP");
}

enum result model_encode(const struct model *m, uint8_t **out_bytes, size_t *out_size,
                         struct error *err) {
    if (m->too_large)
        return fail(err, RESULT_LIMIT, "more than 4 GiB; a shorter time holds less");
    try {
        std::ostringstream stream;
        tinygltf::TinyGLTF writer;
        if (!writer.WriteGltfSceneToStream(const_cast<tinygltf::Model *>(&m->gltf), stream, false,
                                           true))
            return fail(err, RESULT_IO, "could not be made");
        std::string made = stream.str();
        *out_bytes = static_cast<uint8_t *>(malloc(made.size()));
        if (!*out_bytes)
            return fail(err, RESULT_LIMIT, "%zu bytes are more than the memory", made.size());
        memcpy(*out_bytes, made.data(), made.size());
        *out_size = made.size();
        return RESULT_OK;
    } catch (const std::exception &why) {
        return fail(err, RESULT_LIMIT, "%s", why.what());
    }
}
