#include "sim/disk.h"

#include "base/check.h"
#include "base/clock.h"
#include "sim/watch.h"

#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#define PAGE 4096
#define FILES 256
#define FDS 1024
#define SLOW_NS (15 * NS_PER_MS)

struct disk_faults disk_faults;

struct file {
    char *path;         // NULL: free
    bool entered;       // its name is on disk
    int64_t written_ns; // UTC
    uint8_t *durable;
    size_t durable_size, durable_room;
    uint8_t *dirty; // a byte for each page
    size_t pages;
};

static struct {
    struct random random;
    const char *dir;
    struct file files[FILES];
    struct file *of[FDS];
    struct disk_counts counts;
    int64_t trouble_ns;
} disk;

int __real_open(const char *path, int flags, ...);
int __real_close(int fd);
ssize_t __real_write(int fd, const void *bytes, size_t size);
ssize_t __real_pwrite(int fd, const void *bytes, size_t size, off_t at);
int __real_fsync(int fd);
int __real_ftruncate(int fd, off_t size);
int __real_rename(const char *from, const char *to);
int __real_unlink(const char *path);
int __real_stat(const char *path, struct stat *out);
int disk_close(int fd);
ssize_t disk_write(int fd, const void *bytes, size_t size);

struct disk_counts disk_counts(void) {
    return disk.counts;
}

int64_t disk_trouble_ns(void) {
    return disk.trouble_ns;
}

static void note_trouble(void) {
    disk.trouble_ns = sim_now_ns();
}

// ---- files --------------------------------------------------------------------------------------

static bool counts(const char *path) {
    size_t length = disk.dir ? strlen(disk.dir) : 0;
    return length && !strncmp(path, disk.dir, length) && path[length] == '/';
}

static struct file *find(const char *path) {
    for (int i = 0; i < FILES; i++)
        if (disk.files[i].path && !strcmp(disk.files[i].path, path))
            return &disk.files[i];
    return NULL;
}

static struct file *enter(const char *path) {
    int i = 0;
    while (i < FILES && disk.files[i].path)
        i++;
    CHECK(i < FILES);
    disk.files[i] = (struct file){.path = alloc_text(path)};
    return &disk.files[i];
}

static void forget(struct file *file) {
    for (int fd = 0; fd < FDS; fd++)
        if (disk.of[fd] == file)
            disk.of[fd] = NULL;
    free(file->path);
    free(file->durable);
    free(file->dirty);
    *file = (struct file){0};
}

static void mark(struct file *file, off_t at, size_t size) {
    size_t last = ((size_t)at + size + PAGE - 1) / PAGE;
    if (last > file->pages) {
        file->dirty = alloc_resize(file->dirty, last, 1);
        memset(file->dirty + file->pages, 0, last - file->pages);
        file->pages = last;
    }
    for (size_t page = (size_t)at / PAGE; page < last; page++)
        file->dirty[page] = 1;
}

// One page of the file, as it is in memory, reaches the disk.
static void put_page(struct file *file, int fd, size_t page) {
    uint8_t bytes[PAGE];
    ssize_t got = pread(fd, bytes, PAGE, (off_t)(page * PAGE));
    if (got <= 0)
        return;
    size_t end = page * PAGE + (size_t)got;
    if (end > file->durable_room) {
        file->durable_room = 2 * end;
        file->durable = alloc_resize(file->durable, file->durable_room, 1);
    }
    if (end > file->durable_size) {
        memset(file->durable + file->durable_size, 0, end - file->durable_size);
        file->durable_size = end;
    }
    memcpy(file->durable + page * PAGE, bytes, (size_t)got);
}

// share: of the dirty pages that reach the disk.
static void put_pages(struct file *file, double share) {
    int fd = __real_open(file->path, O_RDONLY | O_CLOEXEC);
    for (size_t page = 0; fd >= 0 && page < file->pages; page++) {
        if (!file->dirty[page])
            continue;
        if (random_between(&disk.random, 0, 1) < share)
            put_page(file, fd, page);
        else
            disk.counts.pages_lost++;
        file->dirty[page] = 0;
    }
    if (fd >= 0)
        __real_close(fd);
}

void disk_begin_run(uint64_t seed, const char *dir) {
    memset(&disk.counts, 0, sizeof disk.counts);
    disk_faults = (struct disk_faults){0};
    disk.random = (struct random){seed};
    disk.dir = dir;
    disk.trouble_ns = 0;
}

void disk_end_run(void) {
    for (int i = 0; i < FILES; i++)
        if (disk.files[i].path)
            forget(&disk.files[i]);
}

static void write_back(const struct file *file) {
    int fd = __real_open(file->path, O_WRONLY | O_TRUNC | O_CLOEXEC);
    CHECK(fd >= 0);
    CHECK(__real_write(fd, file->durable, file->durable_size) == (ssize_t)file->durable_size);
    __real_close(fd);
}

void disk_lose_power(void) {
    for (int i = 0; i < FILES; i++) {
        struct file *file = &disk.files[i];
        if (!file->path)
            continue;
        put_pages(file, random_between(&disk.random, 0, 1));
        if (file->entered || random_bits(&disk.random) % 2) {
            write_back(file);
        } else {
            __real_unlink(file->path);
            forget(file);
        }
    }
}

// ---- faults -------------------------------------------------------------------------------------

// What every operation costs; a thread that waits here may be killed.
static void take_time(void) {
    int64_t ns = 20000 + (int64_t)(random_bits(&disk.random) % 200000);
    if (disk_faults.slow_ns)
        ns = (int64_t)(random_bits(&disk.random) % (uint64_t)disk_faults.slow_ns);
    if (ns > SLOW_NS)
        note_trouble();
    sim_sleep(ns);
    if (ns > SLOW_NS)
        note_trouble();
}

// False: errno says why. *size may become less.
static bool may_write(size_t *size) {
    disk.counts.writes++;
    bool fails =
        disk_faults.full || (disk_faults.fails_write && random_bits(&disk.random) % 3 == 0);
    if (!fails)
        return true;
    note_trouble();
    disk.counts.refused_writes++;
    if (*size > 1 && random_bits(&disk.random) % 2 && !disk_faults.full) {
        *size = 1 + random_bits(&disk.random) % (*size - 1);
        return true;
    }
    errno = disk_faults.full ? ENOSPC : EIO;
    return false;
}

static struct file *file_of(int fd) {
    return fd >= 0 && fd < FDS ? disk.of[fd] : NULL;
}

static int64_t utc_now_ns(void) {
    return clock_utc_ns();
}

// ---- as the rooms call them ---------------------------------------------------------------------

int __wrap_open(const char *path, int flags, ...);
int __wrap_open(const char *path, int flags, ...) {
    va_list args;
    va_start(args, flags);
    unsigned mode = flags & O_CREAT ? va_arg(args, unsigned) : 0;
    va_end(args);
    bool ours = counts(path) && !(flags & O_DIRECTORY) && (flags & (O_WRONLY | O_RDWR));
    if (ours && sim_is_dead())
        return __real_open("/dev/null", O_RDWR | O_CLOEXEC);
    if (ours && (flags & O_CREAT) && disk_faults.full) {
        errno = ENOSPC;
        note_trouble();
        return -1;
    }
    int fd = __real_open(path, flags, mode);
    if (fd < 0 || !ours)
        return fd;
    CHECK(fd < FDS);
    struct file *file = find(path);
    disk.of[fd] = file ? file : enter(path);
    if (!file)
        disk.of[fd]->written_ns = utc_now_ns();
    return fd;
}

int disk_close(int fd) {
    if (fd >= 0 && fd < FDS)
        disk.of[fd] = NULL;
    return __real_close(fd);
}

static ssize_t wrote(struct file *file, off_t at, ssize_t size) {
    if (size > 0)
        mark(file, at, (size_t)size);
    file->written_ns = utc_now_ns();
    return size;
}

ssize_t __wrap_pwrite(int fd, const void *bytes, size_t size, off_t at);
ssize_t __wrap_pwrite(int fd, const void *bytes, size_t size, off_t at) {
    struct file *file = file_of(fd);
    if (!file)
        return __real_pwrite(fd, bytes, size, at);
    take_time();
    if (sim_is_dead())
        return (ssize_t)size;
    if (!may_write(&size))
        return -1;
    if (size > 1 && random_bits(&disk.random) % 8 == 0) { // a kill may come in between
        size_t half = 1 + random_bits(&disk.random) % (size - 1);
        CHECK(__real_pwrite(fd, bytes, half, at) == (ssize_t)half);
        wrote(file, at, (ssize_t)half);
        take_time();
        if (sim_is_dead())
            return (ssize_t)size;
    }
    return wrote(file, at, __real_pwrite(fd, bytes, size, at));
}

ssize_t disk_write(int fd, const void *bytes, size_t size) {
    struct file *file = file_of(fd);
    if (!file)
        return __real_write(fd, bytes, size);
    take_time();
    if (sim_is_dead())
        return (ssize_t)size;
    if (!may_write(&size))
        return -1;
    off_t at = lseek(fd, 0, SEEK_CUR);
    return wrote(file, at, __real_write(fd, bytes, size));
}

static int sync_one(struct file *file) {
    take_time();
    if (sim_is_dead())
        return 0;
    disk.counts.syncs++;
    if (!disk_faults.fails_sync) {
        put_pages(file, 1);
        file->entered = true;
        return 0;
    }
    disk.counts.failed_syncs++;
    note_trouble();
    put_pages(file, random_between(&disk.random, 0, 1));
    errno = EIO;
    return -1;
}

int __wrap_fdatasync(int fd);
int __wrap_fdatasync(int fd) {
    return file_of(fd) ? sync_one(file_of(fd)) : 0;
}

int __wrap_fsync(int fd);
int __wrap_fsync(int fd) {
    return file_of(fd) ? sync_one(file_of(fd)) : 0; // names are entered with their files
}

int __wrap_ftruncate(int fd, off_t size);
int __wrap_ftruncate(int fd, off_t size) {
    struct file *file = file_of(fd);
    if (!file)
        return __real_ftruncate(fd, size);
    take_time();
    if (sim_is_dead())
        return 0;
    if ((size_t)size < file->durable_size) // the journal takes it at once
        file->durable_size = (size_t)size;
    return __real_ftruncate(fd, size);
}

int __wrap_rename(const char *from, const char *to);
int __wrap_rename(const char *from, const char *to) {
    if (sim_is_dead())
        return 0;
    int failed = __real_rename(from, to);
    struct file *file = failed || !counts(from) ? NULL : find(from);
    if (!file)
        return failed;
    watch_renamed(from, to);
    if (find(to))
        forget(find(to));
    free(file->path);
    file->path = alloc_text(to);
    return failed;
}

int __wrap_unlink(const char *path);
int __wrap_unlink(const char *path) {
    if (sim_is_dead())
        return 0;
    if (counts(path) && find(path))
        forget(find(path));
    return __real_unlink(path);
}

// Files have the time of day of the machine that wrote them.
int __wrap_stat(const char *path, struct stat *out);
int __wrap_stat(const char *path, struct stat *out) {
    int failed = __real_stat(path, out);
    const struct file *file = failed || !counts(path) ? NULL : find(path);
    if (file)
        out->st_mtim = (struct timespec){file->written_ns / NS_PER_S, file->written_ns % NS_PER_S};
    return failed;
}
