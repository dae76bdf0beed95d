// Preloaded into a program: calls of the operating system fail as another process says through a
// shared file (environment variable ARTHRON_FAILING). failing.py has the other side of struct plan.
#pragma once

#include <dlfcn.h>
#include <errno.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

enum door {
#define DOOR(name, error) name,
#include "doors.def"
#undef DOOR
    DOORS
};

#define CALLERS_MAX 48
#define FRAMES_MAX 16
#define NAME_MAX_BYTES 32

struct plan {
    atomic_int door;             // that fails; -1: none
    atomic_int on;               // 0: one call, 1: all from then on
    atomic_int error;            // errno; 0: the door's usual one
    atomic_int caller;           // number of the caller, 0: the program itself; -1: whoever
    atomic_llong left;           // calls until the first failure
    atomic_llong failed;         // how many failed
    atomic_llong clock_off_ns;   // of the time of day
    char path[NAME_MAX_BYTES];   // only files whose path has this in it are not opened; "": all
    uint64_t frames[FRAMES_MAX]; // who called when the first one failed, addresses in the program
    char callers[CALLERS_MAX][NAME_MAX_BYTES];
    atomic_llong counts[CALLERS_MAX][DOORS];
};

#pragma GCC visibility push(hidden)
// Whether this call, made from `address`, fails. It has then set errno.
bool failing_now(enum door door, const void *address);
bool failing_to_open(const char *path, const void *address);
// The same for bytes through a descriptor or a stream. Pipes, events, terminals and the log on
// stderr never fail.
bool failing_bytes(int fd, enum door of_file, enum door of_socket, const void *address);
bool failing_is_file(int fd);
long long failing_clock_off_ns(void);
#pragma GCC visibility pop

#define FAILS(door) failing_now(door, __builtin_return_address(0))
#define REAL(name)                                                                                 \
    static __typeof__(&name) real;                                                                 \
    if (!real)                                                                                     \
    real = (__typeof__(&name))dlsym(RTLD_NEXT, #name)

// A function that does nothing but fail, with `refusal`, or go on.
#define CALL(door, refusal, type, name, parameters, arguments)                                     \
    type name parameters;                                                                          \
    type name parameters {                                                                         \
        REAL(name);                                                                                \
        return FAILS(door) ? refusal : real arguments;                                             \
    }
