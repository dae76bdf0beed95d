// Folders for the files of tests and benches.
#pragma once

#include <stddef.h>

#define FOLDER_MAX 96 // leaves room for a socket's name

// A new empty folder in $TMPDIR or, where that is not set, /tmp. Where it cannot be made or its
// path does not fit, the program ends, saying so.
void folder_make(char out_path[FOLDER_MAX]);

// The same in memory (/dev/shm) where $TMPDIR is not set and there is such a place.
void folder_make_in_memory(char out_path[FOLDER_MAX]);

// With all that is in it; nothing where it is gone.
void folder_remove(const char *path);
