#include "base/draft.h"

#include "base/check.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static void release(struct draft *d) {
    free(d->path);
    free(d->draft_path);
    *d = (struct draft){0};
}

// A device or a pipe is written to as it is.
static bool is_special(const char *path) {
    struct stat status;
    return stat(path, &status) == 0 && !S_ISREG(status.st_mode);
}

enum result draft_open(const char *path, struct draft *d, struct error *err) {
    size_t room = strlen(path) + sizeof ".4294967296.draft";
    *d = (struct draft){.path = alloc_text(path), .draft_path = alloc(room, 1)};
    if (is_special(path))
        snprintf(d->draft_path, room, "%s", path);
    else
        snprintf(d->draft_path, room, "%s.%u.draft", path, (unsigned)getpid());
    d->file = fopen(d->draft_path, "we");
    if (d->file)
        return RESULT_OK;
    int problem = errno;
    release(d);
    return fail(err, problem == ENOENT ? RESULT_MISSING : RESULT_IO, "%s: %s", path,
                strerror(problem));
}

bool draft_is_good(struct draft *d) {
    if (!d->trouble && ferror(d->file))
        d->trouble = errno ? errno : EIO;
    return !d->trouble;
}

static bool is_in_place(const struct draft *d) {
    return !strcmp(d->path, d->draft_path);
}

enum result draft_keep(struct draft *d, struct error *err) {
    if (draft_is_good(d) && fflush(d->file) != 0)
        d->trouble = errno;
    if (!d->trouble && !is_in_place(d) && fsync(fileno(d->file)) != 0)
        d->trouble = errno;
    if (fclose(d->file) != 0 && !d->trouble)
        d->trouble = errno;
    if (!d->trouble && !is_in_place(d) && rename(d->draft_path, d->path) != 0)
        d->trouble = errno;
    enum result result = RESULT_OK;
    if (d->trouble) {
        result = fail(err, RESULT_IO, "%s: %s", d->path, strerror(d->trouble));
        if (!is_in_place(d))
            unlink(d->draft_path);
    }
    release(d);
    return result;
}

void draft_drop(struct draft *d) {
    fclose(d->file);
    if (!is_in_place(d))
        unlink(d->draft_path);
    release(d);
}

enum result draft_write(const char *path, const void *bytes, size_t size, struct error *err) {
    struct draft draft;
    enum result result = draft_open(path, &draft, err);
    if (result != RESULT_OK)
        return result;
    fwrite(bytes, 1, size, draft.file);
    draft_is_good(&draft);
    return draft_keep(&draft, err);
}
