#include "records/audit_head.h"

#include "base/draft.h"
#include "base/number.h"

#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>

static enum result name_file(const char *authority, char out[PATH_MAX], struct error *err) {
    const char *slash = strrchr(authority, '/');
    int folder = slash ? (int)(slash + 1 - authority) : 0;
    return snprintf(out, PATH_MAX, "%.*saudit.head", folder, authority) < PATH_MAX
               ? RESULT_OK
               : fail(err, RESULT_LIMIT, "%s: the path is too long", authority);
}

bool audit_head_parse(const char *text, struct store_audit_head *out) {
    char number[24] = "";
    const char *colon = strchr(text, ':');
    size_t length = colon ? (size_t)(colon - text) : 0;
    if (length > 0 && length < sizeof number)
        memcpy(number, text, length);
    *out = (struct store_audit_head){0};
    if (!number_int(number, 1, INT64_MAX, &out->entry) || strlen(colon + 1) >= sizeof out->hash)
        return false;
    snprintf(out->hash, sizeof out->hash, "%s", colon + 1);
    return true;
}

enum result audit_head_read(const char *authority, struct store_audit_head *out,
                            struct error *err) {
    char path[PATH_MAX], line[128];
    *out = (struct store_audit_head){0};
    enum result result = name_file(authority, path, err);
    if (result != RESULT_OK)
        return result;
    FILE *file = fopen(path, "re");
    if (!file)
        return fail(err, errno == ENOENT ? RESULT_MISSING : RESULT_IO, "%s: %s", path,
                    strerror(errno));
    bool got = fgets(line, sizeof line, file);
    bool failed = ferror(file);
    fclose(file);
    if (failed)
        return fail(err, RESULT_IO, "%s: it cannot be read", path);
    line[got ? strcspn(line, "\n") : 0] = '\0';
    return audit_head_parse(line, out) ? RESULT_OK
                                       : fail(err, RESULT_FORMAT, "%s: not NUMBER:HASH", path);
}

enum result audit_head_keep(const char *authority, const struct store_audit_head *head,
                            struct error *err) {
    char path[PATH_MAX], line[128];
    int length = snprintf(line, sizeof line, "%lld:%s\n", (long long)head->entry, head->hash);
    enum result result = name_file(authority, path, err);
    return result == RESULT_OK ? draft_write(path, line, (size_t)length, err) : result;
}

enum result audit_head_check(struct store *store, const char *authority,
                             struct store_audit_head *out, struct error *err) {
    char path[PATH_MAX];
    enum result result = audit_head_read(authority, out, err);
    if (result != RESULT_OK)
        return result == RESULT_MISSING ? RESULT_OK : result;
    result = store_audit_has(store, out, err);
    if (result == RESULT_MISSING && name_file(authority, path, NULL) == RESULT_OK)
        fail(err, result,
             "entry %lld of the audit log, which the server signed, is missing or was changed: the "
             "records are an older copy, or somebody wrote into them; if you restored a backup, "
             "remove %s",
             (long long)out->entry, path);
    return result;
}
