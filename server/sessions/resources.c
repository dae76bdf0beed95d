#include "sessions/resources.h"

#include "base/check.h"

#include <dirent.h>
#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#define DESCRIPTORS_KEPT                                                                           \
    16 // the console's, a browser's, the records', connections that are refused
#define ROOM_FOR_SESSIONS ((size_t)48 << 20) // four may be opened at once

// The cases and all else, a station with its connection and a session, and one that cuts.
#define SERVER_BYTES (UINT64_C(512) << 20)
#define STATION_BYTES (UINT64_C(2) << 20)
#define CUTTING_BYTES (UINT64_C(16) << 20)
#define DESCRIPTORS_OF_SERVER 512
#define DESCRIPTORS_OF_STATION 2 // its connection and its trace

#define DESCRIPTORS_EVER 65536 // more than a server can ever need

// -1: there is none left to count them with.
static long free_descriptors(void) {
    struct rlimit limit;
    if (!getrlimit(RLIMIT_NOFILE, &limit) && limit.rlim_cur > DESCRIPTORS_EVER)
        return DESCRIPTORS_EVER;
    DIR *folder = opendir("/proc/self/fd");
    if (!folder || getrlimit(RLIMIT_NOFILE, &limit))
        limit.rlim_cur = 0;
    long open = 0;
    while (folder && readdir(folder))
        open++;
    if (!folder)
        return -1;
    closedir(folder);
    return (long)limit.rlim_cur - (open - 3); // without ".", ".." and the folder itself
}

static bool has_memory(void) {
    if (memory_is_short())
        return false;
    void *room =
        mmap(NULL, ROOM_FOR_SESSIONS, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (room != MAP_FAILED)
        munmap(room, ROOM_FOR_SESSIONS);
    return room != MAP_FAILED;
}

enum result resources_allow_session(struct error *err) {
    if (!has_memory())
        return fail(err, RESULT_LIMIT,
                    "the server has no memory left for another session: raise its limit");
    long left = free_descriptors();
    if (left < DESCRIPTORS_KEPT)
        return fail(err, RESULT_LIMIT,
                    "the server has %ld descriptors left and keeps them for its console and for "
                    "instructors: raise its limit (LimitNOFILE)",
                    left < 0 ? 0 : left);
    return RESULT_OK;
}

// ---- at the start -------------------------------------------------------------------------------

static uint64_t least(uint64_t a, uint64_t b) {
    return a < b ? a : b;
}

static uint64_t limit_of(int resource) {
    struct rlimit limit;
    return getrlimit(resource, &limit) || limit.rlim_cur == RLIM_INFINITY ? UINT64_MAX
                                                                          : limit.rlim_cur;
}

// Of the control group that this process is in (cgroups(7), version 2).
static uint64_t group_bytes(void) {
    char line[512] = "", path[640], *group = NULL;
    FILE *file = fopen("/proc/self/cgroup", "re");
    while (file && !group && fgets(line, sizeof line, file))
        group = strncmp(line, "0::", 3) ? NULL : line + 3;
    if (file)
        fclose(file);
    if (!group)
        return UINT64_MAX;
    group[strcspn(group, "\n")] = '\0';
    snprintf(path, sizeof path, "/sys/fs/cgroup%s/memory.max", group);
    uint64_t bytes = UINT64_MAX;
    file = fopen(path, "re");
    if (file && fscanf(file, "%" SCNu64, &bytes) != 1) // "max"
        bytes = UINT64_MAX;
    if (file)
        fclose(file);
    return bytes;
}

void resources_look(struct resource_limits *out) {
    uint64_t machine = (uint64_t)sysconf(_SC_PHYS_PAGES) * (uint64_t)sysconf(_SC_PAGESIZE);
    out->bytes = least(least(machine, limit_of(RLIMIT_AS)), group_bytes());
    out->descriptors = limit_of(RLIMIT_NOFILE);
}

static double gb(uint64_t bytes) {
    return (double)bytes / 1e9;
}

enum result resources_reckon(int stations, const struct resource_limits *limits,
                             struct error *err) {
    uint64_t count = (uint64_t)stations;
    uint64_t descriptors = DESCRIPTORS_OF_SERVER + DESCRIPTORS_OF_STATION * count;
    uint64_t bytes = SERVER_BYTES + STATION_BYTES * count;
    uint64_t cutting = SERVER_BYTES + CUTTING_BYTES * count;
    if (limits->descriptors < descriptors)
        return fail(err, RESULT_LIMIT,
                    "the system gives %" PRIu64 " descriptors, and %d stations may need %" PRIu64
                    ": some stations may be refused. Raise the limit (LimitNOFILE)",
                    limits->descriptors, stations, descriptors);
    if (limits->bytes < cutting)
        return fail(err, RESULT_LIMIT,
                    "%d stations need %.1f GB of memory, and %.1f GB while all of them cut. The "
                    "system gives %.1f GB: some stations may be refused",
                    stations, gb(bytes), gb(cutting), gb(limits->bytes));
    return RESULT_OK;
}
