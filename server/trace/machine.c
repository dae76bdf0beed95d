#include "trace/trace.h"

#include <gnu/libc-version.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/utsname.h>

// Written by build.cmake: server and arthron-trace are two programs with the same kernels, so the
// build id of the program would not tell.
extern const char trace_build[];

// The levels of the x86-64 psABI, by the features that the mathematics of glibc looks at.
static const char *cpu_level(void) {
#ifdef __x86_64__
    __builtin_cpu_init();
    bool v2 = __builtin_cpu_supports("sse4.2") && __builtin_cpu_supports("ssse3") &&
              __builtin_cpu_supports("popcnt");
    bool v3 = v2 && __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
              __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2");
    bool v4 = v3 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
              __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512dq") &&
              __builtin_cpu_supports("avx512vl");
    return v4 ? "x86-64-v4" : v3 ? "x86-64-v3" : v2 ? "x86-64-v2" : "x86-64";
#else
    static struct utsname name;
    return uname(&name) == 0 ? name.machine : "unknown";
#endif
}

void trace_header_set_machine(struct trace_header *header) {
    snprintf(header->build, sizeof header->build, "%s", trace_build);
    snprintf(header->libc, sizeof header->libc, "glibc %s", gnu_get_libc_version());
    // glibc.cpu.hwcaps takes features away from the mathematics.
    const char *tunables = getenv("GLIBC_TUNABLES");
    bool masked = tunables && strstr(tunables, "hwcaps");
    snprintf(header->cpu, sizeof header->cpu, "%s%s%s", cpu_level(), masked ? " " : "",
             masked ? tunables : "");
}
