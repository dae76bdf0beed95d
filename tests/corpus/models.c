#include "models.h"

#include "test.h"

#include <fts.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#define BUFFER_MAX (1 << 20)

static const char data_uri[] = "data:application/octet-stream;base64,";

static const char *protocol_folder(char *out, size_t size, const char *name) {
    const char *data = getenv("ARTHRON_DATA");
    snprintf(out, size, "%s/protocol/%s", data ? data : DATA, name);
    return out;
}

bool models_are_here(void) {
    char path[400];
    struct stat status;
    return stat(protocol_folder(path, sizeof path, "gltf_validator"), &status) == 0;
}

static bool ends_with(const char *text, const char *ending) {
    size_t length = strlen(text), end = strlen(ending);
    return length >= end && strcmp(text + length - end, ending) == 0;
}

static void read_report(struct model *model) {
    char path[600];
    snprintf(path, sizeof path, "%s.report.json", model->path);
    json_t *report = json_load_file(path, 0, NULL);
    json_t *issues = json_object_get(report, "issues"), *message;
    size_t index;
    model->errors = report ? (int)json_integer_value(json_object_get(issues, "numErrors")) : -1;
    json_array_foreach(json_object_get(issues, "messages"), index, message) {
        const char *code = json_string_value(json_object_get(message, "code"));
        size_t used = strlen(model->codes);
        if (json_integer_value(json_object_get(message, "severity")) == 0 &&
            !strstr(model->codes, code))
            snprintf(model->codes + used, sizeof model->codes - used, "%s%s", used ? " " : "",
                     code);
    }
    json_decref(report);
}

static int by_name(const FTSENT **a, const FTSENT **b) {
    return strcmp((*a)->fts_name, (*b)->fts_name);
}

static size_t find_in(const char *folder, struct model *models, size_t count) {
    char root[400];
    char *const roots[] = {root, NULL};
    protocol_folder(root, sizeof root, folder);
    FTS *tree = fts_open(roots, FTS_PHYSICAL | FTS_NOCHDIR, by_name);
    for (FTSENT *entry; tree && (entry = fts_read(tree));) {
        if (entry->fts_info != FTS_F ||
            (!ends_with(entry->fts_name, ".gltf") && !ends_with(entry->fts_name, ".glb")))
            continue;
        assert_true(count < MODELS_MAX);
        struct model *model = &models[count++];
        snprintf(model->path, sizeof model->path, "%s", entry->fts_path);
        const char *inside = strstr(model->path, "/base/data/");
        inside = inside ? inside + strlen("/base/data/") : model->path + strlen(root) + 1;
        snprintf(model->name, sizeof model->name, "%s", inside);
        read_report(model);
    }
    fts_close(tree);
    return count;
}

size_t models_find(struct model *out_models) {
    size_t count = find_in("gltf_validator", out_models, 0);
    return find_in("gltf_tinygltf", out_models, count);
}

static struct model_bytes read_path(const char *path) {
    struct model_bytes bytes = {calloc(1, BUFFER_MAX), 0};
    FILE *file = fopen(path, "rb");
    if (file) {
        bytes.size = fread(bytes.data, 1, BUFFER_MAX, file);
        fclose(file);
    }
    return bytes;
}

struct model_bytes model_read(const struct model *model) {
    struct model_bytes bytes = read_path(model->path);
    // To its size, so that a sanitizer sees what reads beyond.
    bytes.data = realloc(bytes.data, bytes.size ? bytes.size : 1);
    return bytes;
}

// ---- completing ---------------------------------------------------------------------------------

static uint32_t u32_at(const uint8_t *p) {
    uint32_t value;
    memcpy(&value, p, 4);
    return value;
}

struct chunks {
    const uint8_t *text, *bin;
    size_t text_size, bin_size;
};

// Both chunks of a GLB, empty where they are not there; all of it is text where it is none.
static struct chunks chunks_of(const struct model_bytes *bytes) {
    struct chunks c = {.text = bytes->data, .text_size = bytes->size};
    if (bytes->size < 20 || memcmp(bytes->data, "glTF", 4) != 0)
        return c;
    size_t size = u32_at(bytes->data + 12), left = bytes->size - 20;
    c.text = bytes->data + 20;
    c.text_size = size < left ? size : left;
    left -= c.text_size;
    if (left < 8)
        return c;
    c.bin = c.text + c.text_size + 8;
    size = u32_at(c.bin - 8);
    c.bin_size = size < left - 8 ? size : left - 8;
    return c;
}

static void add_nodes(json_t *root) {
    json_t *nodes = json_object_get(root, "nodes"), *meshes = json_object_get(root, "meshes");
    json_t *node;
    size_t index;
    if (!nodes && json_is_array(meshes)) {
        nodes = json_array();
        json_object_set_new(root, "nodes", nodes);
        for (size_t i = 0; i < json_array_size(meshes); i++)
            json_array_append_new(nodes, json_pack("{s:i}", "mesh", (int)i));
    }
    json_array_foreach(nodes, index, node) {
        char name[32];
        snprintf(name, sizeof name, "%s/%zu", index % 2 ? "femur" : "tibia", index);
        if (json_is_object(node) && !json_object_get(node, "name"))
            json_object_set_new(node, "name", json_string(name));
    }
}

// The first buffer's bytes: from a file beside the model, of zeros where it has no URI or holds
// them itself. Any other URI stays.
static struct model_bytes first_buffer(json_t *root, const struct chunks *chunks,
                                       const char *path) {
    json_t *buffers = json_object_get(root, "buffers");
    json_t *buffer = json_array_get(buffers, 0);
    if (!buffers)
        json_object_set_new(root, "buffers", json_pack("[{s:i}]", "byteLength", 4));
    json_int_t length = json_integer_value(json_object_get(buffer, "byteLength"));
    const char *uri = json_string_value(json_object_get(buffer, "uri"));
    char beside[1024];
    const char *slash = strrchr(path, '/');
    snprintf(beside, sizeof beside, "%.*s/%s", slash ? (int)(slash - path) : 0, path,
             uri ? uri : "none");
    struct model_bytes bytes = read_path(beside);
    if (chunks->bin_size && chunks->bin_size <= BUFFER_MAX) {
        memcpy(bytes.data, chunks->bin, chunks->bin_size);
        bytes.size = chunks->bin_size;
    } else if (!bytes.size && uri && strncmp(uri, data_uri, strlen(data_uri)) != 0) {
        bytes.size = 4;
        return bytes;
    } else if (!bytes.size) {
        bytes.size = length > 0 && length < BUFFER_MAX ? (size_t)length : 4;
    }
    json_object_del(buffer, "uri");
    return bytes;
}

static size_t put_chunk(uint8_t *out, const char *type, const void *data, size_t size, int fill) {
    uint32_t padded = (uint32_t)(size + 3) / 4 * 4;
    memcpy(out, &padded, 4);
    memcpy(out + 4, type, 4);
    memset(out + 8, fill, padded);
    memcpy(out + 8, data, size);
    return 8 + padded;
}

struct model_bytes model_complete(const struct model_bytes *bytes, const char *path) {
    struct chunks chunks = chunks_of(bytes);
    json_t *root = json_loadb((const char *)chunks.text, chunks.text_size, 0, NULL);
    struct model_bytes bin = {calloc(1, 4), 4};
    char *text = NULL;
    if (json_is_object(root)) {
        add_nodes(root);
        free(bin.data);
        bin = first_buffer(root, &chunks, path);
        text = json_dumps(root, JSON_COMPACT);
    }
    size_t text_size = text ? strlen(text) : chunks.text_size;
    struct model_bytes out = {malloc(12 + 16 + text_size + bin.size + 8), 12};
    out.size += put_chunk(out.data + out.size, "JSON", text ? text : (const void *)chunks.text,
                          text_size, ' ');
    out.size += put_chunk(out.data + out.size, "BIN", bin.data, bin.size, 0);
    uint32_t header[3] = {0x46546c67u, 2, (uint32_t)out.size};
    memcpy(out.data, header, sizeof header);
    out.data = realloc(out.data, out.size);
    json_decref(root);
    free(bin.data);
    free(text);
    return out;
}
