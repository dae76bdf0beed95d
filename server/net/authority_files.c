#include "net/authority_files.h"

#include "base/check.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#define PATH_SIZE 4096
#define RECORDS_MAX 65536

static enum result path_of(const char *dir, const char *name, char out_path[PATH_SIZE],
                           struct error *err) {
    int used = snprintf(out_path, PATH_SIZE, "%s/%s", dir, name);
    if (used < 0 || used >= PATH_SIZE)
        return fail(err, RESULT_LIMIT, "%s: the path is too long", name);
    return RESULT_OK;
}

// An administrator works here as root, the server as a user of its own: files belong to whom the
// folder belongs.
static bool give_to_owner(const char *dir, int fd) {
    struct stat owner;
    return geteuid() != 0 || (!stat(dir, &owner) && !fchown(fd, owner.st_uid, owner.st_gid));
}

enum result authority_lock(const char *dir, bool waits, int *out_fd, struct error *err) {
    char path[PATH_SIZE];
    enum result result = path_of(dir, "lock", path, err);
    if (result != RESULT_OK)
        return result;
    int fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
    if (fd < 0)
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    if (!give_to_owner(dir, fd)) {
        close(fd);
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    }
    while (flock(fd, waits ? LOCK_EX : LOCK_EX | LOCK_NB)) {
        int reason = errno;
        if (reason == EINTR)
            continue;
        close(fd);
        return reason == EWOULDBLOCK
                   ? fail(err, RESULT_TIMEOUT, "%s: another process is using these keys", path)
                   : fail(err, RESULT_IO, "%s: %s", path, strerror(reason));
    }
    *out_fd = fd;
    return RESULT_OK;
}

// ---- whole files --------------------------------------------------------------------------------

static bool write_all(int fd, const char *data, size_t size) {
    while (size) {
        ssize_t written = write(fd, data, size);
        if (written < 0 && errno != EINTR)
            return false;
        if (written > 0) {
            data += written;
            size -= (size_t)written;
        }
    }
    return !fsync(fd);
}

static bool sync_folder(const char *dir) {
    int fd = open(dir, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    bool done = fd >= 0 && !fsync(fd);
    if (fd >= 0)
        close(fd);
    return done;
}

static bool replace(const char *dir, const char *path, const char *beside, const void *data,
                    size_t size) {
    unlink(beside); // left by a process that was killed
    int fd = open(beside, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    if (fd < 0)
        return false;
    bool written = give_to_owner(dir, fd) && write_all(fd, data, size);
    written &= !close(fd);
    return written && !rename(beside, path) && sync_folder(dir);
}

enum result authority_write(const char *dir, const char *name, const void *data, size_t size,
                            struct error *err) {
    char path[PATH_SIZE], beside[PATH_SIZE];
    enum result result = path_of(dir, name, path, err);
    if (result != RESULT_OK)
        return result;
    int used = snprintf(beside, sizeof beside, "%s.new", path);
    if (used >= (int)sizeof beside)
        return fail(err, RESULT_LIMIT, "%s: the path is too long", name);
    if (!replace(dir, path, beside, data, size))
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    return RESULT_OK;
}

// ---- records ------------------------------------------------------------------------------------

void records_add(struct records *records, const char *key, int64_t utc_s, const char *station) {
    records->items =
        alloc_resize(records->items, (unsigned long)records->count + 1, sizeof *records->items);
    struct record *record = &records->items[records->count++];
    *record = (struct record){.utc_s = utc_s};
    snprintf(record->key, sizeof record->key, "%s", key);
    snprintf(record->station, sizeof record->station, "%s", station);
}

void records_remove(struct records *records, int index) {
    records->count--;
    memmove(&records->items[index], &records->items[index + 1],
            (size_t)(records->count - index) * sizeof *records->items);
}

void records_release(struct records *records) {
    free(records->items);
    *records = (struct records){0};
}

static enum result read_lines(FILE *file, const char *path, struct records *out,
                              struct error *err) {
    char line[256];
    for (int number = 1; fgets(line, sizeof line, file); number++) {
        struct record record;
        int end = 0;
        if (sscanf(line, "%64s %" SCNd64 " %63s%n", record.key, &record.utc_s, record.station,
                   &end) != 3 ||
            line[end] != '\n')
            return fail(err, RESULT_CORRUPT, "%s: line %d is not a key, a time and a station", path,
                        number);
        if (out->count == RECORDS_MAX)
            return fail(err, RESULT_LIMIT, "%s: more than %d lines", path, RECORDS_MAX);
        records_add(out, record.key, record.utc_s, record.station);
    }
    return ferror(file) ? fail(err, RESULT_IO, "%s: %s", path, strerror(errno)) : RESULT_OK;
}

enum result records_read(const char *dir, const char *name, struct records *out_records,
                         struct error *err) {
    *out_records = (struct records){0};
    char path[PATH_SIZE];
    enum result result = path_of(dir, name, path, err);
    if (result != RESULT_OK)
        return result;
    FILE *file = fopen(path, "re");
    if (!file)
        return errno == ENOENT ? RESULT_OK : fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    result = read_lines(file, path, out_records, err);
    fclose(file);
    return result;
}

enum result records_write(const char *dir, const char *name, const struct records *records,
                          struct error *err) {
    char *text = NULL;
    size_t size = 0;
    FILE *memory = open_memstream(&text, &size);
    if (!memory)
        return fail(err, RESULT_LIMIT, "%s/%s: no memory", dir, name);
    for (int i = 0; i < records->count; i++)
        fprintf(memory, "%s %" PRId64 " %s\n", records->items[i].key, records->items[i].utc_s,
                records->items[i].station);
    bool whole = fclose(memory) == 0 && text;
    enum result result = whole ? authority_write(dir, name, text, size, err)
                               : fail(err, RESULT_LIMIT, "%s/%s: no memory", dir, name);
    free(text);
    return result;
}
