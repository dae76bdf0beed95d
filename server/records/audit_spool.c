#include "records/audit_spool.h"

#include "base/log.h"
#include "base/number.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <libgen.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define LINE_MAX_BYTES 1024

_Static_assert(2 * STORE_NAME_MAX + STORE_TEXT_MAX + 32 < LINE_MAX_BYTES, "a line holds an entry");

static enum result path_of(const char *records, const char *end, char out[PATH_MAX],
                           struct error *err) {
    int length = snprintf(out, PATH_MAX, "%s.arrears%s", records, end);
    return length < PATH_MAX ? RESULT_OK : fail(err, RESULT_LIMIT, "%s: too long", records);
}

// Control characters would end the field or the line; no name contains them.
static size_t put_field(char *line, size_t used, const char *text, char end) {
    for (; *text; text++)
        line[used++] = (unsigned char)*text < ' ' ? '?' : *text;
    line[used++] = end;
    return used;
}

static bool write_line(int fd, const struct store_audit_entry *entry) {
    char line[LINE_MAX_BYTES];
    size_t used = (size_t)snprintf(line, sizeof line, "%" PRId64 "\t", entry->utc_ns);
    used = put_field(line, used, entry->actor, '\t');
    used = put_field(line, used, entry->action, '\t');
    used = put_field(line, used, entry->subject, '\n');
    errno = ENOSPC; // what a short write means
    return write(fd, line, used) == (ssize_t)used;
}

static enum result write_lines(const char *path, int flags,
                               const struct store_audit_entry *(*next)(void *user), void *user,
                               struct error *err) {
    int fd = open(path, O_WRONLY | O_CREAT | O_CLOEXEC | flags, 0600);
    bool done = fd >= 0;
    for (const struct store_audit_entry *entry; done && (entry = next(user));)
        done = write_line(fd, entry);
    done = done && fsync(fd) == 0;
    if (!done)
        fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    if (fd >= 0)
        close(fd);
    return done ? RESULT_OK : RESULT_IO;
}

static bool sync_folder(const char *path) {
    char copy[PATH_MAX];
    snprintf(copy, sizeof copy, "%s", path);
    int fd = open(dirname(copy), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    bool done = fd >= 0 && fsync(fd) == 0;
    if (fd >= 0)
        close(fd);
    return done;
}

enum result audit_spool_write(const char *records,
                              const struct store_audit_entry *(*next)(void *user), void *user,
                              struct error *err) {
    char path[PATH_MAX], draft[PATH_MAX];
    enum result result = path_of(records, "", path, err);
    if (result == RESULT_OK)
        result = path_of(records, ".draft", draft, err);
    if (result == RESULT_OK)
        result = write_lines(draft, O_TRUNC, next, user, err);
    if (result == RESULT_OK && (rename(draft, path) != 0 || !sync_folder(path)))
        result = fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    return result;
}

enum result audit_spool_add(const char *records,
                            const struct store_audit_entry *(*next)(void *user), void *user,
                            struct error *err) {
    char path[PATH_MAX];
    enum result result = path_of(records, "", path, err);
    return result == RESULT_OK ? write_lines(path, O_APPEND, next, user, err) : result;
}

static bool take_text(char **line, char *out, size_t size) {
    char *text = strsep(line, "\t");
    return text && (size_t)snprintf(out, size, "%s", text) < size;
}

static bool read_line(char *line, struct store_audit_entry *out) {
    const char *number = strsep(&line, "\t");
    return number_int(number, 0, INT64_MAX, &out->utc_ns) &&
           take_text(&line, out->actor, sizeof out->actor) &&
           take_text(&line, out->action, sizeof out->action) &&
           take_text(&line, out->subject, sizeof out->subject) && !line;
}

static size_t read_lines(FILE *file, const char *path,
                         void (*take)(void *user, const struct store_audit_entry *entry),
                         void *user) {
    char line[LINE_MAX_BYTES];
    size_t count = 0;
    while (fgets(line, sizeof line, file)) {
        struct store_audit_entry entry = {0};
        line[strcspn(line, "\n")] = '\0';
        if (!read_line(line, &entry)) {
            log_warning("records", "%s: a line is no entry of the audit log", path);
            continue;
        }
        take(user, &entry);
        count++;
    }
    return count;
}

enum result audit_spool_read(const char *records,
                             void (*take)(void *user, const struct store_audit_entry *entry),
                             void *user, size_t *out_count, struct error *err) {
    char path[PATH_MAX];
    *out_count = 0;
    enum result result = path_of(records, "", path, err);
    if (result != RESULT_OK)
        return result;
    FILE *file = fopen(path, "re");
    if (!file)
        return errno == ENOENT ? RESULT_OK : fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    *out_count = read_lines(file, path, take, user);
    if (ferror(file))
        result = fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    fclose(file);
    return result;
}

void audit_spool_drop(const char *records) {
    char path[PATH_MAX];
    if (path_of(records, "", path, NULL) == RESULT_OK)
        unlink(path);
}
