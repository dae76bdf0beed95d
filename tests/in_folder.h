// A folder for the files of a test program, from before its tests until after them.
#pragma once

#include "folder.h"

extern char folder[FOLDER_MAX];

int make_folder(void **state); // for cmocka's groups
int remove_folder(void **state);

const char *in_folder(const char *name); // its path; the last four stay
