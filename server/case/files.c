#include "case/files.h"

#include "base/check.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define FILES_MAX 4

static enum result fail_errno(struct error *err, const char *path) {
    enum result code = errno == ENOENT ? RESULT_MISSING : RESULT_IO;
    return fail(err, code, "%s: %s", path, strerror(errno));
}

static enum result read_open(int file, const char *path, size_t max_bytes, uint8_t **out_bytes,
                             size_t *out_size, struct error *err) {
    struct stat status;
    if (fstat(file, &status) != 0)
        return fail_errno(err, path);
    if (!S_ISREG(status.st_mode))
        return fail(err, RESULT_INVALID, "%s: not a regular file", path);
    if ((uint64_t)status.st_size > max_bytes)
        return fail(err, RESULT_LIMIT, "%s: %lld bytes, more than %zu", path,
                    (long long)status.st_size, max_bytes);
    size_t size = (size_t)status.st_size, used = 0;
    uint8_t *bytes = alloc(size, 1);
    while (used < size) {
        ssize_t got = read(file, bytes + used, size - used);
        if (got < 0 && errno == EINTR)
            continue;
        if (got <= 0)
            break;
        used += (size_t)got;
    }
    if (used < size) {
        free(bytes);
        return fail(err, RESULT_IO, "%s: only %zu of %zu bytes could be read", path, used, size);
    }
    *out_bytes = bytes;
    *out_size = size;
    return RESULT_OK;
}

enum result files_read(const char *path, size_t max_bytes, uint8_t **out_bytes, size_t *out_size,
                       struct error *err) {
    int file = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK); // a pipe must not keep us waiting
    if (file < 0)
        return fail_errno(err, path);
    enum result result = read_open(file, path, max_bytes, out_bytes, out_size, err);
    close(file);
    return result;
}

static enum result make_folders(const char *dir, struct error *err) {
    char path[PATH_MAX];
    if (strlen(dir) == 0 || strlen(dir) + 32 > sizeof path)
        return fail(err, RESULT_INVALID, "\"%.80s\": not the path of a folder", dir);
    snprintf(path, sizeof path, "%s", dir);
    for (char *c = path + 1; *c; c++) {
        if (*c != '/')
            continue;
        *c = '\0';
        if (mkdir(path, 0777) != 0 && errno != EEXIST)
            return fail_errno(err, path);
        *c = '/';
    }
    if (mkdir(path, 0777) != 0 && errno != EEXIST)
        return fail_errno(err, path);
    return RESULT_OK;
}

static bool write_all(int file, const uint8_t *bytes, size_t size) {
    while (size > 0) {
        ssize_t put = write(file, bytes, size);
        if (put < 0 && errno == EINTR)
            continue;
        if (put < 0)
            return false;
        bytes += put;
        size -= (size_t)put;
    }
    return fsync(file) == 0;
}

// Writes under the temporary name `path`; nothing stays after a failure.
static enum result write_aside(const char *path, const struct named_bytes *from, struct error *err) {
    int file = open(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
    if (file < 0)
        return fail_errno(err, path);
    bool good = write_all(file, from->bytes, from->size);
    int saved = errno;
    close(file);
    errno = saved;
    if (good)
        return RESULT_OK;
    enum result result = fail_errno(err, path);
    unlink(path);
    return result;
}

static void sync_folder(const char *dir) {
    int folder = open(dir, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (folder >= 0) {
        fsync(folder);
        close(folder);
    }
}

enum result files_write(const char *dir, const struct named_bytes *files, int count,
                        struct error *err) {
    CHECK(count <= FILES_MAX);
    char aside[FILES_MAX][PATH_MAX], path[PATH_MAX];
    enum result result = make_folders(dir, err);
    int written = 0, placed = 0;
    for (; result == RESULT_OK && written < count; written++) {
        snprintf(aside[written], PATH_MAX, "%s/%s.%d~", dir, files[written].name, (int)getpid());
        result = write_aside(aside[written], &files[written], err);
        if (result != RESULT_OK)
            break;
    }
    for (; result == RESULT_OK && placed < count; placed++) {
        snprintf(path, sizeof path, "%s/%s", dir, files[placed].name);
        if (rename(aside[placed], path) != 0) {
            result = fail_errno(err, path);
            break;
        }
    }
    for (int i = placed; i < written; i++)
        unlink(aside[i]);
    if (result == RESULT_OK)
        sync_folder(dir);
    return result;
}
