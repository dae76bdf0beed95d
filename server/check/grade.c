#include "check/grade.h"

#include "case/files.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <jansson.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <xxhash.h>

#define FILE_BYTES_MAX (4 << 20)

// ---- checks made here ---------------------------------------------------------------------------

static void list_path(const char *dir, char out[PATH_MAX]) {
    snprintf(out, PATH_MAX, "%s/../%s", dir, GRADE_MADE_HERE);
}

static bool was_made_here(const char *dir, uint64_t hash, const void *text, size_t size) {
    char path[PATH_MAX], line[128];
    bool found = false;
    list_path(dir, path);
    FILE *file = fopen(path, "re");
    while (file && !found && fgets(line, sizeof line, file)) {
        uint64_t of_case, of_text;
        found = sscanf(line, "%16" SCNx64 " %16" SCNx64, &of_case, &of_text) == 2 &&
                of_case == hash && of_text == XXH3_64bits(text, size);
    }
    if (file)
        fclose(file);
    return found;
}

enum result grade_note(const char *dir, uint64_t hash, const char *text, size_t size, int64_t utc_s,
                       struct error *err) {
    char path[PATH_MAX], line[128];
    list_path(dir, path);
    int length = snprintf(line, sizeof line, "%016" PRIx64 " %016" PRIx64 " %" PRId64 "\n", hash,
                          (uint64_t)XXH3_64bits(text, size), utc_s);
    int fd = open(path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC | O_NOFOLLOW, 0644);
    bool written = fd >= 0 && write(fd, line, (size_t)length) == length && !fsync(fd);
    int reason = errno;
    if (fd >= 0)
        close(fd);
    return written ? RESULT_OK : fail(err, RESULT_IO, "%s: %s", path, strerror(reason));
}

// ---- reading ------------------------------------------------------------------------------------

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

static enum result take_fields(const json_t *root, struct case_grade *out, struct error *err) {
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
    enum result result = json_is_object(root) ? take_fields(root, out, err)
                                              : fail(err, RESULT_FORMAT, "not an object");
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
    out->made_here = result == RESULT_OK && was_made_here(dir, out->hash, bytes, size);
    free(bytes);
    if (result == RESULT_OK)
        return RESULT_OK;
    *out = (struct case_grade){0};
    return fail_in(err, result, "%s: ", path);
}
