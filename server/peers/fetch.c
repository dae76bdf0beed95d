#include "peers/fetch.h"

#include "base/check.h"
#include "case/case.h"
#include "case/content.h"

#include <errno.h>
#include <fcntl.h>
#include <jansson.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#define LIST_MAX 4096 // bytes of the list of files
#define FILES (CONTENT_FILES + 1)
#define SILENCE_S 10
#define LIST_S 20 // that server may have to read all its cases for it
#define FILE_S 1800

struct fetch {
    struct peers *peers;
    const struct fetch_source *source;
    const char *hash;
    char dir[PATH_MAX]; // to be
    char new[PATH_MAX]; // the folder that what comes is put into
    bool has[FILES];
    struct content_file files[FILES]; // as they are told; the check is the last
};

static const char *name_of(int file) {
    return file < CONTENT_FILES ? content_names[file] : FETCH_CHECK;
}

static uint64_t limit_of(int file) {
    return file < CONTENT_FILES ? case_limits_default().file_bytes : FETCH_CHECK_MAX;
}

static enum result ask(const struct fetch *f, const char *name, uint64_t most, int patience_s,
                       FILE *body, struct error *err) {
    char path[sizeof FETCH_PATH + 32], query[CONTENT_HASH_SIZE + 8];
    struct peer_answer answer;
    snprintf(path, sizeof path, FETCH_PATH "%s%s", name[0] ? "/" : "", name);
    snprintf(query, sizeof query, "hash=%s", f->hash);
    const struct peer_request request = {.pages = f->source->pages,
                                         .method = "GET",
                                         .path = path,
                                         .query = query,
                                         .token = f->source->secret,
                                         .most = (int64_t)most,
                                         .silence_s = name[0] ? SILENCE_S : patience_s,
                                         .patience_s = patience_s};
    enum result result = peer_ask(f->peers, &request, body, &answer, err);
    if (result == RESULT_OK && answer.status != 200)
        result = fail(err, answer.status == 404 ? RESULT_MISSING : RESULT_REFUSED,
                      "https://%s: status %d", f->source->pages, answer.status);
    return result;
}

// ---- the list -----------------------------------------------------------------------------------

static enum result refuse(const struct fetch *f, const char *what, struct error *err) {
    return fail(err, RESULT_CORRUPT, "https://%s: %s", f->source->pages, what);
}

// Names are looked up among ours, and never used as they came.
static bool take_file(struct fetch *f, const json_t *row) {
    const char *name = json_string_value(json_object_get(row, "name"));
    const char *hash = json_string_value(json_object_get(row, "sha256"));
    const json_t *size = json_object_get(row, "size");
    int file = 0;
    while (file < FILES && (!name || strcmp(name, name_of(file)) != 0))
        file++;
    if (file == FILES || f->has[file] || !hash || !content_is_hash(hash) ||
        !json_is_integer(size) || json_integer_value(size) < 0 ||
        (uint64_t)json_integer_value(size) > limit_of(file))
        return false;
    f->has[file] = true;
    f->files[file].size = (uint64_t)json_integer_value(size);
    memcpy(f->files[file].hash, hash, CONTENT_HASH_SIZE);
    return true;
}

static enum result take_list(struct fetch *f, const char *text, size_t size, struct error *err) {
    json_t *list = json_loadb(text, size, JSON_REJECT_DUPLICATES, NULL), *row;
    json_t *files = json_object_get(list, "files");
    bool good = json_is_array(files);
    size_t i;
    json_array_foreach(files, i, row) {
        good = good && take_file(f, row);
    }
    json_decref(list);
    for (int file = 0; file < CONTENT_FILES; file++)
        good = good && f->has[file];
    return good ? RESULT_OK : refuse(f, "its list of the case's files is none", err);
}

static enum result read_list(struct fetch *f, struct error *err) {
    char *text = NULL, hash[CONTENT_HASH_SIZE];
    size_t size = 0;
    FILE *body = open_memstream(&text, &size);
    NEED(body, "memory");
    enum result result = ask(f, "", LIST_MAX, LIST_S, body, err);
    fclose(body);
    if (result == RESULT_OK)
        result = take_list(f, text, size, err);
    free(text);
    if (result != RESULT_OK)
        return result;
    content_hash(f->files, hash);
    return strcmp(hash, f->hash) ? refuse(f, "its list is of another case", err) : RESULT_OK;
}

// ---- the files ----------------------------------------------------------------------------------

static enum result fail_errno(struct error *err, const char *path) {
    return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
}

static enum result fetch_file(const struct fetch *f, int file, struct error *err) {
    char path[PATH_MAX + 16];
    struct content_file found;
    snprintf(path, sizeof path, "%s/%s", f->new, name_of(file));
    FILE *body = fopen(path, "wxe");
    if (!body)
        return fail_errno(err, path);
    enum result result = ask(f, name_of(file), f->files[file].size, FILE_S, body, err);
    if (result == RESULT_OK && fsync(fileno(body)) != 0)
        result = fail_errno(err, path);
    fclose(body);
    if (result == RESULT_OK)
        result = content_read_file(path, f->files[file].size, &found, err);
    if (result == RESULT_OK && strcmp(found.hash, f->files[file].hash) != 0)
        result = fail(err, RESULT_CORRUPT, "https://%s: %s came otherwise than it was told",
                      f->source->pages, name_of(file));
    return result;
}

static void remove_new(const struct fetch *f) {
    char path[PATH_MAX + 16];
    for (int file = 0; file < FILES; file++) {
        snprintf(path, sizeof path, "%s/%s", f->new, name_of(file));
        unlink(path);
    }
    rmdir(f->new);
}

static void sync_folder(const char *path) {
    int folder = open(path, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (folder >= 0) {
        fsync(folder);
        close(folder);
    }
}

static enum result fetch_files(const struct fetch *f, struct error *err) {
    enum result result = RESULT_OK;
    remove_new(f); // of a start that was ended
    if (mkdir(f->new, 0777) != 0)
        return fail_errno(err, f->new);
    for (int file = 0; result == RESULT_OK && file < FILES; file++)
        if (f->has[file])
            result = fetch_file(f, file, err);
    if (result == RESULT_OK)
        sync_folder(f->new);
    else
        remove_new(f);
    return result;
}

// ---- into place ---------------------------------------------------------------------------------

static enum result put_in_place(const struct fetch *f, char *out_kept, size_t size,
                                struct error *err) {
    char moment[32], parent[PATH_MAX];
    time_t now = time(NULL);
    struct tm utc;
    strftime(moment, sizeof moment, "%Y%m%dT%H%M%SZ", gmtime_r(&now, &utc));
    int length = snprintf(out_kept, size, "%s.until-%s", f->dir, moment);
    CHECK(length < (int)size);
    bool was_there = !rename(f->dir, out_kept);
    if (!was_there && errno != ENOENT)
        return fail_errno(err, f->dir);
    if (!was_there)
        out_kept[0] = '\0';
    if (rename(f->new, f->dir) != 0)
        return fail_errno(err, f->dir);
    snprintf(parent, sizeof parent, "%s", f->dir);
    char *slash = strrchr(parent, '/');
    *(slash ? slash + 1 : parent) = '\0';
    sync_folder(slash ? parent : ".");
    return RESULT_OK;
}

enum result fetch_case(struct peers *peers, const struct fetch_source *source, const char *hash,
                       const char *dir, char *out_kept, size_t size, struct error *err) {
    struct fetch f = {.peers = peers, .source = source, .hash = hash};
    int length = snprintf(f.dir, sizeof f.dir, "%s", dir);
    while (length > 1 && length < PATH_MAX && f.dir[length - 1] == '/')
        f.dir[--length] = '\0';
    out_kept[0] = '\0';
    if (snprintf(f.new, sizeof f.new, "%s.coming", f.dir) >= PATH_MAX)
        return fail(err, RESULT_LIMIT, "%s: the path is too long", dir);
    enum result result = read_list(&f, err);
    if (result == RESULT_OK)
        result = fetch_files(&f, err);
    if (result == RESULT_OK)
        result = put_in_place(&f, out_kept, size, err);
    return result;
}
