// What a run tells: the last events and, where an invariant is broken, all that is known of it.
#pragma once

#include <stdbool.h>
#include <stdint.h>

void report_begin(uint64_t seed, bool verbose);
// What is done before a broken run ends the program.
void report_at_end(void (*run)(void));

// An event, for the reader of a broken invariant.
void happened(const char *format, ...) __attribute__((format(printf, 1, 2)));

// Prints seed, time, what was expected, what was found and the last events; exits with 1.
_Noreturn void broken(const char *expected, const char *found, ...)
    __attribute__((format(printf, 2, 3)));

// Of everything that happens, in order.
void report_hash(uint64_t value);
uint64_t report_take_hash(void);
