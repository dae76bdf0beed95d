#include "api/case_summary.h"

#include "api/call.h"
#include "base/check.h"
#include "case/case.h"
#include "check/grade.h"

#include <inttypes.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#define FILES 2

static const char *const files[FILES] = {"case.json", "anatomy.glb"};

struct file_stamp {
    int64_t changed_ns, size;
};

struct summary {
    bool is_read;
    struct file_stamp stamps[FILES]; // when it was read
    uint64_t hash;                   // 0: it cannot be read
    json_t *row;                     // without its grade
    char broken[sizeof((struct error){0}).text];
};

struct case_summaries {
    pthread_mutex_t lock;
    const struct api_case *cases;
    case_checker check;
    int count;
    struct summary *entries;
};

struct case_summaries *case_summaries_create(const struct api_case *cases, int count,
                                             case_checker check) {
    struct case_summaries *summaries = alloc(1, sizeof *summaries);
    *summaries = (struct case_summaries){.cases = cases, .check = check, .count = count};
    summaries->entries = alloc((unsigned long)count + 1, sizeof *summaries->entries);
    pthread_mutex_init(&summaries->lock, NULL);
    return summaries;
}

void case_summaries_destroy(struct case_summaries **summaries) {
    struct case_summaries *c = *summaries;
    if (!c)
        return;
    for (int i = 0; i < c->count; i++)
        json_decref(c->entries[i].row);
    pthread_mutex_destroy(&c->lock);
    free(c->entries);
    free(c);
    *summaries = NULL;
}

// ---- the case -----------------------------------------------------------------------------------

static void take_stamps(const char *dir, struct file_stamp out[FILES]) {
    for (int i = 0; i < FILES; i++) {
        char path[1024];
        struct stat status = {0};
        snprintf(path, sizeof path, "%s/%s", dir, files[i]);
        stat(path, &status); // a missing file has size 0
        out[i].changed_ns =
            (int64_t)status.st_mtim.tv_sec * 1000000000 + (int64_t)status.st_mtim.tv_nsec;
        out[i].size = (int64_t)status.st_size;
    }
}

static json_t *groups_of(const struct knee_case *knee) {
    json_t *groups = json_array();
    for (int i = 0; i < knee->group_count; i++) {
        const struct case_group *g = &knee->groups[i];
        json_array_append_new(groups,
                              json_pack("{s:o, s:s, s:b}", "name", call_string(g->name), "body",
                                        body_name(g->body), "cuttable", g->cuttable));
    }
    return groups;
}

static void read_case(const struct api_case *about, case_checker check, struct summary *summary) {
    struct knee_case *knee;
    struct error err = {""};
    json_decref(summary->row);
    summary->row = json_pack("{s:o}", "name", call_string(about->name));
    summary->hash = 0;
    if (case_load_checked(about->dir, check, &knee, &err) != RESULT_OK) {
        snprintf(summary->broken, sizeof summary->broken, "%s", err.text);
        return;
    }
    summary->hash = knee->hash;
    json_object_set_new(summary->row, "title", call_string(knee->title));
    json_object_set_new(summary->row, "groups", groups_of(knee));
    case_destroy(&knee);
}

// ---- the grade ----------------------------------------------------------------------------------

static void set_grade(json_t *row, const char *grade, const char *reason) {
    json_object_set_new(row, "grade", json_string(grade));
    json_object_set_new(row, "grade_reason", call_string(reason));
}

static void add_grade(const struct api_case *about, const struct summary *summary, json_t *row) {
    struct case_grade grade;
    struct error err = {""};
    enum result result = grade_read(about->dir, &grade, &err);
    if (!summary->hash)
        set_grade(row, "broken", error_without_folder(summary->broken));
    else if (result == RESULT_MISSING)
        set_grade(row, "unchecked", "");
    else if (result != RESULT_OK)
        set_grade(row, "unchecked", error_without_folder(err.text));
    else if (grade.hash != summary->hash)
        set_grade(row, "outdated", grade.reason);
    else if (!grade.made_here && grade.grade != GRADE_UNFIT)
        set_grade(row, "unchecked", "its check was made elsewhere");
    else
        set_grade(row, grade_name(grade.grade), grade.reason);
}

json_t *case_summary(struct case_summaries *summaries, int index, char out_hash[17]) {
    CHECK(index >= 0 && index < summaries->count);
    const struct api_case *about = &summaries->cases[index];
    struct summary *summary = &summaries->entries[index];
    struct file_stamp stamps[FILES];
    pthread_mutex_lock(&summaries->lock);
    take_stamps(about->dir, stamps);
    if (!summary->is_read || memcmp(stamps, summary->stamps, sizeof stamps) != 0)
        read_case(about, summaries->check, summary);
    summary->is_read = true;
    memcpy(summary->stamps, stamps, sizeof stamps);
    json_t *row = json_deep_copy(summary->row);
    out_hash[0] = '\0';
    if (summary->hash)
        snprintf(out_hash, 17, "%016" PRIx64, summary->hash);
    add_grade(about, summary, row);
    pthread_mutex_unlock(&summaries->lock);
    json_object_set_new(row, "hash", summary->hash ? json_string(out_hash) : json_null());
    return row;
}
