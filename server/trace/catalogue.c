#include "trace/catalogue.h"

#include "base/clock.h"

#include <dirent.h>
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#define DIGITS "0123456789abcdef"
#define ENDING ".trace"
#define END_OF_NAME "-" TRACE_STAMP "-01234567" ENDING

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
    char part[16] = "";
    if (header->part > 1)
        snprintf(part, sizeof part, "-p%u", header->part);
    snprintf(out_name, TRACE_NAME_MAX, "%s-%s-%.8s%s.trace", header->station, stamp, id, part);
}

// ---- the folder ---------------------------------------------------------------------------------

// The number behind -p at the end of a name without its ending, of which *in_out_length then is
// shorter; 1 where there is none.
static int take_part(const char *name, size_t *in_out_length) {
    size_t digits = 0, length = *in_out_length - strlen(ENDING);
    while (digits < 5 && digits < length && strchr("0123456789", name[length - digits - 1]))
        digits++;
    size_t begin = length - digits;
    int part = digits && begin > 2 ? atoi(name + begin) : 0;
    if (part < 2 || part > TRACE_PARTS_MAX || name[begin] == '0' || name[begin - 1] != 'p' ||
        name[begin - 2] != '-')
        return 1;
    *in_out_length -= digits + 2;
    return part;
}

// False where it is no name of a trace.
static bool take_name(const char *whole, struct trace_entry *out) {
    char name[TRACE_NAME_MAX];
    size_t length = strlen(whole), end = sizeof END_OF_NAME - 1;
    if (length <= end || length >= sizeof name ||
        strcmp(whole + length - strlen(ENDING), ENDING) != 0)
        return false;
    out->part = take_part(whole, &length);
    snprintf(name, sizeof name, "%.*s" ENDING, (int)(length - strlen(ENDING)), whole);
    const char *rest = length > end ? name + length - end : "";
    if (rest[0] != '-' || length - end >= sizeof out->station || rest[sizeof TRACE_STAMP] != '-')
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
    int part; // of what was found; 0: nothing
};

static bool find(void *user, const struct trace_entry *entry) {
    struct trace_search *f = user;
    if (strncmp(entry->id_start, f->id, strlen(entry->id_start)) != 0 || entry->part <= f->part ||
        strlen(entry->path) >= f->path_size || !catalogue_is_of(entry->path, f->id))
        return true;
    snprintf(f->path, f->path_size, "%s", entry->path);
    f->part = entry->part;
    return true;
}

enum result catalogue_find(const char *folder, const char *id, char *out_path, size_t path_size,
                           struct error *err) {
    struct trace_search f = {id, out_path, path_size, 0};
    if (!trace_is_id(id))
        return fail(err, RESULT_INVALID, "%s is no session's id", id);
    enum result result = catalogue_each(folder, find, &f, err);
    if (result == RESULT_OK && !f.part)
        return fail(err, RESULT_MISSING, "%s: no trace of a session %s", folder, id);
    return result;
}
