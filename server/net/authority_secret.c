#include "net/authority_secret.h"

#include "base/check.h"
#include "net/authority.h"
#include "net/authority_files.h"
#include "net/authority_keys.h"

#include <errno.h>
#include <fcntl.h>
#include <openssl/crypto.h>
#include <openssl/pem.h>
#include <openssl/pkcs12.h>
#include <openssl/x509.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define NAME "authority.key"
#define CREDENTIAL "authority-passphrase"
#define PATH_SIZE 4096
#define PASSPHRASE_MIN 8
#define PASSPHRASE_MAX 1024

// scrypt: 16 MB, and a fraction of a second for each try.
#define COST 16384
#define BLOCKS 8
#define PARALLEL 5

static struct authority_key_place key_place; // set before there are threads

void authority_place_key(const struct authority_key_place *of_key) {
    key_place = *of_key;
}

static const char *folder(const char *dir) {
    return key_place.dir && key_place.dir[0] ? key_place.dir : dir;
}

// ---- the passphrase -----------------------------------------------------------------------------

struct passphrase {
    char path[PATH_SIZE]; // empty: there is none
    char text[PASSPHRASE_MAX];
    int length;
    bool was_asked_for;
};

// As systemd hands it over, unless a file is named.
static void find_path(const char *named, char out[PATH_SIZE]) {
    const char *credentials = getenv("CREDENTIALS_DIRECTORY");
    out[0] = '\0';
    if (named && named[0])
        snprintf(out, PATH_SIZE, "%s", named);
    else if (credentials && (snprintf(out, PATH_SIZE, "%s/" CREDENTIAL, credentials) >= PATH_SIZE ||
                             access(out, F_OK)))
        out[0] = '\0';
}

// The first line of the file.
static enum result read_passphrase(const char *named, struct passphrase *out, struct error *err) {
    out->length = 0;
    out->was_asked_for = false;
    find_path(named, out->path);
    if (!out->path[0])
        return RESULT_OK;
    int file = open(out->path, O_RDONLY | O_CLOEXEC); // stdio would keep a copy in its buffer
    ssize_t size = file < 0 ? -1 : read(file, out->text, sizeof out->text - 1);
    int why = errno;
    if (file >= 0)
        close(file);
    if (size <= 0)
        return fail(err, RESULT_INVALID, "%s: the passphrase of " NAME " cannot be read: %s",
                    out->path, size ? strerror(why) : "the file is empty");
    out->text[size] = '\0';
    out->length = (int)strcspn(out->text, "\r\n");
    return RESULT_OK;
}

static void forget_passphrase(struct passphrase *passphrase) {
    OPENSSL_cleanse(passphrase, sizeof *passphrase);
}

static int give(char *out, int size, int writing, void *user) {
    struct passphrase *passphrase = user;
    (void)writing;
    passphrase->was_asked_for = true;
    if (!passphrase->path[0] || passphrase->length > size)
        return -1;
    memcpy(out, passphrase->text, (size_t)passphrase->length);
    return passphrase->length;
}

// ---- reading ------------------------------------------------------------------------------------

static enum result refuse_passphrase(const char *path, const struct passphrase *passphrase,
                                     struct error *err) {
    if (!passphrase->was_asked_for)
        return fail(err, RESULT_CORRUPT, "%s: it is no private key", path);
    if (passphrase->path[0])
        return fail(err, RESULT_INVALID, "%s: the passphrase in %s does not open it", path,
                    passphrase->path);
    return fail(
        err, RESULT_INVALID,
        "%s: it is encrypted, and no file with its passphrase is named "
        "([server] authority_passphrase, keys --passphrase, or the systemd credential " CREDENTIAL
        ")",
        path);
}

static enum result read_with(const char *dir, struct passphrase *passphrase, EVP_PKEY **out_key,
                             struct error *err) {
    char path[PATH_SIZE];
    int used = snprintf(path, sizeof path, "%s/" NAME, folder(dir));
    FILE *file = used < PATH_SIZE ? fopen(path, "re") : NULL;
    *out_key = NULL;
    if (!file)
        return fail(err, RESULT_MISSING,
                    "%s: authority.pem or authority.key is missing or unreadable", folder(dir));
    *out_key = PEM_read_PrivateKey(file, NULL, give, passphrase);
    fclose(file);
    return *out_key ? RESULT_OK : refuse_passphrase(path, passphrase, err);
}

enum result authority_secret_read(const char *dir, EVP_PKEY **out_key, bool *out_encrypted,
                                  struct error *err) {
    struct passphrase passphrase;
    *out_key = NULL;
    enum result result = read_passphrase(key_place.passphrase, &passphrase, err);
    if (result == RESULT_OK)
        result = read_with(dir, &passphrase, out_key, err);
    *out_encrypted = passphrase.was_asked_for;
    forget_passphrase(&passphrase);
    return result;
}

enum result authority_check_key(const char *dir, bool *out_encrypted, struct error *err) {
    EVP_PKEY *key;
    enum result result = authority_secret_read(dir, &key, out_encrypted, err);
    EVP_PKEY_free(key);
    return result;
}

// ---- writing ------------------------------------------------------------------------------------

static X509_SIG *encrypt(EVP_PKEY *key, const struct passphrase *passphrase) {
    PKCS8_PRIV_KEY_INFO *plain = EVP_PKEY2PKCS8(key);
    X509_ALGOR *method =
        PKCS5_pbe2_set_scrypt(EVP_aes_256_cbc(), NULL, 0, NULL, COST, BLOCKS, PARALLEL);
    NEED(plain && method, "memory");
    X509_SIG *sealed = PKCS8_set0_pbe(passphrase->text, passphrase->length, plain, method);
    NEED(sealed, "memory");
    PKCS8_PRIV_KEY_INFO_free(plain);
    return sealed;
}

static enum result write_encrypted(const char *dir, EVP_PKEY *key,
                                   const struct passphrase *passphrase, struct error *err) {
    if (passphrase->length < PASSPHRASE_MIN)
        return fail(err, RESULT_INVALID, "%s: a passphrase has at least %d characters",
                    passphrase->path, PASSPHRASE_MIN);
    X509_SIG *sealed = encrypt(key, passphrase);
    BIO *memory = BIO_new(BIO_s_mem());
    NEED(memory, "memory");
    int written = PEM_write_bio_PKCS8(memory, sealed);
    NEED(written == 1, "memory");
    X509_SIG_free(sealed);
    return authority_write_memory(dir, NAME, memory, err);
}

// named: as the key's place has it; NULL inside: in the clear.
static enum result write_with(const char *dir, EVP_PKEY *key, const char *named,
                              struct error *err) {
    struct passphrase passphrase = {.path = ""};
    enum result result = named ? read_passphrase(named, &passphrase, err) : RESULT_OK;
    if (result == RESULT_OK)
        result = passphrase.path[0] ? write_encrypted(folder(dir), key, &passphrase, err)
                                    : authority_write_key(folder(dir), NAME, key, err);
    forget_passphrase(&passphrase);
    return result;
}

enum result authority_secret_write(const char *dir, EVP_PKEY *key, struct error *err) {
    return write_with(dir, key, key_place.passphrase ? key_place.passphrase : "", err);
}

enum result authority_change_passphrase(const char *dir, const char *passphrase,
                                        struct error *err) {
    EVP_PKEY *key;
    bool was_encrypted;
    int lock;
    enum result result = authority_lock(dir, true, &lock, err);
    if (result != RESULT_OK)
        return result;
    result = authority_secret_read(dir, &key, &was_encrypted, err);
    if (result == RESULT_OK)
        result = write_with(dir, key, passphrase, err);
    EVP_PKEY_free(key);
    close(lock);
    return result;
}
