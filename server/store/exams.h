// Exams and ratings, in the records (store.h).
//
// An exam is planned; it begins once its checklist is done; it is done when each of its tasks has
// an attempt (store_attempt_add); its result is withheld from the trainee until it is released.
// Errors: RESULT_REFUSED where the exam's state, or its raters, do not permit what is asked.
#pragma once

#include "store/attempts.h"

#define EXAM_TASKS_MAX 16
#define EXAM_RATERS_MAX 2
#define EXAM_DRIFT_MAX_MM 2.0
#define EXAM_INTERVENTIONS_MAX 64
#define EXAM_REASON_MIN 3
#define EXAM_RESULT_MAX 32768

struct exam_task {
    char task[ATTEMPT_TASK_MAX];
    char knee_case[STORE_NAME_MAX];
    char hand[8]; // "right", "left"; empty: either
};

struct exam_plan {
    char course[STORE_NAME_MAX], trainee[STORE_NAME_MAX], title[ATTEMPT_TITLE_MAX];
    int64_t seed;
    int count;
    struct exam_task tasks[EXAM_TASKS_MAX];
    int rater_count;
    char raters[EXAM_RATERS_MAX][STORE_NAME_MAX]; // accounts of instructors
};

// The trainee is in the course.
enum result store_add_exam(struct store *store, const struct exam_plan *plan, int64_t *out_id,
                           struct error *err);
enum result store_remove_exam(struct store *store, int64_t id, struct error *err); // planned only

// What was looked at before the exam begins. case_hashes: of each task's case, 16 hexadecimal
// digits; attempts on another version of the case do not count.
struct exam_checklist {
    bool who, station_check;
    double drift_mm;
    char case_hashes[EXAM_TASKS_MAX][17];
};
enum result store_begin_exam(struct store *store, int64_t id, const struct exam_checklist *checked,
                             struct error *err);

// Flags the exam. Only while it goes on. The reason has at least EXAM_REASON_MIN bytes.
enum result store_add_intervention(struct store *store, int64_t id, const char *reason,
                                   struct error *err);

// A result as it was signed; hash, certificate and signature (DER) in hexadecimal digits.
struct exam_result {
    const char *text;
    bool passed;
    char hash[STORE_HASH_MAX]; // SHA-256 of the text
    char certificate[STORE_CERTIFICATE_MAX], signature[STORE_SIGNATURE_MAX];
    int64_t released_utc_ns;
};
// Fills the result in from the records, within the transaction that keeps it. The text is the
// maker's.
typedef enum result (*exam_result_maker)(void *user, struct exam_result *out, struct error *err);
// incomplete: also one that is begun, without attempts at all of its tasks.
enum result store_release_exam(struct store *store, int64_t id, bool incomplete,
                               exam_result_maker make, void *user, struct error *err);

// NULL matches every exam; the newest EXAMS_MAX, newest first, as LIST_EXAMS. rater: an
// account, or NULL; it finds none by the name of a trainee that it must not learn.
#define EXAMS_MAX 500
enum result store_find_exams(struct store *store, const char *course, const char *trainee,
                             const char *rater, store_row_handler take, void *user,
                             struct error *err);

// account, rated: the raters of an exam and whether each has rated all of its attempts.
enum result store_exam_raters(struct store *store, int64_t id, store_row_handler take, void *user,
                              struct error *err);

// trainee, task, state: the tasks of a course's exams, the newest exam last; without those that
// the rater (NULL: nobody) is blind to.
enum result store_exams_in(struct store *store, const char *course, const char *rater,
                           store_row_handler take, void *user, struct error *err);

// Whether the account is to rate an attempt of this session in an exam that was not released: then
// it must not learn whose it is. exam: the same of an exam.
enum result store_is_blind(struct store *store, const char *account, const char *session,
                           bool *out_is, struct error *err);
enum result store_is_blind_to_exam(struct store *store, const char *account, int64_t exam,
                                   bool *out_is, struct error *err);

// Whether the account is to rate an exam of the trainee that goes on, or is done and not released.
enum result store_is_blind_to(struct store *store, const char *account, const char *trainee,
                              bool *out_is, struct error *err);

// account, trainee: who is to rate an exam that goes on, or is done and not released, and whose it
// is.
enum result store_blind_pairs(struct store *store, store_row_handler take, void *user,
                              struct error *err);

// The exam in which an attempt would take a place now. RESULT_MISSING: the trainee has none, and
// the error says so.
struct exam_place {
    const char *trainee, *task, *knee_case;
    uint64_t case_hash;
    const char *hand; // "right", "left"
};
enum result store_find_exam_place(struct store *store, const struct exam_place *place,
                                  int64_t *out_exam, struct error *err);

// Whether the session has an attempt of an exam that was not released, or of none: then its trainee
// must not see what came of it.
enum result store_is_withheld(struct store *store, const char *session, bool *out_is,
                              struct error *err);

// ---- ratings ------------------------------------------------------------------------------------

// ASSET: seven domains from 1 to 5, autonomy from 1 to 3.
enum rating_domain {
    RATING_SAFETY,
    RATING_FIELD_OF_VIEW,
    RATING_CAMERA_DEXTERITY,
    RATING_INSTRUMENT_DEXTERITY,
    RATING_BIMANUAL_DEXTERITY,
    RATING_FLOW,
    RATING_QUALITY,
    RATING_AUTONOMY,
    RATING_DOMAINS
};
#define RATING_COMPETENT 3                                    // in each domain
extern const char *const rating_domain_names[RATING_DOMAINS]; // "safety", ..., as the columns
int rating_domain_most(enum rating_domain domain);            // 5, or 3

// Replaces the account's own rating. remark: or NULL. RESULT_MISSING: there is no such attempt.
enum result store_put_rating(struct store *store, const char *session, int number, int64_t account,
                             const int levels[RATING_DOMAINS], const char *remark,
                             struct error *err);

// The ratings of an attempt, as LIST_RATINGS.
enum result store_ratings_of(struct store *store, const char *session, int number,
                             store_row_handler take, void *user, struct error *err);

// The attempts that an account has still to rate: session, number, exam, task, title, case, time_s.
enum result store_to_rate(struct store *store, int64_t account, store_row_handler take, void *user,
                          struct error *err);

// The ratings by an exam's raters of a course's attempts that two or more have rated: attempt (its
// number in the records), sum, competent; those of an attempt after each other.
enum result store_rated_twice(struct store *store, const char *course, store_row_handler take,
                              void *user, struct error *err);
