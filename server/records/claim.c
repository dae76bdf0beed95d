#include "records/claim.h"

#include "base/check.h"
#include "trace/trace.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <unistd.h>

struct claim {
    int records, traces; // descriptors of the locks; -1: none
};

// The process that holds the lock, for the message; 0: unknown.
static int holder_of(int fd) {
    char text[16] = "";
    return pread(fd, text, sizeof text - 1, 0) > 0 ? atoi(text) : 0;
}

static enum result write_holder(int fd, const char *path, struct error *err) {
    char text[16];
    int length = snprintf(text, sizeof text, "%d\n", (int)getpid());
    if (ftruncate(fd, 0) || pwrite(fd, text, (size_t)length, 0) != length)
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    return RESULT_OK;
}

// RESULT_REFUSED, without a text, if another process keeps the lock.
static enum result lock(int fd, const char *path, struct error *err) {
    if (flock(fd, LOCK_EX | LOCK_NB) == 0)
        return RESULT_OK;
    return errno == EWOULDBLOCK ? RESULT_REFUSED
                                : fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
}

// Two paths of the same file get the same lock.
static enum result lock_records(const char *records, int *out_fd, struct error *err) {
    char real[PATH_MAX], path[PATH_MAX + 8];
    snprintf(path, sizeof path, "%s-server", realpath(records, real) ? real : records);
    *out_fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    if (*out_fd < 0)
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    enum result result = lock(*out_fd, path, err);
    if (result == RESULT_REFUSED)
        fail(err, result,
             "%s: another arthron-server (process %d) uses these records; stop it, or name others "
             "in the config",
             records, holder_of(*out_fd));
    return result == RESULT_OK ? write_holder(*out_fd, path, err) : result;
}

static enum result lock_traces(const char *dir, int *out_fd, struct error *err) {
    *out_fd = open(dir, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (*out_fd < 0)
        return fail(err, RESULT_IO, "%s: %s", dir, strerror(errno));
    enum result result = lock(*out_fd, dir, err);
    if (result == RESULT_REFUSED)
        fail(err, result,
             "%s: another arthron-server writes its traces into this folder; stop it, or name "
             "another folder in the config",
             dir);
    return result;
}

// An older server takes no lock of the folder, but locks each trace that it writes.
static enum result check_traces(const char *dir, struct error *err) {
    char path[PATH_MAX];
    enum result result = RESULT_OK;
    DIR *entries = opendir(dir);
    if (!entries)
        return fail(err, RESULT_IO, "%s: %s", dir, strerror(errno));
    struct dirent *entry;
    while (result == RESULT_OK && (errno = 0, entry = readdir(entries))) {
        size_t length = strlen(entry->d_name);
        if (length <= 6 || strcmp(entry->d_name + length - 6, ".trace"))
            continue;
        snprintf(path, sizeof path, "%s/%s", dir, entry->d_name);
        if (trace_is_written(path))
            result = fail(err, RESULT_REFUSED,
                          "%s: another program is still writing this trace; stop it first", path);
    }
    if (result == RESULT_OK && errno)
        result = fail(err, RESULT_IO, "%s: %s", dir, strerror(errno));
    closedir(entries);
    return result;
}

enum result claim_create(const char *records, const char *traces_dir, struct claim **out_claim,
                         struct error *err) {
    struct claim *claim = alloc(1, sizeof *claim);
    *claim = (struct claim){-1, -1};
    enum result result = records[0] ? lock_records(records, &claim->records, err) : RESULT_OK;
    if (result == RESULT_OK)
        result = lock_traces(traces_dir, &claim->traces, err);
    if (result == RESULT_OK)
        result = check_traces(traces_dir, err);
    if (result != RESULT_OK)
        claim_destroy(&claim);
    *out_claim = claim;
    return result;
}

void claim_destroy(struct claim **claim) {
    struct claim *c = *claim;
    if (!c)
        return;
    if (c->records >= 0)
        close(c->records);
    if (c->traces >= 0)
        close(c->traces);
    free(c);
    *claim = NULL;
}
