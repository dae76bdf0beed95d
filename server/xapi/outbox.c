#include "xapi/outbox.h"

#include "base/check.h"
#include "base/log.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <limits.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define SENT_BYTES 42 // "INODE OFFSET\n", 20 digits each

struct outbox {
    pthread_mutex_t mutex;
    char path[PATH_MAX], before[PATH_MAX], sent_path[PATH_MAX];
    int fd, sent_fd; // sent_fd -1: nobody sends
    size_t size, sent;
};

static enum result broken(const char *path, struct error *err) {
    return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
}

// ---- opening ------------------------------------------------------------------------------------

static enum result open_file(struct outbox *o, struct error *err) {
    struct stat status;
    char last;
    o->fd = open(o->path, O_RDWR | O_APPEND | O_CREAT | O_CLOEXEC, 0600);
    if (o->fd < 0 || fstat(o->fd, &status))
        return broken(o->path, err);
    o->size = (size_t)status.st_size;
    bool cut = o->size && pread(o->fd, &last, 1, (off_t)o->size - 1) == 1 && last != '\n';
    if (cut && write(o->fd, "\n", 1) != 1)
        return broken(o->path, err);
    o->size += cut;
    return RESULT_OK;
}

static enum result write_sent(struct outbox *o, struct error *err) {
    struct stat status;
    char text[SENT_BYTES + 1];
    if (o->sent_fd < 0)
        return RESULT_OK;
    if (fstat(o->fd, &status))
        return broken(o->path, err);
    snprintf(text, sizeof text, "%020" PRIu64 " %020" PRIu64 "\n", (uint64_t)status.st_ino,
             (uint64_t)o->sent);
    return pwrite(o->sent_fd, text, SENT_BYTES, 0) == SENT_BYTES ? RESULT_OK
                                                                 : broken(o->sent_path, err);
}

// Of another file, as after a restore, or of none: then all is sent again, which the store notices.
static size_t read_sent(const struct outbox *o) {
    struct stat status;
    char text[SENT_BYTES + 1] = "";
    uint64_t inode, sent;
    bool whole = pread(o->sent_fd, text, SENT_BYTES, 0) == SENT_BYTES && !fstat(o->fd, &status) &&
                 sscanf(text, "%" SCNu64 " %" SCNu64, &inode, &sent) == 2;
    return whole && inode == status.st_ino && sent <= o->size ? (size_t)sent : 0;
}

enum result outbox_open(const char *path, bool sends, struct outbox **out, struct error *err) {
    struct outbox *o = alloc(1, sizeof *o);
    o->fd = o->sent_fd = -1;
    pthread_mutex_init(&o->mutex, NULL);
    *out = o;
    bool fits = snprintf(o->path, PATH_MAX, "%s", path) < PATH_MAX &&
                snprintf(o->before, PATH_MAX, "%s.1", path) < PATH_MAX &&
                snprintf(o->sent_path, PATH_MAX, "%s.sent", path) < PATH_MAX;
    enum result result = fits ? open_file(o, err) : fail(err, RESULT_LIMIT, "%s: too long", path);
    if (result == RESULT_OK && sends) {
        o->sent_fd = open(o->sent_path, O_RDWR | O_CREAT | O_CLOEXEC, 0600);
        result = o->sent_fd < 0 ? broken(o->sent_path, err) : RESULT_OK;
        o->sent = result == RESULT_OK ? read_sent(o) : 0;
    }
    if (result != RESULT_OK)
        outbox_close(out);
    return result;
}

void outbox_close(struct outbox **outbox) {
    struct outbox *o = *outbox;
    *outbox = NULL;
    if (!o)
        return;
    if (o->fd >= 0)
        close(o->fd);
    if (o->sent_fd >= 0)
        close(o->sent_fd);
    pthread_mutex_destroy(&o->mutex);
    free(o);
}

// ---- adding -------------------------------------------------------------------------------------

static enum result turn_over(struct outbox *o, struct error *err) {
    if (rename(o->path, o->before))
        return broken(o->before, err);
    close(o->fd);
    o->sent = 0;
    enum result result = open_file(o, err);
    return result == RESULT_OK ? write_sent(o, err) : result;
}

static enum result make_room(struct outbox *o, size_t more, struct error *err) {
    bool all_sent = o->sent_fd < 0 || o->sent == o->size;
    if (o->size + more > OUTBOX_TURN && all_sent)
        return turn_over(o, err);
    if (o->size + more > OUTBOX_MOST)
        return fail(err, RESULT_LIMIT, "%s: %zu MB wait to be sent, so it takes no more", o->path,
                    OUTBOX_MOST >> 20);
    return RESULT_OK;
}

// All of the line or nothing.
static enum result append(struct outbox *o, const char *line, size_t bytes, struct error *err) {
    errno = ENOSPC; // what a short write means
    if (write(o->fd, line, bytes) == (ssize_t)bytes && !fdatasync(o->fd)) {
        o->size += bytes;
        return RESULT_OK;
    }
    enum result result = broken(o->path, err);
    if (ftruncate(o->fd, (off_t)o->size))
        log_error("xapi", "%s: %s", o->path, strerror(errno));
    return result;
}

enum result outbox_add(struct outbox *o, const char *line, struct error *err) {
    size_t bytes = strlen(line) + 1;
    if (bytes > OUTBOX_LINE_MAX)
        return fail(err, RESULT_LIMIT, "%s: a statement of %zu bytes is too long", o->path, bytes);
    char *ended = alloc(bytes + 1, 1);
    memcpy(ended, line, bytes - 1);
    ended[bytes - 1] = '\n';
    pthread_mutex_lock(&o->mutex);
    enum result result = o->fd < 0 ? open_file(o, err) : RESULT_OK;
    if (result == RESULT_OK)
        result = make_room(o, bytes, err);
    if (result == RESULT_OK)
        result = append(o, ended, bytes, err);
    pthread_mutex_unlock(&o->mutex);
    free(ended);
    return result;
}

// ---- sending ------------------------------------------------------------------------------------

static void find_lines(struct outbox_batch *batch, size_t bytes) {
    batch->count = 0;
    batch->starts[0] = 0;
    for (size_t i = 0; i < bytes && batch->count < OUTBOX_BATCH; i++)
        if (batch->text[i] == '\n') {
            batch->text[i] = '\0';
            batch->starts[++batch->count] = i + 1;
        }
}

enum result outbox_next(struct outbox *o, struct outbox_batch *batch, struct error *err) {
    pthread_mutex_lock(&o->mutex);
    ssize_t got = pread(o->fd, batch->text, OUTBOX_BATCH_BYTES, (off_t)o->sent);
    pthread_mutex_unlock(&o->mutex);
    if (got < 0)
        return broken(o->path, err);
    find_lines(batch, (size_t)got);
    bool endless = got == (ssize_t)OUTBOX_BATCH_BYTES && !batch->count;
    return endless ? fail(err, RESULT_FORMAT, "%s: a line at byte %zu has no end", o->path, o->sent)
                   : RESULT_OK;
}

enum result outbox_sent(struct outbox *o, size_t bytes, struct error *err) {
    pthread_mutex_lock(&o->mutex);
    CHECK(o->sent + bytes <= o->size);
    o->sent += bytes;
    enum result result = write_sent(o, err);
    pthread_mutex_unlock(&o->mutex);
    return result;
}
