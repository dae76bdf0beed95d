#include "link/key_files.h"

#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <openssl/pem.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static void path_in(const char *dir, const char *name, char out[KEY_FILES_PATH_SIZE]) {
    snprintf(out, KEY_FILES_PATH_SIZE, "%s/%s", dir, name);
}

static bool has_certificate(const char *path) {
    FILE *file = fopen(path, "re");
    X509 *certificate = file ? PEM_read_X509(file, NULL, NULL, NULL) : NULL;
    if (file)
        fclose(file);
    X509_free(certificate);
    return certificate != NULL;
}

enum result key_files_find(const char *dir, struct key_files *out, struct error *err) {
    path_in(dir, "authority.pem", out->authority);
    path_in(dir, "station.key", out->key);
    path_in(dir, has_certificate(out->key) ? "station.key" : "station.pem", out->certificate);
    const char *const paths[] = {out->authority, out->certificate, out->key};
    for (int i = 0; i < 3; i++)
        if (access(paths[i], R_OK))
            return fail(err, RESULT_MISSING, "%s: %s", paths[i], strerror(errno));
    return RESULT_OK;
}

// ---- writing ------------------------------------------------------------------------------------

struct key_content {
    EVP_PKEY *key;     // NULL: none
    X509 *certificate; // behind it
};

static bool write_content(int fd, const struct key_content *content) {
    FILE *file = fdopen(fd, "w");
    if (!file) {
        close(fd);
        return false;
    }
    bool written = (!content->key ||
                    PEM_write_PrivateKey(file, content->key, NULL, NULL, 0, NULL, NULL) == 1) &&
                   PEM_write_X509(file, content->certificate) == 1 && fflush(file) == 0 &&
                   fsync(fd) == 0;
    return !fclose(file) && written;
}

static bool sync_folder(const char *dir) {
    int fd = open(dir, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    bool synced = fd >= 0 && !fsync(fd);
    if (fd >= 0)
        close(fd);
    return synced;
}

// Written whole under another name, then renamed.
static enum result replace(const char *dir, const char *name, mode_t mode,
                           const struct key_content *content, struct error *err) {
    char path[KEY_FILES_PATH_SIZE], part[KEY_FILES_PATH_SIZE + 8];
    path_in(dir, name, path);
    snprintf(part, sizeof part, "%s.part", path);
    unlink(part); // left by a process that was killed
    int fd = open(part, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode);
    if (fd < 0)
        return fail(err, RESULT_IO, "%s: %s", part, strerror(errno));
    if (!write_content(fd, content) || rename(part, path) || !sync_folder(dir)) {
        fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
        unlink(part);
        return RESULT_IO;
    }
    return RESULT_OK;
}

// A folder that is not there is made in the one above.
enum result key_files_can_write(const char *dir, struct error *err) {
    char copy[KEY_FILES_PATH_SIZE], inside[KEY_FILES_PATH_SIZE];
    snprintf(copy, sizeof copy, "%s", dir);
    path_in(access(dir, F_OK) ? dirname(copy) : dir, ".", inside);
    return access(inside, W_OK | X_OK) ? fail(err, RESULT_IO, "%s: %s", dir, strerror(errno))
                                       : RESULT_OK;
}

enum result key_files_write(const char *dir, EVP_PKEY *key, X509 *certificate, X509 *authority,
                            struct error *err) {
    enum result result = RESULT_OK;
    if (mkdir(dir, 0700) && errno != EEXIST)
        return fail(err, RESULT_IO, "%s: %s", dir, strerror(errno));
    if (authority)
        result = replace(dir, "authority.pem", 0644, &(struct key_content){NULL, authority}, err);
    if (result == RESULT_OK)
        result = replace(dir, "station.key", 0600, &(struct key_content){key, certificate}, err);
    if (result == RESULT_OK)
        result = replace(dir, "station.pem", 0644, &(struct key_content){NULL, certificate}, err);
    return result;
}

// ---- changes ------------------------------------------------------------------------------------

void key_files_stamp(const char *dir, struct key_stamps *out) {
    static const char *const names[] = {"authority.pem", "station.key", "station.pem"};
    memset(out, 0, sizeof *out);
    for (int i = 0; i < 3; i++) {
        char path[KEY_FILES_PATH_SIZE];
        struct stat status = {0};
        path_in(dir, names[i], path);
        stat(path, &status); // what is not there has no size
        out->of[i].device = (int64_t)status.st_dev;
        out->of[i].file = (int64_t)status.st_ino;
        out->of[i].size = (int64_t)status.st_size;
        out->of[i].changed_s = (int64_t)status.st_ctim.tv_sec;
        out->of[i].changed_ns = (int64_t)status.st_ctim.tv_nsec;
    }
}
