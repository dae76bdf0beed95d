#include "trace/trace.h"

#include <elf.h>
#include <gnu/libc-version.h>
#include <link.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/utsname.h>

#define ALIGN_4(size) (((size_t)(size) + 3) & ~(size_t)3)

static void print_hex(const uint8_t *bytes, size_t size, char *out, size_t out_size) {
    for (size_t i = 0; i < size && 2 * i + 2 < out_size; i++)
        snprintf(out + 2 * i, 3, "%02x", bytes[i]);
}

// Notes: a header, the name ("GNU") and the content, each padded to 4 bytes.
static void find_build_id(const uint8_t *notes, size_t size, struct trace_header *header) {
    size_t at = 0;
    while (at + sizeof(ElfW(Nhdr)) <= size) {
        ElfW(Nhdr) note;
        memcpy(&note, notes + at, sizeof note);
        const uint8_t *name = notes + at + sizeof note;
        const uint8_t *content = name + ALIGN_4(note.n_namesz);
        if (note.n_type == NT_GNU_BUILD_ID && note.n_namesz == 4 && !memcmp(name, "GNU", 4))
            print_hex(content, note.n_descsz, header->build, sizeof header->build);
        at += sizeof note + ALIGN_4(note.n_namesz) + ALIGN_4(note.n_descsz);
    }
}

// The first object is the program itself.
static int visit_program(struct dl_phdr_info *info, size_t size, void *header) {
    (void)size;
    for (int i = 0; i < info->dlpi_phnum; i++)
        if (info->dlpi_phdr[i].p_type == PT_NOTE)
            find_build_id((const uint8_t *)(info->dlpi_addr + info->dlpi_phdr[i].p_vaddr),
                          info->dlpi_phdr[i].p_memsz, header);
    return 1;
}

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
    memset(header->build, 0, sizeof header->build);
    dl_iterate_phdr(visit_program, header);
    snprintf(header->libc, sizeof header->libc, "glibc %s", gnu_get_libc_version());
    // glibc.cpu.hwcaps takes features away from the mathematics.
    const char *tunables = getenv("GLIBC_TUNABLES");
    bool masked = tunables && strstr(tunables, "hwcaps");
    snprintf(header->cpu, sizeof header->cpu, "%s%s%s", cpu_level(), masked ? " " : "",
             masked ? tunables : "");
}
