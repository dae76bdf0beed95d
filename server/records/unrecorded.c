#include "records/unrecorded.h"

#include "base/check.h"
#include "base/log.h"

#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static bool is_trace(const char *name) {
    size_t length = strlen(name);
    return length > 6 && !strcmp(name + length - 6, ".trace");
}

static enum result look_at(struct store *store, const char *traces_dir, const char *name,
                           char out_path[STORE_TEXT_MAX], bool *out_new, struct error *err) {
    bool done = false;
    *out_new = false;
    if (!is_trace(name))
        return RESULT_OK;
    if (snprintf(out_path, STORE_TEXT_MAX, "%s/%s", traces_dir, name) >= STORE_TEXT_MAX) {
        log_error("records", "%s/%s: the path is too long for the records", traces_dir, name);
        return RESULT_OK;
    }
    enum result result = store_trace_is_done(store, out_path, &done, err);
    *out_new = result == RESULT_OK && !done;
    return result;
}

static enum result collect(struct store *store, const char *traces_dir, DIR *dir,
                           struct trace_paths *paths, struct error *err) {
    enum result result = RESULT_OK;
    struct dirent *entry;
    while (result == RESULT_OK && (errno = 0, entry = readdir(dir))) {
        bool is_new;
        if (paths->count == paths->room) {
            paths->room = 2 * paths->room + 16;
            paths->at = alloc_resize(paths->at, paths->room, sizeof *paths->at);
        }
        result = look_at(store, traces_dir, entry->d_name, paths->at[paths->count], &is_new, err);
        paths->count += is_new;
    }
    return result == RESULT_OK && errno
               ? fail(err, RESULT_IO, "%s: %s", traces_dir, strerror(errno))
               : result;
}

enum result unrecorded_find(const char *records, const char *traces_dir, int64_t start_utc_ns,
                            struct trace_paths *out_paths, struct error *err) {
    struct store *store;
    DIR *dir = opendir(traces_dir);
    *out_paths = (struct trace_paths){0};
    if (!dir)
        return fail(err, RESULT_IO, "%s: %s", traces_dir, strerror(errno));
    enum result result = store_open(records, STORE_MAKE, RECORDER_ACTOR, &store, err);
    if (result == RESULT_OK)
        result = store_interrupt_open(store, start_utc_ns, err);
    if (result == RESULT_OK)
        result = collect(store, traces_dir, dir, out_paths, err);
    store_close(&store);
    closedir(dir);
    return result;
}

void trace_paths_fini(struct trace_paths *paths) {
    free(paths->at);
}
