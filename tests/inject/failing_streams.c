#include "failing.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdio_ext.h>
#include <sys/types.h>

#define ERROR_FLAG 0x20 // of glibc: what ferror reads

FILE *fopen(const char *restrict path, const char *restrict mode) {
    REAL(fopen);
    return failing_to_open(path, __builtin_return_address(0)) ? NULL : real(path, mode);
}

FILE *fopen64(const char *restrict path, const char *restrict mode) {
    REAL(fopen64);
    return failing_to_open(path, __builtin_return_address(0)) ? NULL : real(path, mode);
}

CALL(MEMORY, NULL, FILE *, fdopen, (int fd, const char *mode), (fd, mode))
CALL(MEMORY, NULL, FILE *, open_memstream, (char **out_text, size_t *out_size),
     (out_text, out_size))

static bool stream_fails(enum door door, FILE *stream, const void *address) {
    int fd = fileno(stream);
    if (fd < 0 || !failing_is_file(fd) || !failing_now(door, address))
        return false;
    stream->_flags |= ERROR_FLAG;
    return true;
}

#define STREAM_FAILS(door, stream) stream_fails(door, stream, __builtin_return_address(0))
#define STREAM(door, refusal, type, name, parameters, arguments)                                   \
    type name parameters;                                                                          \
    type name parameters {                                                                         \
        REAL(name);                                                                                \
        return STREAM_FAILS(door, stream) ? refusal : real arguments;                              \
    }

// ---- reading

STREAM(READ, 0, size_t, fread,
       (void *restrict data, size_t size, size_t count, FILE *restrict stream),
       (data, size, count, stream))
STREAM(READ, 0, size_t, __fread_chk,
       (void *restrict data, size_t room, size_t size, size_t count, FILE *restrict stream),
       (data, room, size, count, stream))
STREAM(READ, NULL, char *, fgets, (char *restrict text, int size, FILE *restrict stream),
       (text, size, stream))
STREAM(READ, NULL, char *, __fgets_chk, (char *text, size_t room, int size, FILE *stream),
       (text, room, size, stream))
STREAM(READ, EOF, int, getc, (FILE * stream), (stream))
STREAM(READ, EOF, int, fgetc, (FILE * stream), (stream))
STREAM(READ, -1, ssize_t, getline,
       (char **restrict text, size_t *restrict size, FILE *restrict stream), (text, size, stream))
STREAM(READ, -1, ssize_t, __getdelim,
       (char **restrict text, size_t *restrict size, int end, FILE *restrict stream),
       (text, size, end, stream))
STREAM(SEEK, -1, int, fseeko, (FILE * stream, off_t offset, int from), (stream, offset, from))
STREAM(SEEK, -1, off_t, ftello, (FILE * stream), (stream))
STREAM(SEEK, -1, long, ftell, (FILE * stream), (stream))

// ---- writing

STREAM(WRITE, 0, size_t, fwrite,
       (const void *restrict data, size_t size, size_t count, FILE *restrict stream),
       (data, size, count, stream))
STREAM(WRITE, EOF, int, fputs, (const char *restrict text, FILE *restrict stream), (text, stream))
STREAM(WRITE, EOF, int, fputc, (int byte, FILE *stream), (byte, stream))
STREAM(WRITE, EOF, int, putc, (int byte, FILE *stream), (byte, stream))
STREAM(WRITE, -1, int, __vfprintf_chk,
       (FILE * stream, int flag, const char *format, va_list values),
       (stream, flag, format, values))

int puts(const char *text) {
    REAL(puts);
    return STREAM_FAILS(WRITE, stdout) ? EOF : real(text);
}

int __fprintf_chk(FILE *stream, int flag, const char *format, ...);
int __fprintf_chk(FILE *stream, int flag, const char *format, ...) {
    (void)flag;
    if (STREAM_FAILS(WRITE, stream))
        return -1;
    va_list values;
    va_start(values, format);
    int result = vfprintf(stream, format, values);
    va_end(values);
    return result;
}

int __printf_chk(int flag, const char *format, ...);
int __printf_chk(int flag, const char *format, ...) {
    (void)flag;
    if (STREAM_FAILS(WRITE, stdout))
        return -1;
    va_list values;
    va_start(values, format);
    int result = vfprintf(stdout, format, values);
    va_end(values);
    return result;
}

int fflush(FILE *stream) {
    REAL(fflush);
    return stream && __fpending(stream) && STREAM_FAILS(WRITE, stream) ? EOF : real(stream);
}

int fclose(FILE *stream) {
    REAL(fclose);
    bool fails = __fpending(stream) && STREAM_FAILS(WRITE, stream);
    int result = real(stream);
    errno = fails ? ENOSPC : errno;
    return fails ? EOF : result;
}
