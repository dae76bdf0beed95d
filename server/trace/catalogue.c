#include "trace/catalogue.h"

#include "base/clock.h"

#include <dirent.h>
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#define DIGITS "0123456789abcdef"
#define END_OF_NAME "-" TRACE_STAMP "-01234567.trace"

void trace_id_text(const uint8_t id[16], char out_text[TRACE_ID_TEXT_SIZE]) {
    for (int i = 0; i < 16; i++)
        snprintf(out_text + 2 * i, 3, "%02x", id[i]);
}

bool trace_is_id(const char *text) {
    return strspn(text, DIGITS) == TRACE_ID_TEXT_SIZE - 1 && !text[TRACE_ID_TEXT_SIZE - 1];
}

void trace_name(const struct trace_header *header, char out_name[TRACE_NAME_MAX]) {
    char id[TRACE_ID_TEXT_SIZE], stamp[sizeof TRACE_STAMP];
    time_t seconds = (time_t)(header->start_utc_ns / NS_PER_S);
    struct tm utc;
    gmtime_r(&seconds, &utc);
    strftime(stamp, sizeof stamp, "%Y%m%dT%H%M%SZ", &utc);
    trace_id_text(header->session_id, id);
    snprintf(out_name, TRACE_NAME_MAX, "%s-%s-%.8s.trace", header->station, stamp, id);
}

// ---- the folder ---------------------------------------------------------------------------------

// False where it is no name of a trace.
static bool take_name(const char *name, struct trace_entry *out) {
    size_t length = strlen(name), end = sizeof END_OF_NAME - 1;
    const char *rest = length > end ? name + length - end : "";
    if (rest[0] != '-' || length - end >= sizeof out->station || rest[sizeof TRACE_STAMP] != '-' ||
        strcmp(rest + end - strlen(".trace"), ".trace") != 0)
        return false;
    snprintf(out->station, sizeof out->station, "%.*s", (int)(length - end), name);
    snprintf(out->stamp, sizeof out->stamp, "%.*s", (int)sizeof TRACE_STAMP - 1, rest + 1);
    snprintf(out->id_start, sizeof out->id_start, "%.8s", rest + sizeof TRACE_STAMP + 1);
    return strspn(out->id_start, DIGITS) == sizeof out->id_start - 1;
}

static bool look_at(const char *folder, const char *name, char path[PATH_MAX],
                    struct trace_entry *out) {
    struct stat status;
    int length = snprintf(path, PATH_MAX, "%s/%s", folder, name);
    if (!take_name(name, out) || length >= PATH_MAX)
        return false;
    bool known = stat(path, &status) == 0;
    if (known ? !S_ISREG(status.st_mode) : errno == ENOENT)
        return false;
    out->path = path;
    out->name = path + length - strlen(name);
    out->written_utc_ns =
        known ? status.st_mtim.tv_sec * NS_PER_S + status.st_mtim.tv_nsec : INT64_MAX;
    return true;
}

enum result catalogue_each(const char *folder,
                           bool (*entry)(void *user, const struct trace_entry *entry), void *user,
                           struct error *err) {
    char path[PATH_MAX];
    struct trace_entry one;
    bool goes_on = true;
    DIR *dir = opendir(folder);
    if (!dir)
        return fail(err, RESULT_IO, "%s: %s", folder, strerror(errno));
    struct dirent *file;
    while (goes_on && (errno = 0, file = readdir(dir)))
        if (look_at(folder, file->d_name, path, &one))
            goes_on = entry(user, &one);
    int fault = goes_on ? errno : 0;
    closedir(dir);
    return fault ? fail(err, RESULT_IO, "%s: %s", folder, strerror(fault)) : RESULT_OK;
}

// ---- one session --------------------------------------------------------------------------------

bool catalogue_is_of(const char *path, const char *id) {
    struct trace_reader *reader;
    char text[TRACE_ID_TEXT_SIZE];
    if (trace_reader_create(path, &reader, NULL) != RESULT_OK)
        return access(path, F_OK) == 0;
    trace_id_text(trace_reader_header(reader)->session_id, text);
    trace_reader_destroy(&reader);
    return !strcmp(text, id);
}

struct trace_search {
    const char *id;
    char *path;
    size_t path_size;
    bool found;
};

static bool find(void *user, const struct trace_entry *entry) {
    struct trace_search *f = user;
    if (strncmp(entry->id_start, f->id, strlen(entry->id_start)) != 0 ||
        strlen(entry->path) >= f->path_size || !catalogue_is_of(entry->path, f->id))
        return true;
    snprintf(f->path, f->path_size, "%s", entry->path);
    f->found = true;
    return false;
}

enum result catalogue_find(const char *folder, const char *id, char *out_path, size_t path_size,
                           struct error *err) {
    struct trace_search f = {id, out_path, path_size, false};
    if (!trace_is_id(id))
        return fail(err, RESULT_INVALID, "%s is no session's id", id);
    enum result result = catalogue_each(folder, find, &f, err);
    if (result == RESULT_OK && !f.found)
        return fail(err, RESULT_MISSING, "%s: no trace of a session %s", folder, id);
    return result;
}
