#include "view/token.h"

#include "base/check.h"

#include <errno.h>
#include <fcntl.h>
#include <openssl/rand.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static void make_token(char out[TOKEN_LENGTH + 1]) {
    unsigned char bits[TOKEN_LENGTH / 2];
    NEED(RAND_bytes(bits, sizeof bits) == 1, "random bytes");
    for (size_t i = 0; i < sizeof bits; i++)
        snprintf(out + 2 * i, 3, "%02x", bits[i]);
}

static enum result write_token(const char *path, const char *token, struct error *err) {
    int fd = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    if (fd < 0)
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    bool written = dprintf(fd, "%s\n", token) == TOKEN_LENGTH + 1 && fsync(fd) == 0;
    if (close(fd) == 0 && written)
        return RESULT_OK;
    unlink(path);
    return fail(err, RESULT_IO, "%s: cannot be written", path);
}

enum result token_get(const char *path, char out[TOKEN_LENGTH + 1], struct error *err) {
    FILE *file = fopen(path, "re");
    if (!file && errno == ENOENT) {
        make_token(out);
        return write_token(path, out, err);
    }
    if (!file)
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    char text[TOKEN_LENGTH + 2] = "";
    size_t used = fread(text, 1, TOKEN_LENGTH + 1, file);
    int fault = ferror(file) ? errno : 0;
    fclose(file);
    if (fault)
        return fail(err, RESULT_IO, "%s: %s", path, strerror(fault));
    bool good = used >= TOKEN_LENGTH && (!text[TOKEN_LENGTH] || text[TOKEN_LENGTH] == '\n');
    text[TOKEN_LENGTH] = '\0';
    if (!good || strspn(text, "0123456789abcdef") != TOKEN_LENGTH)
        return fail(
            err, RESULT_FORMAT,
            "%s: not a token of %d digits. Delete the file, and the station makes a new one", path,
            TOKEN_LENGTH);
    memcpy(out, text, TOKEN_LENGTH + 1);
    return RESULT_OK;
}

enum result token_check(const char *path, struct error *err) {
    struct stat status;
    if (stat(path, &status) || !(status.st_mode & 077))
        return RESULT_OK;
    return fail(err, RESULT_INVALID, "%s: other users have access to it (mode %03o)", path,
                status.st_mode & 0777);
}
