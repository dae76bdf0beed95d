// Files of meshes in a folder of the test, and what import makes of them.
#pragma once

#include "case_knee.h"
#include "import/import.h"

extern struct error err; // of the last read_mesh
extern char folder[FOLDER_MAX];

int mesh_folder_make(void **state); // before and after each test
int mesh_folder_remove(void **state);

void write_text_file(const char *name, const char *text);

// In millimetres and the case's frame.
extern const struct import_source as_it_is;

// A file of the folder; the path of `source` does not count.
enum result read_mesh(const char *name, struct import_source source, struct mesh *out_mesh,
                      struct repair_report *out_report);
