#include "failing.h"

#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

void *__libc_malloc(size_t size);
void *__libc_calloc(size_t count, size_t size);
void *__libc_realloc(void *memory, size_t size);
void *__libc_memalign(size_t alignment, size_t size);

void *malloc(size_t size) {
    return FAILS(MEMORY) ? NULL : __libc_malloc(size);
}

void *calloc(size_t count, size_t size) {
    return FAILS(MEMORY) ? NULL : __libc_calloc(count, size);
}

void *realloc(void *memory, size_t size) {
    return FAILS(MEMORY) ? NULL : __libc_realloc(memory, size);
}

void *reallocarray(void *memory, size_t count, size_t size) {
    size_t bytes;
    if (__builtin_mul_overflow(count, size, &bytes) || FAILS(MEMORY)) {
        errno = ENOMEM;
        return NULL;
    }
    return __libc_realloc(memory, bytes);
}

void *aligned_alloc(size_t alignment, size_t size) {
    return FAILS(MEMORY) ? NULL : __libc_memalign(alignment, size);
}

int posix_memalign(void **out, size_t alignment, size_t size) {
    *out = FAILS(MEMORY) ? NULL : __libc_memalign(alignment, size);
    return *out ? 0 : ENOMEM;
}

char *strdup(const char *text) {
    size_t size = strlen(text) + 1;
    char *copy = FAILS(MEMORY) ? NULL : __libc_malloc(size);
    return copy ? memcpy(copy, text, size) : NULL;
}

char *strndup(const char *text, size_t most) {
    size_t size = strnlen(text, most);
    char *copy = FAILS(MEMORY) ? NULL : __libc_malloc(size + 1);
    if (copy) {
        memcpy(copy, text, size);
        copy[size] = '\0';
    }
    return copy;
}

// The memory of operator new is asked for by the C++ library, which throws where there is none.
void *_Znwm(size_t size);
void *_Znwm(size_t size) {
    REAL(_Znwm);
    return real(FAILS(MEMORY) ? (size_t)1 << 62 : size);
}

void *_Znam(size_t size);
void *_Znam(size_t size) {
    REAL(_Znam);
    return real(FAILS(MEMORY) ? (size_t)1 << 62 : size);
}

#define MAP(name)                                                                                  \
    void *name(void *address, size_t size, int protection, int flags, int fd, off_t offset) {      \
        if (FAILS(MMAP))                                                                           \
            return MAP_FAILED;                                                                     \
        return (void *)syscall(SYS_mmap, address, size, protection, flags, fd, offset);            \
    }
MAP(mmap)
MAP(mmap64)

CALL(MMAP, -1, int, madvise, (void *address, size_t size, int advice), (address, size, advice))
