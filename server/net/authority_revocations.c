#include "net/authority_revocations.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "net/authority_files.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <strings.h>
#include <sys/stat.h>

#define BRIDGED_NS (60 * NS_PER_S)

struct revocations {
    bool readable;
    int64_t failing_ns;     // since when a newer one could not be read; 0: it could
    struct stat file;       // before it was read; zero: not there
    struct records records; // sorted by key
};

// A change of the content, the rights or the name is a change of ctime.
static bool is_same_file(const struct stat *a, const struct stat *b) {
    return a->st_dev == b->st_dev && a->st_ino == b->st_ino && a->st_size == b->st_size &&
           a->st_ctim.tv_sec == b->st_ctim.tv_sec && a->st_ctim.tv_nsec == b->st_ctim.tv_nsec;
}

// False where nobody can tell.
static bool find_file(const char *dir, struct stat *out) {
    char path[4096];
    int used = snprintf(path, sizeof path, "%s/revoked", dir);
    *out = (struct stat){0};
    return used < (int)sizeof path && (!stat(path, out) || errno == ENOENT);
}

static int compare(const void *a, const void *b) {
    return strcasecmp(((const struct record *)a)->key, ((const struct record *)b)->key);
}

// The one before goes on for a while: what cannot be read just now ends no sessions.
static bool is_bridged(struct revocations *before, const struct error *err) {
    int64_t now_ns = clock_now_ns();
    if (!before || !before->readable)
        return false;
    if (!before->failing_ns) {
        before->failing_ns = now_ns;
        log_error("control",
                  "the list of revoked certificates cannot be read, the one before goes "
                  "on for a minute: %s",
                  err->text);
    }
    return now_ns - before->failing_ns < BRIDGED_NS;
}

struct revocations *revocations_read(const char *dir, struct revocations *before) {
    struct stat file;
    struct error err;
    bool found = find_file(dir, &file);
    if (before && before->readable && found && is_same_file(&before->file, &file))
        return NULL;
    struct revocations *now = alloc(1, sizeof *now);
    now->file = file;
    now->readable = records_read(dir, "revoked", &now->records, &err) == RESULT_OK;
    if (!now->readable && is_bridged(before, &err)) {
        revocations_release(&now);
        return NULL;
    }
    if (now->records.count)
        qsort(now->records.items, (size_t)now->records.count, sizeof *now->records.items, compare);
    if (!now->readable && (!before || before->readable))
        log_error("control",
                  "all stations are refused; the list of revoked certificates cannot be read: %s",
                  err.text);
    return now;
}

bool revocations_contain(const struct revocations *revocations, const char *serial_hex) {
    const struct records *records = &revocations->records;
    struct record wanted;
    if (!revocations->readable)
        return true;
    snprintf(wanted.key, sizeof wanted.key, "%s", serial_hex);
    return records->count && bsearch(&wanted, records->items, (size_t)records->count,
                                     sizeof *records->items, compare);
}

void revocations_release(struct revocations **revocations) {
    records_release(&(*revocations)->records);
    free(*revocations);
    *revocations = NULL;
}
