#include "api/case_summary.h"

#include "api/call.h"
#include "base/check.h"
#include "base/task_pool.h"
#include "case/case.h"
#include "check/grade.h"

#include <inttypes.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#define FILES 2
#define READER_NICE 19

static const char *const summary_files[FILES] = {"case.json", "anatomy.glb"};

struct file_stamp {
    int64_t changed_ns, size;
};

struct summary {
    struct case_summaries *all;
    bool is_known, is_being_read;
    struct file_stamp stamps[FILES]; // when it was read
    uint64_t hash;                   // 0: it cannot be read
    json_t *row;                     // without its grade
    char broken[sizeof((struct error){0}).text];
};

struct case_summaries {
    pthread_mutex_t lock; // of the entries; never held over a reading
    const struct api_case *cases;
    case_checker check;
    int count;
    struct summary *entries;
    struct task_pool *reader; // one thread
};

// ---- the case -----------------------------------------------------------------------------------

static void take_summary_stamps(const char *dir, struct file_stamp out[FILES]) {
    for (int i = 0; i < FILES; i++) {
        char path[1024];
        struct stat status = {0};
        snprintf(path, sizeof path, "%s/%s", dir, summary_files[i]);
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
        const struct case_tissue *t = &g->tissue;
        char colour[8];
        snprintf(colour, sizeof colour, "#%06x", (unsigned)t->colour & 0xffffff);
        json_array_append_new(
            groups,
            json_pack("{s:o, s:s, s:b, s:s, s:o, s:s, s:b, s:s, s:b}", "name", call_string(g->name),
                      "body", body_name(g->body), "cuttable", g->cuttable, "tissue",
                      tissue_kind_name(t->kind), "label", call_string(t->label), "colour", colour,
                      "own_colour", t->colour != tissue_colour(t->kind), "side",
                      tissue_side_name(t->side), "zones", t->has_zones));
    }
    return groups;
}

static void set_known(struct summary *summary, const struct api_case *about,
                      const struct knee_case *knee, const char *broken) {
    summary->is_known = true;
    summary->row = json_pack("{s:o}", "name", call_string(about->name));
    snprintf(summary->broken, sizeof summary->broken, "%s", broken);
    if (!knee)
        return;
    summary->hash = knee->hash;
    json_object_set_new(summary->row, "title", call_string(knee->title));
    json_object_set_new(summary->row, "groups", groups_of(knee));
}

// On the reader's thread. A change while it reads is seen by the next request.
static int64_t read_case(void *data) {
    struct summary *summary = data, now = {0};
    struct case_summaries *all = summary->all;
    const struct api_case *about = &all->cases[summary - all->entries];
    struct knee_case *knee = NULL;
    struct error err = {""};
    take_summary_stamps(about->dir, now.stamps);
    if (case_load_checked(about->dir, all->check, &knee, &err) != RESULT_OK)
        knee = NULL;
    set_known(&now, about, knee, err.text);
    case_destroy(&knee);
    now.all = all;
    pthread_mutex_lock(&all->lock);
    json_decref(summary->row);
    *summary = now;
    pthread_mutex_unlock(&all->lock);
    return TASK_DONE;
}

// With the lock.
static void call_reader(struct summary *summary) {
    if (summary->is_being_read)
        return;
    summary->is_being_read =
        task_pool_add(summary->all->reader, &(struct pool_task){.run = read_case, .data = summary});
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
    if (!summary->is_known)
        set_grade(row, "unchecked", "the server is reading it");
    else if (!summary->hash)
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

// With the lock: the entry of files with these stamps.
static const struct summary *look_up_summary(struct case_summaries *all, int index,
                                             const struct file_stamp stamps[FILES]) {
    struct summary *summary = &all->entries[index];
    if (summary->is_known && memcmp(stamps, summary->stamps, sizeof summary->stamps) != 0)
        summary->is_known = false;
    if (!summary->is_known)
        call_reader(summary);
    return summary;
}

// The row without its grade, of files with these stamps; `out` says what its grade depends on.
static json_t *copy_known(struct case_summaries *all, int index,
                          const struct file_stamp stamps[FILES], struct summary *out) {
    pthread_mutex_lock(&all->lock);
    const struct summary *summary = look_up_summary(all, index, stamps);
    *out = *summary;
    json_t *row = summary->row ? json_deep_copy(summary->row)
                               : json_pack("{s:o}", "name", call_string(all->cases[index].name));
    pthread_mutex_unlock(&all->lock);
    return row;
}

json_t *case_summary(struct case_summaries *summaries, int index, char out_hash[17]) {
    CHECK(index >= 0 && index < summaries->count);
    const struct api_case *about = &summaries->cases[index];
    struct summary known;
    struct file_stamp stamps[FILES];
    take_summary_stamps(about->dir, stamps);
    json_t *row = copy_known(summaries, index, stamps, &known);
    out_hash[0] = '\0';
    if (known.is_known && known.hash)
        snprintf(out_hash, 17, "%016" PRIx64, known.hash);
    json_object_set_new(row, "hash", out_hash[0] ? json_string(out_hash) : json_null());
    add_grade(about, &known, row);
    return row;
}

enum result case_summary_hash(struct case_summaries *summaries, int index, uint64_t *out_hash) {
    CHECK(index >= 0 && index < summaries->count);
    struct file_stamp stamps[FILES];
    take_summary_stamps(summaries->cases[index].dir, stamps);
    pthread_mutex_lock(&summaries->lock);
    const struct summary *summary = look_up_summary(summaries, index, stamps);
    bool is_known = summary->is_known;
    *out_hash = summary->hash;
    pthread_mutex_unlock(&summaries->lock);
    return !is_known ? RESULT_TIMEOUT : *out_hash ? RESULT_OK : RESULT_MISSING;
}

// ---- begin and end ------------------------------------------------------------------------------

struct case_summaries *case_summaries_create(const struct api_case *cases, int count,
                                             case_checker check) {
    const struct task_pool_settings reader = {
        .threads = 1, .tasks_max = count, .nice = READER_NICE};
    struct case_summaries *all = alloc(1, sizeof *all);
    *all = (struct case_summaries){.cases = cases, .check = check, .count = count};
    all->entries = alloc((unsigned long)count, sizeof *all->entries);
    all->reader = task_pool_create(&reader);
    pthread_mutex_init(&all->lock, NULL);
    for (int i = 0; i < count; i++) {
        struct summary *summary = &all->entries[i];
        bool is_refused = cases[i].refusal && cases[i].refusal[0];
        summary->all = all;
        take_summary_stamps(cases[i].dir, summary->stamps);
        if (is_refused)
            set_known(summary, &cases[i], NULL, cases[i].refusal);
        else if (cases[i].knee)
            set_known(summary, &cases[i], cases[i].knee, "");
    }
    return all;
}

void case_summaries_destroy(struct case_summaries **summaries) {
    struct case_summaries *all = *summaries;
    if (!all)
        return;
    task_pool_destroy(&all->reader);
    for (int i = 0; i < all->count; i++)
        json_decref(all->entries[i].row);
    pthread_mutex_destroy(&all->lock);
    free(all->entries);
    free(all);
    *summaries = NULL;
}
