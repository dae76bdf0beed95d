// The tasks of a folder: all files *.ini in it.
#pragma once

#include "task/task.h"

#define LIBRARY_TASKS_MAX 256

struct task_library;

// Reads the folder, in the order of the names. A file that is no good is told to the log and left
// out; so are those behind LIBRARY_TASKS_MAX. A folder that is not there has no task. Never NULL.
struct task_library *library_read(const char *dir);
void library_destroy(struct task_library **library); // NULL inside is fine; it becomes NULL

int library_count(const struct task_library *library);
const struct task *library_tasks(const struct task_library *library);
// NULL: it has none of this name.
const struct task_file *library_find(const struct task_library *library, const char *name);
