#include "api/secret.h"

#include "base/chance.h"
#include "base/check.h"

#include <ctype.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/hmac.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

static const char letters[] = "ABCDEFGHJKLMNPQRSTUVWXYZ23456789";

static void write_hex(const uint8_t bytes[32], char out[SECRET_MAX]) {
    for (int i = 0; i < 32; i++)
        snprintf(out + 2 * i, 3, "%02x", bytes[i]);
}

void secret_make(char out_secret[SECRET_MAX]) {
    uint8_t bytes[32];
    chance_fill(bytes, sizeof bytes);
    write_hex(bytes, out_secret);
}

void secret_make_code(char out_code[SECRET_CODE_MAX]) {
    uint8_t bytes[SECRET_CODE_MAX - 1];
    chance_fill(bytes, sizeof bytes);
    for (size_t i = 0; i < sizeof bytes; i++)
        out_code[i] = letters[bytes[i] % 32];
    out_code[sizeof bytes] = '\0';
}

bool secret_read_code(const char *typed, char out_code[SECRET_CODE_MAX]) {
    size_t count = 0;
    for (; *typed; typed++) {
        if (*typed == ' ' || *typed == '-')
            continue;
        char letter = (char)toupper((unsigned char)*typed);
        if (!strchr(letters, letter) || count == SECRET_CODE_MAX - 1)
            return false;
        out_code[count++] = letter;
    }
    out_code[count] = '\0';
    return count == SECRET_CODE_MAX - 1;
}

void secret_hash(const char *secret, char out_hash[SECRET_MAX]) {
    uint8_t hash[32];
    int done = EVP_Digest(secret, strlen(secret), hash, NULL, EVP_sha256(), NULL);
    NEED(done == 1, "memory");
    write_hex(hash, out_hash);
}

// ---- a key of the server ------------------------------------------------------------------------

// RESULT_MISSING: there is no such file.
static enum result read_key(const char *path, struct secret_key *out, struct error *err) {
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0)
        return fail(err, errno == ENOENT ? RESULT_MISSING : RESULT_IO, "%s: %s", path,
                    strerror(errno));
    ssize_t got = read(fd, out->bytes, sizeof out->bytes);
    close(fd);
    if (got == sizeof out->bytes)
        return RESULT_OK;
    return fail(err, RESULT_FORMAT, "%s: this file does not hold %d bytes; remove it", path,
                SECRET_KEY_SIZE);
}

// Under its own name only once it is whole. Another program may be doing the same.
static enum result make_key(const char *path, const struct secret_key *key, struct error *err) {
    char part[PATH_MAX];
    if (snprintf(part, sizeof part, "%s.%d", path, (int)getpid()) >= (int)sizeof part)
        return fail(err, RESULT_LIMIT, "%s: the path is too long", path);
    int fd = open(part, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    bool good = fd >= 0 && write(fd, key->bytes, sizeof key->bytes) == sizeof key->bytes &&
                fsync(fd) == 0 && (link(part, path) == 0 || errno == EEXIST);
    enum result result = good ? RESULT_OK : fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    if (fd >= 0)
        close(fd);
    unlink(part);
    return result;
}

enum result secret_key_load(const char *dir, struct secret_key *out, struct error *err) {
    char path[PATH_MAX];
    if (snprintf(path, sizeof path, "%s/web.key", dir) >= (int)sizeof path)
        return fail(err, RESULT_LIMIT, "%s: the path is too long", dir);
    enum result result = read_key(path, out, err);
    if (result != RESULT_MISSING)
        return result;
    chance_fill(out->bytes, sizeof out->bytes);
    result = make_key(path, out, err);
    return result == RESULT_OK ? read_key(path, out, err) : result;
}

void secret_keyed_hash(const struct secret_key *key, const char *purpose, const char *text,
                       char out_hash[SECRET_MAX]) {
    char message[1024];
    uint8_t hash[32];
    int length = snprintf(message, sizeof message, "%s\n%s", purpose, text);
    CHECK(length < (int)sizeof message);
    bool done = HMAC(EVP_sha256(), key->bytes, sizeof key->bytes, (const uint8_t *)message,
                     (size_t)length, hash, NULL);
    CHECK(done);
    write_hex(hash, out_hash);
}

bool secret_is(const char *secret, const char *given) {
    char hashes[2][SECRET_MAX];
    secret_hash(secret, hashes[0]);
    secret_hash(given, hashes[1]);
    return !CRYPTO_memcmp(hashes[0], hashes[1], SECRET_MAX);
}
