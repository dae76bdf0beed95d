#include "task/library.h"

#include "base/check.h"
#include "base/log.h"

#include <dirent.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct task_library {
    int count;
    struct task_file *files; // in the order of their names
    struct task *tasks;      // the same
};

static int is_task(const struct dirent *entry) {
    size_t length = strlen(entry->d_name);
    return entry->d_name[0] != '.' && length > 4 && !strcmp(entry->d_name + length - 4, ".ini");
}

static void add(struct task_library *l, const char *dir, const char *name) {
    char path[PATH_MAX];
    struct error err;
    struct task_file *file = &l->files[l->count];
    if (l->count == LIBRARY_TASKS_MAX) {
        log_warning("task", "%s/%s is left out: a server has at most %d tasks", dir, name,
                    LIBRARY_TASKS_MAX);
        return;
    }
    snprintf(path, sizeof path, "%s/%s", dir, name);
    if (task_read(path, file, &err) == RESULT_OK)
        l->tasks[l->count++] = file->task;
    else
        log_warning("task", "%s; this task is left out", err.text);
}

struct task_library *library_read(const char *dir) {
    struct task_library *l = alloc(1, sizeof *l);
    struct dirent **entries;
    int found = scandir(dir, &entries, is_task, alphasort);
    if (found <= 0) {
        if (found == 0)
            free(entries);
        return l;
    }
    int room = found < LIBRARY_TASKS_MAX ? found : LIBRARY_TASKS_MAX;
    l->files = alloc((size_t)room, sizeof *l->files);
    l->tasks = alloc((size_t)room, sizeof *l->tasks);
    for (int i = 0; i < found; i++) {
        add(l, dir, entries[i]->d_name);
        free(entries[i]);
    }
    free(entries);
    log_info("task", "%d tasks from %s", l->count, dir);
    return l;
}

void library_destroy(struct task_library **library) {
    if (!*library)
        return;
    free((*library)->files);
    free((*library)->tasks);
    free(*library);
    *library = NULL;
}

int library_count(const struct task_library *l) {
    return l->count;
}

const struct task *library_tasks(const struct task_library *l) {
    return l->tasks;
}

const struct task_file *library_find(const struct task_library *l, const char *name) {
    for (int i = 0; i < l->count; i++)
        if (!strcmp(l->files[i].task.name, name))
            return &l->files[i];
    return NULL;
}
