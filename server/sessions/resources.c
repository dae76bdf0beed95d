#include "sessions/resources.h"

#include "base/check.h"

#include <dirent.h>
#include <stdbool.h>
#include <sys/mman.h>
#include <sys/resource.h>

#define DESCRIPTORS_KEPT                                                                           \
    16 // the console's, a browser's, the records', connections that are refused
// A session takes 9 MB; four may be opened at once.
#define ROOM_FOR_SESSIONS ((size_t)48 << 20)

// -1: there is none left to count them with.
static long free_descriptors(void) {
    struct rlimit limit;
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
