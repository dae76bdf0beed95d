#include "commands/sealed_file.h"

#include "base/bytes.h"
#include "base/chance.h"
#include "base/check.h"

#include <argon2.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/hmac.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define MEMORY_KIB (64 * 1024)
#define MEMORY_MOST_KIB (1024 * 1024)
#define PASSES 3
#define LANES 1
#define COST_MOST 16 // passes, lanes
#define MAGIC 16
#define SALT 16
#define NONCE 7
#define MAC 16
#define HEADER (MAGIC + 3 * 4 + SALT + NONCE + 1) // without the MAC
#define PIECE 65536
#define TAG 16

static const uint8_t magic[MAGIC] = "arthron sealed\0\1";

struct keys {
    uint8_t aes[32], mac[32];
};

struct sealed {
    const char *path, *out_path; // for errors; the sealed one is the other in turn
    FILE *in, *out;
    uint8_t header[HEADER + MAC];
    struct keys keys;
    EVP_CIPHER_CTX *context;
    uint32_t number; // of the next piece
    uint8_t piece[PIECE + TAG], result[PIECE + TAG];
};

// ---- files --------------------------------------------------------------------------------------

static enum result open_files(struct sealed *s, const char *part, struct error *err) {
    s->in = fopen(s->path, "re");
    if (!s->in)
        return fail(err, RESULT_IO, "%s: %s", s->path, strerror(errno));
    if (access(s->out_path, F_OK) == 0)
        return fail(err, RESULT_REFUSED, "%s: this file already exists; name another file",
                    s->out_path);
    int fd = open(part, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW, 0600);
    s->out = fd < 0 ? NULL : fdopen(fd, "w");
    return s->out ? RESULT_OK : fail(err, RESULT_IO, "%s: %s", s->out_path, strerror(errno));
}

static enum result read_some(struct sealed *s, void *out, size_t size, size_t *out_got,
                             struct error *err) {
    *out_got = fread(out, 1, size, s->in);
    return ferror(s->in) ? fail(err, RESULT_IO, "%s: %s", s->path, strerror(errno)) : RESULT_OK;
}

static enum result write_all(struct sealed *s, const void *bytes, size_t size, struct error *err) {
    return fwrite(bytes, 1, size, s->out) == size
               ? RESULT_OK
               : fail(err, RESULT_IO, "%s: %s", s->out_path, strerror(errno));
}

// Under its own name only once it is whole and on disk.
static enum result keep(struct sealed *s, const char *part, struct error *err) {
    if (fflush(s->out) || fsync(fileno(s->out)) || link(part, s->out_path))
        return fail(err, RESULT_IO, "%s: %s", s->out_path, strerror(errno));
    return RESULT_OK;
}

static enum result look_for_end(struct sealed *s, bool *out_is_end, struct error *err) {
    int c = getc(s->in);
    if (c != EOF)
        ungetc(c, s->in);
    *out_is_end = c == EOF;
    return ferror(s->in) ? fail(err, RESULT_IO, "%s: %s", s->path, strerror(errno)) : RESULT_OK;
}

// ---- keys ---------------------------------------------------------------------------------------

static void make_mac(const struct sealed *s, uint8_t out_mac[32]) {
    const uint8_t *done =
        HMAC(EVP_sha256(), s->keys.mac, sizeof s->keys.mac, s->header, HEADER, out_mac, NULL);
    CHECK(done);
}

static enum result make_keys(struct sealed *s, const char *passphrase, struct error *err) {
    struct reader r = {s->header + MAGIC, HEADER - MAGIC, 0, false};
    uint32_t memory_kib = read_u32(&r), passes = read_u32(&r), lanes = read_u32(&r);
    bool good = memory_kib >= 8 * lanes && memory_kib <= MEMORY_MOST_KIB && passes >= 1 &&
                passes <= COST_MOST && lanes >= 1 && lanes <= COST_MOST;
    if (!good)
        return fail(err, RESULT_CORRUPT, "%s: the beginning of this file was changed", s->path);
    int code = argon2id_hash_raw(passes, memory_kib, lanes, passphrase, strlen(passphrase),
                                 s->header + MAGIC + 12, SALT, &s->keys, sizeof s->keys);
    return code == ARGON2_OK ? RESULT_OK
                             : fail(err, RESULT_LIMIT, "%s: the key cannot be made: %s", s->path,
                                    argon2_error_message(code));
}

// ---- pieces -------------------------------------------------------------------------------------

static void begin_piece(struct sealed *s, bool last, bool encrypts) {
    uint8_t nonce[NONCE + 5];
    int used;
    CHECK(s->number < UINT32_MAX);
    memcpy(nonce, s->header + HEADER - NONCE - 1, NONCE);
    for (int i = 0; i < 4; i++)
        nonce[NONCE + i] = (uint8_t)(s->number >> (24 - 8 * i));
    nonce[NONCE + 4] = last;
    s->number++;
    int done =
        EVP_CipherInit_ex(s->context, EVP_aes_256_gcm(), NULL, s->keys.aes, nonce, encrypts) &&
        EVP_CipherUpdate(s->context, NULL, &used, s->header, sizeof s->header);
    CHECK(done);
}

// From piece into result, with the tag behind it.
static void encrypt_block(struct sealed *s, size_t size, bool last) {
    int used, more;
    begin_piece(s, last, true);
    int done = EVP_EncryptUpdate(s->context, s->result, &used, s->piece, (int)size) &&
               EVP_EncryptFinal_ex(s->context, s->result + used, &more) &&
               EVP_CIPHER_CTX_ctrl(s->context, EVP_CTRL_GCM_GET_TAG, TAG, s->result + size);
    CHECK(done && used + more == (int)size);
}

static bool decrypt(struct sealed *s, size_t size, bool last) {
    int used, more;
    begin_piece(s, last, false);
    int done = EVP_DecryptUpdate(s->context, s->result, &used, s->piece, (int)size) &&
               EVP_CIPHER_CTX_ctrl(s->context, EVP_CTRL_GCM_SET_TAG, TAG, s->piece + size);
    CHECK(done);
    return EVP_DecryptFinal_ex(s->context, s->result + used, &more) == 1;
}

// ---- both ways ----------------------------------------------------------------------------------

static enum result seal(struct sealed *s, const char *passphrase, struct error *err) {
    struct writer w = {s->header, HEADER, 0, false};
    uint8_t random[SALT + NONCE], mac[32];
    size_t size;
    chance_fill(random, sizeof random);
    write_bytes(&w, magic, sizeof magic);
    write_u32(&w, MEMORY_KIB);
    write_u32(&w, PASSES);
    write_u32(&w, LANES);
    write_bytes(&w, random, sizeof random);
    enum result result = make_keys(s, passphrase, err);
    if (result != RESULT_OK)
        return result;
    make_mac(s, mac);
    memcpy(s->header + HEADER, mac, MAC);
    result = write_all(s, s->header, sizeof s->header, err);
    for (bool last = false; result == RESULT_OK && !last;) {
        result = read_some(s, s->piece, PIECE, &size, err);
        if (result == RESULT_OK)
            result = look_for_end(s, &last, err);
        if (result != RESULT_OK)
            return result;
        encrypt_block(s, size, last);
        result = write_all(s, s->result, size + TAG, err);
    }
    return result;
}

static enum result check_header(struct sealed *s, const char *passphrase, struct error *err) {
    uint8_t mac[32];
    size_t size;
    enum result result = read_some(s, s->header, sizeof s->header, &size, err);
    if (result != RESULT_OK)
        return result;
    if (size != sizeof s->header || memcmp(s->header, magic, sizeof magic) != 0)
        return fail(err, RESULT_FORMAT, "%s: this file is not an encrypted backup", s->path);
    result = make_keys(s, passphrase, err);
    if (result != RESULT_OK)
        return result;
    make_mac(s, mac);
    return CRYPTO_memcmp(mac, s->header + HEADER, MAC) == 0
               ? RESULT_OK
               : fail(err, RESULT_REFUSED, "%s: the passphrase is wrong", s->path);
}

static enum result unseal(struct sealed *s, const char *passphrase, struct error *err) {
    size_t size;
    enum result result = check_header(s, passphrase, err);
    for (bool last = false; result == RESULT_OK && !last;) {
        result = read_some(s, s->piece, sizeof s->piece, &size, err);
        if (result == RESULT_OK)
            result = look_for_end(s, &last, err);
        if (result != RESULT_OK)
            return result;
        if (size < TAG || !decrypt(s, size - TAG, last))
            return fail(err, RESULT_CORRUPT,
                        "%s: this file was changed, or is cut off, near byte %ld", s->path,
                        ftell(s->in));
        result = write_all(s, s->result, size - TAG, err);
    }
    return result;
}

static enum result convert(const char *path, const char *passphrase, const char *out_path,
                           enum result (*work)(struct sealed *, const char *, struct error *),
                           struct error *err) {
    char part[PATH_MAX];
    struct sealed *s = alloc(1, sizeof *s);
    *s = (struct sealed){.path = path, .out_path = out_path, .context = EVP_CIPHER_CTX_new()};
    CHECK(s->context);
    enum result result = snprintf(part, sizeof part, "%s.part", out_path) < (int)sizeof part
                             ? open_files(s, part, err)
                             : fail(err, RESULT_LIMIT, "%s: the path is too long", out_path);
    if (result == RESULT_OK)
        result = work(s, passphrase, err);
    if (result == RESULT_OK)
        result = keep(s, part, err);
    if (s->out) {
        fclose(s->out);
        unlink(part);
    }
    if (s->in)
        fclose(s->in);
    EVP_CIPHER_CTX_free(s->context);
    OPENSSL_cleanse(s, sizeof *s);
    free(s);
    return result;
}

bool sealed_file_is(const char *path) {
    uint8_t begin[MAGIC];
    FILE *file = fopen(path, "re");
    bool is = file && fread(begin, 1, MAGIC, file) == MAGIC && !memcmp(begin, magic, MAGIC);
    if (file)
        fclose(file);
    return is;
}

enum result sealed_file_write(const char *path, const char *passphrase, const char *out_path,
                              struct error *err) {
    return convert(path, passphrase, out_path, seal, err);
}

enum result sealed_file_read(const char *path, const char *passphrase, const char *out_path,
                             struct error *err) {
    return convert(path, passphrase, out_path, unseal, err);
}
