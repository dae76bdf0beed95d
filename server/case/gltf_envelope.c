#include "base/bytes.h"
#include "case/gltf.h"

#include <jansson.h>
#include <string.h>

#define MAGIC 0x46546c67u      // "glTF"
#define CHUNK_JSON 0x4e4f534au // "JSON"
#define CHUNK_BIN 0x004e4942u  // "BIN\0"
#define JSON_BYTES_MAX ((size_t)4 << 20)

struct chunk {
    const uint8_t *data;
    uint32_t size;
};

static enum result read_chunk(struct reader *r, uint32_t type, const char *name,
                              struct chunk *out_chunk, struct error *err) {
    size_t at = r->used;
    uint32_t size = read_u32(r), found = read_u32(r);
    const uint8_t *data = read_bytes(r, size);
    if (r->underflow)
        return fail(err, RESULT_FORMAT,
                    "the %s chunk at byte %zu says %u bytes, the file ends before", name, at, size);
    if (found != type)
        return fail(err, RESULT_FORMAT, "the chunk at byte %zu is not %s", at, name);
    if (size % 4 != 0)
        return fail(err, RESULT_FORMAT, "the %s chunk has %u bytes, not a multiple of 4", name,
                    size);
    *out_chunk = (struct chunk){data, size};
    return RESULT_OK;
}

// bin: NULL in a text file, which bounds the data that it holds.
static enum result check_buffers(const json_t *root, const struct chunk *bin, struct error *err) {
    const json_t *buffers = json_object_get(root, "buffers");
    if (json_array_size(buffers) != 1)
        return fail(err, RESULT_FORMAT, "buffers: %zu where one is needed",
                    json_array_size(buffers));
    const json_t *buffer = json_array_get(buffers, 0);
    const char *uri = json_string_value(json_object_get(buffer, "uri"));
    if (bin ? json_object_get(buffer, "uri") != NULL : !uri || strncmp(uri, "data:", 5) != 0)
        return fail(err, RESULT_REFUSED, "buffers[0].uri: the data must be inside the file");
    const json_t *length = json_object_get(buffer, "byteLength");
    if (!json_is_integer(length) || json_integer_value(length) < 1 ||
        json_integer_value(length) > (json_int_t)(bin ? bin->size : strlen(uri)))
        return fail(err, RESULT_FORMAT, "buffers[0].byteLength is not within the %s's %zu",
                    bin ? "BIN chunk" : "URI", bin ? (size_t)bin->size : strlen(uri));
    return RESULT_OK;
}

// tinygltf takes 0 for what is not a whole number from 0 on.
static enum result check_whole_numbers(const json_t *root, const char *list, struct error *err) {
    static const char *const keys[] = {"buffer",     "byteOffset", "byteLength",   "byteStride",
                                       "bufferView", "count",      "componentType"};
    size_t index;
    const json_t *object;
    json_array_foreach(json_object_get(root, list), index, object) {
        for (size_t i = 0; i < sizeof keys / sizeof keys[0]; i++) {
            const json_t *value = json_object_get(object, keys[i]);
            if (value && (!json_is_integer(value) || json_integer_value(value) < 0))
                return fail(err, RESULT_FORMAT, "%s[%zu].%s: not a whole number from 0 on", list,
                            index, keys[i]);
        }
    }
    return RESULT_OK;
}

// "2.MINOR", and nothing newer needed than 2.0.
static enum result check_asset(const json_t *root, struct error *err) {
    const json_t *asset = json_object_get(root, "asset");
    const char *version = json_string_value(json_object_get(asset, "version"));
    const char *needed = json_string_value(json_object_get(asset, "minVersion"));
    if (!version || strncmp(version, "2.", 2) != 0 || !version[2] ||
        version[2 + strspn(version + 2, "0123456789")])
        return fail(err, RESULT_VERSION, "asset.version: %.20s, where 2.0 is read here",
                    version ? version : "none");
    if (needed && strcmp(needed, "2.0") != 0)
        return fail(err, RESULT_VERSION, "asset.minVersion: %.20s, where 2.0 is read here", needed);
    return RESULT_OK;
}

static enum result check_lists(const json_t *root, struct error *err) {
    static const char *const lists[] = {"accessors", "bufferViews", "buffers", "meshes", "nodes"};
    for (size_t i = 0; i < sizeof lists / sizeof lists[0]; i++) {
        const json_t *list = json_object_get(root, lists[i]);
        if (list && !json_is_array(list))
            return fail(err, RESULT_FORMAT, "%s: not a list", lists[i]);
    }
    return RESULT_OK;
}

static enum result check_root(const json_t *root, const struct chunk *bin, struct error *err) {
    if (!json_is_object(root))
        return fail(err, RESULT_FORMAT, "the JSON chunk is not an object");
    const json_t *required = json_object_get(root, "extensionsRequired");
    if (required) {
        const char *name = json_string_value(json_array_get(required, 0));
        return fail(err, RESULT_REFUSED, "needs the extension %.80s, which is not read here",
                    name ? name : "(unnamed)");
    }
    if (json_object_get(root, "images"))
        return fail(err, RESULT_REFUSED, "images: they are not read here");
    enum result result = check_asset(root, err);
    if (result == RESULT_OK)
        result = check_lists(root, err);
    if (result == RESULT_OK)
        result = check_whole_numbers(root, "accessors", err);
    if (result == RESULT_OK)
        result = check_whole_numbers(root, "bufferViews", err);
    return result == RESULT_OK ? check_buffers(root, bin, err) : result;
}

// Chunks of other types may follow, and are passed over.
static enum result check_further_chunks(struct reader *r, struct error *err) {
    while (r->used < r->size) {
        size_t at = r->used;
        uint32_t size = read_u32(r), type = read_u32(r);
        read_bytes(r, size);
        if (r->underflow)
            return fail(err, RESULT_FORMAT, "the chunk at byte %zu does not end", at);
        if (type == CHUNK_JSON || type == CHUNK_BIN)
            return fail(err, RESULT_FORMAT, "the chunk at byte %zu is a second one of its type",
                        at);
    }
    return RESULT_OK;
}

bool gltf_is_binary(const uint8_t *bytes, size_t size) {
    return size >= 4 && memcmp(bytes, "glTF", 4) == 0;
}

static enum result check_json(const uint8_t *text, size_t size, const struct chunk *bin,
                              struct error *err) {
    json_error_t where;
    json_t *root = json_loadb((const char *)text, size, JSON_REJECT_DUPLICATES, &where);
    if (!root)
        return fail(err, RESULT_FORMAT, "JSON chunk, byte %d: %s", where.position, where.text);
    enum result result = check_root(root, bin, err);
    json_decref(root);
    return result;
}

enum result gltf_check_text(const uint8_t *bytes, size_t size, struct error *err) {
    return check_json(bytes, size, NULL, err);
}

enum result gltf_check_envelope(const uint8_t *bytes, size_t size, struct error *err) {
    struct reader r = {.data = bytes, .size = size};
    uint32_t magic = read_u32(&r), version = read_u32(&r), length = read_u32(&r);
    if (r.underflow || magic != MAGIC)
        return fail(err, RESULT_FORMAT, "not a binary glTF file");
    if (version != 2)
        return fail(err, RESULT_VERSION, "binary glTF version %u, not 2", version);
    if (length != size)
        return fail(err, RESULT_FORMAT, "the header says %u bytes, the file has %zu", length, size);
    struct chunk text, bin;
    enum result result = read_chunk(&r, CHUNK_JSON, "JSON", &text, err);
    if (result == RESULT_OK)
        result = read_chunk(&r, CHUNK_BIN, "BIN", &bin, err);
    if (result == RESULT_OK)
        result = check_further_chunks(&r, err);
    if (result != RESULT_OK)
        return result;
    if (text.size > JSON_BYTES_MAX)
        return fail(err, RESULT_LIMIT, "the JSON chunk has %u bytes, more than %zu", text.size,
                    JSON_BYTES_MAX);
    return check_json(text.data, text.size, &bin, err);
}
