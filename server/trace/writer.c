#include "base/bytes.h"
#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "trace/disk.h"
#include "trace/record.h"

#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <time.h>
#include <unistd.h>

// The appender and the threads of disk.c share the writer's buffer. Only the appender drops, and
// only whole records.

// ---- appending

static void count(atomic_uint_fast64_t *counter, uint64_t more) {
    atomic_fetch_add_explicit(counter, more, memory_order_relaxed);
}

static bool is_told(const struct session_input *input, const struct session_output *output) {
    return input->kind == INPUT_JOB || input_is_command(input->kind) || output->job.id;
}

// Before what follows: that the disk failed, that steps are missing.
static size_t encode_troubles(struct trace_writer *w, uint8_t *data) {
    size_t size = 0;
    unsigned faults = atomic_load(&w->faults);
    if (faults != w->faults_told && w->version >= TRACE_FIRST_WITH_FAULTS)
        size += record_encode_fault(atomic_load(&w->fault_utc_ns), NULL, data);
    if (w->gap)
        size += record_encode_gap(w->gap, NULL, data + size);
    w->faults_told = faults;
    return size;
}

struct touch_source {
    uint64_t job;
    int tissue;
    const struct touch_change *touch; // NULL: none
};

// By rules before offsets there is none.
static struct touch_source source_of(const struct trace_writer *w, uint64_t job, int tissue,
                                     const struct touch_change *touch) {
    bool recorded = touch && touch->size && w->rules >= RULES_TOUCH_FITTED;
    return (struct touch_source){job, tissue, recorded ? touch : NULL};
}

static size_t room_for(const struct touch_source *source) {
    size_t parts = source->touch ? source->touch->size / TOUCH_PART_MAX + 1 : 0;
    return (3 + parts) * RECORD_MAX;
}

static void put_touch(struct trace_writer *w, const struct touch_source *source) {
    uint8_t data[RECORD_MAX];
    const struct touch_change *touch = source->touch;
    struct trace_touch_part part = {source->job, source->tissue, (uint32_t)touch->size, 0, 0, NULL};
    for (size_t at = 0; at < touch->size; at += part.size) {
        size_t left = touch->size - at;
        part.offset = (uint32_t)at;
        part.size = (uint32_t)(left < TOUCH_PART_MAX ? left : TOUCH_PART_MAX);
        part.bytes = touch->bytes + at;
        CHECK(buffer_put(&w->buffer, data, record_encode_touch(&part, NULL, data)));
    }
}

// There is room for the step, which will be at this position.
static void note(struct trace_writer *w, const struct session_input *input,
                 const struct session_output *output, uint64_t at) {
    struct notes *notes = &w->notes;
    uint64_t head = atomic_load_explicit(&notes->head, memory_order_relaxed);
    if (!w->tap || !is_told(input, output))
        return;
    if (head - atomic_load_explicit(&notes->tail, memory_order_acquire) == NOTES) {
        atomic_store_explicit(&notes->lost, at + 1, memory_order_release);
        return;
    }
    notes->at[head % NOTES] = at;
    atomic_store_explicit(&notes->head, head + 1, memory_order_release);
}

static bool append(struct trace_writer *w, const struct session_input *input, bool job_done,
                   const struct touch_source *source, const struct session_output *output) {
    uint8_t data[3 * RECORD_MAX];
    unsigned told = w->faults_told;
    if (source->touch && !buffer_has_room(&w->buffer, room_for(source)))
        return false;
    size_t size = encode_troubles(w, data);
    if (source->touch) {
        CHECK(buffer_put(&w->buffer, data, size));
        put_touch(w, source);
        size = 0;
    }
    size_t before = size;
    size += record_encode_step(input, job_done, output, w->rules, NULL, data + size);
    if (!buffer_has_room(&w->buffer, size)) {
        w->faults_told = told;
        return false;
    }
    note(w, input, output, buffer_head(&w->buffer) + before);
    CHECK(buffer_put(&w->buffer, data, size));
    w->gap = 0;
    count(&w->records, 1);
    return true;
}

static void wait_where_all_ends(void) {
    while (atomic_load_explicit(&disk_ends, memory_order_relaxed))
        pause();
}

bool trace_append(struct trace_writer *w, const struct session_input *input,
                  const struct session_output *output) {
    const struct job_result *result = input->kind == INPUT_JOB ? input->result : NULL;
    struct touch_source source =
        source_of(w, input->job, result ? result->tissue : 0, result ? &result->touch : NULL);
    bool done = append(w, input, result, &source, output);
    if (!done) {
        w->gap++;
        count(&w->missing, 1);
    }
    wait_where_all_ends();
    return done;
}

// A gap before it stays where it is: steps are missing behind the last one, whatever was said.
bool trace_append_remark(struct trace_writer *w, const struct remark *remark) {
    uint8_t data[RECORD_MAX];
    CHECK(remark_is_valid(remark));
    bool done = buffer_put(&w->buffer, data, record_encode_remark(remark, NULL, data));
    wait_where_all_ends();
    return done;
}

bool trace_append_marker(struct trace_writer *w, const struct marker *marker) {
    uint8_t data[RECORD_MAX];
    CHECK(marker_is_valid(marker) && trace_takes_markers(w));
    bool done = buffer_put(&w->buffer, data, record_encode_marker(marker, NULL, data));
    wait_where_all_ends();
    return done;
}

bool trace_takes_markers(const struct trace_writer *w) {
    return w->version >= TRACE_FIRST_WITH_FAULTS;
}

bool trace_append_begun(struct trace_writer *w, const struct trace_attempt *attempt) {
    uint8_t data[RECORD_MAX];
    CHECK(trace_attempt_is_valid(attempt) && trace_takes_attempts(w));
    bool done = buffer_put(&w->buffer, data, record_encode_begun(attempt, NULL, data));
    wait_where_all_ends();
    return done;
}

bool trace_append_ended(struct trace_writer *w, const struct trace_outcome *outcome) {
    uint8_t data[RECORD_MAX];
    CHECK(trace_outcome_is_valid(outcome) && trace_takes_attempts(w));
    bool done = buffer_put(&w->buffer, data, record_encode_ended(outcome, NULL, data));
    wait_where_all_ends();
    return done;
}

bool trace_takes_attempts(const struct trace_writer *w) {
    return w->version >= TRACE_FIRST_WITH_ATTEMPTS;
}

uint64_t trace_position(const struct trace_writer *w) {
    return buffer_head(&w->buffer);
}

bool trace_is_on_disk(const struct trace_writer *w, uint64_t position) {
    return atomic_load(&w->synced) >= position;
}

void trace_place_behind(const struct trace_writer *w, uint64_t position,
                        const struct session_output *output, struct trace_place *out) {
    struct trace_status status = trace_writer_status(w);
    *out = (struct trace_place){.offset = w->offset + position,
                                .step = output->step,
                                .records = status.records,
                                .missing = status.missing,
                                .past = output->step - status.records - status.missing,
                                .time_ns = output->time_ns,
                                .version = w->version,
                                .rules = w->rules};
}

static enum result wait_for_room(struct trace_writer *w, size_t size, struct error *err) {
    while (!buffer_has_room(&w->buffer, size)) {
        if (atomic_load(&w->failing))
            return fail(err, RESULT_IO, "%s: the disk takes no more", w->path);
        disk_hurry();
        nanosleep(&(struct timespec){0, NS_PER_MS}, NULL);
    }
    return RESULT_OK;
}

static void append_input(struct trace_writer *w, const struct trace_record *record,
                         const struct touch_source *source) {
    uint8_t data[RECORD_MAX];
    if (source->touch)
        put_touch(w, source);
    size_t size = record->type == TRACE_TAKEN
                      ? record_encode_taken(record, w->rules, NULL, data)
                      : record_encode_past(&record->input, record->job_done, NULL, data);
    CHECK(buffer_put(&w->buffer, data, size));
}

static void append_touch_part(struct trace_writer *w, const struct trace_touch_part *part) {
    uint8_t data[RECORD_MAX];
    CHECK(buffer_put(&w->buffer, data, record_encode_touch(part, NULL, data)));
}

enum result trace_append_record(struct trace_writer *w, const struct trace_record *record,
                                struct error *err) {
    bool is_job = record->input.kind == INPUT_JOB;
    struct touch_source source =
        source_of(w, is_job ? record->input.job : 0, record->touch_tissue, record->touch);
    enum result result = wait_for_room(w, room_for(&source), err);
    if (result != RESULT_OK)
        return result;
    if (record->type == TRACE_STEP)
        CHECK(append(w, &record->input, record->job_done, &source, &record->output));
    if (record->type == TRACE_PAST || record->type == TRACE_TAKEN)
        append_input(w, record, &source);
    if (record->type == TRACE_TOUCH && record->is_packed)
        append_touch_part(w, &record->touch_part);
    if (record->type == TRACE_REMARK)
        CHECK(trace_append_remark(w, &record->remark));
    if (record->type == TRACE_MARKER)
        CHECK(trace_append_marker(w, &record->marker));
    if (record->type == TRACE_BEGUN)
        CHECK(trace_append_begun(w, &record->begun));
    if (record->type == TRACE_ENDED)
        CHECK(trace_append_ended(w, &record->ended));
    if (record->type == TRACE_GAP) {
        w->gap += record->missing;
        count(&w->missing, record->missing);
    }
    return RESULT_OK;
}

enum result writer_append_state(struct trace_writer *w, const struct trace_state_part *part,
                                struct error *err) {
    uint8_t data[RECORD_MAX];
    enum result result = wait_for_room(w, RECORD_MAX, err);
    if (result == RESULT_OK)
        CHECK(buffer_put(&w->buffer, data, record_encode_state(part, NULL, data)));
    return result;
}

struct trace_status trace_writer_status(const struct trace_writer *w) {
    return (struct trace_status){
        .records = atomic_load_explicit(&w->records, memory_order_relaxed),
        .missing = atomic_load_explicit(&w->missing, memory_order_relaxed),
        .bytes = w->offset + atomic_load_explicit(&w->written, memory_order_relaxed),
        .failing = atomic_load_explicit(&w->failing, memory_order_relaxed),
    };
}

// ---- hashes

static size_t size_of_record(const struct trace_writer *w, uint64_t at) {
    uint8_t bytes[RECORD_PREFIX];
    buffer_read(&w->buffer, at, bytes, sizeof bytes);
    struct reader r = {bytes, sizeof bytes, 0, false};
    return RECORD_PREFIX + (size_t)read_u32(&r);
}

void writer_seal(struct trace_writer *w) {
    uint8_t data[RECORD_MAX];
    for (uint64_t head = buffer_head(&w->buffer); w->sealed < head;) {
        size_t size = size_of_record(w, w->sealed);
        buffer_read(&w->buffer, w->sealed, data, size);
        chain_add(&w->chain, data, size);
        buffer_change(&w->buffer, w->sealed + size, w->chain.value, sizeof w->chain.value);
        w->sealed += size + sizeof w->chain.value;
    }
}

// ---- the tap

// Whether the tap learns of the step at this position, as the appender noted it; where notes were
// lost, its output tells.
static bool is_noted(struct trace_writer *w, uint64_t at, bool *out_is_lost) {
    struct notes *notes = &w->notes;
    uint64_t tail = atomic_load_explicit(&notes->tail, memory_order_relaxed);
    *out_is_lost = at < atomic_load_explicit(&notes->lost, memory_order_acquire);
    if (tail == atomic_load_explicit(&notes->head, memory_order_acquire) ||
        notes->at[tail % NOTES] != at)
        return false;
    atomic_store_explicit(&notes->tail, tail + 1, memory_order_release);
    return true;
}

static bool has_type_to_tell(unsigned type) {
    return type != TRACE_GAP && type != TRACE_END && type != TRACE_RESUME && type != TRACE_FAULT &&
           type != TRACE_STATE;
}

static void tell_written(struct trace_writer *w, uint64_t at, size_t size) {
    static _Thread_local struct trace_record record;
    uint8_t data[RECORD_MAX];
    bool is_lost = false;
    buffer_read(&w->buffer, at, data, size);
    bool is_step = data[RECORD_PREFIX - 1] == TRACE_STEP;
    if (!has_type_to_tell(data[RECORD_PREFIX - 1]) ||
        (is_step && !is_noted(w, at, &is_lost) && !is_lost))
        return;
    CHECK(record_decode_bare(data, size, w->layout, &record, NULL, NULL) == RESULT_OK);
    if (is_step && !is_told(&record.input, &record.output))
        return;
    record.offset = w->offset + at;
    record.size = size + TRACE_HASH_SIZE;
    w->tap->record(w->tap->user, &record);
}

// While the program crashes, nobody is told.
void writer_tap(struct trace_writer *w) {
    uint64_t written = atomic_load(&w->written);
    while (w->tap && !atomic_load_explicit(&disk_ends, memory_order_relaxed) &&
           w->tapped + RECORD_PREFIX <= written) {
        size_t size = size_of_record(w, w->tapped);
        if (w->tapped + size + TRACE_HASH_SIZE > written)
            return;
        tell_written(w, w->tapped, size);
        w->tapped += size + TRACE_HASH_SIZE;
    }
}

// ---- the end

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

void writer_put_end(struct trace_writer *w) {
    uint8_t data[3 * RECORD_MAX];
    struct trace_status status = trace_writer_status(w);
    struct trace_end end = {.records = status.records, .missing = status.missing};
    bool put = buffer_put(&w->buffer, data, encode_troubles(w, data));
    pthread_mutex_lock(&w->writing);
    writer_seal(w);
    pthread_mutex_unlock(&w->writing);
    if (w->signer)
        sign(w, &end);
    put = put && buffer_put(&w->buffer, data, record_encode_end(&end, NULL, data));
    if (!put)
        log_error("trace", "%s: its end is lost because the disk is full or fails", w->path);
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

static enum result put_bytes_on_disk(int fd, const char *path, const uint8_t *data, size_t size,
                                     struct error *err) {
    errno = ENOSPC; // what a short write means
    if (write(fd, data, size) != (ssize_t)size || fsync(fd) != 0 || !sync_folder_of(path))
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    return RESULT_OK;
}

static void release(struct trace_writer *w) {
    close(w->fd);
    pthread_mutex_destroy(&w->writing);
    chain_fini(&w->chain);
    buffer_fini(&w->buffer);
    free(w->path);
    free(w);
}

// NULL: no memory; the file is closed then.
static struct trace_writer *writer_of(int fd, const char *path, const struct trace_signer *signer,
                                      const struct trace_tap *tap, struct error *err) {
    struct trace_writer *w = alloc_aligned(64, sizeof *w);
    memset(w, 0, sizeof *w);
    w->fd = fd;
    w->path = alloc_text(path);
    w->signer = signer;
    w->tap = tap;
    w->synced_ns = clock_now_ns();
    pthread_mutex_init(&w->writing, NULL);
    chain_init(&w->chain);
    if (buffer_init(&w->buffer))
        return w;
    fail(err, RESULT_LIMIT, "%s: there is no memory for the trace", path);
    release(w);
    return NULL;
}

static enum result begin(struct trace_writer *w, struct error *err) {
    return disk_begin(w)
               ? RESULT_OK
               : fail(err, RESULT_LIMIT, "%s: the system gives no thread that writes it", w->path);
}

// Two writers would spoil a file for good.
static bool lock(int fd) {
    return flock(fd, LOCK_EX | LOCK_NB) == 0;
}

enum result trace_writer_create(const char *path, const struct trace_header *header,
                                const struct trace_signer *signer, const struct trace_tap *tap,
                                struct trace_writer **out_writer, struct error *err) {
    int fd = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0640);
    if (fd < 0)
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    struct trace_writer *w = writer_of(fd, path, signer, tap, err);
    if (!w) {
        unlink(path);
        return RESULT_LIMIT;
    }
    w->version = TRACE_VERSION;
    w->rules = header->settings.rules;
    w->layout = layout_of(header, TRACE_VERSION);
    uint8_t data[HEADER_MAX];
    size_t size = header_encode(header, &w->chain, data);
    enum result result = lock(fd) ? put_bytes_on_disk(fd, path, data, size, err)
                                  : fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    w->offset = size;
    if (result == RESULT_OK)
        result = begin(w, err);
    if (result != RESULT_OK) {
        unlink(path);
        release(w);
        return result;
    }
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

// What a tap needs to read the records.
static enum result take_layout(struct trace_writer *w, struct error *err) {
    struct trace_reader *reader;
    enum result result = w->tap ? trace_reader_create(w->path, &reader, err) : RESULT_OK;
    if (!w->tap || result != RESULT_OK)
        return result;
    w->layout = layout_of(trace_reader_header(reader), w->version);
    trace_reader_destroy(&reader);
    return RESULT_OK;
}

// If fdatasync failed before the writer of before ended, the system may hold pages that are not on
// disk and not to be written any more. So what that writer may not have had on disk is written
// again.
static bool write_tail_again(int fd, uint64_t end) {
    uint8_t bytes[4096];
    uint64_t at = end > BUFFER_SIZE ? end - BUFFER_SIZE : 0;
    while (at < end) {
        size_t size = end - at < sizeof bytes ? (size_t)(end - at) : sizeof bytes;
        if (pread(fd, bytes, size, (off_t)at) != (ssize_t)size ||
            pwrite(fd, bytes, size, (off_t)at) != (ssize_t)size)
            return false;
        at += size;
    }
    return true;
}

static enum result cut_back(int fd, const char *path, uint64_t offset, struct error *err) {
    if (!lock(fd))
        return fail(err, RESULT_REFUSED, "%s: it is still being written", path);
    errno = ENOSPC; // what a short write means
    if (ftruncate(fd, (off_t)offset) != 0 || !write_tail_again(fd, offset) ||
        lseek(fd, 0, SEEK_END) < 0)
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    return RESULT_OK;
}

enum result trace_writer_resume(const char *path, const struct trace_place *end, int64_t utc_ns,
                                const struct trace_signer *signer, const struct trace_tap *tap,
                                struct trace_writer **out_writer, struct error *err) {
    int fd = open(path, O_RDWR | O_CLOEXEC);
    if (fd < 0)
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    struct trace_writer *w = writer_of(fd, path, signer, tap, err);
    if (!w)
        return RESULT_LIMIT;
    w->version = end->version;
    w->rules = end->rules;
    memcpy(w->chain.value, end->hash, sizeof end->hash);
    uint8_t data[RECORD_MAX];
    size_t size = record_encode_resume(utc_ns, &w->chain, data);
    enum result result = cut_back(fd, path, end->offset, err);
    if (result == RESULT_OK)
        result = take_layout(w, err);
    if (result == RESULT_OK)
        result = put_bytes_on_disk(fd, path, data, size, err);
    w->offset = end->offset + size;
    count(&w->records, end->records);
    count(&w->missing, end->missing);
    if (result == RESULT_OK)
        result = begin(w, err);
    if (result != RESULT_OK) {
        release(w);
        return result;
    }
    *out_writer = w;
    return RESULT_OK;
}

void trace_writer_destroy(struct trace_writer **writer) {
    struct trace_writer *w = *writer;
    if (!w)
        return;
    disk_end(w);
    release(w);
    *writer = NULL;
}

void trace_writer_leave(struct trace_writer **writer) {
    if (*writer)
        (*writer)->leaves = true;
    trace_writer_destroy(writer);
}
