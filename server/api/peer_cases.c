#include "api/peer_cases.h"

#include "api/routes.h"
#include "base/check.h"
#include "base/log.h"
#include "case/content.h"
#include "peers/fetch.h"

#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

struct content {
    bool is_known;
    struct stat stamps[CONTENT_FILES]; // before it was read
    struct content_file files[CONTENT_FILES];
    char hash[CONTENT_HASH_SIZE];
};

struct peer_cases {
    pthread_mutex_t lock; // held while a case is read: others that ask wait
    const struct api_case *cases;
    int count;
    struct content *contents;
};

struct peer_cases *peer_cases_create(const struct api_case *cases, int count) {
    struct peer_cases *all = alloc(1, sizeof *all);
    *all = (struct peer_cases){.cases = cases, .count = count};
    all->contents = alloc((size_t)count, sizeof *all->contents);
    pthread_mutex_init(&all->lock, NULL);
    return all;
}

void peer_cases_destroy(struct peer_cases **peer_cases) {
    struct peer_cases *all = *peer_cases;
    if (!all)
        return;
    pthread_mutex_destroy(&all->lock);
    free(all->contents);
    free(all);
    *peer_cases = NULL;
}

// ---- finding one --------------------------------------------------------------------------------

static void take_content_stamps(const char *dir, struct stat out[CONTENT_FILES]) {
    for (int i = 0; i < CONTENT_FILES; i++) {
        char path[PATH_MAX];
        snprintf(path, sizeof path, "%s/%s", dir, content_names[i]);
        if (stat(path, &out[i]) != 0)
            out[i] = (struct stat){0};
    }
}

static bool is_same(const struct stat a[CONTENT_FILES], const struct stat b[CONTENT_FILES]) {
    for (int i = 0; i < CONTENT_FILES; i++)
        if (a[i].st_dev != b[i].st_dev || a[i].st_ino != b[i].st_ino ||
            a[i].st_size != b[i].st_size || a[i].st_ctim.tv_sec != b[i].st_ctim.tv_sec ||
            a[i].st_ctim.tv_nsec != b[i].st_ctim.tv_nsec)
            return false;
    return true;
}

// With the lock.
static const struct content *look_up_content(struct peer_cases *all, int index) {
    struct content *content = &all->contents[index], now = {0};
    struct error err;
    take_content_stamps(all->cases[index].dir, now.stamps);
    if (content->is_known && is_same(content->stamps, now.stamps))
        return content;
    now.is_known = true;
    if (content_read(all->cases[index].dir, now.files, &err) == RESULT_OK)
        content_hash(now.files, now.hash);
    *content = now;
    return content;
}

// The case with the hash of the query; NULL after a refusal.
static const struct api_case *find_peer_case(struct api_call *call, struct content *out) {
    struct call_query query = {.names = {"hash"}};
    struct peer_cases *all = call->api->peer_cases;
    const struct api_case *found = NULL;
    if (!call_take_query(call, &query))
        return NULL;
    const char *hash = call_parameter(&query, 0);
    pthread_mutex_lock(&all->lock);
    for (int i = 0; hash && !found && i < all->count; i++) {
        *out = *look_up_content(all, i);
        found = strcmp(out->hash, hash) ? NULL : &all->cases[i];
    }
    pthread_mutex_unlock(&all->lock);
    if (!found)
        call_refuse(call, 404, "not_found", NULL, "This server has no case with this hash.");
    return found;
}

// ---- answers ------------------------------------------------------------------------------------

static void add_file(json_t *files, const char *name, const struct content_file *file) {
    json_array_append_new(files, json_pack("{s:s, s:I, s:s}", "name", name, "size",
                                           (json_int_t)file->size, "sha256", file->hash));
}

void get_peer_cases(struct api_call *call) {
    char path[PATH_MAX];
    struct content content;
    struct content_file check;
    call_close_store(call);
    const struct api_case *found = find_peer_case(call, &content);
    if (!found)
        return;
    json_t *files = json_array();
    for (int i = 0; i < CONTENT_FILES; i++)
        add_file(files, content_names[i], &content.files[i]);
    snprintf(path, sizeof path, "%s/%s", found->dir, FETCH_CHECK);
    if (content_read_file(path, FETCH_CHECK_MAX, &check, NULL) == RESULT_OK)
        add_file(files, FETCH_CHECK, &check);
    log_info("api", "case %s: another server fetches it", found->name);
    call_answer(call, 200, json_pack("{s:o}", "files", files));
}

void get_peer_case_file(struct api_call *call) {
    struct content content;
    call_close_store(call);
    const struct api_case *found = find_peer_case(call, &content);
    if (!found)
        return;
    for (int i = 0; i < CONTENT_FILES + 1; i++) {
        const char *name = i < CONTENT_FILES ? content_names[i] : FETCH_CHECK;
        if (strcmp(call->args[0], name) != 0)
            continue;
        call_answer_file(call, found->dir, name, "application/octet-stream");
        return;
    }
    call_refuse(call, 404, "not_found", NULL, "A case has no such file.");
}
