// Which file the records are.
#include "base/clock.h"
#include "store/database.h"

#include <errno.h>
#include <string.h>
#include <sys/stat.h>

static enum result read_numbers(const char *path, struct store_identity *out, struct error *err) {
    struct store *store;
    out->audit = 0;
    enum result result = store_open(path, STORE_THERE, "server", &store, err);
    if (result != RESULT_OK)
        return result;
    result = store_find(store, "SELECT seq FROM sqlite_sequence WHERE name = 'audit'", &out->audit,
                        err, "");
    if (result == RESULT_OK || result == RESULT_MISSING)
        result = store_find(store, "SELECT dropped FROM share", &out->dropped, err, "");
    store_close(&store);
    return result == RESULT_MISSING ? RESULT_OK : result;
}

enum result store_identify(const char *path, const struct store_identity *before,
                           struct store_identity *out, struct error *err) {
    struct stat status;
    *out = (struct store_identity){0};
    if (stat(path, &status))
        return fail(err, errno == ENOENT ? RESULT_MISSING : RESULT_IO, "%s: %s", path,
                    strerror(errno));
    out->device = status.st_dev;
    out->inode = status.st_ino;
    out->changed_ns = status.st_ctim.tv_sec * NS_PER_S + status.st_ctim.tv_nsec;
    out->audit = before->audit;
    out->dropped = before->dropped;
    if (out->device == before->device && out->inode == before->inode &&
        out->changed_ns == before->changed_ns)
        return RESULT_OK;
    return read_numbers(path, out, err);
}

bool store_is_other(const struct store_identity *before, const struct store_identity *now) {
    return before->inode && (now->dropped > before->dropped || before->device != now->device ||
                             before->inode != now->inode || now->audit < before->audit);
}
