// Whether a call fails, and who made it.
#include "failing.h"

#include <execinfo.h>
#include <fcntl.h>
#include <link.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

static const int usual_errors[DOORS] = {
#define DOOR(name, error) [name] = (error),
#include "doors.def"
#undef DOOR
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

bool failing_now(enum door door, const void *address) {
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

long long failing_clock_off_ns(void) {
    return plan ? atomic_load(&plan->clock_off_ns) : 0;
}

bool failing_to_open(const char *path, const void *address) {
    return plan && strstr(path, plan->path) && failing_now(OPEN, address);
}

// ---- what a descriptor is -----------------------------------------------------------------------

static mode_t kind_of(int fd) {
    struct stat status;
    return syscall(SYS_fstat, fd, &status) == 0 ? status.st_mode & S_IFMT : 0;
}

bool failing_is_file(int fd) {
    return fd != STDERR_FILENO && kind_of(fd) == S_IFREG;
}

bool failing_bytes(int fd, enum door of_file, enum door of_socket, const void *address) {
    if (!plan || within || fd == STDERR_FILENO)
        return false;
    int before = errno;
    mode_t kind = kind_of(fd);
    errno = before;
    return kind == S_IFREG ? failing_now(of_file, address)
                           : kind == S_IFSOCK && failing_now(of_socket, address);
}
