// CHECK(condition): a caller's bug stops the program at once, in every build type.
#pragma once

#define CHECK(condition)                                                                           \
    ((condition) ? (void)0 : check_failed(#condition, __FILE__, __LINE__, __func__))

_Noreturn void check_failed(const char *condition, const char *file, int line,
                            const char *function);

// malloc-like functions that never return NULL: out of memory is fatal.
void *alloc(unsigned long count, unsigned long size);                      // zeroed
void *alloc_resize(void *memory, unsigned long count, unsigned long size); // new part undefined
char *alloc_text(const char *text);                                        // a copy
