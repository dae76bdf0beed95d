// Preloaded into a program: calls of the operating system fail as another process says through a
// shared file (environment variable ARTHRON_FAILING). failing.py has the other side of struct plan.
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <execinfo.h>
#include <fcntl.h>
#include <link.h>
#include <netdb.h>
#include <poll.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

enum door {
    MEMORY,
    MMAP,
    OPEN,
    READ,
    WRITE,
    SYNC,
    CLOSE,
    RENAME,
    UNLINK,
    MKDIR,
    TRUNCATE,
    LOCK,
    SOCKET,
    BIND,
    LISTEN,
    ACCEPT,
    CONNECT,
    RECEIVE,
    SEND,
    OPTION,
    RESOLVE,
    THREAD,
    EVENT,
    POLL,
    DOORS
};

#define CALLERS_MAX 48
#define FRAMES_MAX 16

struct plan {
    atomic_int door;             // that fails; -1: none
    atomic_int on;               // 0: one call, 1: all from then on
    atomic_int error;            // errno; 0: the door's usual one
    atomic_int caller;           // number of the caller, 0: the program itself; -1: whoever
    atomic_llong left;           // calls until the first failure
    atomic_llong failed;         // how many failed
    atomic_llong clock_off_ns;   // of the time of day
    uint64_t frames[FRAMES_MAX]; // who called when the first one failed, addresses in the program
    char callers[CALLERS_MAX][32];
    atomic_llong counts[CALLERS_MAX][DOORS];
};

static const int usual_errors[DOORS] = {
    [MEMORY] = ENOMEM,       [MMAP] = ENOMEM,        [OPEN] = EMFILE,       [READ] = EIO,
    [WRITE] = ENOSPC,        [SYNC] = EIO,           [CLOSE] = EIO,         [RENAME] = EIO,
    [UNLINK] = EIO,          [MKDIR] = ENOSPC,       [TRUNCATE] = EIO,      [LOCK] = ENOLCK,
    [SOCKET] = EMFILE,       [BIND] = EADDRINUSE,    [LISTEN] = EADDRINUSE, [ACCEPT] = EMFILE,
    [CONNECT] = ENETUNREACH, [RECEIVE] = ECONNRESET, [SEND] = ENOBUFS,      [OPTION] = ENOBUFS,
    [RESOLVE] = ENOMEM,      [THREAD] = EAGAIN,      [EVENT] = EMFILE,      [POLL] = EINTR,
};

// ---- who calls ----------------------------------------------------------------------------------

static struct plan *plan;
static struct range { uintptr_t begin, end; } ranges[CALLERS_MAX];
static int caller_count;
static uintptr_t program_base;

static int add_caller(struct dl_phdr_info *info, size_t size, void *context) {
    (void)size;
    (void)context;
    if (caller_count == CALLERS_MAX)
        return 1;
    struct range *range = &ranges[caller_count];
    for (int i = 0; i < info->dlpi_phnum; i++) {
        const ElfW(Phdr) *part = &info->dlpi_phdr[i];
        if (part->p_type == PT_LOAD && part->p_flags & PF_X) {
            range->begin = info->dlpi_addr + part->p_vaddr;
            range->end = range->begin + part->p_memsz;
        }
    }
    const char *slash = strrchr(info->dlpi_name, '/');
    const char *name = slash ? slash + 1 : info->dlpi_name;
    const char *end = strstr(name, ".so");
    int length = end ? (int)(end - name) : (int)strlen(name);
    if (caller_count == 0) {
        name = "program", length = 7;
        program_base = info->dlpi_addr;
    }
    snprintf(plan->callers[caller_count], sizeof plan->callers[0], "%.*s", length, name);
    caller_count++;
    return 0;
}

static int caller_of(const void *address) {
    for (int i = 0; i < caller_count; i++)
        if ((uintptr_t)address - ranges[i].begin < ranges[i].end - ranges[i].begin)
            return i;
    return CALLERS_MAX - 1;
}

__attribute__((constructor)) static void begin(void) {
    const char *path = getenv("ARTHRON_FAILING");
    int fd = path ? (int)syscall(SYS_openat, AT_FDCWD, path, O_RDWR | O_CLOEXEC) : -1;
    if (fd < 0)
        return;
    void *memory =
        (void *)syscall(SYS_mmap, NULL, sizeof *plan, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    syscall(SYS_close, fd);
    if (memory == MAP_FAILED)
        abort();
    void *warm[2];
    backtrace(warm, 2); // loads its library
    plan = memory;
    dl_iterate_phdr(add_caller, NULL);
}

// ---- whether a call fails -----------------------------------------------------------------------

static _Thread_local bool within; // what this library calls itself never fails

static void note_frames(void) {
    void *frames[FRAMES_MAX];
    within = true;
    int count = backtrace(frames, FRAMES_MAX);
    within = false;
    for (int i = 0; i < count; i++)
        plan->frames[i] = (uintptr_t)frames[i] - program_base;
}

static bool fails_for(enum door door, const void *address) {
    if (!plan || within)
        return false;
    int caller = caller_of(address);
    atomic_fetch_add(&plan->counts[caller][door], 1);
    if (atomic_load(&plan->door) != (int)door)
        return false;
    int wanted = atomic_load(&plan->caller);
    if (wanted >= 0 && wanted != caller)
        return false;
    long long left = atomic_fetch_sub(&plan->left, 1);
    if (left > 0 || (left < 0 && !atomic_load(&plan->on)))
        return false;
    if (atomic_fetch_add(&plan->failed, 1) == 0)
        note_frames();
    int error = atomic_load(&plan->error);
    errno = error ? error : usual_errors[door];
    return true;
}

#define FAILS(door) fails_for(door, __builtin_return_address(0))
#define REAL(name)                                                                                 \
    static __typeof__(&name) real;                                                                 \
    if (!real)                                                                                     \
    real = (__typeof__(&name))dlsym(RTLD_NEXT, #name)

static bool is_file(int fd) {
    struct stat status;
    return fstat(fd, &status) == 0 && S_ISREG(status.st_mode);
}

static bool is_socket(int fd) {
    struct stat status;
    return fstat(fd, &status) == 0 && S_ISSOCK(status.st_mode);
}

// ---- memory -------------------------------------------------------------------------------------

void *__libc_malloc(size_t size);
void *__libc_calloc(size_t count, size_t size);
void *__libc_realloc(void *memory, size_t size);
void *__libc_memalign(size_t alignment, size_t size);

#define MEMORY_FAILS FAILS(MEMORY)

void *malloc(size_t size) {
    return MEMORY_FAILS ? NULL : __libc_malloc(size);
}

void *calloc(size_t count, size_t size) {
    return MEMORY_FAILS ? NULL : __libc_calloc(count, size);
}

void *realloc(void *memory, size_t size) {
    return MEMORY_FAILS ? NULL : __libc_realloc(memory, size);
}

void *reallocarray(void *memory, size_t count, size_t size) {
    size_t bytes;
    if (__builtin_mul_overflow(count, size, &bytes) || MEMORY_FAILS) {
        errno = ENOMEM;
        return NULL;
    }
    return __libc_realloc(memory, bytes);
}

void *aligned_alloc(size_t alignment, size_t size) {
    return MEMORY_FAILS ? NULL : __libc_memalign(alignment, size);
}

int posix_memalign(void **out, size_t alignment, size_t size) {
    *out = MEMORY_FAILS ? NULL : __libc_memalign(alignment, size);
    return *out ? 0 : ENOMEM;
}

char *strdup(const char *text) {
    size_t size = strlen(text) + 1;
    char *copy = MEMORY_FAILS ? NULL : __libc_malloc(size);
    return copy ? memcpy(copy, text, size) : NULL;
}

// The memory of operator new is asked for by the C++ library, which throws where there is none.
void *_Znwm(size_t size);
void *_Znwm(size_t size) {
    static void *(*real)(size_t);
    if (!real)
        real = (void *(*)(size_t))dlsym(RTLD_NEXT, "_Znwm");
    if (fails_for(MEMORY, __builtin_return_address(0)))
        size = (size_t)1 << 62; // the real one throws
    return real(size);
}

void *mmap(void *address, size_t size, int protection, int flags, int fd, off_t offset) {
    if (FAILS(MMAP))
        return MAP_FAILED;
    return (void *)syscall(SYS_mmap, address, size, protection, flags, fd, offset);
}

// ---- files --------------------------------------------------------------------------------------

static int open_at(const void *address, int folder, const char *path, int flags, mode_t mode) {
    return fails_for(OPEN, address) ? -1 : (int)syscall(SYS_openat, folder, path, flags, mode);
}

#define OPEN_FUNCTION(name)                                                                        \
    int name(const char *path, int flags, ...) {                                                   \
        va_list rest;                                                                              \
        va_start(rest, flags);                                                                     \
        mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(rest, mode_t) : 0;                    \
        va_end(rest);                                                                              \
        return open_at(__builtin_return_address(0), AT_FDCWD, path, flags, mode);                  \
    }
OPEN_FUNCTION(open)
OPEN_FUNCTION(open64)

int openat(int folder, const char *path, int flags, ...) {
    va_list rest;
    va_start(rest, flags);
    mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(rest, mode_t) : 0;
    va_end(rest);
    return open_at(__builtin_return_address(0), folder, path, flags, mode);
}

FILE *fopen(const char *path, const char *mode) {
    REAL(fopen);
    return FAILS(OPEN) ? NULL : real(path, mode);
}

FILE *fopen64(const char *path, const char *mode) {
    REAL(fopen64);
    return FAILS(OPEN) ? NULL : real(path, mode);
}

FILE *fdopen(int fd, const char *mode) {
    REAL(fdopen);
    return FAILS(MEMORY) ? NULL : real(fd, mode);
}

FILE *open_memstream(char **out_text, size_t *out_size) {
    REAL(open_memstream);
    return FAILS(MEMORY) ? NULL : real(out_text, out_size);
}

DIR *opendir(const char *path) {
    REAL(opendir);
    return FAILS(OPEN) ? NULL : real(path);
}

static bool stream_fails(enum door door, FILE *stream, const void *address) {
    int fd = fileno(stream);
    if (fd < 0 || !is_file(fd) || !fails_for(door, address))
        return false;
    stream->_flags |= 0x20; // what ferror reads
    return true;
}

#define STREAM_FAILS(door, stream) stream_fails(door, stream, __builtin_return_address(0))

size_t fread(void *data, size_t size, size_t count, FILE *stream) {
    REAL(fread);
    return STREAM_FAILS(READ, stream) ? 0 : real(data, size, count, stream);
}

size_t fwrite(const void *data, size_t size, size_t count, FILE *stream) {
    REAL(fwrite);
    return STREAM_FAILS(WRITE, stream) ? 0 : real(data, size, count, stream);
}

int fflush(FILE *stream) {
    REAL(fflush);
    return stream && STREAM_FAILS(WRITE, stream) ? EOF : real(stream);
}

int fclose(FILE *stream) {
    REAL(fclose);
    bool fails = STREAM_FAILS(WRITE, stream);
    int result = real(stream);
    errno = fails ? ENOSPC : errno;
    return fails ? EOF : result;
}

// A socket's bytes may be read and written by these, too. Pipes, events and terminals never fail.
static bool transfer_fails(int fd, enum door of_file, enum door of_socket, const void *address) {
    if (!plan || within)
        return false;
    int before = errno;
    bool fails =
        is_file(fd) ? fails_for(of_file, address) : is_socket(fd) && fails_for(of_socket, address);
    if (!fails)
        errno = before;
    return fails;
}

#define READ_FAILS(fd) transfer_fails(fd, READ, RECEIVE, __builtin_return_address(0))
#define WRITE_FAILS(fd) transfer_fails(fd, WRITE, SEND, __builtin_return_address(0))

ssize_t read(int fd, void *data, size_t size) {
    return READ_FAILS(fd) ? -1 : syscall(SYS_read, fd, data, size);
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

ssize_t pwrite(int fd, const void *data, size_t size, off_t offset) {
    return WRITE_FAILS(fd) ? -1 : syscall(SYS_pwrite64, fd, data, size, offset);
}

ssize_t pwrite64(int fd, const void *data, size_t size, off_t offset) {
    return WRITE_FAILS(fd) ? -1 : syscall(SYS_pwrite64, fd, data, size, offset);
}

int fsync(int fd) {
    return FAILS(SYNC) ? -1 : (int)syscall(SYS_fsync, fd);
}

int fdatasync(int fd) {
    return FAILS(SYNC) ? -1 : (int)syscall(SYS_fdatasync, fd);
}

int close(int fd) {
    bool fails = is_file(fd) && FAILS(CLOSE);
    int result = (int)syscall(SYS_close, fd);
    errno = fails ? EIO : errno;
    return fails ? -1 : result;
}

int rename(const char *from, const char *to) {
    return FAILS(RENAME) ? -1 : (int)syscall(SYS_rename, from, to);
}

int unlink(const char *path) {
    return FAILS(UNLINK) ? -1 : (int)syscall(SYS_unlink, path);
}

int mkdir(const char *path, mode_t mode) {
    return FAILS(MKDIR) ? -1 : (int)syscall(SYS_mkdir, path, mode);
}

int ftruncate(int fd, off_t size) {
    return FAILS(TRUNCATE) ? -1 : (int)syscall(SYS_ftruncate, fd, size);
}

int ftruncate64(int fd, off_t size) {
    return FAILS(TRUNCATE) ? -1 : (int)syscall(SYS_ftruncate, fd, size);
}

int flock(int fd, int operation) {
    return FAILS(LOCK) ? -1 : (int)syscall(SYS_flock, fd, operation);
}

// ---- sockets ------------------------------------------------------------------------------------

int socket(int domain, int type, int protocol) {
    return FAILS(SOCKET) ? -1 : (int)syscall(SYS_socket, domain, type, protocol);
}

int bind(int fd, const struct sockaddr *address, socklen_t size) {
    return FAILS(BIND) ? -1 : (int)syscall(SYS_bind, fd, address, size);
}

int listen(int fd, int backlog) {
    return FAILS(LISTEN) ? -1 : (int)syscall(SYS_listen, fd, backlog);
}

int accept(int fd, struct sockaddr *restrict address, socklen_t *restrict size) {
    return FAILS(ACCEPT) ? -1 : (int)syscall(SYS_accept, fd, address, size);
}

int accept4(int fd, struct sockaddr *restrict address, socklen_t *restrict size, int flags) {
    return FAILS(ACCEPT) ? -1 : (int)syscall(SYS_accept4, fd, address, size, flags);
}

int connect(int fd, const struct sockaddr *address, socklen_t size) {
    REAL(connect);
    return FAILS(CONNECT) ? -1 : real(fd, address, size);
}

ssize_t recv(int fd, void *data, size_t size, int flags) {
    REAL(recv);
    return FAILS(RECEIVE) ? -1 : real(fd, data, size, flags);
}

int recvmmsg(int fd, struct mmsghdr *messages, unsigned count, int flags,
             struct timespec *timeout) {
    REAL(recvmmsg);
    return FAILS(RECEIVE) ? -1 : real(fd, messages, count, flags, timeout);
}

ssize_t send(int fd, const void *data, size_t size, int flags) {
    REAL(send);
    return FAILS(SEND) ? -1 : real(fd, data, size, flags);
}

int sendmmsg(int fd, struct mmsghdr *messages, unsigned count, int flags) {
    REAL(sendmmsg);
    return FAILS(SEND) ? -1 : real(fd, messages, count, flags);
}

int setsockopt(int fd, int level, int name, const void *value, socklen_t size) {
    return FAILS(OPTION) ? -1 : (int)syscall(SYS_setsockopt, fd, level, name, value, size);
}

int getaddrinfo(const char *restrict host, const char *restrict service,
                const struct addrinfo *restrict hints, struct addrinfo **restrict out) {
    REAL(getaddrinfo);
    return FAILS(RESOLVE) ? EAI_MEMORY : real(host, service, hints, out);
}

// ---- threads and time ---------------------------------------------------------------------------

int pthread_create(pthread_t *restrict out, const pthread_attr_t *restrict attributes,
                   void *(*run)(void *), void *restrict argument) {
    REAL(pthread_create);
    return FAILS(THREAD) ? EAGAIN : real(out, attributes, run, argument);
}

int eventfd(unsigned value, int flags) {
    return FAILS(EVENT) ? -1 : (int)syscall(SYS_eventfd2, value, flags);
}

int pipe2(int fds[2], int flags) {
    return FAILS(EVENT) ? -1 : (int)syscall(SYS_pipe2, fds, flags);
}

int pipe(int fds[2]) {
    return FAILS(EVENT) ? -1 : (int)syscall(SYS_pipe2, fds, 0);
}

int poll(struct pollfd *fds, nfds_t count, int timeout_ms) {
    REAL(poll);
    return FAILS(POLL) ? -1 : real(fds, count, timeout_ms);
}

int ppoll(struct pollfd *fds, nfds_t count, const struct timespec *timeout,
          const sigset_t *signals) {
    REAL(ppoll);
    return FAILS(POLL) ? -1 : real(fds, count, timeout, signals);
}

int clock_gettime(clockid_t id, struct timespec *out) {
    int result = (int)syscall(SYS_clock_gettime, id, out);
    if (plan && (id == CLOCK_REALTIME || id == CLOCK_REALTIME_COARSE)) {
        long long now =
            out->tv_sec * 1000000000LL + out->tv_nsec + atomic_load(&plan->clock_off_ns);
        out->tv_sec = now / 1000000000LL;
        out->tv_nsec = now % 1000000000LL;
    }
    return result;
}

time_t time(time_t *out) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    if (out)
        *out = now.tv_sec;
    return now.tv_sec;
}
