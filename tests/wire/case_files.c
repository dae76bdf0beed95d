// Case folders that somebody damaged or made to do harm: always an error that names the place.
#include "case/case.h"
#include "case/gltf.h"
#include "random.h"
#include "test.h"
#include "unit/case_knee.h"

#include <jansson.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static char folder[FOLDER_MAX];
static char *glb; // of a sound case, as the JSON chunk's text and the BIN chunk
static size_t glb_size;
static char *manifest;
static struct error err;

static int make(void **state) {
    (void)state;
    folder_make(folder);
    struct knee_case *knee = box_knee();
    if (case_save(knee, folder, &err) != RESULT_OK)
        return -1;
    case_destroy(&knee);
    glb = read_file(folder, "anatomy.glb", &glb_size);
    manifest = read_file(folder, "case.json", NULL);
    // Without its hash, so that what follows meets the damage itself.
    json_t *json = json_loads(manifest, 0, NULL);
    json_object_del(json, "anatomy_xxh3");
    free(manifest);
    manifest = json_dumps(json, JSON_REAL_PRECISION(17));
    json_decref(json);
    write_file(folder, "case.json", manifest, strlen(manifest));
    return 0;
}

static int clear(void **state) {
    (void)state;
    folder_remove(folder);
    free(glb);
    free(manifest);
    return 0;
}

static enum result load(void) {
    struct knee_case *knee;
    memset(&err, 0, sizeof err);
    enum result result = case_load(folder, NULL, &knee, &err);
    if (result != RESULT_OK)
        assert_null(knee);
    case_destroy(&knee);
    return result;
}

static void assert_says(const char *row, const char *says) {
    if (!strstr(err.text, says))
        fail_msg("%s: \"%s\" does not say \"%s\"", row, err.text, says);
}

// ---- JSON that is changed in one place ----------------------------------------------------------

static json_t *child(json_t *json, const char *key) {
    return json_is_array(json) ? json_array_get(json, (size_t)atoi(key))
                               : json_object_get(json, key);
}

// path: keys and indices with '/' between; value: JSON text, or NULL to take the key out.
static void change(json_t *root, const char *path, const char *value) {
    char copy[128], *rest = copy, *key;
    snprintf(copy, sizeof copy, "%s", path);
    json_t *at = root;
    for (key = strsep(&rest, "/"); rest; key = strsep(&rest, "/"))
        at = child(at, key);
    assert_non_null(at);
    json_t *made = value ? json_loads(value, JSON_DECODE_ANY, NULL) : NULL;
    if (json_is_array(at))
        assert_int_equal(made ? json_array_set_new(at, (size_t)atoi(key), made)
                              : json_array_remove(at, (size_t)atoi(key)),
                         0);
    else
        assert_int_equal(made ? json_object_set_new(at, key, made) : json_object_del(at, key), 0);
}

static uint32_t u32_at(const char *bytes) {
    uint32_t value;
    memcpy(&value, bytes, 4);
    return value;
}

// The sound file with another JSON chunk.
static char *with_json(const char *text, size_t *out_size) {
    uint32_t old = u32_at(glb + 12), size = (uint32_t)(strlen(text) + 3) / 4 * 4;
    size_t bin = glb_size - 20 - old;
    char *made = malloc(20 + size + bin);
    memcpy(made, glb, 20);
    memset(made + 20, ' ', size);
    memcpy(made + 20, text, strlen(text));
    memcpy(made + 20 + size, glb + 20 + old, bin);
    memcpy(made + 12, &size, 4);
    uint32_t total = (uint32_t)(20 + size + bin);
    memcpy(made + 8, &total, 4);
    *out_size = total;
    return made;
}

static void write_json_chunk(const char *text) {
    size_t size;
    char *made = with_json(text, &size);
    write_file(folder, "anatomy.glb", made, size);
    free(made);
}

#define POSITION "accessors/0"
#define SHARES "accessors/15"
#define SHARED "meshes/5/primitives/0/attributes"
#define MENISCUS "meshes/4/primitives/0/attributes"
#define INDICES "accessors/1"
#define VIEW "bufferViews/0"
#define PRIMITIVE "meshes/0/primitives/0"

static void a_glb_that_lies_is_refused_with_node_and_accessor(void **state) {
    (void)state;
    static const struct {
        const char *path, *value, *says;
    } rows[] = {
        {POSITION "/count", "4294967295", "nodes[0] tibia/bone: POSITION (accessor 0)"},
        {POSITION "/count", "9223372036854775807", "POSITION (accessor 0): 9223372036854775807"},
        {POSITION "/count", "9", "9 elements do not fit"},
        {POSITION "/count", "0", "do not fit"},
        {POSITION "/count", "-1", "accessors[0].count"},
        {POSITION "/count", "1e300", "accessors[0].count"},
        {POSITION "/count", "3", "morph target warp (accessor 2): 8 vectors for 3 vertices"},
        {POSITION "/byteOffset", "1", "do not fit"},
        {POSITION "/byteOffset", "4294967295", "do not fit"},
        {POSITION "/byteOffset", "9223372036854775807", "do not fit"},
        {POSITION "/byteOffset", "-4", "accessors[0].byteOffset"},
        {POSITION "/bufferView", "99", "accessor 0): there is no such buffer view"},
        {POSITION "/bufferView", NULL, "accessor 0): there is no such buffer view"},
        {POSITION "/sparse",
         "{\"count\":1,\"indices\":{\"bufferView\":0,\"componentType\":5125},"
         "\"values\":{\"bufferView\":0}}",
         "accessor 0): sparse"},
        {POSITION "/normalized", "true", "accessor 0): normalised"},
        {POSITION "/componentType", "5122", "accessor 0): not vectors of three floats"},
        {POSITION "/componentType", "77", "anatomy.glb"},
        {POSITION "/type", "\"VEC2\"", "accessor 0): not vectors"},
        {INDICES "/componentType", "5121", "indices (accessor 1): not unsigned"},
        {INDICES "/count", "35", "35 are not whole triangles"},
        {INDICES "/count", "600000003", "accessor 1): 600000003 elements do not fit"},
        {INDICES "/type", "\"VEC3\"", "accessor 1): not unsigned"},
        {VIEW "/byteOffset", "9223372036854775807", "its view ends after the buffer"},
        {VIEW "/byteLength", "9223372036854775807", "its view ends after the buffer"},
        {VIEW "/byteLength", "95", "do not fit"},
        {VIEW "/byteStride", "4", "stride of 4"},
        {VIEW "/byteStride", "253", "anatomy.glb"},
        {VIEW "/byteStride", "16", "do not fit"},
        {VIEW "/buffer", "1", "a missing buffer"},
        {VIEW "/buffer", "-1", "bufferViews[0].buffer"},
        {PRIMITIVE "/indices", "99", "anatomy.glb"},
        {PRIMITIVE "/indices", NULL, "no indices"},
        {PRIMITIVE "/indices", "0", "indices (accessor 0): not unsigned"},
        {PRIMITIVE "/mode", "1", "not made of triangles"},
        {PRIMITIVE "/attributes/POSITION", "-7", "there is no such accessor"},
        {PRIMITIVE "/attributes/POSITION", "99", "(accessor 99): there is no such accessor"},
        {PRIMITIVE "/attributes", "{\"NORMAL\":0}", "no POSITION"},
        {PRIMITIVE "/targets/0/POSITION", "1", "morph target warp (accessor 1): not vectors"},
        {PRIMITIVE "/targets/0", "{}", "morph target warp: no POSITION"},
        {PRIMITIVE "/targets/0", "{\"NORMAL\":0}", "morph target warp: no POSITION"},
        {SHARES "/count", "7", "nodes[5] lcl: _OTHER_SHARE (accessor 15): 7 numbers for 8 vert"},
        {SHARES "/count", "9", "_OTHER_SHARE (accessor 15): 9 elements do not fit"},
        {SHARES "/type", "\"VEC3\"", "_OTHER_SHARE (accessor 15): not single floats"},
        {SHARES "/componentType", "5125", "_OTHER_SHARE (accessor 15): not single floats"},
        {SHARES "/normalized", "true", "_OTHER_SHARE (accessor 15): normalised"},
        {SHARED "/_OTHER_SHARE", "99", "_OTHER_SHARE (accessor 99): there is no such accessor"},
        {SHARED "/_OTHER_SHARE", NULL, "node lcl: _OTHER_SHARE is missing"},
        {PRIMITIVE "/attributes/_OTHER_SHARE", "15", "tibia/bone: _OTHER_SHARE of a group that br"},
        {PRIMITIVE "/attributes/_WEAR", "99", "_WEAR (accessor 99): there is no such accessor"},
        {PRIMITIVE "/attributes/_WEAR", "0", "tibia/bone: _WEAR (accessor 0): not single floats"},
        {MENISCUS "/_WEAR", "15", "group meniscus_medial is cuttable, so nothing of it can be w"},
        {SHARED "/_WEAR", "15", "group lcl is neither bone nor cartilage, so nothing of it can"},
        {"meshes/0/primitives", "[]", "0 primitives"},
        {"meshes/0/extras", NULL, "targetNames"},
        {"meshes/0/extras/targetNames/0", "\"bend\"", "morph target \"bend\""},
        {"meshes/0/extras/targetNames/0", "7", "morph target \"\""},
        {"nodes/0/mesh", "99", "no mesh 99"},
        {"nodes/1/mesh", "0", "mesh 0 is used twice"},
        {"nodes/0/translation", "[1,0,0]", "nodes[0] tibia/bone: the node has a transform"},
        {"nodes/0/matrix", "[1,0,0,0,0,1,0,0,0,0,2,0,0,0,0,1]", "the node has a transform"},
        {"nodes/0/children", "[1]", "nodes[0] has children"},
        {"nodes/0/name", "\"humerus\"", "node humerus: the manifest has no such group"},
        {"nodes/0/name", "\"tibia/\"", "cannot be the name"},
        {"nodes/0/name", "\"tibia/cartilage\"", "two parts cartilage"},
        {"extensionsRequired", "[\"KHR_draco_mesh_compression\"]", "KHR_draco_mesh_compression"},
        {"buffers/0/uri", "\"more.bin\"", "buffers[0].uri"},
        {"buffers/0/uri", "\"data:application/octet-stream;base64,AAAA\"", "buffers[0].uri"},
        {"buffers/0/byteLength", "4294967296", "buffers[0].byteLength"},
        {"buffers/0/byteLength", "0", "buffers[0].byteLength"},
        {"buffers", "[{\"byteLength\":4},{\"byteLength\":4}]", "buffers: 2 where one"},
        {"buffers", NULL, "buffers: 0 where one"},
        {"images", "[{\"uri\":\"/etc/passwd\"}]", "images"},
        {"asset/version", NULL, "anatomy.glb"},
        {"nodes", "[]", "group tibia has no mesh"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        json_t *json = json_loadb(glb + 20, u32_at(glb + 12), 0, NULL);
        change(json, rows[i].path, rows[i].value);
        char *text = json_dumps(json, JSON_COMPACT | JSON_REAL_PRECISION(9));
        json_decref(json);
        write_json_chunk(text);
        free(text);
        char row[160];
        snprintf(row, sizeof row, "%s = %s", rows[i].path, rows[i].value ? rows[i].value : "out");
        if (load() == RESULT_OK) {
            fail_msg("%s: was taken", row);
        }
        assert_says(row, rows[i].says);
        assert_says(row, folder);
    }
}

static void
numbers_that_are_no_numbers_and_bad_indices_are_refused_by_vertex_or_triangle(void **state) {
    (void)state;
    size_t bin = 20 + u32_at(glb + 12) + 8;
    static const struct {
        size_t offset; // in the BIN chunk: 96 bytes of positions, 144 of indices, 96 of warp
        uint32_t value;
        const char *says;
    } rows[] = {
        {0, 0x7fc00000, "node tibia/bone"},  {92, 0x7f800000, "node tibia/bone"},
        {96, 8, "node tibia/bone"},          {96, UINT32_MAX, "node tibia/bone"},
        {100, 0, "node tibia/bone"},         {244, 0xff800000, "group tibia: warp of vertex 0"},
        {240, 0x7f7fffff, "warp of vertex"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char *copy = malloc(glb_size);
        memcpy(copy, glb, glb_size);
        memcpy(copy + bin + rows[i].offset, &rows[i].value, 4);
        write_file(folder, "anatomy.glb", copy, glb_size);
        free(copy);
        assert_int_not_equal(load(), RESULT_OK);
        assert_says("BIN", rows[i].says);
    }
}

static void a_glb_cut_anywhere_is_refused(void **state) {
    (void)state;
    for (size_t size = 0; size < glb_size; size += size < 64 ? 1 : 37) {
        write_file(folder, "anatomy.glb", glb, size);
        assert_int_not_equal(load(), RESULT_OK);
        assert_says("cut", "anatomy.glb: ");
    }
    // The header agrees with the cut: the chunks must disagree.
    char *copy = malloc(glb_size);
    for (size_t size = 12; size < glb_size; size += 41) {
        memcpy(copy, glb, size);
        uint32_t length = (uint32_t)size;
        memcpy(copy + 8, &length, 4);
        write_file(folder, "anatomy.glb", copy, size);
        assert_int_not_equal(load(), RESULT_OK);
        assert_says("cut", "chunk");
    }
    // The BIN chunk says 8 bytes more than there are.
    memcpy(copy, glb, glb_size);
    uint32_t bin = u32_at(glb + 20 + u32_at(glb + 12)) + 8;
    memcpy(copy + 20 + u32_at(glb + 12), &bin, 4);
    write_file(folder, "anatomy.glb", copy, glb_size);
    assert_int_not_equal(load(), RESULT_OK);
    assert_says("BIN", "the BIN chunk");
    free(copy);
}

static void flipped_bytes_never_do_harm(void **state) {
    (void)state;
    struct random r = {20261121};
    size_t head = 20 + u32_at(glb + 12) + 8;
    char *copy = malloc(glb_size);
    int refused = 0;
    for (int i = 0; i < 3000; i++) {
        memcpy(copy, glb, glb_size);
        for (uint64_t flips = 1 + random_bits(&r) % 3; flips > 0; flips--)
            copy[random_bits(&r) % head] = (char)random_bits(&r);
        write_file(folder, "anatomy.glb", copy, glb_size);
        if (load() == RESULT_OK)
            continue;
        refused++;
        assert_says("flip", folder);
    }
    free(copy);
    assert_true(refused > 2000);
}

static void json_nested_without_end_is_refused(void **state) {
    (void)state;
    size_t depth = 1000000;
    char *text = malloc(depth + 64);
    int start = sprintf(text, "{\"extras\":");
    memset(text + start, '[', depth);
    text[(size_t)start + depth] = '\0';
    write_json_chunk(text);
    free(text);
    assert_int_not_equal(load(), RESULT_OK);
    assert_says("deep", "JSON chunk");
}

static void accessors_may_not_multiply_the_bytes_of_a_small_file(void **state) {
    (void)state;
    // 200 meshes that all read the same accessors.
    json_t *json = json_loadb(glb + 20, u32_at(glb + 12), 0, NULL);
    json_t *nodes = json_array(), *meshes = json_array();
    for (int i = 0; i < 200; i++) {
        char name[32];
        snprintf(name, sizeof name, "tibia/%d", i);
        json_array_append_new(nodes, json_pack("{s:s, s:i}", "name", name, "mesh", i));
        json_array_append(meshes, json_array_get(json_object_get(json, "meshes"), 0));
    }
    json_object_set_new(json, "nodes", nodes);
    json_object_set_new(json, "meshes", meshes);
    char *text = json_dumps(json, JSON_COMPACT | JSON_REAL_PRECISION(9));
    json_decref(json);
    struct gltf_limits limits = {.nodes = 256, .triangles = 1000};
    struct gltf *gltf;
    size_t size;
    char *made = with_json(text, &size);
    free(text);
    assert_int_equal(gltf_decode((const uint8_t *)made, size, &limits, &gltf, &err), RESULT_LIMIT);
    assert_says("shared", "again and again");
    limits.nodes = 199;
    assert_int_equal(gltf_decode((const uint8_t *)made, size, &limits, &gltf, &err), RESULT_LIMIT);
    assert_says("nodes", "200 nodes");
    free(made);
}

static void indices_of_16_bits_are_read(void **state) {
    (void)state;
    size_t bin = 20 + u32_at(glb + 12) + 8 + 96;
    char *copy = malloc(glb_size);
    memcpy(copy, glb, glb_size);
    for (size_t i = 0; i < 36; i++)
        memcpy(copy + bin + 2 * i, glb + bin + 4 * i, 2); // little endian
    char *wide = glb;
    glb = copy;
    json_t *json = json_loadb(glb + 20, u32_at(glb + 12), 0, NULL);
    change(json, INDICES "/componentType", "5123");
    char *text = json_dumps(json, JSON_COMPACT | JSON_REAL_PRECISION(9));
    json_decref(json);
    write_json_chunk(text);
    free(text);
    struct knee_case *knee, *sound = box_knee();
    if (case_load(folder, NULL, &knee, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    assert_memory_equal(case_group(knee, "tibia")->mesh.triangles,
                        case_group(sound, "tibia")->mesh.triangles, 36 * sizeof(uint32_t));
    case_destroy(&knee);
    case_destroy(&sound);
    glb = wide;
    free(copy);
}

static void limits_hold_before_anything_is_read(void **state) {
    (void)state;
    struct case_limits limits = case_limits_default();
    struct knee_case *knee;
    limits.file_bytes = strlen(manifest);
    assert_int_equal(case_load(folder, &limits, &knee, &err), RESULT_LIMIT);
    assert_says("bytes", "anatomy.glb: ");
    limits = case_limits_default();
    limits.group_triangles = 23; // tibia has two parts of 12
    assert_int_equal(case_load(folder, &limits, &knee, &err), RESULT_LIMIT);
    assert_says("triangles", "node tibia/cartilage");
    limits.group_triangles = 11;
    assert_int_equal(case_load(folder, &limits, &knee, &err), RESULT_LIMIT);
    assert_says("triangles", "12 triangles, more than 11");
}

// ---- manifest -----------------------------------------------------------------------------------

static void a_manifest_at_fault_is_refused_with_the_key(void **state) {
    (void)state;
    static const struct {
        const char *path, *value;
        enum result code;
        const char *says;
    } rows[] = {
        {"format", "5", RESULT_VERSION, "case.json: format"},
        {"format", "0", RESULT_VERSION, "case.json: format"},
        {"format", NULL, RESULT_MISSING, "case.json: format"},
        {"format", "\"1\"", RESULT_MISSING, "format"},
        {"colour", "1", RESULT_FORMAT, "colour: unknown key"},
        {"joint/scale", "1", RESULT_FORMAT, "joint.scale: unknown key"},
        {"scan", "5", RESULT_FORMAT, "scan: not an object"},
        {"scan", "{\"mirrored\":false}", RESULT_MISSING, "scan.T_case_scan: missing"},
        {"scan", "{\"mirrored\":1,\"T_case_scan\":[0,0,0,1,0,0,0]}", RESULT_INVALID,
         "scan.mirrored: neither"},
        {"scan", "{\"mirrored\":true,\"T_case_scan\":[0,0,0,2,0,0,0]}", RESULT_INVALID,
         "scan.T_case_scan: the quaternion"},
        {"groups/1/colours", "1", RESULT_FORMAT, "groups[1].colours: unknown key"},
        {"portals/0/size", "1", RESULT_FORMAT, "portals[0].size: unknown key"},
        {"name", NULL, RESULT_MISSING, "name: missing"},
        {"name", "\"../x\"", RESULT_INVALID, "name: not a name"},
        {"name", "\"\"", RESULT_INVALID, "name: not a name"},
        {"title", "5", RESULT_INVALID, "title: not a text"},
        {"side", "\"both\"", RESULT_INVALID, "side: neither"},
        {"side", NULL, RESULT_MISSING, "side: missing"},
        {"joint", NULL, RESULT_MISSING, "joint: missing"},
        {"joint", "[]", RESULT_FORMAT, "joint: not an object"},
        {"joint/T_femur_joint", NULL, RESULT_MISSING, "joint.T_femur_joint: missing"},
        {"joint/T_femur_joint", "[0,0,0,1,0,0]", RESULT_INVALID, "joint.T_femur_joint: not an"},
        {"joint/T_tibia_joint/3", "2", RESULT_INVALID, "joint.T_tibia_joint: the quaternion"},
        {"joint/T_tibia_joint/3", "null", RESULT_INVALID, "joint.T_tibia_joint: not an array"},
        {"groups", NULL, RESULT_MISSING, "groups: missing"},
        {"groups", "{}", RESULT_INVALID, "groups: not an array"},
        {"groups", "[]", RESULT_FORMAT, "no such group"},
        {"groups/0", "5", RESULT_FORMAT, "groups[0]: not an object"},
        {"groups/0/name", "\"femur\"", RESULT_INVALID, "groups[1].name: there are two"},
        {"groups/0/body", "\"pelvis\"", RESULT_INVALID, "groups[0].body"},
        {"groups/0/cuttable", "1", RESULT_INVALID, "groups[0].cuttable"},
        {"groups/0/cuttable", "true", RESULT_INVALID, "tibia is cuttable but has 2 parts"},
#define LESION "groups/3/lesion"
        {LESION, "[]", RESULT_FORMAT, "groups[3].lesion: not an object"},
        {LESION, "{\"tears\":[]}", RESULT_FORMAT, "groups[3].lesion.tears: unknown key"},
        {LESION "/tear", "{}", RESULT_FORMAT, "groups[3].lesion.tear: not an array"},
        {LESION "/tear/0", "7", RESULT_FORMAT, "groups[3].lesion.tear[0]: not an array of"},
        {LESION "/tear/0", "[]", RESULT_INVALID, "groups[3].lesion.tear[0]: 0 planes"},
        {LESION "/tear/0/2", "[1,0,0]", RESULT_INVALID, "lesion.tear[0][2]: not a plane"},
        {LESION "/plan/1/5", "[1,0,0,0,0]", RESULT_INVALID, "lesion.plan[1][5]: not a plane"},
        {LESION "/plan/1/0", "[1,0,\"0\",0]", RESULT_INVALID, "lesion.plan[1][0]: not a plane"},
        {LESION "/plan/1/0", "5", RESULT_INVALID, "lesion.plan[1][0]: not a plane"},
        {LESION "/plan/1/0", "[0,0,0,1]", RESULT_INVALID, "lesion.plan[1]: plane 0"},
        {LESION "/plan/1/0/3", "1e300", RESULT_INVALID, "lesion.plan[1]: the planes enclose"},
        {LESION "/plan/1/0/3", "-1e300", RESULT_INVALID, "lesion.plan[1]: plane"},
        {LESION "/plan/1/0", NULL, RESULT_INVALID, "lesion.plan[1]: the planes enclose nothing"},
        {LESION "/tear/0/0/3", "-900", RESULT_INVALID, "lesion.tear[0]: plane"},
        {"groups/3/cuttable", "false", RESULT_INVALID, "medial has lesion.tear but is not"},
        {"groups/0", NULL, RESULT_FORMAT, "node tibia/bone: the manifest has no such group"},
        {"portals/0/position", "[1,2]", RESULT_INVALID, "portals[0].position"},
        {"portals/0/direction", "[0,0,5]", RESULT_INVALID, "portal anteromedial: direction"},
        {"patella/1/flexion_deg", "-1", RESULT_INVALID, "patella[1]: flexion_deg"},
        {"patella/1/flexion_deg", "\"90\"", RESULT_INVALID, "patella[1].flexion_deg: not a"},
        {"groups/4/bridges", "\"pelvis\"", RESULT_INVALID, "groups[4].bridges: neither"},
        {"groups/4/bridges", "true", RESULT_INVALID, "groups[4].bridges: not a text"},
        {"groups/4/bridges", "\"tibia\"", RESULT_INVALID, "lcl bridges from its body tibia"},
        {"groups/4/bridges", NULL, RESULT_FORMAT, "node lcl: _OTHER_SHARE of a group that bridges"},
        {"groups/1/bridges", "\"tibia\"", RESULT_FORMAT, "node femur: _OTHER_SHARE is missing"},
        {"rest", "{}", RESULT_INVALID, "rest: not an array"},
        {"rest/1", "{}", RESULT_INVALID, "rest[1]: not an array of 7 numbers"},
        {"rest/1", "[0,0,0,1,0,0]", RESULT_INVALID, "rest[1]: not an array of 7 numbers"},
        {"rest/1/3", "0", RESULT_INVALID, "rest[1]: the quaternion"},
        {"torn", "5", RESULT_INVALID, "torn: not an array"},
        {"torn/1", "5", RESULT_FORMAT, "torn[1]: not an object"},
        {"torn/1/side", "5", RESULT_FORMAT, "torn[1].side: unknown key"},
        {"torn/1/ligament", NULL, RESULT_MISSING, "torn[1].ligament: missing"},
        {"torn/1/ligament", "\"a b\"", RESULT_INVALID, "torn[1].ligament: not a name"},
        {"torn/1/ligament", "\"mcl\"", RESULT_INVALID, "two torn ligaments mcl"},
        {"torn/1/keys", NULL, RESULT_MISSING, "torn[1].keys: missing"},
        {"torn/1/keys", "{}", RESULT_INVALID, "torn[1].keys: not an array"},
        {"torn/1/keys", "[]", RESULT_INVALID, "torn ligament acl has no key"},
        {"torn/0/keys/1", "7", RESULT_FORMAT, "torn[0].keys[1]: not an object"},
        {"torn/0/keys/1/flexion", "7", RESULT_FORMAT, "torn[0].keys[1].flexion: unknown key"},
        {"torn/0/keys/1/target", NULL, RESULT_MISSING, "torn[0].keys[1].target: missing"},
        {"torn/0/keys/1/target", "[1]", RESULT_INVALID, "torn[0].keys[1].target: not an array"},
        {"torn/0/keys/1/physical/4", "2", RESULT_INVALID, "keys[1].physical: the quaternion"},
        {"anatomy_xxh3", "\"12\"", RESULT_INVALID, "anatomy_xxh3: not 16"},
        {"anatomy_xxh3", "\"0123456789abcdef\"", RESULT_CORRUPT, "anatomy_xxh3"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        json_t *json = json_loads(manifest, 0, NULL);
        change(json, rows[i].path, rows[i].value);
        char *text = json_dumps(json, JSON_REAL_PRECISION(17));
        json_decref(json);
        write_file(folder, "case.json", text, strlen(text));
        free(text);
        enum result result = load();
        assert_says(rows[i].path, rows[i].says);
        assert_says(rows[i].path, folder);
        assert_int_equal(result, rows[i].code);
    }
}

static void too_many_groups_portals_and_keys_are_refused(void **state) {
    (void)state;
    static const struct {
        const char *key, *says;
        int count;
    } rows[] = {
        {"groups", "groups: 33, more than 32", 33},   {"portals", "portals: 9, more than 8", 9},
        {"patella", "patella: 65, more than 64", 65}, {"rest", "rest: 33, more than 32", 33},
        {"torn", "torn: 9, more than 8", 9},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        json_t *json = json_loads(manifest, 0, NULL), *list = json_array();
        for (int k = 0; k < rows[i].count; k++)
            json_array_append(list, json_array_get(json_object_get(json, rows[i].key), 0));
        json_object_set_new(json, rows[i].key, list);
        char *text = json_dumps(json, JSON_REAL_PRECISION(17));
        json_decref(json);
        write_file(folder, "case.json", text, strlen(text));
        free(text);
        assert_int_equal(load(), RESULT_LIMIT);
        assert_says(rows[i].key, rows[i].says);
    }
}

static void all_ligaments_together_have_at_most_32_keys(void **state) {
    (void)state;
    static const struct {
        int mcl_keys;
        enum result code;
        const char *says;
    } rows[] = {
        {31, RESULT_OK, ""},
        {32, RESULT_LIMIT, "torn[1].keys[0]: more than 32 keys of all ligaments"},
        {33, RESULT_LIMIT, "torn[0].keys: 33, more than 32"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        json_t *json = json_loads(manifest, 0, NULL);
        json_t *keys = json_object_get(json_array_get(json_object_get(json, "torn"), 0), "keys");
        while (json_array_size(keys) < (size_t)rows[i].mcl_keys)
            json_array_append(keys, json_array_get(keys, 0));
        char *text = json_dumps(json, JSON_REAL_PRECISION(17));
        json_decref(json);
        write_file(folder, "case.json", text, strlen(text));
        free(text);
        assert_int_equal(load(), rows[i].code);
        assert_says("keys", rows[i].says);
    }
}

static void too_many_parts_and_planes_of_a_lesion_are_refused(void **state) {
    (void)state;
    static const struct {
        const char *key, *says;
        int parts, planes;
    } rows[] = {
        {"tear", "groups[3].lesion.tear: more than 32 parts", 33, 6},
        {"plan", "groups[3].lesion.plan[0]: more than 64 planes", 1, 65},
    };
    for (size_t i = 0; i < 2; i++) {
        json_t *json = json_loads(manifest, 0, NULL), *parts = json_array(), *part = json_array();
        for (int k = 0; k < rows[i].planes; k++)
            json_array_append_new(part, json_pack("[i, i, i, i]", 0, 0, 1, 1));
        for (int k = 0; k < rows[i].parts; k++)
            json_array_append(parts, part);
        json_t *meniscus = json_array_get(json_object_get(json, "groups"), 3);
        json_object_set_new(json_object_get(meniscus, "lesion"), rows[i].key, parts);
        json_decref(part);
        char *text = json_dumps(json, JSON_REAL_PRECISION(17));
        json_decref(json);
        write_file(folder, "case.json", text, strlen(text));
        free(text);
        assert_int_equal(load(), RESULT_LIMIT);
        assert_says(rows[i].key, rows[i].says);
    }
}

static void a_manifest_that_is_no_json_is_refused_with_its_line(void **state) {
    (void)state;
    static const char *const texts[] = {
        "",
        "{",
        "[1]",
        "nonsense",
        "{\"format\":1,\"format\":1}",
        "{\"format\":NaN}",
        "{\"format\":1e999}",
        "{\"name\":\"\\u0000\"}",
        "\xff\xfe",
    };
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++) {
        write_file(folder, "case.json", texts[i], strlen(texts[i]));
        assert_int_not_equal(load(), RESULT_OK);
        assert_says(texts[i], "case.json: ");
    }
    for (size_t size = 0; size < strlen(manifest); size += 7) {
        write_file(folder, "case.json", manifest, size);
        assert_int_not_equal(load(), RESULT_OK);
        assert_says("cut manifest", "case.json: ");
    }
}

static void an_open_meniscus_to_be_cut_is_refused(void **state) {
    (void)state;
    struct knee_case *knee = box_knee();
    struct case_group *meniscus = case_group(knee, "meniscus_medial");
    meniscus->cuttable = false;
    meniscus->lesion.tear.part_count = meniscus->lesion.plan.part_count = 0;
    meniscus->mesh.triangle_count = meniscus->parts[0].triangle_count = 11;
    assert_int_equal(case_save(knee, folder, &err), RESULT_OK);
    case_destroy(&knee);
    assert_int_equal(load(), RESULT_OK);
    write_file(folder, "case.json", manifest, strlen(manifest)); // says cuttable
    assert_int_equal(load(), RESULT_INVALID);
    assert_says("open", "group meniscus_medial is cuttable but open: 3 edges");
}

static void files_that_are_not_there_are_named(void **state) {
    (void)state;
    char path[300];
    snprintf(path, sizeof path, "%s/anatomy.glb", folder);
    remove(path);
    assert_int_equal(load(), RESULT_MISSING);
    assert_says("missing", path);
    snprintf(path, sizeof path, "%s/case.json", folder);
    remove(path);
    assert_int_equal(load(), RESULT_MISSING);
    assert_says("missing", path);
}

#define row(test) cmocka_unit_test_setup_teardown(test, make, clear)

int main(void) {
    const struct CMUnitTest tests[] = {
        row(a_glb_that_lies_is_refused_with_node_and_accessor),
        row(numbers_that_are_no_numbers_and_bad_indices_are_refused_by_vertex_or_triangle),
        row(a_glb_cut_anywhere_is_refused),
        row(flipped_bytes_never_do_harm),
        row(json_nested_without_end_is_refused),
        row(accessors_may_not_multiply_the_bytes_of_a_small_file),
        row(indices_of_16_bits_are_read),
        row(limits_hold_before_anything_is_read),
        row(a_manifest_at_fault_is_refused_with_the_key),
        row(too_many_groups_portals_and_keys_are_refused),
        row(all_ligaments_together_have_at_most_32_keys),
        row(too_many_parts_and_planes_of_a_lesion_are_refused),
        row(a_manifest_that_is_no_json_is_refused_with_its_line),
        row(an_open_meniscus_to_be_cut_is_refused),
        row(files_that_are_not_there_are_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
