#include "case/content.h"

#include "base/check.h"
#include "case/case.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <openssl/evp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define PIECE ((size_t)256 << 10)

const char *const content_names[CONTENT_FILES] = {"anatomy.glb", "case.json"};

bool content_is_hash(const char *text) {
    return strlen(text) == CONTENT_HASH_SIZE - 1 &&
           strspn(text, "0123456789abcdef") == CONTENT_HASH_SIZE - 1;
}

static void finish(EVP_MD_CTX *digest, char out[CONTENT_HASH_SIZE]) {
    uint8_t bytes[EVP_MAX_MD_SIZE];
    unsigned size;
    int done = EVP_DigestFinal_ex(digest, bytes, &size);
    CHECK(done == 1 && 2 * size == CONTENT_HASH_SIZE - 1);
    for (unsigned i = 0; i < size; i++)
        snprintf(out + 2 * i, 3, "%02x", bytes[i]);
}

static EVP_MD_CTX *begin(void) {
    EVP_MD_CTX *digest = EVP_MD_CTX_new();
    NEED(digest && EVP_DigestInit_ex(digest, EVP_sha256(), NULL) == 1, "memory");
    return digest;
}

// ---- a file -------------------------------------------------------------------------------------

static enum result fail_at(struct error *err, const char *path) {
    enum result code = errno == ENOENT ? RESULT_MISSING : RESULT_IO;
    return fail(err, code, "%s: %s", path, strerror(errno));
}

static enum result digest_all(int file, const char *path, EVP_MD_CTX *digest, uint64_t *out_size,
                              struct error *err) {
    uint8_t *piece = alloc(PIECE, 1);
    ssize_t got;
    *out_size = 0;
    while ((got = read(file, piece, PIECE)) > 0 || (got < 0 && errno == EINTR))
        if (got > 0) {
            EVP_DigestUpdate(digest, piece, (size_t)got);
            *out_size += (uint64_t)got;
        }
    free(piece);
    return got < 0 ? fail_at(err, path) : RESULT_OK;
}

static enum result read_open_content(int file, const char *path, uint64_t max_bytes,
                                     struct content_file *out, struct error *err) {
    struct stat status;
    if (fstat(file, &status) != 0)
        return fail_at(err, path);
    if (!S_ISREG(status.st_mode))
        return fail(err, RESULT_INVALID, "%s: not a regular file", path);
    if ((uint64_t)status.st_size > max_bytes)
        return fail(err, RESULT_LIMIT, "%s: %lld bytes, more than %llu", path,
                    (long long)status.st_size, (unsigned long long)max_bytes);
    EVP_MD_CTX *digest = begin();
    enum result result = digest_all(file, path, digest, &out->size, err);
    finish(digest, out->hash);
    EVP_MD_CTX_free(digest);
    return result;
}

enum result content_read_file(const char *path, uint64_t max_bytes, struct content_file *out,
                              struct error *err) {
    int file = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (file < 0)
        return fail_at(err, path);
    enum result result = read_open_content(file, path, max_bytes, out, err);
    close(file);
    return result;
}

// ---- a case -------------------------------------------------------------------------------------

void content_hash(const struct content_file files[CONTENT_FILES], char out[CONTENT_HASH_SIZE]) {
    EVP_MD_CTX *digest = begin();
    for (int i = 0; i < CONTENT_FILES; i++) {
        char line[CONTENT_HASH_SIZE + 32];
        int length = snprintf(line, sizeof line, "%s  %s\n", files[i].hash, content_names[i]);
        EVP_DigestUpdate(digest, line, (size_t)length);
    }
    finish(digest, out);
    EVP_MD_CTX_free(digest);
}

enum result content_read(const char *dir, struct content_file out[CONTENT_FILES],
                         struct error *err) {
    const uint64_t max_bytes = case_limits_default().file_bytes;
    enum result result = RESULT_OK;
    for (int i = 0; result == RESULT_OK && i < CONTENT_FILES; i++) {
        char path[PATH_MAX];
        snprintf(path, sizeof path, "%s/%s", dir, content_names[i]);
        result = content_read_file(path, max_bytes, &out[i], err);
    }
    return result;
}
