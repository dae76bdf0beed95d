// Accessors of a glTF model, each checked to lie within its view, and the view within the buffer.
#include "case/gltf_parts.hpp"

#include <cstring>
#include <tiny_gltf.h>

namespace {

const tinygltf::Accessor &find_accessor(const tinygltf::Model &model, int index,
                                        const std::string &what) {
    if (index < 0 || (size_t)index >= model.accessors.size())
        throw gltf_refusal{RESULT_FORMAT, what + ": there is no such accessor"};
    const tinygltf::Accessor &accessor = model.accessors[index];
    if (accessor.sparse.isSparse)
        throw gltf_refusal{RESULT_REFUSED, what + ": sparse accessors are not read here"};
    if (accessor.normalized)
        throw gltf_refusal{RESULT_REFUSED, what + ": normalised values are not read here"};
    return accessor;
}

size_t component_size(const tinygltf::Accessor &accessor) {
    return (size_t)tinygltf::GetComponentSizeInBytes((uint32_t)accessor.componentType);
}

size_t element_size(const tinygltf::Accessor &accessor) {
    return component_size(accessor) *
           (size_t)tinygltf::GetNumComponentsInType((uint32_t)accessor.type);
}

// The view lies within the buffer.
void check_view(const tinygltf::Model &model, const tinygltf::BufferView &view,
                const std::string &what) {
    if (view.buffer != 0 || model.buffers.size() != 1)
        throw gltf_refusal{RESULT_FORMAT, what + ": its view is in a missing buffer"};
    const std::vector<unsigned char> &data = model.buffers[0].data;
    if (view.byteOffset > data.size() || view.byteLength > data.size() - view.byteOffset)
        throw gltf_refusal{RESULT_FORMAT, what + ": its view ends after the buffer"};
    if (view.byteLength < 1)
        throw gltf_refusal{RESULT_FORMAT, what + ": its view has no bytes"};
    if (view.byteStride > 252 || view.byteStride > view.byteLength)
        throw gltf_refusal{RESULT_FORMAT,
                           what + ": stride of " + std::to_string(view.byteStride) + " bytes"};
    if (view.byteStride && view.target == TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER)
        throw gltf_refusal{RESULT_FORMAT, what + ": its view is for indices but has a stride"};
}

// Every element of the accessor lies within its view, the view within the buffer.
gltf_elements locate(const tinygltf::Model &model, const tinygltf::Accessor &accessor,
                     const std::string &what) {
    if (accessor.bufferView < 0 || (size_t)accessor.bufferView >= model.bufferViews.size())
        throw gltf_refusal{RESULT_FORMAT, what + ": there is no such buffer view"};
    const tinygltf::BufferView &view = model.bufferViews[accessor.bufferView];
    check_view(model, view, what);
    size_t element = element_size(accessor);
    size_t stride = view.byteStride ? view.byteStride : element;
    if (stride < element)
        throw gltf_refusal{RESULT_FORMAT,
                           what + ": stride of " + std::to_string(stride) + " bytes"};
    if (accessor.count < 1 || accessor.byteOffset > view.byteLength ||
        view.byteLength - accessor.byteOffset < element ||
        accessor.count - 1 > (view.byteLength - accessor.byteOffset - element) / stride)
        throw gltf_refusal{RESULT_FORMAT, what + ": " + std::to_string(accessor.count) +
                                              " elements do not fit into its view"};
    if (accessor.byteOffset % component_size(accessor) != 0 ||
        view.byteOffset % component_size(accessor) != 0)
        throw gltf_refusal{RESULT_FORMAT, what + ": it does not start where its numbers may"};
    const std::vector<unsigned char> &data = model.buffers[0].data;
    return {data.data() + view.byteOffset + accessor.byteOffset, stride, accessor.count};
}

} // namespace

std::string gltf_accessor_name(const char *what, int index) {
    return std::string(what) + " (accessor " + std::to_string(index) + ")";
}

gltf_elements gltf_locate_floats(const tinygltf::Model &model, int index, int type,
                                 const char *name) {
    std::string what = gltf_accessor_name(name, index);
    const tinygltf::Accessor &accessor = find_accessor(model, index, what);
    if (accessor.type != type || accessor.componentType != TINYGLTF_COMPONENT_TYPE_FLOAT)
        throw gltf_refusal{RESULT_REFUSED,
                           what + (type == TINYGLTF_TYPE_VEC3 ? ": not vectors of three floats"
                                                              : ": not single floats")};
    return locate(model, accessor, what);
}

std::vector<uint32_t> gltf_read_indices(const tinygltf::Model &model, int index,
                                        uint32_t triangles_max) {
    std::string what = gltf_accessor_name("indices", index);
    const tinygltf::Accessor &accessor = find_accessor(model, index, what);
    bool wide = accessor.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
    if (accessor.type != TINYGLTF_TYPE_SCALAR ||
        (!wide && accessor.componentType != TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT))
        throw gltf_refusal{RESULT_REFUSED, what + ": not unsigned integers of 16 or 32 bits"};
    gltf_elements from = locate(model, accessor, what);
    if (model.bufferViews[accessor.bufferView].byteStride)
        throw gltf_refusal{RESULT_FORMAT, what + ": its view has a stride"};
    if (from.count % 3 != 0)
        throw gltf_refusal{RESULT_FORMAT,
                           what + ": " + std::to_string(from.count) + " are not whole triangles"};
    if (from.count / 3 > triangles_max)
        throw gltf_refusal{RESULT_LIMIT, what + ": " + std::to_string(from.count / 3) +
                                             " triangles, more than " +
                                             std::to_string(triangles_max)};
    std::vector<uint32_t> values(from.count);
    for (size_t i = 0; i < from.count; i++) {
        uint16_t narrow = 0;
        if (wide)
            memcpy(&values[i], from.first + i * from.stride, 4);
        else {
            memcpy(&narrow, from.first + i * from.stride, 2);
            values[i] = narrow;
        }
    }
    return values;
}

namespace {

std::string first_line(const std::string &text) {
    return text.substr(0, std::min<size_t>(text.find('\n'), 200));
}

} // namespace

void gltf_load_model(const uint8_t *bytes, size_t size, tinygltf::Model &model) {
    tinygltf::TinyGLTF loader;
    std::string error, warning;
    bool read = gltf_is_binary(bytes, size)
                    ? loader.LoadBinaryFromMemory(&model, &error, &warning, bytes, (unsigned)size)
                    : loader.LoadASCIIFromString(&model, &error, &warning, (const char *)bytes,
                                                 (unsigned)size, "");
    if (!read || !error.empty())
        throw gltf_refusal{RESULT_FORMAT,
                           error.empty() ? "not readable as glTF" : first_line(error)};
}

void gltf_check_the_rest(const tinygltf::Model &model) {
    for (size_t i = 0; i < model.bufferViews.size(); i++)
        check_view(model, model.bufferViews[i], "bufferViews[" + std::to_string(i) + "]");
    for (size_t i = 0; i < model.accessors.size(); i++) {
        const tinygltf::Accessor &accessor = model.accessors[i];
        std::string what = "accessors[" + std::to_string(i) + "]";
        if (accessor.bufferView >= 0)
            locate(model, accessor, what);
        else if (accessor.byteOffset)
            throw gltf_refusal{RESULT_FORMAT, what + ": an offset without a buffer view"};
        if (accessor.normalized && (accessor.componentType == TINYGLTF_COMPONENT_TYPE_FLOAT ||
                                    accessor.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT))
            throw gltf_refusal{RESULT_FORMAT, what + ": such numbers cannot be normalised"};
        if (accessor.sparse.isSparse &&
            (accessor.sparse.count < 1 || (size_t)accessor.sparse.count > accessor.count))
            throw gltf_refusal{RESULT_FORMAT, what + ": sparse.count is out of range"};
    }
}
