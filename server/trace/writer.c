#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "trace/record.h"

#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <time.h>
#include <unistd.h>

#define WRITE_EVERY_NS (20 * NS_PER_MS)
#define SYNC_EVERY_NS NS_PER_S
#define BUFFER_SIZE ((size_t)4 << 20) // a power of two: about 40 s of one instrument at 100 Hz

// The buffer is a stream of whole records between one appender and one thread that writes. A write
// that fails leaves its bytes in the buffer, so the file stays a whole stream whatever the disk
// does; only the appender drops, and only whole records.
struct trace_writer {
    int fd;
    int rules; // that the session follows
    char *path;
    uint8_t *buffer;
    _Alignas(64) atomic_size_t head; // next byte to fill, owned by the appender
    uint64_t gap;                    // steps dropped since the last record, the appender's
    struct chain chain;              // the appender's, through the records in the buffer
    const struct trace_signer *signer;
    _Alignas(64) atomic_size_t tail; // next byte to write, owned by the thread
    bool unsynced;                   // the thread's
    atomic_bool failing;
    atomic_uint_fast64_t records, missing, bytes;
    pthread_t thread;
    pthread_mutex_t mutex; // of stop
    pthread_cond_t wake;
    bool stop;
};

// ---- appending

static bool put(struct trace_writer *w, const uint8_t *data, size_t size) {
    size_t head = atomic_load_explicit(&w->head, memory_order_relaxed);
    size_t tail = atomic_load_explicit(&w->tail, memory_order_acquire);
    if (BUFFER_SIZE - (head - tail) < size)
        return false;
    size_t at = head & (BUFFER_SIZE - 1);
    size_t first = size < BUFFER_SIZE - at ? size : BUFFER_SIZE - at;
    memcpy(w->buffer + at, data, first);
    memcpy(w->buffer, data + first, size - first);
    atomic_store_explicit(&w->head, head + size, memory_order_release);
    return true;
}

static size_t waiting_bytes(const struct trace_writer *w) {
    return atomic_load_explicit(&w->head, memory_order_acquire) -
           atomic_load_explicit(&w->tail, memory_order_relaxed);
}

static void count(atomic_uint_fast64_t *counter, uint64_t more) {
    atomic_fetch_add_explicit(counter, more, memory_order_relaxed);
}

// Where the buffer is full the chain is as it was.
static bool append(struct trace_writer *w, const struct session_input *input, bool job_done,
                   const struct session_output *output) {
    uint8_t data[2 * RECORD_MAX], before[TRACE_HASH_SIZE];
    memcpy(before, w->chain.value, sizeof before);
    size_t size = w->gap ? record_encode_gap(w->gap, &w->chain, data) : 0;
    size += record_encode_step(input, job_done, output, w->rules, &w->chain, data + size);
    if (!put(w, data, size)) {
        memcpy(w->chain.value, before, sizeof before);
        return false;
    }
    w->gap = 0;
    count(&w->records, 1);
    return true;
}

bool trace_append(struct trace_writer *w, const struct session_input *input,
                  const struct session_output *output) {
    if (append(w, input, input->kind == INPUT_JOB && input->result, output))
        return true;
    w->gap++;
    count(&w->missing, 1);
    return false;
}

// A gap before it stays where it is: steps are missing behind the last one, whatever was said.
bool trace_append_remark(struct trace_writer *w, const struct remark *remark) {
    uint8_t data[RECORD_MAX], before[TRACE_HASH_SIZE];
    CHECK(remark_is_valid(remark));
    memcpy(before, w->chain.value, sizeof before);
    if (put(w, data, record_encode_remark(remark, &w->chain, data)))
        return true;
    memcpy(w->chain.value, before, sizeof before);
    return false;
}

static enum result wait_for_room(struct trace_writer *w, struct error *err) {
    while (BUFFER_SIZE - waiting_bytes(w) < 2 * RECORD_MAX) {
        if (atomic_load(&w->failing))
            return fail(err, RESULT_IO, "%s: the disk takes no more", w->path);
        nanosleep(&(struct timespec){0, NS_PER_MS}, NULL);
    }
    return RESULT_OK;
}

enum result trace_append_record(struct trace_writer *w, const struct trace_record *record,
                                struct error *err) {
    uint8_t data[RECORD_MAX];
    enum result result = wait_for_room(w, err);
    if (result != RESULT_OK)
        return result;
    bool taken = true;
    if (record->type == TRACE_STEP)
        taken = append(w, &record->input, record->job_done, &record->output);
    if (record->type == TRACE_PAST)
        taken = put(w, data, record_encode_past(&record->input, record->job_done, &w->chain, data));
    if (record->type == TRACE_REMARK)
        taken = trace_append_remark(w, &record->remark);
    if (record->type == TRACE_GAP) {
        w->gap += record->missing;
        count(&w->missing, record->missing);
    }
    CHECK(taken);
    return RESULT_OK;
}

struct trace_status trace_writer_status(const struct trace_writer *w) {
    return (struct trace_status){
        .records = atomic_load_explicit(&w->records, memory_order_relaxed),
        .missing = atomic_load_explicit(&w->missing, memory_order_relaxed),
        .bytes = atomic_load_explicit(&w->bytes, memory_order_relaxed),
        .failing = atomic_load_explicit(&w->failing, memory_order_relaxed),
    };
}

// ---- the thread

static void disk_failed(struct trace_writer *w, const char *what) {
    if (!atomic_exchange(&w->failing, true))
        log_error("trace", "%s: %s: %s; trying again", w->path, what, strerror(errno));
}

static void drain(struct trace_writer *w) {
    size_t tail = atomic_load_explicit(&w->tail, memory_order_relaxed);
    size_t head = atomic_load_explicit(&w->head, memory_order_acquire);
    while (tail != head) {
        size_t at = tail & (BUFFER_SIZE - 1);
        size_t left = head - tail, to_edge = BUFFER_SIZE - at;
        ssize_t done = write(w->fd, w->buffer + at, left < to_edge ? left : to_edge);
        if (done < 0 && errno == EINTR)
            continue;
        if (done <= 0) {
            disk_failed(w, "cannot write");
            return;
        }
        tail += (size_t)done;
        atomic_store_explicit(&w->tail, tail, memory_order_release);
        count(&w->bytes, (uint64_t)done);
        w->unsynced = true;
    }
}

static void sync_data(struct trace_writer *w) {
    if (!w->unsynced)
        return;
    if (fdatasync(w->fd) != 0) {
        disk_failed(w, "cannot put on disk");
        return;
    }
    w->unsynced = false;
    if (waiting_bytes(w) == 0 && atomic_exchange(&w->failing, false))
        log_warning("trace", "%s: the disk takes records again", w->path);
}

static void sign(struct trace_writer *w, struct trace_end *end) {
    const struct trace_signer *signer = w->signer;
    uint8_t message[TRACE_SEAL_SIZE];
    size_t certificate_size = sizeof end->certificate, signature_size = sizeof end->signature;
    seal_message(w->chain.value, end->records, end->missing, message);
    if (!signer->sign(signer->context, message, sizeof message, end->certificate, &certificate_size,
                      end->signature, &signature_size)) {
        log_error("trace", "%s: it cannot be signed", w->path);
        return;
    }
    CHECK(certificate_size <= sizeof end->certificate && signature_size <= sizeof end->signature);
    end->certificate_size = certificate_size;
    end->signature_size = signature_size;
}

// The appender has stopped: this thread has both ends.
static void finish(struct trace_writer *w) {
    uint8_t data[2 * RECORD_MAX];
    struct trace_status status = trace_writer_status(w);
    struct trace_end end = {.records = status.records, .missing = status.missing};
    drain(w);
    size_t size = w->gap ? record_encode_gap(w->gap, &w->chain, data) : 0;
    if (w->signer)
        sign(w, &end);
    size += record_encode_end(&end, &w->chain, data + size);
    bool complete = put(w, data, size);
    drain(w);
    sync_data(w);
    size_t lost = waiting_bytes(w);
    if (lost || !complete)
        log_error("trace", "%s: its last %zu bytes are lost, the disk does not take them", w->path,
                  lost);
}

// Waits until `when` or until it is to stop, which it answers.
static bool wait_until(struct trace_writer *w, int64_t when_ns) {
    struct timespec when = {when_ns / NS_PER_S, when_ns % NS_PER_S};
    pthread_mutex_lock(&w->mutex);
    while (!w->stop && pthread_cond_timedwait(&w->wake, &w->mutex, &when) != ETIMEDOUT)
        ;
    bool stop = w->stop;
    pthread_mutex_unlock(&w->mutex);
    return stop;
}

static void *run(void *context) {
    struct trace_writer *w = context;
    int64_t synced_ns = clock_now_ns();
    while (!wait_until(w, clock_now_ns() + WRITE_EVERY_NS)) {
        drain(w);
        if (clock_now_ns() - synced_ns >= SYNC_EVERY_NS) {
            sync_data(w);
            synced_ns = clock_now_ns();
        }
    }
    finish(w);
    return NULL;
}

// Signals are for the program's other threads; a file size limit then is an error like a full disk.
static void start_thread(struct trace_writer *w) {
    pthread_condattr_t monotonic;
    pthread_condattr_init(&monotonic);
    pthread_condattr_setclock(&monotonic, CLOCK_MONOTONIC);
    pthread_cond_init(&w->wake, &monotonic);
    pthread_condattr_destroy(&monotonic);
    pthread_mutex_init(&w->mutex, NULL);
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    CHECK(pthread_create(&w->thread, NULL, run, w) == 0);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
}

// ---- opening and closing

// A new file survives a power loss only once its folder is on disk too.
static bool sync_folder_of(const char *path) {
    char *copy = alloc_text(path);
    int fd = open(dirname(copy), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    free(copy);
    bool done = fd >= 0 && fsync(fd) == 0;
    if (fd >= 0)
        close(fd);
    return done;
}

static enum result put_on_disk(int fd, const char *path, const uint8_t *data, size_t size,
                               struct error *err) {
    errno = ENOSPC; // what a short write means
    if (write(fd, data, size) != (ssize_t)size || fsync(fd) != 0 || !sync_folder_of(path))
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    return RESULT_OK;
}

static struct trace_writer *writer_of(int fd, const char *path, const struct trace_signer *signer) {
    struct trace_writer *w = aligned_alloc(64, sizeof *w);
    CHECK(w);
    memset(w, 0, sizeof *w);
    w->fd = fd;
    w->path = alloc_text(path);
    w->signer = signer;
    chain_init(&w->chain);
    w->buffer = alloc(1, BUFFER_SIZE);
    memset(w->buffer, 0xff, BUFFER_SIZE); // the appender must not meet a page for the first time
    return w;
}

static void release(struct trace_writer *w) {
    close(w->fd);
    chain_fini(&w->chain);
    free(w->buffer);
    free(w->path);
    free(w);
}

// Two writers would spoil a file for good.
static bool lock(int fd) {
    return flock(fd, LOCK_EX | LOCK_NB) == 0;
}

enum result trace_writer_create(const char *path, const struct trace_header *header,
                                const struct trace_signer *signer, struct trace_writer **out_writer,
                                struct error *err) {
    int fd = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0640);
    if (fd < 0)
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    struct trace_writer *w = writer_of(fd, path, signer);
    w->rules = header->settings.rules;
    uint8_t data[HEADER_MAX];
    size_t size = header_encode(header, &w->chain, data);
    enum result result = lock(fd) ? put_on_disk(fd, path, data, size, err)
                                  : fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    if (result != RESULT_OK) {
        unlink(path);
        release(w);
        return result;
    }
    count(&w->bytes, size);
    start_thread(w);
    *out_writer = w;
    return RESULT_OK;
}

bool trace_is_written(const char *path) {
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0)
        return false;
    bool written = !lock(fd);
    close(fd);
    return written;
}

static enum result cut_back(int fd, const char *path, uint64_t offset, struct error *err) {
    if (!lock(fd))
        return fail(err, RESULT_REFUSED, "%s: it is still being written", path);
    if (ftruncate(fd, (off_t)offset) != 0 || lseek(fd, 0, SEEK_END) < 0)
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    return RESULT_OK;
}

enum result trace_writer_resume(const char *path, const struct trace_place *end, int64_t utc_ns,
                                const struct trace_signer *signer, struct trace_writer **out_writer,
                                struct error *err) {
    int fd = open(path, O_WRONLY | O_CLOEXEC);
    if (fd < 0)
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    struct trace_writer *w = writer_of(fd, path, signer);
    w->rules = end->rules;
    memcpy(w->chain.value, end->hash, sizeof end->hash);
    uint8_t data[RECORD_MAX];
    size_t size = record_encode_resume(utc_ns, &w->chain, data);
    enum result result = cut_back(fd, path, end->offset, err);
    if (result == RESULT_OK)
        result = put_on_disk(fd, path, data, size, err);
    if (result != RESULT_OK) {
        release(w);
        return result;
    }
    count(&w->bytes, end->offset + size);
    count(&w->records, end->records);
    count(&w->missing, end->missing);
    start_thread(w);
    *out_writer = w;
    return RESULT_OK;
}

void trace_writer_destroy(struct trace_writer **writer) {
    struct trace_writer *w = *writer;
    if (!w)
        return;
    pthread_mutex_lock(&w->mutex);
    w->stop = true;
    pthread_cond_signal(&w->wake);
    pthread_mutex_unlock(&w->mutex);
    pthread_join(w->thread, NULL);
    pthread_cond_destroy(&w->wake);
    pthread_mutex_destroy(&w->mutex);
    release(w);
    *writer = NULL;
}
