#include "check/grade.h"

#include "case/files.h"

#include <errno.h>
#include <jansson.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define FILE_BYTES_MAX (4 << 20)

const char *grade_name(enum grade grade) {
    static const char *const names[GRADE_COUNT] = {"fit", "fit with warnings", "unfit"};
    return (unsigned)grade < GRADE_COUNT ? names[grade] : "unknown";
}

static bool take_grade(const char *text, enum grade *out) {
    for (int i = 0; text && i < GRADE_COUNT; i++)
        if (!strcmp(text, grade_name((enum grade)i))) {
            *out = (enum grade)i;
            return true;
        }
    return false;
}

// Sixteen digits, as written.
static bool take_hash(const char *text, uint64_t *out) {
    if (!text || strlen(text) != 16 || strspn(text, "0123456789abcdef") != 16)
        return false;
    *out = strtoull(text, NULL, 16);
    return true;
}

static void take_reason(const json_t *root, struct case_grade *out) {
    const json_t *findings = json_object_get(root, "findings");
    size_t count = json_array_size(findings);
    for (size_t i = 0; i < count; i++) {
        const json_t *finding = json_array_get(findings, i);
        const char *level = json_string_value(json_object_get(finding, "level"));
        const char *where = json_string_value(json_object_get(finding, "where"));
        const char *text = json_string_value(json_object_get(finding, "text"));
        if (level && where && text && !strcmp(level, "fault")) {
            snprintf(out->reason, sizeof out->reason, "%s: %s", where, text);
            return;
        }
    }
}

static enum result take(const json_t *root, struct case_grade *out, struct error *err) {
    const char *format = json_string_value(json_object_get(root, "format"));
    const json_t *version = json_object_get(root, "version");
    const json_t *quick = json_object_get(root, "quick");
    const json_t *settings = json_object_get(root, "settings");
    const char *field = json_string_value(json_object_get(settings, "field"));
    if (!format || strcmp(format, GRADE_FORMAT) != 0)
        return fail(err, RESULT_FORMAT, "format is not \"%s\"", GRADE_FORMAT);
    if (!json_is_integer(version) || json_integer_value(version) != GRADE_VERSION)
        return fail(err, RESULT_VERSION, "version is not %d", GRADE_VERSION);
    if (!take_grade(json_string_value(json_object_get(root, "grade")), &out->grade))
        return fail(err, RESULT_INVALID, "grade: none of ours");
    if (!take_hash(json_string_value(json_object_get(root, "hash")), &out->hash))
        return fail(err, RESULT_INVALID, "hash: not 16 hexadecimal digits");
    if (!json_is_boolean(quick))
        return fail(err, RESULT_INVALID, "quick: neither true nor false");
    if (!field || strlen(field) >= sizeof out->field)
        return fail(err, RESULT_INVALID, "settings.field: not a name");
    out->quick = json_is_true(quick);
    snprintf(out->field, sizeof out->field, "%s", field);
    take_reason(root, out);
    return RESULT_OK;
}

static enum result parse(const uint8_t *bytes, size_t size, struct case_grade *out,
                         struct error *err) {
    json_error_t where;
    json_t *root = json_loadb((const char *)bytes, size, JSON_REJECT_DUPLICATES, &where);
    if (!root)
        return fail(err, RESULT_FORMAT, "line %d: %s", where.line, where.text);
    enum result result =
        json_is_object(root) ? take(root, out, err) : fail(err, RESULT_FORMAT, "not an object");
    json_decref(root);
    return result;
}

enum result grade_read(const char *dir, struct case_grade *out, struct error *err) {
    char path[PATH_MAX];
    uint8_t *bytes;
    size_t size;
    *out = (struct case_grade){0};
    snprintf(path, sizeof path, "%s/%s", dir, GRADE_FILE);
    if (access(path, F_OK) && errno == ENOENT)
        return fail(err, RESULT_MISSING, "%s: no such file", path);
    enum result result = files_read(path, FILE_BYTES_MAX, &bytes, &size, err);
    if (result != RESULT_OK)
        return result;
    result = parse(bytes, size, out, err);
    free(bytes);
    if (result == RESULT_OK)
        return RESULT_OK;
    *out = (struct case_grade){0};
    return fail_in(err, result, "%s: ", path);
}
