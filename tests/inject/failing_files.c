// Descriptors, names and folders. failing_streams.c has what goes through a FILE.
#include "failing.h"

#include <dirent.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <termios.h>
#include <unistd.h>

// ---- opening ------------------------------------------------------------------------------------

static int open_at(const void *address, int folder, const char *path, int flags, mode_t mode) {
    return failing_to_open(path, address) ? -1
                                          : (int)syscall(SYS_openat, folder, path, flags, mode);
}

#define OPEN_FUNCTION(name, folder, ...)                                                           \
    int name(__VA_ARGS__ __VA_OPT__(, ) const char *path, int flags, ...) {                        \
        va_list rest;                                                                              \
        va_start(rest, flags);                                                                     \
        mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(rest, mode_t) : 0;                    \
        va_end(rest);                                                                              \
        return open_at(__builtin_return_address(0), folder, path, flags, mode);                    \
    }
OPEN_FUNCTION(open, AT_FDCWD)
OPEN_FUNCTION(open64, AT_FDCWD)
OPEN_FUNCTION(openat, at, int at)
OPEN_FUNCTION(openat64, at, int at)

int creat(const char *path, mode_t mode) {
    return open_at(__builtin_return_address(0), AT_FDCWD, path, O_WRONLY | O_CREAT | O_TRUNC, mode);
}

DIR *opendir(const char *path) {
    REAL(opendir);
    return failing_to_open(path, __builtin_return_address(0)) ? NULL : real(path);
}

CALL(OPEN, -1, int, posix_openpt, (int flags), (flags))

// ---- bytes --------------------------------------------------------------------------------------

#define READ_FAILS(fd) failing_bytes(fd, READ, RECEIVE, __builtin_return_address(0))
#define WRITE_FAILS(fd) failing_bytes(fd, WRITE, SEND, __builtin_return_address(0))

ssize_t read(int fd, void *data, size_t size) {
    return READ_FAILS(fd) ? -1 : syscall(SYS_read, fd, data, size);
}

ssize_t readv(int fd, const struct iovec *parts, int count) {
    return READ_FAILS(fd) ? -1 : syscall(SYS_readv, fd, parts, count);
}

ssize_t pread(int fd, void *data, size_t size, off_t offset) {
    return READ_FAILS(fd) ? -1 : syscall(SYS_pread64, fd, data, size, offset);
}

ssize_t pread64(int fd, void *data, size_t size, off_t offset) {
    return READ_FAILS(fd) ? -1 : syscall(SYS_pread64, fd, data, size, offset);
}

ssize_t write(int fd, const void *data, size_t size) {
    return WRITE_FAILS(fd) ? -1 : syscall(SYS_write, fd, data, size);
}

ssize_t writev(int fd, const struct iovec *parts, int count) {
    return WRITE_FAILS(fd) ? -1 : syscall(SYS_writev, fd, parts, count);
}

ssize_t pwrite(int fd, const void *data, size_t size, off_t offset) {
    return WRITE_FAILS(fd) ? -1 : syscall(SYS_pwrite64, fd, data, size, offset);
}

ssize_t pwrite64(int fd, const void *data, size_t size, off_t offset) {
    return WRITE_FAILS(fd) ? -1 : syscall(SYS_pwrite64, fd, data, size, offset);
}

int close(int fd) {
    bool fails = failing_is_file(fd) && FAILS(CLOSE);
    int result = (int)syscall(SYS_close, fd);
    errno = fails ? EIO : errno;
    return fails ? -1 : result;
}

CALL(SEEK, -1, off_t, lseek, (int fd, off_t offset, int from), (fd, offset, from))
CALL(SYNC, -1, int, fsync, (int fd), (fd))
CALL(SYNC, -1, int, fdatasync, (int fd), (fd))
CALL(TRUNCATE, -1, int, ftruncate, (int fd, off_t size), (fd, size))
CALL(TRUNCATE, -1, int, ftruncate64, (int fd, off_t size), (fd, size))
CALL(TRUNCATE, -1, int, fallocate, (int fd, int mode, off_t at, off_t size), (fd, mode, at, size))
CALL(TRUNCATE, EIO, int, posix_fallocate, (int fd, off_t at, off_t size), (fd, at, size))
CALL(LOCK, -1, int, flock, (int fd, int operation), (fd, operation))

// ---- names and folders --------------------------------------------------------------------------

CALL(LIST, NULL, struct dirent *, readdir, (DIR * folder), (folder))
CALL(LIST, NULL, struct dirent64 *, readdir64, (DIR * folder), (folder))
CALL(RENAME, -1, int, rename, (const char *from, const char *to), (from, to))
CALL(RENAME, -1, int, link, (const char *from, const char *to), (from, to))
CALL(RENAME, -1, int, symlink, (const char *from, const char *to), (from, to))
CALL(UNLINK, -1, int, unlink, (const char *path), (path))
CALL(UNLINK, -1, int, rmdir, (const char *path), (path))
CALL(UNLINK, -1, int, remove, (const char *path), (path))
CALL(MKDIR, -1, int, mkdir, (const char *path, mode_t mode), (path, mode))
CALL(MODE, -1, int, chmod, (const char *path, mode_t mode), (path, mode))
CALL(MODE, -1, int, fchmod, (int fd, mode_t mode), (fd, mode))
CALL(MODE, -1, int, chown, (const char *path, uid_t user, gid_t group), (path, user, group))
CALL(MODE, -1, int, fchown, (int fd, uid_t user, gid_t group), (fd, user, group))
CALL(STAT, -1, int, access, (const char *path, int mode), (path, mode))
CALL(STAT, -1, int, stat, (const char *restrict path, struct stat *restrict out), (path, out))
CALL(STAT, -1, int, lstat, (const char *restrict path, struct stat *restrict out), (path, out))
CALL(STAT, -1, int, fstat, (int fd, struct stat *out), (fd, out))
CALL(STAT, -1, int, stat64, (const char *restrict path, struct stat64 *restrict out), (path, out))
CALL(STAT, -1, int, lstat64, (const char *restrict path, struct stat64 *restrict out), (path, out))
CALL(STAT, -1, int, fstat64, (int fd, struct stat64 *out), (fd, out))
CALL(STAT, -1, ssize_t, readlink, (const char *restrict path, char *restrict out, size_t size),
     (path, out, size))
CALL(STAT, NULL, char *, realpath, (const char *restrict path, char *restrict out), (path, out))
CALL(STAT, NULL, char *, __realpath_chk, (const char *path, char *out, size_t size),
     (path, out, size))

// ---- devices ------------------------------------------------------------------------------------

int ioctl(int fd, unsigned long request, ...) {
    va_list rest;
    va_start(rest, request);
    void *argument = va_arg(rest, void *);
    va_end(rest);
    return FAILS(DEVICE) ? -1 : (int)syscall(SYS_ioctl, fd, request, argument);
}

CALL(DEVICE, -1, int, tcgetattr, (int fd, struct termios *out), (fd, out))
CALL(DEVICE, -1, int, tcsetattr, (int fd, int when, const struct termios *settings),
     (fd, when, settings))
CALL(DEVICE, -1, int, grantpt, (int fd), (fd))
CALL(DEVICE, -1, int, unlockpt, (int fd), (fd))
CALL(DEVICE, EIO, int, ptsname_r, (int fd, char *out, size_t size), (fd, out, size))
