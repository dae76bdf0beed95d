#include "case/manifest.h"

#include "base/check.h"

#include <jansson.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PATH_MAX_LENGTH 128

// The first refusal stays; everything after it is passed over.
struct manifest {
    enum result result;
    struct error *err;
};

static void refuse(struct manifest *m, enum result code, const char *path, const char *what) {
    if (m->result == RESULT_OK)
        m->result = fail(m->err, code, "%s: %s", path, what);
}

struct object {
    const json_t *json;
    char path[PATH_MAX_LENGTH];
};

static void key_path(const struct object *object, const char *key, char *out_path) {
    snprintf(out_path, PATH_MAX_LENGTH, "%.64s%s%.40s", object->path, object->path[0] ? "." : "",
             key);
}

static struct object open_object(struct manifest *m, const json_t *json, const char *path,
                                 const char *const *keys) {
    struct object object = {.json = json};
    snprintf(object.path, sizeof object.path, "%.127s", path);
    if (!json_is_object(json))
        refuse(m, RESULT_FORMAT, path[0] ? path : "the manifest", "not an object");
    const char *key;
    json_t *value;
    json_object_foreach((json_t *)json, key, value) {
        bool known = false;
        for (const char *const *k = keys; *k && !known; k++)
            known = strcmp(*k, key) == 0;
        char at[PATH_MAX_LENGTH];
        key_path(&object, key, at);
        if (!known)
            refuse(m, RESULT_FORMAT, at, "unknown key");
    }
    return object;
}

static const json_t *need(struct manifest *m, const struct object *object, const char *key) {
    const json_t *value = json_object_get(object->json, key);
    char path[PATH_MAX_LENGTH];
    key_path(object, key, path);
    if (!value)
        refuse(m, RESULT_MISSING, path, "missing");
    return value;
}

static void refuse_key(struct manifest *m, const struct object *object, const char *key,
                       const char *what) {
    char path[PATH_MAX_LENGTH];
    key_path(object, key, path);
    refuse(m, RESULT_INVALID, path, what);
}

static const char *read_string(struct manifest *m, const struct object *object, const char *key) {
    const json_t *value = need(m, object, key);
    if (value && !json_is_string(value))
        refuse_key(m, object, key, "not a text");
    const char *text = json_string_value(value);
    return text ? text : "";
}

static void read_name(struct manifest *m, const struct object *object, const char *key,
                      char *out_name) {
    const char *text = read_string(m, object, key);
    if (case_name_is_valid(text))
        memcpy(out_name, text, strlen(text) + 1);
    else
        refuse_key(m, object, key, "not a name of letters, digits and \"_-.\"");
}

static double read_number(struct manifest *m, const struct object *object, const char *key) {
    const json_t *value = need(m, object, key);
    if (value && !json_is_number(value))
        refuse_key(m, object, key, "not a number");
    return json_number_value(value);
}

static void take_numbers(struct manifest *m, const json_t *array, const char *path,
                         double *out_values, size_t count) {
    bool good = json_array_size(array) == count;
    for (size_t i = 0; i < count; i++) {
        const json_t *value = json_array_get(array, i);
        good = good && json_is_number(value);
        out_values[i] = json_number_value(value);
    }
    char what[48];
    snprintf(what, sizeof what, "not an array of %zu numbers", count);
    if (!good)
        refuse(m, RESULT_INVALID, path, what);
}

static void read_numbers(struct manifest *m, const struct object *object, const char *key,
                         double *out_values, size_t count) {
    char path[PATH_MAX_LENGTH];
    key_path(object, key, path);
    take_numbers(m, need(m, object, key), path, out_values, count);
}

static vec3 vec3_of(struct manifest *m, const struct object *object, const char *key) {
    double v[3];
    read_numbers(m, object, key, v, 3);
    return (vec3){v[0], v[1], v[2]};
}

// From x, y, z, qw, qx, qy, qz.
static pose take_pose(struct manifest *m, const double v[7], const char *path) {
    pose p = {{v[3], v[4], v[5], v[6]}, {v[0], v[1], v[2]}};
    if (!pose_is_valid(p))
        refuse(m, RESULT_INVALID, path, "the quaternion (qw, qx, qy, qz) has not unit length");
    return p;
}

static pose pose_of(struct manifest *m, const struct object *object, const char *key) {
    double v[7];
    char path[PATH_MAX_LENGTH];
    read_numbers(m, object, key, v, 7);
    key_path(object, key, path);
    return take_pose(m, v, path);
}

static void read_joint(struct manifest *m, const struct object *root, struct joint_frame *joint) {
    static const char *const keys[] = {"T_femur_joint", "T_tibia_joint", NULL};
    const char *side = read_string(m, root, "side");
    joint->side = strcmp(side, "left") == 0 ? SIDE_LEFT : SIDE_RIGHT;
    if (joint->side == SIDE_RIGHT && strcmp(side, "right") != 0)
        refuse_key(m, root, "side", "neither left nor right");
    struct object object = open_object(m, need(m, root, "joint"), "joint", keys);
    joint->T_femur_joint = pose_of(m, &object, "T_femur_joint");
    joint->T_tibia_joint = pose_of(m, &object, "T_tibia_joint");
}

static void read_scan(struct manifest *m, const struct object *root, struct knee_case *knee) {
    static const char *const keys[] = {"mirrored", "T_case_scan", NULL};
    const json_t *scan = json_object_get(root->json, "scan");
    if (!scan)
        return;
    struct object object = open_object(m, scan, "scan", keys);
    const json_t *mirrored = need(m, &object, "mirrored");
    if (mirrored && !json_is_boolean(mirrored))
        refuse_key(m, &object, "mirrored", "neither true nor false");
    knee->has_scan = true;
    knee->scan_mirrored = json_is_true(mirrored);
    knee->T_case_scan = pose_of(m, &object, "T_case_scan");
}

// ---- lesions ------------------------------------------------------------------------------------

static bool read_plane(const json_t *row, struct plane *out_plane) {
    double v[4];
    bool good = json_is_array(row) && json_array_size(row) == 4;
    for (size_t i = 0; good && i < 4; i++) {
        good = json_is_number(json_array_get(row, i));
        v[i] = json_number_value(json_array_get(row, i));
    }
    if (good)
        *out_plane = (struct plane){{v[0], v[1], v[2]}, v[3]};
    return good;
}

static void read_polyhedron(struct manifest *m, const json_t *rows, const char *path,
                            struct case_region *region) {
    struct plane planes[CONVEX_PLANES_MAX];
    size_t count = json_array_size(rows);
    char at[PATH_MAX_LENGTH];
    if (!json_is_array(rows))
        refuse(m, RESULT_FORMAT, path, "not an array of planes");
    if (count > CONVEX_PLANES_MAX)
        refuse(m, RESULT_LIMIT, path, "more than 64 planes");
    for (size_t i = 0; m->result == RESULT_OK && i < count; i++) {
        snprintf(at, sizeof at, "%.100s[%zu]", path, i);
        if (!read_plane(json_array_get(rows, i), &planes[i]))
            refuse(m, RESULT_INVALID, at, "not a plane of four numbers: nx, ny, nz, offset");
    }
    struct error why;
    if (m->result == RESULT_OK && case_region_add(region, planes, (int)count, &why) != RESULT_OK)
        refuse(m, RESULT_INVALID, path, why.text);
}

static void read_region(struct manifest *m, const struct object *lesion, const char *key,
                        struct case_region *region) {
    const json_t *parts = json_object_get(lesion->json, key);
    char path[PATH_MAX_LENGTH], at[PATH_MAX_LENGTH];
    key_path(lesion, key, path);
    if (parts && !json_is_array(parts))
        refuse(m, RESULT_FORMAT, path, "not an array");
    if (json_array_size(parts) > CASE_REGION_PARTS_MAX)
        refuse(m, RESULT_LIMIT, path, "more than 32 parts");
    for (size_t i = 0; m->result == RESULT_OK && i < json_array_size(parts); i++) {
        snprintf(at, sizeof at, "%.100s[%zu]", path, i);
        read_polyhedron(m, json_array_get(parts, i), at, region);
    }
}

static void read_lesion(struct manifest *m, const struct object *group_object,
                        struct case_lesion *lesion) {
    static const char *const keys[] = {"tear", "damage", "plan", NULL};
    const json_t *json = json_object_get(group_object->json, "lesion");
    if (!json)
        return;
    char path[PATH_MAX_LENGTH];
    key_path(group_object, "lesion", path);
    struct object object = open_object(m, json, path, keys);
    read_region(m, &object, "tear", &lesion->tear);
    read_region(m, &object, "damage", &lesion->damage);
    read_region(m, &object, "plan", &lesion->plan);
}

// ---- groups and the rest ------------------------------------------------------------------------

// What the group is. What is absent stays as the name says.
static void read_tissue(struct manifest *m, const struct object *object,
                        struct case_tissue *tissue) {
    enum tissue_kind kind;
    const json_t *zones = json_object_get(object->json, "zones");
    if (json_object_get(object->json, "tissue")) {
        if (tissue_kind_from_name(read_string(m, object, "tissue"), &kind))
            tissue_set_kind(tissue, kind);
        else
            refuse_key(m, object, "tissue",
                       "neither bone, cartilage, meniscus, ligament, synovium, skin nor other");
    }
    if (json_object_get(object->json, "label")) {
        const char *label = read_string(m, object, "label");
        if (tissue_label_is_valid(label))
            strcpy(tissue->label, label);
        else
            refuse_key(m, object, "label", "not 1 to 63 bytes of text without control characters");
    }
    if (json_object_get(object->json, "colour") &&
        !tissue_colour_from_text(read_string(m, object, "colour"), &tissue->colour))
        refuse_key(m, object, "colour", "not #rrggbb");
    if (json_object_get(object->json, "side") &&
        !tissue_side_from_name(read_string(m, object, "side"), &tissue->side))
        refuse_key(m, object, "side", "neither medial, lateral nor none");
    if (zones && !json_is_boolean(zones))
        refuse_key(m, object, "zones", "neither true nor false");
    tissue->has_zones = zones ? json_is_true(zones) : tissue->has_zones;
}

static void read_group(struct manifest *m, const struct object *object, struct knee_case *knee) {
    char name[CASE_NAME_MAX] = "";
    enum body body = BODY_FEMUR;
    read_name(m, object, "name", name);
    if (!body_from_name(read_string(m, object, "body"), &body))
        refuse_key(m, object, "body", "neither femur, tibia nor patella");
    const json_t *cuttable = json_object_get(object->json, "cuttable");
    if (cuttable && !json_is_boolean(cuttable))
        refuse_key(m, object, "cuttable", "neither true nor false");
    if (name[0] && case_group(knee, name))
        refuse_key(m, object, "name", "there are two groups of this name");
    enum body other = BODY_COUNT;
    if (json_object_get(object->json, "bridges") &&
        !body_from_name(read_string(m, object, "bridges"), &other))
        refuse_key(m, object, "bridges", "neither femur, tibia nor patella");
    if (m->result != RESULT_OK)
        return;
    struct case_group *group = case_add_group(knee, name, body);
    group->cuttable = json_is_true(cuttable);
    if (other != BODY_COUNT)
        case_group_bridge(group, other);
    read_tissue(m, object, &group->tissue);
    read_lesion(m, object, &group->lesion);
}

static void read_portal(struct manifest *m, const struct object *object, struct knee_case *knee) {
    struct case_portal *portal = &knee->portals[knee->portal_count++];
    read_name(m, object, "name", portal->name);
    portal->position = vec3_of(m, object, "position");
    portal->direction = vec3_of(m, object, "direction");
}

static void read_landmark(struct manifest *m, const struct object *object, struct knee_case *knee) {
    struct case_landmark *landmark = &knee->landmarks[knee->landmark_count++];
    const char *by = read_string(m, object, "by");
    read_name(m, object, "name", landmark->name);
    if (!body_from_name(read_string(m, object, "body"), &landmark->body))
        refuse_key(m, object, "body", "neither femur, tibia nor patella");
    landmark->at = vec3_of(m, object, "at");
    landmark->error_mm = read_number(m, object, "error_mm");
    landmark->by_hand = strcmp(by, "hand") == 0;
    if (!landmark->by_hand && strcmp(by, "proposal") != 0)
        refuse_key(m, object, "by", "neither proposal nor hand");
}

static void read_loose(struct manifest *m, const struct object *object, struct knee_case *knee) {
    struct case_loose *loose = &knee->loose[knee->loose_count++];
    read_name(m, object, "name", loose->name);
    if (!body_from_name(read_string(m, object, "body"), &loose->body))
        refuse_key(m, object, "body", "neither femur, tibia nor patella");
    loose->at = vec3_of(m, object, "at");
    loose->radii_mm = vec3_of(m, object, "radii_mm");
}

static void read_patella(struct manifest *m, const struct object *object, struct knee_case *knee) {
    struct patella_key *key = &knee->patella_keys[knee->patella_key_count++];
    key->flexion_deg = read_number(m, object, "flexion_deg");
    key->T_femur_patella = pose_of(m, object, "T_femur_patella");
}

// An array that may be absent, of at most so many; NULL where there is none.
static const json_t *open_list(struct manifest *m, const struct object *object, const char *key,
                               size_t max) {
    const json_t *array = json_object_get(object->json, key);
    char path[PATH_MAX_LENGTH], what[48];
    key_path(object, key, path);
    snprintf(what, sizeof what, "%zu, more than %zu", json_array_size(array), max);
    if (array && !json_is_array(array))
        refuse(m, RESULT_INVALID, path, "not an array");
    else if (json_array_size(array) > max)
        refuse(m, RESULT_LIMIT, path, what);
    return m->result == RESULT_OK ? array : NULL;
}

struct manifest_list {
    const char *key;
    size_t max;
    const char *const *keys;
    void (*read)(struct manifest *m, const struct object *object, struct knee_case *knee);
};

static void read_list(struct manifest *m, const struct object *object,
                      const struct manifest_list *list, struct knee_case *knee) {
    const json_t *array = open_list(m, object, list->key, list->max);
    char path[PATH_MAX_LENGTH], at[PATH_MAX_LENGTH];
    key_path(object, list->key, path);
    for (size_t i = 0; m->result == RESULT_OK && i < json_array_size(array); i++) {
        snprintf(at, sizeof at, "%.100s[%zu]", path, i);
        struct object entry = open_object(m, json_array_get(array, i), at, list->keys);
        if (m->result == RESULT_OK)
            list->read(m, &entry, knee);
    }
}

static void read_rest(struct manifest *m, const struct object *root, struct knee_case *knee) {
    const json_t *array = open_list(m, root, "rest", CASE_KEYS_MAX);
    for (size_t i = 0; m->result == RESULT_OK && i < json_array_size(array); i++) {
        char path[PATH_MAX_LENGTH];
        double v[7];
        snprintf(path, sizeof path, "rest[%zu]", i);
        take_numbers(m, json_array_get(array, i), path, v, 7);
        knee->rest[knee->rest_count++] = take_pose(m, v, path);
    }
}

// Of the ligament that was read last.
static void read_key(struct manifest *m, const struct object *object, struct knee_case *knee) {
    if (knee->key_count == CASE_KEYS_MAX) {
        refuse(m, RESULT_LIMIT, object->path, "more than 32 keys of all ligaments");
        return;
    }
    struct case_key *key = &knee->keys[knee->key_count++];
    key->ligament = knee->torn_count - 1;
    key->physical = pose_of(m, object, "physical");
    key->target = pose_of(m, object, "target");
}

static void read_torn(struct manifest *m, const struct object *object, struct knee_case *knee) {
    static const char *const keys[] = {"physical", "target", NULL};
    static const struct manifest_list list = {"keys", CASE_KEYS_MAX, keys, read_key};
    need(m, object, "keys");
    read_name(m, object, "ligament", knee->torn[knee->torn_count++]);
    read_list(m, object, &list, knee);
}

static void read_lists(struct manifest *m, const struct object *root, struct knee_case *knee) {
    static const char *const group_keys[] = {"name",   "body",   "bridges", "cuttable",
                                             "lesion", "tissue", "label",   "colour",
                                             "side",   "zones",  NULL};
    static const char *const portal_keys[] = {"name", "position", "direction", NULL};
    static const char *const landmark_keys[] = {"name", "body", "at", "error_mm", "by", NULL};
    static const char *const loose_keys[] = {"name", "body", "at", "radii_mm", NULL};
    static const char *const patella_keys[] = {"flexion_deg", "T_femur_patella", NULL};
    static const char *const torn_keys[] = {"ligament", "keys", NULL};
    static const struct manifest_list lists[] = {
        {"groups", CASE_GROUPS_MAX, group_keys, read_group},
        {"portals", CASE_PORTALS_MAX, portal_keys, read_portal},
        {"landmarks", CASE_LANDMARKS_MAX, landmark_keys, read_landmark},
        {"loose", CASE_LOOSE_MAX, loose_keys, read_loose},
        {"patella", PATELLA_KEYS_MAX, patella_keys, read_patella},
        {"torn", CASE_LIGAMENTS_MAX, torn_keys, read_torn},
    };
    need(m, root, "groups");
    read_rest(m, root, knee);
    for (size_t i = 0; i < sizeof lists / sizeof lists[0]; i++)
        read_list(m, root, &lists[i], knee);
}

static uint64_t read_hash(struct manifest *m, const struct object *root) {
    if (!json_object_get(root->json, "anatomy_xxh3"))
        return 0;
    const char *text = read_string(m, root, "anatomy_xxh3");
    if (strlen(text) != 16 || strspn(text, "0123456789abcdef") != 16)
        refuse_key(m, root, "anatomy_xxh3", "not 16 hex digits");
    return strtoull(text, NULL, 16);
}

static void check_format(struct manifest *m, const json_t *root) {
    const json_t *format = json_object_get(root, "format");
    if (!json_is_integer(format))
        refuse(m, RESULT_MISSING, "format", "not a whole number: is this a case's manifest?");
    else if (json_integer_value(format) < 1 || json_integer_value(format) > MANIFEST_FORMAT)
        refuse(m, RESULT_VERSION, "format",
               "of another version than 1 to 4, which are read here: is the program older?");
}

static struct knee_case *read_root(struct manifest *m, const json_t *json,
                                   uint64_t *out_anatomy_hash) {
    static const char *const keys[] = {"format", "name", "title",   "side",    "anatomy_xxh3",
                                       "joint",  "scan", "groups",  "portals", "landmarks",
                                       "rest",   "torn", "patella", "loose",   NULL};
    check_format(m, json);
    struct object root = open_object(m, json, "", keys);
    char name[CASE_NAME_MAX] = "unnamed";
    read_name(m, &root, "name", name);
    const char *title = json_object_get(json, "title") ? read_string(m, &root, "title") : "";
    struct knee_case *knee = case_create(name, title);
    if (strlen(title) >= sizeof knee->title)
        refuse_key(m, &root, "title", "longer than 127 bytes");
    *out_anatomy_hash = read_hash(m, &root);
    read_joint(m, &root, &knee->joint);
    read_scan(m, &root, knee);
    if (m->result == RESULT_OK)
        read_lists(m, &root, knee);
    if (m->result != RESULT_OK)
        case_destroy(&knee);
    return knee;
}

enum result manifest_read(const char *text, size_t size, struct knee_case **out_case,
                          uint64_t *out_anatomy_hash, struct error *err) {
    json_error_t where;
    json_t *json = json_loadb(text, size, JSON_REJECT_DUPLICATES, &where);
    if (!json)
        return fail(err, RESULT_FORMAT, "line %d: %s", where.line, where.text);
    struct manifest m = {.err = err};
    *out_case = read_root(&m, json, out_anatomy_hash);
    json_decref(json);
    return m.result;
}
