#include "commands/records_password.h"

#include "api/password.h"

#include <errno.h>
#include <openssl/crypto.h>
#include <stdio.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#define LINE_MAX_LENGTH PASSPHRASE_MAX

_Static_assert(PASSPHRASE_MAX > PASSWORD_MOST, "a line holds a password");

static enum result read_line(FILE *file, const char *path, char line[LINE_MAX_LENGTH],
                             struct error *err) {
    errno = 0;
    if (!fgets(line, LINE_MAX_LENGTH, file))
        return ferror(file) ? fail(err, RESULT_IO, "%s: %s", path, strerror(errno))
                            : fail(err, RESULT_FORMAT, "%s: there is no password in it", path);
    if (!strpbrk(line, "\r\n") && !feof(file))
        return fail(err, RESULT_LIMIT, "%s: its first line is longer than a password may be", path);
    line[strcspn(line, "\r\n")] = '\0';
    return RESULT_OK;
}

static enum result ask_password(const char *what, char line[LINE_MAX_LENGTH], struct error *err) {
    struct termios before, quiet;
    if (tcgetattr(STDIN_FILENO, &before))
        return fail(err, RESULT_IO, "the terminal: %s", strerror(errno));
    quiet = before;
    quiet.c_lflag &= ~(tcflag_t)ECHO;
    tcsetattr(STDIN_FILENO, TCSAFLUSH, &quiet);
    fputs(what, stderr);
    enum result result = read_line(stdin, "the terminal", line, err);
    tcsetattr(STDIN_FILENO, TCSAFLUSH, &before);
    fputc('\n', stderr);
    return result;
}

static enum result ask_twice(char line[LINE_MAX_LENGTH], struct error *err) {
    char again[LINE_MAX_LENGTH];
    enum result result = ask_password("password: ", line, err);
    if (result == RESULT_OK)
        result = ask_password("once more: ", again, err);
    if (result == RESULT_OK && strcmp(line, again) != 0)
        result = fail(err, RESULT_REFUSED, "the two differ");
    OPENSSL_cleanse(again, sizeof again);
    return result;
}

static enum result read_file(const char *path, char line[LINE_MAX_LENGTH], struct error *err) {
    FILE *file = strcmp(path, "-") ? fopen(path, "re") : stdin;
    if (!file)
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    enum result result = read_line(file, path, line, err);
    if (file != stdin)
        fclose(file);
    return result;
}

static enum result encode(const char *line, char out_encoded[STORE_TEXT_MAX], struct error *err) {
    size_t length = strlen(line);
    if (!strncmp(line, "$argon2", 7) && length < STORE_TEXT_MAX) {
        memcpy(out_encoded, line, length + 1);
        return RESULT_OK;
    }
    enum result result = password_check(line, err);
    if (result == RESULT_OK)
        result = password_encode(line, out_encoded, err);
    return result;
}

enum result records_read_password(const char *path, char out_encoded[STORE_TEXT_MAX],
                                  struct error *err) {
    char line[LINE_MAX_LENGTH];
    if (!path && !isatty(STDIN_FILENO))
        return fail(err, RESULT_REFUSED, "there is no terminal to type a password: use --password");
    enum result result = path ? read_file(path, line, err) : ask_twice(line, err);
    if (result == RESULT_OK)
        result = encode(line, out_encoded, err);
    OPENSSL_cleanse(line, sizeof line);
    return result;
}

enum result passphrase_read(const char *path, char out_passphrase[PASSPHRASE_MAX],
                            struct error *err) {
    struct error why;
    enum result result = read_file(path, out_passphrase, err);
    if (result == RESULT_OK && password_check(out_passphrase, &why) != RESULT_OK)
        result = fail(err, RESULT_INVALID, "%s: a passphrase has %d characters at least", path,
                      PASSWORD_LEAST);
    return result;
}
