#include "base/check.h"
#include "case/case.h"
#include "case/files.h"
#include "case/gltf.h"
#include "case/manifest.h"

#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <xxhash.h>

#define MANIFEST_FILE "case.json"
#define ANATOMY_FILE "anatomy.glb"

static uint64_t hash_of_both(const void *manifest, size_t manifest_size, const void *anatomy,
                             size_t anatomy_size) {
    XXH3_state_t *state = XXH3_createState();
    CHECK(state);
    XXH3_64bits_reset(state);
    XXH3_64bits_update(state, manifest, manifest_size);
    XXH3_64bits_update(state, anatomy, anatomy_size);
    uint64_t hash = XXH3_64bits_digest(state);
    XXH3_freeState(state);
    return hash;
}

// ---- loading ------------------------------------------------------------------------------------

struct case_bytes {
    uint8_t *manifest, *anatomy;
    size_t manifest_size, anatomy_size;
};

// The group that "group" or "group/part" names, and the part.
static struct case_group *group_of_node(struct knee_case *knee, const char *node,
                                        const char **out_part) {
    char name[GLTF_NAME_MAX];
    snprintf(name, sizeof name, "%s", node);
    char *slash = strchr(name, '/');
    *out_part = slash ? node + (slash - name) + 1 : node;
    if (slash)
        *slash = '\0';
    return case_group(knee, name);
}

static void take_displacement(const struct case_group *group, float *into, const float *from) {
    const struct case_part *part = &group->parts[group->part_count - 1];
    memcpy(into + 3 * (size_t)part->first_vertex, from,
           3 * (size_t)part->vertex_count * sizeof *into);
}

static enum result take_shares(const struct case_group *group, const struct gltf_node *node,
                               struct error *err) {
    if (group->bridges != !!node->other_share)
        return fail(err, RESULT_FORMAT, "node %.80s: %s", node->name,
                    group->bridges ? "_OTHER_SHARE is missing, which a group that bridges needs"
                                   : "_OTHER_SHARE of a group that bridges nothing");
    const struct case_part *part = &group->parts[group->part_count - 1];
    if (group->bridges)
        memcpy(group->other_share + part->first_vertex, node->other_share,
               part->vertex_count * sizeof *group->other_share);
    return RESULT_OK;
}

static enum result take_node(struct knee_case *knee, const struct gltf_node *node,
                             uint32_t group_triangles, struct error *err) {
    const char *part;
    struct case_group *group = group_of_node(knee, node->name, &part);
    if (!group)
        return fail(err, RESULT_FORMAT, "node %.80s: the manifest has no such group", node->name);
    if (node->triangle_count > group_triangles - group->mesh.triangle_count)
        return fail(err, RESULT_LIMIT, "node %.80s: the group has more than %u triangles",
                    node->name, group_triangles);
    // A mesh has no const members, and case_add_part only reads it.
    struct mesh mesh = {.vertex_count = node->vertex_count,
                        .triangle_count = node->triangle_count,
                        .positions = (float *)node->positions,
                        .triangles = (uint32_t *)node->triangles};
    enum result result = case_add_part(group, part, &mesh, err);
    if (result != RESULT_OK)
        return fail_in(err, result, "node %.80s: ", node->name);
    if (node->warp)
        take_displacement(group, case_group_need_warp(group), node->warp);
    if (node->maxcut)
        take_displacement(group, case_group_need_maxcut(group), node->maxcut);
    if (node->covered)
        memcpy(case_group_need_covered(group) + group->parts[group->part_count - 1].first_vertex,
               node->covered, node->vertex_count * sizeof *group->covered);
    if (node->wear)
        memcpy(case_group_need_wear(group) + group->parts[group->part_count - 1].first_vertex,
               node->wear, node->vertex_count * sizeof *group->wear);
    return take_shares(group, node, err);
}

static enum result take_anatomy(struct knee_case *knee, const struct case_bytes *bytes,
                                const struct case_limits *limits, struct error *err) {
    struct gltf_limits gltf_limits = {.nodes = CASE_GROUPS_MAX * CASE_PARTS_MAX,
                                      .triangles = limits->group_triangles};
    struct gltf *gltf;
    enum result result = gltf_decode(bytes->anatomy, bytes->anatomy_size, &gltf_limits, &gltf, err);
    if (result != RESULT_OK)
        return result;
    for (uint32_t i = 0; result == RESULT_OK && i < gltf_node_count(gltf); i++)
        result = take_node(knee, gltf_at(gltf, i), limits->group_triangles, err);
    gltf_destroy(&gltf);
    return result;
}

static enum result build(const char *dir, const struct case_bytes *bytes,
                         const struct case_limits *limits, struct knee_case **out_case,
                         struct error *err) {
    uint64_t anatomy_hash;
    uint64_t hash =
        hash_of_both(bytes->manifest, bytes->manifest_size, bytes->anatomy, bytes->anatomy_size);
    if (limits->hash && limits->hash != hash)
        return fail(err, RESULT_CORRUPT, "%s: the case was changed while it was read", dir);
    enum result result = manifest_read((const char *)bytes->manifest, bytes->manifest_size,
                                       out_case, &anatomy_hash, err);
    if (result != RESULT_OK)
        return fail_in(err, result, "%s/" MANIFEST_FILE ": ", dir);
    if (anatomy_hash && anatomy_hash != XXH3_64bits(bytes->anatomy, bytes->anatomy_size))
        return fail(err, RESULT_CORRUPT,
                    "%s/" ANATOMY_FILE ": not the file that anatomy_xxh3 of " MANIFEST_FILE
                    " speaks of (take the key out where the file was changed on purpose)",
                    dir);
    result = take_anatomy(*out_case, bytes, limits, err);
    if (result != RESULT_OK)
        return fail_in(err, result, "%s/" ANATOMY_FILE ": ", dir);
    result = case_validate(*out_case, err);
    if (result != RESULT_OK)
        return fail_in(err, result, "%s: ", dir);
    (*out_case)->hash = hash;
    return RESULT_OK;
}

static enum result read_both(const char *dir, size_t max_bytes, struct case_bytes *out_bytes,
                             struct error *err) {
    char path[PATH_MAX];
    snprintf(path, sizeof path, "%s/" MANIFEST_FILE, dir);
    enum result result =
        files_read(path, max_bytes, &out_bytes->manifest, &out_bytes->manifest_size, err);
    if (result != RESULT_OK)
        return result;
    snprintf(path, sizeof path, "%s/" ANATOMY_FILE, dir);
    return files_read(path, max_bytes, &out_bytes->anatomy, &out_bytes->anatomy_size, err);
}

enum result case_load(const char *dir, const struct case_limits *limits,
                      struct knee_case **out_case, struct error *err) {
    struct case_limits defaults = case_limits_default();
    struct case_bytes bytes = {0};
    *out_case = NULL;
    if (!limits)
        limits = &defaults;
    enum result result = read_both(dir, limits->file_bytes, &bytes, err);
    if (result == RESULT_OK)
        result = build(dir, &bytes, limits, out_case, err);
    if (result != RESULT_OK)
        case_destroy(out_case);
    free(bytes.manifest);
    free(bytes.anatomy);
    return result;
}

enum result case_load_checked(const char *dir, case_checker check, struct knee_case **out_case,
                              struct error *err) {
    struct case_limits limits = case_limits_default();
    *out_case = NULL;
    enum result result = check ? check(dir, &limits.hash, err) : RESULT_OK;
    return result == RESULT_OK ? case_load(dir, &limits, out_case, err) : result;
}

// ---- saving -------------------------------------------------------------------------------------

// A part as a node; its triangles count from the group's first vertex and are moved into `indices`.
static struct gltf_node node_of_part(const struct case_group *group, const struct case_part *part,
                                     uint32_t *indices) {
    size_t vertex = 3 * (size_t)part->first_vertex, corner = 3 * (size_t)part->first_triangle;
    for (size_t i = 0; i < 3 * (size_t)part->triangle_count; i++)
        indices[i] = group->mesh.triangles[corner + i] - part->first_vertex;
    struct gltf_node node = {
        .vertex_count = part->vertex_count,
        .triangle_count = part->triangle_count,
        .positions = group->mesh.positions + vertex,
        .triangles = indices,
        .warp = group->warp ? group->warp + vertex : NULL,
        .maxcut = group->maxcut ? group->maxcut + vertex : NULL,
        .other_share = group->bridges ? group->other_share + part->first_vertex : NULL,
        .covered = group->covered ? group->covered + part->first_vertex : NULL,
        .wear = group->wear ? group->wear + part->first_vertex : NULL,
    };
    if (strcmp(group->name, part->name) == 0)
        snprintf(node.name, sizeof node.name, "%s", group->name);
    else
        snprintf(node.name, sizeof node.name, "%s/%s", group->name, part->name);
    return node;
}

static enum result encode_anatomy(const struct knee_case *knee, struct case_bytes *out_bytes,
                                  struct error *err) {
    size_t corners = 0;
    for (int i = 0; i < knee->group_count; i++)
        corners += 3 * (size_t)knee->groups[i].mesh.triangle_count;
    uint32_t *indices = alloc(corners, sizeof *indices), *next = indices;
    struct gltf_node *nodes = alloc(CASE_GROUPS_MAX * CASE_PARTS_MAX, sizeof *nodes);
    uint32_t count = 0;
    for (int i = 0; i < knee->group_count; i++) {
        const struct case_group *group = &knee->groups[i];
        for (int k = 0; k < group->part_count; k++) {
            nodes[count++] = node_of_part(group, &group->parts[k], next);
            next += 3 * (size_t)group->parts[k].triangle_count;
        }
    }
    enum result result =
        gltf_encode(nodes, count, &out_bytes->anatomy, &out_bytes->anatomy_size, err);
    free(nodes);
    free(indices);
    return result;
}

static enum result encode(const struct knee_case *knee, struct case_bytes *out_bytes,
                          struct error *err) {
    enum result result = encode_anatomy(knee, out_bytes, err);
    if (result != RESULT_OK)
        return fail_in(err, result, ANATOMY_FILE ": ");
    uint64_t hash = XXH3_64bits(out_bytes->anatomy, out_bytes->anatomy_size);
    char *text = manifest_write(knee, hash);
    if (!text)
        return fail(err, RESULT_INVALID, MANIFEST_FILE ": the title is not UTF-8");
    out_bytes->manifest = (uint8_t *)text;
    out_bytes->manifest_size = strlen(text);
    return RESULT_OK;
}

enum result case_save(struct knee_case *knee, const char *dir, struct error *err) {
    enum result result = case_validate(knee, err);
    if (result != RESULT_OK)
        return fail_in(err, result, "case %s: ", knee->name);
    struct case_bytes bytes = {0};
    result = encode(knee, &bytes, err);
    if (result == RESULT_OK) {
        struct named_bytes files[] = {{ANATOMY_FILE, bytes.anatomy, bytes.anatomy_size},
                                      {MANIFEST_FILE, bytes.manifest, bytes.manifest_size}};
        result = files_write(dir, files, 2, err);
    } else {
        fail_in(err, result, "%s: ", dir);
    }
    if (result == RESULT_OK)
        knee->hash =
            hash_of_both(bytes.manifest, bytes.manifest_size, bytes.anatomy, bytes.anatomy_size);
    free(bytes.manifest);
    free(bytes.anatomy);
    return result;
}
