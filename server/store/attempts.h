// Attempts at tasks and ratings of them, in the records (store.h). The words of verdict and end are
// those of task/attempt.h.
#pragma once

#include "store/store.h"

#define ATTEMPT_TASK_MAX 32 // bytes with the 0 at the end, as are the others
#define ATTEMPT_TITLE_MAX 64
#define ATTEMPT_FIGURES_MAX 4096
#define ATTEMPT_OCCURRENCES_TEXT_MAX 8192

// One trial of a task, a span of a session's steps. It belongs to the session's trainee.
struct attempt_row {
    char session[STORE_ID_MAX];
    int number; // within the session, from 1
    char task[ATTEMPT_TASK_MAX];
    int task_version; // from 1
    char title[ATTEMPT_TITLE_MAX];
    char file_hash[STORE_HASH_MAX]; // SHA-256 of the task's file, hexadecimal
    char purpose[16];               // "practice", "exam"
    char hand[8];                   // "right", "left": the one that holds the arthroscope
    uint64_t first_step, last_step;
    int64_t begun_utc_ns;
    double time_s; // of the running session
    int goals, goals_met, errors;
    bool sentinel;      // an error ended it
    char verdict[16];   // "passed", "not yet"
    char end[16];       // "done", "time out", "sentinel error", "left", "stopped"
    double pass_time_s; // what it was judged by
    int pass_errors;
    int mark_version;                               // of the pass mark; 0: the task file's
    char figures[ATTEMPT_FIGURES_MAX];              // a JSON object; empty: none
    char occurrences[ATTEMPT_OCCURRENCES_TEXT_MAX]; // a JSON array; empty: none
};

// Replaces an attempt of the same session and number; *out_new: there was none. An attempt for an
// exam that has begun joins it: the first at the task, on the case and with the hand that the exam
// names.
//
// RESULT_MISSING: the records have no such session. An attempt of a trainee who was erased is not
// kept, which is no error.
enum result store_attempt_add(struct store *store, const struct attempt_row *row, bool *out_new,
                              struct error *err);

// Of a session that the records may lack: 0.
enum result store_attempt_count(struct store *store, const char *session, int64_t *out_count,
                                struct error *err);

// A NULL field, and a time of 0, matches every attempt. course: of its trainees.
struct attempt_filter {
    const char *course, *task, *trainee, *session, *purpose, *hand;
    int64_t from_utc_ns, to_utc_ns;
    int number;                 // within the session; 0: any
    const char *before_session; // only those older than this attempt
    int before_number;
    int limit;
    bool counted; // only those that ran, and that nobody but their trainee ended
    // A rater, who finds nothing by the name of a trainee that it must not learn; NULL: nobody.
    const char *rater;
};

// Newest first, as LIST_ATTEMPTS.
enum result store_attempt_list(struct store *store, const struct attempt_filter *filter,
                               store_row_handler take, void *user, struct error *err);
