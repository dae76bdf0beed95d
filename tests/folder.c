#include "folder.h"

#include <ftw.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

static void make_in(const char *parent, char out_path[FOLDER_MAX]) {
    int length = snprintf(out_path, FOLDER_MAX, "%s/arthron-XXXXXX", parent);
    if (length < FOLDER_MAX && mkdtemp(out_path))
        return;
    fprintf(stderr, "%s: no folder can be made here, or its path is too long\n", parent);
    exit(1);
}

void folder_make(char out_path[FOLDER_MAX]) {
    const char *parent = getenv("TMPDIR");
    make_in(parent ? parent : "/tmp", out_path);
}

void folder_make_in_memory(char out_path[FOLDER_MAX]) {
    if (getenv("TMPDIR") || access("/dev/shm", W_OK))
        folder_make(out_path);
    else
        make_in("/dev/shm", out_path);
}

static int remove_one(const char *path, const struct stat *status, int type, struct FTW *walk) {
    (void)status, (void)type, (void)walk;
    return remove(path);
}

void folder_remove(const char *path) {
    nftw(path, remove_one, 16, FTW_DEPTH | FTW_PHYS);
}
