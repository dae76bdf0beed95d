#include "base/check.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

// ---- what the system does not give --------------------------------------------------------------

#define LAST_WORDS_MAX 4
#define LAST_WORDS_S 2 // that another thread's may take
static struct {
    void (*say)(void *context);
    void *context;
} last_words[LAST_WORDS_MAX];
static atomic_int last_word_count;
static atomic_flag ends = ATOMIC_FLAG_INIT;
static _Thread_local bool ends_here;

void need_before_end(void (*last)(void *context), void *context) {
    int count = last ? atomic_load(&last_word_count) : -1;
    CHECK(count < LAST_WORDS_MAX);
    if (last) {
        last_words[count].say = last;
        last_words[count].context = context;
    }
    atomic_store(&last_word_count, count + 1);
}

// A last word that ends the program itself comes back here: the next ones follow.
static void say_the_rest(void) {
    static int said;
    while (said < atomic_load(&last_word_count)) {
        int next = said++;
        last_words[next].say(last_words[next].context);
    }
}

void say_last_words(void) {
    for (int i = 0; !ends_here && i < LAST_WORDS_S * 10; i++)
        if (atomic_flag_test_and_set(&ends)) // another thread says them
            nanosleep(&(struct timespec){0, 100000000}, NULL);
        else
            ends_here = true;
    if (ends_here)
        say_the_rest();
}

static _Noreturn void end_without(const char *what, const char *where) {
    if (!ends_here) {
        while (atomic_flag_test_and_set(&ends)) // another thread is about to end the program
            pause();
        ends_here = true;
        dprintf(STDERR_FILENO, "arthron: the system gives no %s (%s); the program ends\n", what,
                where);
    }
    say_the_rest();
    _exit(1);
}

_Noreturn void check_failed(const char *condition, const char *file, int line,
                            const char *function) {
    fprintf(stderr, "arthron: %s:%d: %s: check failed: %s\n", file, line, function, condition);
    say_last_words();
    abort();
}

_Noreturn void need_failed(const char *what, const char *file, int line, const char *function) {
    char where[256];
    snprintf(where, sizeof where, "%s:%d, %s", file, line, function);
    end_without(what, where);
}

// ---- memory -------------------------------------------------------------------------------------

static struct {
    pthread_mutex_t lock;
    void *room; // MAP_FAILED: given up
    size_t size;
} kept = {.lock = PTHREAD_MUTEX_INITIALIZER};

// Nothing is ever written there: it costs addresses, which a limit counts, and no memory.
static void *map_room(size_t size) {
    return mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
}

void memory_keep_back(size_t size) {
    pthread_mutex_lock(&kept.lock);
    kept.size = size;
    kept.room = map_room(size);
    pthread_mutex_unlock(&kept.lock);
}

bool memory_is_short(void) {
    pthread_mutex_lock(&kept.lock);
    if (kept.size && kept.room == MAP_FAILED)
        kept.room = map_room(kept.size);
    bool is_short = kept.size && kept.room == MAP_FAILED;
    pthread_mutex_unlock(&kept.lock);
    return is_short;
}

bool memory_give_up(void) {
    pthread_mutex_lock(&kept.lock);
    bool was_there = kept.size && kept.room != MAP_FAILED;
    if (was_there) {
        munmap(kept.room, kept.size);
        kept.room = MAP_FAILED;
    }
    pthread_mutex_unlock(&kept.lock);
    return was_there;
}

static _Noreturn void end_without_memory(unsigned long count, unsigned long size) {
    char where[64];
    snprintf(where, sizeof where, "%lu times %lu bytes", count, size);
    end_without("memory", where);
}

void *alloc(unsigned long count, unsigned long size) {
    void *memory = calloc(count ? count : 1, size);
    if (!memory) {
        memory_give_up();
        memory = calloc(count ? count : 1, size);
    }
    if (!memory)
        end_without_memory(count, size);
    return memory;
}

void *alloc_resize(void *memory, unsigned long count, unsigned long size) {
    void *resized = reallocarray(memory, count ? count : 1, size);
    if (!resized) {
        memory_give_up();
        resized = reallocarray(memory, count ? count : 1, size);
    }
    if (!resized)
        end_without_memory(count, size);
    return resized;
}

void *alloc_aligned(size_t alignment, size_t size) {
    size_t whole = (size + alignment - 1) / alignment * alignment;
    void *memory = aligned_alloc(alignment, whole);
    if (!memory) {
        memory_give_up();
        memory = aligned_alloc(alignment, whole);
    }
    if (!memory)
        end_without_memory(1, whole);
    return memory;
}

char *alloc_text(const char *text) {
    size_t size = strlen(text) + 1;
    return memcpy(alloc(size, 1), text, size);
}
