#include "case/recorded_keys.h"

#include "base/check.h"
#include "case/files.h"

#include <errno.h>
#include <jansson.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define RECORD_FILE "recorded.json"
#define RECORD_FORMAT 1
#define RECORDED_BYTES_MAX ((size_t)1 << 20)

static double flexion_of(const struct knee_case *knee, pose T_femur_tibia) {
    return joint_from_pose(&knee->joint, T_femur_tibia).flexion_deg;
}

static double flexion_between(const struct knee_case *knee, pose a, pose b) {
    return fabs(flexion_of(knee, a) - flexion_of(knee, b));
}

// ---- the file -----------------------------------------------------------------------------------

static bool read_pose_array(const json_t *array, pose *out) {
    double v[7];
    bool good = json_array_size(array) == 7;
    for (size_t i = 0; i < 7 && good; i++) {
        good = json_is_number(json_array_get(array, i));
        v[i] = json_number_value(json_array_get(array, i));
    }
    if (good)
        *out = (pose){{v[3], v[4], v[5], v[6]}, {v[0], v[1], v[2]}};
    return good && pose_is_valid(*out);
}

static enum result read_entries(const json_t *json, struct recorded_keys *out, struct error *err) {
    const json_t *array = json_object_get(json, "physical");
    if (json_integer_value(json_object_get(json, "format")) != RECORD_FORMAT)
        return fail(err, RESULT_VERSION, "format: not %d", RECORD_FORMAT);
    if (!json_is_array(array) || json_array_size(array) > CASE_KEYS_MAX)
        return fail(err, RESULT_FORMAT, "physical: not a list of at most %d", CASE_KEYS_MAX);
    for (size_t i = 0; i < json_array_size(array); i++) {
        const json_t *entry = json_array_get(array, i);
        const char *name = json_string_value(json_object_get(entry, "ligament"));
        if (!name || !case_name_is_valid(name))
            return fail(err, RESULT_INVALID, "physical[%zu].ligament: not a name", i);
        strcpy(out->waiting[i].ligament, name);
        if (!read_pose_array(json_object_get(entry, "T_femur_tibia"), &out->waiting[i].physical))
            return fail(err, RESULT_INVALID, "physical[%zu].T_femur_tibia: not a pose", i);
        out->count++;
    }
    return RESULT_OK;
}

enum result recorded_keys_load(const char *dir, struct recorded_keys *out_record,
                               struct error *err) {
    char path[PATH_MAX];
    uint8_t *bytes;
    size_t size;
    *out_record = (struct recorded_keys){0};
    snprintf(path, sizeof path, "%s/" RECORD_FILE, dir);
    if (access(path, F_OK) != 0 && errno == ENOENT)
        return RESULT_OK;
    enum result result = files_read(path, RECORDED_BYTES_MAX, &bytes, &size, err);
    if (result != RESULT_OK)
        return result;
    json_error_t where;
    json_t *json = json_loadb((const char *)bytes, size, JSON_REJECT_DUPLICATES, &where);
    result = json ? read_entries(json, out_record, err)
                  : fail(err, RESULT_FORMAT, "line %d: %s", where.line, where.text);
    json_decref(json);
    free(bytes);
    return result == RESULT_OK ? result : fail_in(err, result, "%s: ", path);
}

static char *text_of(const struct recorded_keys *record) {
    json_t *array = json_array();
    for (int i = 0; i < record->count; i++) {
        pose p = record->waiting[i].physical;
        json_array_append_new(array,
                              json_pack("{s:s, s:[f, f, f, f, f, f, f]}", "ligament",
                                        record->waiting[i].ligament, "T_femur_tibia",
                                        p.translation.x, p.translation.y, p.translation.z,
                                        p.rotation.w, p.rotation.x, p.rotation.y, p.rotation.z));
    }
    json_t *json = json_pack("{s:i, s:o}", "format", RECORD_FORMAT, "physical", array);
    char *text = json_dumps(json, JSON_INDENT(2) | JSON_REAL_PRECISION(17));
    NEED(text, "memory");
    json_decref(json);
    return text;
}

enum result recorded_keys_save(const char *dir, const struct recorded_keys *record,
                               struct error *err) {
    if (record->count == 0) {
        char path[PATH_MAX];
        snprintf(path, sizeof path, "%s/" RECORD_FILE, dir);
        if (unlink(path) != 0 && errno != ENOENT)
            return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
        return RESULT_OK;
    }
    char *text = text_of(record);
    struct named_bytes file = {RECORD_FILE, text, strlen(text)};
    enum result result = files_write(dir, &file, 1, err);
    free(text);
    return result;
}

// ---- poses --------------------------------------------------------------------------------------

enum result recorded_keys_rest(struct knee_case *knee, pose T_femur_tibia, struct error *err) {
    double flexion = flexion_of(knee, T_femur_tibia);
    int kept = 0, at = 0;
    for (int i = 0; i < knee->rest_count; i++) {
        if (flexion_between(knee, knee->rest[i], T_femur_tibia) < RECORDED_SAME_DEG)
            continue;
        at += flexion_of(knee, knee->rest[i]) < flexion;
        knee->rest[kept++] = knee->rest[i];
    }
    if (kept == CASE_KEYS_MAX)
        return fail(err, RESULT_LIMIT, "more than %d poses at rest", CASE_KEYS_MAX);
    memmove(&knee->rest[at + 1], &knee->rest[at], (size_t)(kept - at) * sizeof *knee->rest);
    knee->rest[at] = T_femur_tibia;
    knee->rest_count = kept + 1;
    return RESULT_OK;
}

// The ligament's waiting pose nearest in flexion, less than `within` away, or -1.
static int nearest_waiting(const struct knee_case *knee, const struct recorded_keys *record,
                           const char *ligament, pose T_femur_tibia, double within) {
    int best = -1;
    for (int i = 0; i < record->count; i++) {
        double away = flexion_between(knee, record->waiting[i].physical, T_femur_tibia);
        if (strcmp(record->waiting[i].ligament, ligament) == 0 && away < within) {
            within = away;
            best = i;
        }
    }
    return best;
}

// The same of its keys, by their physical poses.
static int nearest_key(const struct knee_case *knee, const char *ligament, pose T_femur_tibia,
                       double within) {
    int best = -1;
    for (int i = 0; i < knee->key_count; i++) {
        double away = flexion_between(knee, knee->keys[i].physical, T_femur_tibia);
        if (strcmp(knee->torn[knee->keys[i].ligament], ligament) == 0 && away < within) {
            within = away;
            best = i;
        }
    }
    return best;
}

enum result recorded_keys_physical(const struct knee_case *knee, struct recorded_keys *record,
                                   const char *ligament, pose T_femur_tibia, struct error *err) {
    if (!case_name_is_valid(ligament))
        return fail(err, RESULT_INVALID, "\"%.80s\" cannot be a ligament's name", ligament);
    int at = nearest_waiting(knee, record, ligament, T_femur_tibia, RECORDED_SAME_DEG);
    if (at < 0 && record->count == CASE_KEYS_MAX)
        return fail(err, RESULT_LIMIT, "more than %d poses wait for targets", CASE_KEYS_MAX);
    if (at < 0)
        at = record->count++;
    strcpy(record->waiting[at].ligament, ligament);
    record->waiting[at].physical = T_femur_tibia;
    return RESULT_OK;
}

// The ligament's index, of a new one where it is not torn yet.
static enum result torn_index(struct knee_case *knee, const char *ligament, int *out_index,
                              struct error *err) {
    for (*out_index = 0; *out_index < knee->torn_count; (*out_index)++)
        if (strcmp(knee->torn[*out_index], ligament) == 0)
            return RESULT_OK;
    if (knee->torn_count == CASE_LIGAMENTS_MAX)
        return fail(err, RESULT_LIMIT, "more than %d torn ligaments", CASE_LIGAMENTS_MAX);
    strcpy(knee->torn[knee->torn_count++], ligament);
    return RESULT_OK;
}

// Two keys of a ligament so near would be refused: of those at this pose the nearest stays.
static int keep_nearest_key(struct knee_case *knee, const char *ligament, pose physical) {
    int nearest = nearest_key(knee, ligament, physical, RECORDED_SAME_DEG), kept = 0, found = -1;
    if (nearest < 0)
        return -1;
    int torn = knee->keys[nearest].ligament;
    for (int i = 0; i < knee->key_count; i++) {
        struct case_key key = knee->keys[i];
        if (i == nearest)
            found = kept;
        else if (key.ligament == torn &&
                 flexion_between(knee, key.physical, physical) < RECORDED_SAME_DEG)
            continue;
        knee->keys[kept++] = key;
    }
    knee->key_count = kept;
    return found;
}

// The index of the ligament's key at this pose, of a new one where there is none.
static enum result key_at(struct knee_case *knee, const char *ligament, pose physical, int *out_key,
                          struct error *err) {
    *out_key = keep_nearest_key(knee, ligament, physical);
    if (*out_key >= 0)
        return RESULT_OK;
    if (knee->key_count == CASE_KEYS_MAX)
        return fail(err, RESULT_LIMIT, "more than %d keys", CASE_KEYS_MAX);
    int index;
    enum result result = torn_index(knee, ligament, &index, err);
    if (result != RESULT_OK)
        return result;
    *out_key = knee->key_count++;
    knee->keys[*out_key].ligament = index;
    return RESULT_OK;
}

// At the joint, where a translation means something.
static enum result check_goes_on(const struct knee_case *knee, pose physical, pose target,
                                 struct error *err) {
    vec3 centre = knee->joint.T_tibia_joint.translation;
    double turned = DEG_PER_RAD * quat_angle(physical.rotation, target.rotation);
    double moved = vec3_distance(pose_apply(physical, centre), pose_apply(target, centre));
    if (turned >= RECORDED_ON_DEG || moved >= RECORDED_ON_MM)
        return RESULT_OK;
    return fail(err, RESULT_INVALID,
                "the joint is only %.1f degrees and %.1f mm on from its physical pose: take the "
                "ligament off and push on",
                turned, moved);
}

enum result recorded_keys_target(struct knee_case *knee, struct recorded_keys *record,
                                 const char *ligament, pose T_femur_tibia, int *out_key,
                                 struct error *err) {
    int at = nearest_waiting(knee, record, ligament, T_femur_tibia, RECORDED_PAIR_DEG);
    if (at < 0) {
        *out_key = nearest_key(knee, ligament, T_femur_tibia, RECORDED_PAIR_DEG);
        if (*out_key < 0)
            return fail(err, RESULT_MISSING,
                        "%.80s has no physical pose within %g degrees of %.1f degrees of flexion: "
                        "record that first",
                        ligament, RECORDED_PAIR_DEG, flexion_of(knee, T_femur_tibia));
        enum result result = check_goes_on(knee, knee->keys[*out_key].physical, T_femur_tibia, err);
        if (result == RESULT_OK)
            knee->keys[*out_key].target = T_femur_tibia;
        return result;
    }
    pose physical = record->waiting[at].physical;
    enum result result = check_goes_on(knee, physical, T_femur_tibia, err);
    if (result == RESULT_OK)
        result = key_at(knee, ligament, physical, out_key, err);
    if (result != RESULT_OK)
        return result;
    knee->keys[*out_key].physical = physical;
    knee->keys[*out_key].target = T_femur_tibia;
    record->waiting[at] = record->waiting[--record->count];
    return RESULT_OK;
}
