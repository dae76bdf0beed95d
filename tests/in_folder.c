#include "in_folder.h"

#include <stdio.h>

char folder[FOLDER_MAX];

int make_folder(void **state) {
    (void)state;
    folder_make(folder);
    return 0;
}

int remove_folder(void **state) {
    (void)state;
    folder_remove(folder);
    return 0;
}

const char *in_folder(const char *name) {
    static char paths[4][FOLDER_MAX + 32];
    static int next;
    char *path = paths[next++ % 4];
    snprintf(path, sizeof paths[0], "%s/%s", folder, name);
    return path;
}
