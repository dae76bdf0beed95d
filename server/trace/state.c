#include "trace/state.h"

#include "base/check.h"
#include "base/kept.h"

#include <errno.h>
#include <fcntl.h>
#include <link.h>
#include <openssl/evp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define MAGIC "ARTHSTAT"
#define VERSION 2     // of what is before the content
#define HEAD_MAX 1024 // before the content

// ---- who wrote it -------------------------------------------------------------------------------

struct identity {
    uint8_t program[20]; // its build id
    char libc[64], cpu[64];
};

#define ALIGNED(size) (((size) + 3) & ~(size_t)3)

static bool take_build_id(const uint8_t *notes, size_t size, uint8_t out[20]) {
    const ElfW(Nhdr) * note;
    for (size_t at = 0; at + sizeof *note <= size;
         at += sizeof *note + ALIGNED(note->n_namesz) + ALIGNED(note->n_descsz)) {
        note = (const void *)(notes + at);
        const uint8_t *name = notes + at + sizeof *note;
        if (note->n_type != NT_GNU_BUILD_ID || note->n_namesz != 4 || memcmp(name, "GNU", 4) != 0 ||
            note->n_descsz != 20)
            continue;
        memcpy(out, name + 4, 20);
        return true;
    }
    return false;
}

// The first object is the program.
static int look_at_program(struct dl_phdr_info *info, size_t size, void *out) {
    (void)size;
    bool found = false;
    for (int i = 0; !found && i < info->dlpi_phnum; i++) {
        const ElfW(Phdr) *part = &info->dlpi_phdr[i];
        const uint8_t *notes = (const uint8_t *)(uintptr_t)(info->dlpi_addr + part->p_vaddr);
        found = part->p_type == PT_NOTE && take_build_id(notes, part->p_memsz, out);
    }
    return 1;
}

static void identify(struct identity *out) {
    struct trace_header header;
    memset(out, 0, sizeof *out);
    trace_header_set_machine(&header);
    dl_iterate_phdr(look_at_program, out->program);
    snprintf(out->libc, sizeof out->libc, "%s", header.libc);
    snprintf(out->cpu, sizeof out->cpu, "%s", header.cpu);
}

// ---- bytes --------------------------------------------------------------------------------------

static bool add_sum(const uint8_t *head, size_t head_size, const uint8_t *content, size_t size,
                    uint8_t out[TRACE_HASH_SIZE]) {
    EVP_MD_CTX *context = EVP_MD_CTX_new();
    bool done = context && EVP_DigestInit_ex(context, EVP_sha256(), NULL) == 1 &&
                EVP_DigestUpdate(context, head, head_size) == 1 &&
                EVP_DigestUpdate(context, content, size) == 1 &&
                EVP_DigestFinal_ex(context, out, NULL) == 1;
    EVP_MD_CTX_free(context);
    return done;
}

// What is before the content.
static void keep_head(struct trace_state *state, struct identity *by, struct kept *k) {
    char magic[] = MAGIC;
    uint32_t version = VERSION;
    uint64_t size = state->size;
    kept_bytes(k, magic, sizeof magic);
    kept_holds(k, !memcmp(magic, MAGIC, sizeof magic));
    kept_bytes(k, &version, sizeof version);
    kept_holds(k, version == VERSION);
    kept_bytes(k, &state->format, sizeof state->format);
    kept_bytes(k, by, sizeof *by);
    struct trace_place *place = &state->place;
    uint64_t *numbers[] = {&place->offset, &place->step, &place->records, &place->missing,
                           &place->past};
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        kept_u64(k, numbers[i]);
    kept_time(k, &place->time_ns);
    kept_bytes(k, &place->version, sizeof place->version);
    kept_int(k, &place->rules, 1, RULES_NEWEST);
    kept_bytes(k, place->hash, sizeof place->hash);
    kept_u64(k, &state->output_hash);
    kept_u64(k, &size);
    kept_holds(k, size <= TRACE_STATE_MAX);
    state->size = (size_t)size;
}

void trace_state_path(const char *trace, char out_path[TRACE_STATE_PATH_MAX]) {
    snprintf(out_path, TRACE_STATE_PATH_MAX, "%.255s.state", trace);
}

void trace_state_remove(const char *trace) {
    char path[TRACE_STATE_PATH_MAX], draft[TRACE_STATE_PATH_MAX + 8];
    trace_state_path(trace, path);
    snprintf(draft, sizeof draft, "%s.new", path);
    unlink(draft);
    unlink(path);
}

// ---- writing ------------------------------------------------------------------------------------

static enum result look_at_trace(const char *trace, struct trace_state *state, struct error *err) {
    uint8_t end[8 + TRACE_HASH_SIZE];
    uint64_t hash;
    struct stat status;
    int fd = open(trace, O_RDONLY | O_CLOEXEC);
    if (fd < 0)
        return fail(err, RESULT_IO, "%s: %s", trace, strerror(errno));
    off_t at = (off_t)(state->place.offset - sizeof end);
    bool there = fstat(fd, &status) == 0 && (uint64_t)status.st_size >= state->place.offset &&
                 pread(fd, end, sizeof end, at) == (ssize_t)sizeof end &&
                 fdatasync(fd) == 0; // a state must not outlive what it is of
    close(fd);
    if (!there)
        return fail(err, RESULT_MISSING, "%s: it is not yet so long", trace);
    memcpy(&hash, end, sizeof hash); // little-endian, as all of a trace
    memcpy(state->place.hash, end + sizeof hash, sizeof state->place.hash);
    return hash == state->output_hash ? RESULT_OK
                                      : fail(err, RESULT_REFUSED, "%s: no such step", trace);
}

static bool write_all(int fd, const uint8_t *bytes, size_t size) {
    while (size) {
        ssize_t done = write(fd, bytes, size);
        if (done < 0 && errno == EINTR)
            continue;
        if (done <= 0)
            return false;
        bytes += done;
        size -= (size_t)done;
    }
    return true;
}

static bool write_parts(int fd, const struct trace_state *state, const struct kept *head) {
    uint8_t sum[TRACE_HASH_SIZE];
    return add_sum(head->data, head->used, state->content, state->size, sum) &&
           write_all(fd, head->data, head->used) && write_all(fd, state->content, state->size) &&
           write_all(fd, sum, sizeof sum) && fsync(fd) == 0;
}

enum result trace_state_write(const char *trace, struct trace_state *state, struct error *err) {
    char path[TRACE_STATE_PATH_MAX], draft[TRACE_STATE_PATH_MAX + 8];
    uint8_t bytes[HEAD_MAX];
    struct identity by;
    struct kept head = kept_into(bytes, sizeof bytes);
    enum result result = look_at_trace(trace, state, err);
    if (result != RESULT_OK)
        return result;
    trace_state_path(trace, path);
    snprintf(draft, sizeof draft, "%s.new", path);
    identify(&by);
    state->format = KEPT_FORMAT;
    keep_head(state, &by, &head);
    CHECK(!head.bad);
    int fd = open(draft, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0640);
    bool written = fd >= 0 && write_parts(fd, state, &head);
    int fault = errno;
    if (fd >= 0)
        close(fd);
    if (written && rename(draft, path) == 0)
        return RESULT_OK;
    fault = written ? errno : fault;
    unlink(draft);
    return fail(err, RESULT_IO, "%s: %s", draft, strerror(fault));
}

// ---- reading ------------------------------------------------------------------------------------

static enum result read_file(const char *path, uint8_t **out_bytes, size_t *out_size,
                             struct error *err) {
    struct stat status;
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0)
        return fail(err, errno == ENOENT ? RESULT_MISSING : RESULT_IO, "%s: %s", path,
                    strerror(errno));
    errno = EFBIG;
    bool readable = fstat(fd, &status) == 0 && S_ISREG(status.st_mode) && status.st_size >= 0 &&
                    (size_t)status.st_size <= TRACE_STATE_MAX + HEAD_MAX;
    *out_size = readable ? (size_t)status.st_size : 0;
    *out_bytes = alloc(*out_size + 1, 1);
    readable = readable && pread(fd, *out_bytes, *out_size, 0) == (ssize_t)*out_size;
    int fault = errno;
    close(fd);
    return readable ? RESULT_OK : fail(err, RESULT_IO, "%s: %s", path, strerror(fault));
}

enum result trace_state_load(const char *trace, uint8_t **out_bytes, size_t *out_size,
                             struct error *err) {
    char path[TRACE_STATE_PATH_MAX];
    trace_state_path(trace, path);
    return read_file(path, out_bytes, out_size, err);
}

enum result trace_state_parse(const uint8_t *bytes, size_t size, struct trace_state *out,
                              struct error *err) {
    struct identity by, here;
    uint8_t sum[TRACE_HASH_SIZE];
    struct kept k = kept_from(bytes, size);
    memset(out, 0, sizeof *out);
    keep_head(out, &by, &k);
    if (k.bad)
        return fail(err, RESULT_CORRUPT, "it is no state of a session");
    if (kept_left(&k) != out->size + sizeof sum ||
        !add_sum(bytes, k.used, bytes + k.used, out->size, sum) ||
        memcmp(sum, bytes + size - sizeof sum, sizeof sum) != 0)
        return fail(err, RESULT_CORRUPT, "it is not whole");
    out->content = k.data + k.used;
    identify(&here);
    out->is_own = out->format == KEPT_FORMAT && memcmp(&by, &here, sizeof by) == 0;
    return RESULT_OK;
}

static enum result take_own(const char *path, const uint8_t *bytes, size_t size,
                            struct trace_state *out, struct error *err) {
    struct trace_state state;
    if (trace_state_parse(bytes, size, &state, err) != RESULT_OK)
        return fail_in(err, RESULT_CORRUPT, "%s: ", path);
    if (!state.is_own)
        return fail(err, RESULT_REFUSED, "%s: another program or machine wrote it", path);
    *out = state;
    out->content = alloc(state.size + 1, 1);
    memcpy(out->content, state.content, state.size);
    return RESULT_OK;
}

enum result trace_state_read(const char *trace, struct trace_state *out, struct error *err) {
    char path[TRACE_STATE_PATH_MAX];
    uint8_t *bytes = NULL;
    size_t size = 0;
    memset(out, 0, sizeof *out);
    trace_state_path(trace, path);
    enum result result = read_file(path, &bytes, &size, err);
    if (result == RESULT_OK)
        result = take_own(path, bytes, size, out, err);
    free(bytes);
    return result;
}
