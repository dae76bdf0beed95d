// CHECK(condition): a caller's bug stops the program, in every build type: a sentence on stderr,
// the last words of need_before_end, abort. NEED(condition, "thread"): what the operating system
// does not give, and what nobody can do without here, ends the program in order: a sentence on
// stderr, the last words of need_before_end, status 1.
#pragma once

#include <stdbool.h>
#include <stddef.h>

#define CHECK(condition)                                                                           \
    ((condition) ? (void)0 : check_failed(#condition, __FILE__, __LINE__, __func__))
#define NEED(condition, what)                                                                      \
    ((condition) ? (void)0 : need_failed(what, __FILE__, __LINE__, __func__))

__attribute__((noreturn)) void check_failed(const char *condition, const char *file, int line,
                                            const char *function);
__attribute__((noreturn)) void need_failed(const char *what, const char *file, int line,
                                           const char *function);

// `last` is called once when a NEED or a CHECK ends the program, after those named before, on any
// thread, which may hold any lock. It returns soon. Where a NEED ends it, the next ones are still
// called.
void need_before_end(void (*last)(void *context), void *context); // NULL: nothing any more

// For who ends the program in another way. Waits a little where another thread says them.
void say_last_words(void);

// malloc-like functions that never return NULL: without memory the program ends as by NEED.
void *alloc(unsigned long count, unsigned long size);                      // zeroed
void *alloc_resize(void *memory, unsigned long count, unsigned long size); // new part undefined
char *alloc_text(const char *text);                                        // a copy
void *alloc_aligned(size_t alignment, size_t size);                        // undefined

// Room that is kept back. Where memory runs out, it is given up, so that what is under way comes to
// its end; whoever would begin anew asks first.
void memory_keep_back(size_t size);
bool memory_give_up(void);  // true: there was room to give up, so memory may be had now
bool memory_is_short(void); // the room is gone and cannot be had again; any thread
