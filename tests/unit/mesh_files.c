#include "mesh_files.h"

#include <stdio.h>
#include <string.h>

struct error err;
char folder[FOLDER_MAX];

const struct import_source as_it_is = {.mm_per_unit = 1, .T_common_file = {{1, 0, 0, 0}, {0}}};

int mesh_folder_make(void **state) {
    (void)state;
    folder_make(folder);
    return 0;
}

int mesh_folder_remove(void **state) {
    (void)state;
    folder_remove(folder);
    return 0;
}

void write_text_file(const char *name, const char *text) {
    write_file(folder, name, text, strlen(text));
}

enum result read_mesh(const char *name, struct import_source source, struct mesh *out_mesh,
                      struct repair_report *out_report) {
    struct case_limits limits = case_limits_default();
    char path[300];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    source.path = path;
    memset(&err, 0, sizeof err);
    return import_mesh(&source, &limits, out_mesh, out_report, &err);
}
