#include "store/exams.h"

#include "api/attempts.h"
#include "api/case_summary.h"
#include "api/routes.h"
#include "api/tasks.h"
#include "api/values.h"
#include "base/chance.h"
#include "base/check.h"
#include "base/clock.h"
#include "records/audit_seal.h"

#include <openssl/evp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define SEED_MAX ((1LL << 53) - 1) // JSON's numbers are exact up to there
#define NAMES_MAX 16

// ---- planning -----------------------------------------------------------------------------------

// The draw of docs/API.md: the number-th output, from 0, of splitmix64 that begins with the seed.
static uint64_t draw(int64_t seed, int number) {
    uint64_t z = (uint64_t)seed + 0x9e3779b97f4a7c15 * ((uint64_t)number + 1);
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9;
    z = (z ^ z >> 27) * 0x94d049bb133111eb;
    return z ^ z >> 31;
}

static int find_exam_case(const struct api_call *call, const char *name) {
    const struct api_config *config = &call->api->config;
    for (int i = 0; i < config->case_count; i++)
        if (!strcmp(config->cases[i].name, name))
            return i;
    return -1;
}

// Lists of tasks and of cases; each task is drawn a case.
static bool take_exam_tasks(struct api_call *call, struct exam_plan *plan, const char *hand) {
    char tasks[NAMES_MAX][ATTEMPT_TASK_MAX], cases[NAMES_MAX][STORE_NAME_MAX];
    int case_count;
    _Static_assert(NAMES_MAX == EXAM_TASKS_MAX, "all tasks of an exam");
    if (!value_texts(call, call->body, "tasks", NAMES_MAX, sizeof tasks[0], tasks[0],
                     &plan->count) ||
        !value_texts(call, call->body, "cases", NAMES_MAX, sizeof cases[0], cases[0], &case_count))
        return false;
    if (!plan->count || !case_count) {
        call_refuse(call, 400, "wrong_field", plan->count ? "cases" : "tasks",
                    "An exam needs at least one task and one case.");
        return false;
    }
    for (int i = 0; i < case_count; i++)
        if (find_exam_case(call, cases[i]) < 0) {
            call_refuse(call, 400, "wrong_field", "cases", "The server's config has no case '%s'.",
                        cases[i]);
            return false;
        }
    for (int i = 0; i < plan->count; i++) {
        struct exam_task *task = &plan->tasks[i];
        if (!task_find(call, tasks[i])) {
            call_refuse(call, 400, "wrong_field", "tasks", "The server has no task '%s'.",
                        tasks[i]);
            return false;
        }
        memcpy(task->task, tasks[i], sizeof task->task);
        memcpy(task->knee_case, cases[draw(plan->seed, i) % (uint64_t)case_count],
               sizeof task->knee_case);
        snprintf(task->hand, sizeof task->hand, "%s", hand);
    }
    return true;
}

static bool take_hand(struct api_call *call, char hand[8]) {
    hand[0] = '\0';
    if (!value_is_given(call->body, "hand"))
        return true;
    if (!value_text(call, call->body, "hand", 8, hand))
        return false;
    if (!strcmp(hand, "right") || !strcmp(hand, "left"))
        return true;
    call_refuse(call, 400, "wrong_field", "hand", "The field 'hand' is 'right' or 'left'.");
    return false;
}

static bool take_seed(struct api_call *call, int64_t *out) {
    uint64_t chance;
    if (value_is_given(call->body, "seed"))
        return value_int(call, call->body, "seed", 0, SEED_MAX, out);
    chance_fill(&chance, sizeof chance);
    *out = (int64_t)(chance & SEED_MAX);
    return true;
}

// Who plans an exam knows whose it is.
static bool take_raters(struct api_call *call, const struct exam_plan *plan) {
    for (int i = 0; i < plan->rater_count; i++)
        if (!strcmp(plan->raters[i], call->principal.name)) {
            call_refuse(call, 400, "wrong_field", "raters",
                        "Who plans an exam is no blind rater of it.");
            return false;
        }
    return true;
}

static bool take_plan(struct api_call *call, struct exam_plan *plan) {
    static const char *const fields[] = {"course", "trainee", "title",  "tasks", "cases",
                                         "hand",   "seed",    "raters", NULL};
    char hand[8];
    return value_take_body(call, fields) &&
           value_text(call, call->body, "course", sizeof plan->course, plan->course) &&
           value_text(call, call->body, "trainee", sizeof plan->trainee, plan->trainee) &&
           value_text(call, call->body, "title", sizeof plan->title, plan->title) &&
           take_hand(call, hand) && take_seed(call, &plan->seed) &&
           take_exam_tasks(call, plan, hand) &&
           value_texts(call, call->body, "raters", EXAM_RATERS_MAX, sizeof plan->raters[0],
                       plan->raters[0], &plan->rater_count) &&
           take_raters(call, plan);
}

// ---- as JSON ------------------------------------------------------------------------------------

static const char *text_of(const json_t *row, const char *field) {
    const char *text = json_string_value(json_object_get(row, field));
    return text ? text : "";
}

// A row as the exam's head, without its parts.
static void shape_head(const struct api_call *call, json_t *exam) {
    bool begun = strcmp(text_of(exam, "state"), "planned") != 0;
    bool released = !strcmp(text_of(exam, "state"), "released");
    json_t *checklist = begun ? json_object() : json_null();
    json_t *result = released ? json_object() : json_null();
    static const char *const checked[] = {"who", "station_check", "case_hash", NULL};
    for (int i = 0; begun && checked[i]; i++)
        json_object_set_new(checklist, checked[i],
                            json_boolean(json_integer_value(json_object_get(exam, checked[i]))));
    if (begun)
        json_object_set(checklist, "drift_mm", json_object_get(exam, "drift_mm"));
    if (released) {
        json_object_set(result, "text", json_object_get(exam, "result"));
        json_object_set(result, "hash", json_object_get(exam, "result_hash"));
        json_object_set(result, "certificate", json_object_get(exam, "certificate"));
        json_object_set(result, "signature", json_object_get(exam, "signature"));
    }
    json_t *flags = json_object_get(exam, "interventions");
    json_object_set_new(exam, "flagged", json_boolean(json_integer_value(flags)));
    static const char *const gone[] = {"who",       "station_check", "case_hash",
                                       "drift_mm",  "result_hash",   "certificate",
                                       "signature", "interventions", NULL};
    for (int i = 0; gone[i]; i++)
        json_object_del(exam, gone[i]);
    json_object_set_new(exam, "checklist", checklist);
    json_object_set_new(exam, "result", result);
    if (call_is_trainee(call))
        json_object_del(exam, "seed");
}

// Whoever rates it does not learn whose it is. False after a refusal.
static bool hide_examinee(struct api_call *call, json_t *exam) {
    struct error err = {""};
    bool blind = false;
    int64_t id = json_integer_value(json_object_get(exam, "id"));
    if (!attempt_rater(call))
        return true;
    enum result result = store_is_blind_to_exam(call->store, attempt_rater(call), id, &blind, &err);
    if (blind)
        json_object_set_new(exam, "trainee", json_null());
    return call_check(call, result, &err);
}

// The exam of the path; NULL after a refusal. One that is another's is not there.
static json_t *find_exam(struct api_call *call, int64_t *out_id) {
    struct error err = {""};
    json_t *rows = json_array();
    if (!value_in_path(call, call->args[0], out_id)) {
        json_decref(rows);
        return NULL;
    }
    enum result result =
        store_rows(call->store, LIST_EXAMS, call->args[0], call_take_row, rows, &err);
    json_t *exam = json_incref(json_array_get(rows, 0));
    json_decref(rows);
    if (!call_check(call, result, &err))
        return NULL;
    if (exam &&
        (!call_is_trainee(call) || !strcmp(text_of(exam, "trainee"), call->principal.trainee)))
        return exam;
    json_decref(exam);
    call_refuse(call, 404, "not_found", NULL, "There is no such exam.");
    return NULL;
}

// The rows of a list of the exam; NULL after a refusal.
static json_t *parts_of(struct api_call *call, enum store_list list, int64_t id) {
    char key[24];
    struct error err = {""};
    json_t *rows = json_array();
    snprintf(key, sizeof key, "%lld", (long long)id);
    enum result result = store_rows(call->store, list, key, call_take_row, rows, &err);
    if (call_check(call, result, &err))
        return rows;
    json_decref(rows);
    return NULL;
}

static json_t *raters_of(struct api_call *call, int64_t id) {
    struct error err = {""};
    json_t *rows = json_array(), *row;
    size_t i;
    enum result result = store_exam_raters(call->store, id, call_take_row, rows, &err);
    json_array_foreach(rows, i, row) {
        json_object_set_new(row, "rated",
                            json_boolean(json_integer_value(json_object_get(row, "rated"))));
        if (call_is_trainee(call))
            json_object_set_new(row, "account", json_null());
    }
    if (call_check(call, result, &err))
        return rows;
    json_decref(rows);
    return NULL;
}

static void shape_items(const struct api_call *call, json_t *items, bool sees_verdicts) {
    size_t i;
    json_t *item;
    json_array_foreach(items, i, item) {
        json_object_del(item, "exam");
        json_object_del(item, "position");
        json_object_set_new(item, "title", task_title(call, text_of(item, "task")));
        if (!sees_verdicts)
            json_object_set_new(item, "verdict", json_null());
    }
}

// The exam with all its parts; false after a refusal.
static bool add_parts(struct api_call *call, json_t *exam, int64_t id) {
    bool released = !strcmp(text_of(exam, "state"), "released");
    bool is_rater = json_is_null(json_object_get(exam, "trainee"));
    json_t *items = parts_of(call, LIST_EXAM_TASKS, id);
    json_t *interventions = items ? parts_of(call, LIST_INTERVENTIONS, id) : NULL;
    json_t *raters = interventions ? raters_of(call, id) : NULL;
    size_t i;
    json_t *row;
    if (raters) {
        shape_items(call, items, released || (!call_is_trainee(call) && !is_rater));
        if (call_is_trainee(call) && !strcmp(text_of(exam, "state"), "planned"))
            json_array_clear(items); // it is sealed until it begins
        json_array_foreach(interventions, i, row) json_object_del(row, "exam");
        json_object_set(exam, "items", items);
        json_object_set(exam, "interventions", interventions);
        json_object_set(exam, "raters", raters);
    }
    json_decref(items);
    json_decref(interventions);
    json_decref(raters);
    return raters;
}

static void answer_exam(struct api_call *call, int status, int64_t id) {
    snprintf(call->args[0], sizeof call->args[0], "%lld", (long long)id);
    json_t *exam = find_exam(call, &id);
    if (!exam)
        return;
    shape_head(call, exam);
    if (hide_examinee(call, exam) && add_parts(call, exam, id))
        call_answer(call, status, json_pack("{s:O}", "exam", exam));
    json_decref(exam);
}

// ---- requests -----------------------------------------------------------------------------------

void post_exams(struct api_call *call) {
    struct exam_plan *plan = alloc(1, sizeof *plan);
    struct error err = {""};
    int64_t id;
    if (take_plan(call, plan) &&
        call_check(call, store_add_exam(call->store, plan, &id, &err), &err))
        answer_exam(call, 201, id);
    free(plan);
}

void get_exam(struct api_call *call) {
    int64_t id;
    if (value_in_path(call, call->args[0], &id))
        answer_exam(call, 200, id);
}

void get_exams(struct api_call *call) {
    struct call_query query = {.names = {"course", "trainee"}};
    struct error err = {""};
    json_t *rows = json_array(), *row;
    size_t i;
    bool good = call_take_query(call, &query);
    const char *whose = call_is_trainee(call) ? call->principal.trainee : call_parameter(&query, 1);
    if (good) {
        enum result result = store_find_exams(call->store, call_parameter(&query, 0), whose,
                                              attempt_rater(call), call_take_row, rows, &err);
        good = call_check(call, result, &err);
    }
    json_array_foreach(rows, i, row) {
        shape_head(call, row);
        json_object_del(row, "result");
        good = good && hide_examinee(call, row);
    }
    if (good)
        call_answer(call, 200, json_pack("{s:O}", "exams", rows));
    json_decref(rows);
}

void delete_exam(struct api_call *call) {
    struct error err = {""};
    int64_t id;
    if (value_in_path(call, call->args[0], &id) &&
        call_check(call, store_remove_exam(call->store, id, &err), &err))
        call_done(call);
}

// The hashes of the cases as the server has them now. False after a refusal.
static bool take_hashes(struct api_call *call, int64_t id, struct exam_checklist *out) {
    json_t *items = parts_of(call, LIST_EXAM_TASKS, id), *item;
    bool good = items;
    size_t i;
    json_array_foreach(items, i, item) {
        int index = find_exam_case(call, text_of(item, "case"));
        if (index >= 0)
            json_decref(case_summary(call->api->summaries, index, out->case_hashes[i]));
        if (good && !out->case_hashes[i][0]) {
            call_refuse(call, 409, "conflict", NULL,
                        "Case '%s' cannot be read now, so nobody can say that it is unchanged.",
                        text_of(item, "case"));
            good = false;
        }
    }
    json_decref(items);
    return good;
}

void post_exam_begin(struct api_call *call) {
    static const char *const fields[] = {"who", "station_check", "case_hash", "drift_mm", NULL};
    struct exam_checklist checked = {.who = true, .station_check = true};
    struct error err = {""};
    int64_t id;
    if (value_in_path(call, call->args[0], &id) && value_take_body(call, fields) &&
        value_true(call, call->body, "who") && value_true(call, call->body, "station_check") &&
        value_true(call, call->body, "case_hash") &&
        value_number(call, call->body, "drift_mm", 0, EXAM_DRIFT_MAX_MM, &checked.drift_mm) &&
        take_hashes(call, id, &checked) &&
        call_check(call, store_begin_exam(call->store, id, &checked, &err), &err))
        answer_exam(call, 200, id);
}

void post_intervention(struct api_call *call) {
    static const char *const fields[] = {"reason", NULL};
    char reason[STORE_TEXT_MAX];
    struct error err = {""};
    int64_t id;
    if (!value_in_path(call, call->args[0], &id) || !value_take_body(call, fields) ||
        !value_text(call, call->body, "reason", sizeof reason, reason))
        return;
    if (strlen(reason) < EXAM_REASON_MIN)
        call_refuse(call, 400, "wrong_field", "reason", "The reason has at least 3 bytes.");
    else if (call_check(call, store_add_intervention(call->store, id, reason, &err), &err))
        answer_exam(call, 200, id);
}

// ---- the result ---------------------------------------------------------------------------------

static void take_whole_attempt(void *rows, const struct store_cell *cells, int count) {
    json_t *row = call_row(cells, count);
    static const char *const gone[] = {"figures", "occurrences", "exam",           "exam_state",
                                       "trainee", "purpose",     "trainee_number", NULL};
    for (int i = 0; gone[i]; i++)
        json_object_del(row, gone[i]);
    json_array_append_new(rows, row);
}

// The attempt of an item, with the hash that stands for its session's trace; or null.
static enum result attempt_of(struct store *store, const json_t *item, json_t **out,
                              struct error *err) {
    json_t *rows = json_array(), *sessions = json_array();
    const char *session = json_string_value(json_object_get(item, "session"));
    const struct attempt_filter filter = {
        .session = session,
        .number = (int)json_integer_value(json_object_get(item, "number")),
        .limit = 1};
    enum result result = RESULT_OK;
    if (session)
        result = store_attempt_list(store, &filter, take_whole_attempt, rows, err);
    if (session && result == RESULT_OK)
        result = store_rows(store, LIST_SESSIONS, session, call_take_row, sessions, err);
    json_t *attempt = json_incref(json_array_get(rows, 0)), *row = json_array_get(sessions, 0);
    json_t *hash = json_object_get(row, "trace_hash");
    if (result == RESULT_OK && !strcmp(text_of(row, "state"), "open"))
        result = fail(err, RESULT_REFUSED, "the session of task '%s' still runs: end it first",
                      text_of(item, "task"));
    if (attempt)
        json_object_set(attempt, "trace_hash", hash ? hash : json_null());
    json_decref(rows);
    json_decref(sessions);
    *out = attempt ? attempt : json_null();
    return result;
}

// Ratings of an attempt; names: of the raters so far, whom the result knows by their place in it.
struct sums {
    json_t *list, *names;
};

static size_t place_of(json_t *names, json_t *name) {
    size_t i;
    json_t *other;
    json_array_foreach(names, i, other) {
        if (json_equal(name, other))
            return i;
    }
    json_array_append(names, name);
    return i;
}

static void take_sum(void *user, const struct store_cell *cells, int count) {
    struct sums *sums = user;
    json_t *row = call_row(cells, count);
    size_t place = place_of(sums->names, json_object_get(row, "rater"));
    json_object_set_new(row, "rater", json_integer((json_int_t)place + 1));
    json_object_del(row, "session");
    json_object_del(row, "number");
    json_object_del(row, "remark");
    json_array_append_new(sums->list, row);
}

static enum result add_item(struct store *store, json_t *item, json_t *names, struct error *err) {
    struct sums sums = {json_array(), names};
    json_t *attempt;
    const char *session = json_string_value(json_object_get(item, "session"));
    int number = (int)json_integer_value(json_object_get(item, "number"));
    enum result result = attempt_of(store, item, &attempt, err);
    if (result == RESULT_OK && session)
        result = store_ratings_of(store, session, number, take_sum, &sums, err);
    json_object_set_new(item, "attempt", attempt);
    json_object_set_new(item, "ratings", sums.list);
    return result;
}

// What is signed: neither the seed nor a rater's name. *out_passed: all attempts passed.
static enum result make_result(struct store *store, int64_t id, double now_s, json_t *exams,
                               bool *out_passed, struct error *err) {
    char key[24];
    json_t *items = json_array(), *interventions = json_array(), *names = json_array(), *item;
    size_t i;
    snprintf(key, sizeof key, "%lld", (long long)id);
    enum result result = store_rows(store, LIST_EXAMS, key, call_take_row, exams, err);
    if (result == RESULT_OK)
        result = store_rows(store, LIST_EXAM_TASKS, key, call_take_row, items, err);
    if (result == RESULT_OK)
        result = store_rows(store, LIST_INTERVENTIONS, key, call_take_row, interventions, err);
    *out_passed = true;
    json_array_foreach(items, i, item) {
        *out_passed = *out_passed && !strcmp(text_of(item, "verdict"), "passed");
        if (result == RESULT_OK)
            result = add_item(store, item, names, err);
    }
    static const char *const gone[] = {
        "result",  "result_hash", "certificate",   "signature", "released_utc_s",
        "verdict", "state",       "created_utc_s", "seed",      NULL};
    json_t *exam = json_array_get(exams, 0);
    for (int g = 0; gone[g]; g++)
        json_object_del(exam, gone[g]);
    json_object_set_new(exam, "items", items);
    json_object_set_new(exam, "interventions", interventions);
    json_object_set_new(exam, "released_utc_s", json_real(now_s));
    json_object_set_new(exam, "verdict", json_string(*out_passed ? "passed" : "not yet"));
    json_decref(names);
    return result;
}

static void hash_text(const char *text, char out[STORE_HASH_MAX]) {
    uint8_t hash[32];
    bool done = EVP_Digest(text, strlen(text), hash, NULL, EVP_sha256(), NULL);
    CHECK(done);
    for (int i = 0; i < 32; i++)
        snprintf(out + 2 * i, 3, "%02x", hash[i]);
}

static enum result seal_result(const struct api *api, int64_t id, struct exam_result *out,
                               struct error *err) {
    const struct trace_signer signer = {.sign = signer_sign, .context = api->signer};
    struct store_audit_head head = {.entry = id};
    struct store_audit_seal seal;
    hash_text(out->text, head.hash);
    enum result result = exam_seal_make(&signer, &head, &seal, err);
    memcpy(out->hash, head.hash, sizeof out->hash);
    memcpy(out->certificate, seal.certificate, sizeof out->certificate);
    memcpy(out->signature, seal.signature, sizeof out->signature);
    return result;
}

struct release {
    const struct api_call *call;
    int64_t id;
    char *text;
};

static enum result make_release(void *user, struct exam_result *out, struct error *err) {
    struct release *release = user;
    json_t *exams = json_array();
    out->released_utc_ns = clock_utc_ns();
    enum result result = make_result(release->call->store, release->id,
                                     call_seconds(out->released_utc_ns), exams, &out->passed, err);
    out->text = release->text = json_dumps(json_array_get(exams, 0), JSON_COMPACT | JSON_SORT_KEYS);
    NEED(out->text, "memory");
    json_decref(exams);
    return result == RESULT_OK ? seal_result(release->call->api, release->id, out, err) : result;
}

static void tell_released(struct api_call *call, int64_t id) {
    const struct api_config *config = &call->api->config;
    char key[24];
    json_t *items = json_array(), *item;
    size_t i;
    snprintf(key, sizeof key, "%lld", (long long)id);
    if (config->attempt_released)
        store_rows(call->store, LIST_EXAM_TASKS, key, call_take_row, items, NULL);
    json_array_foreach(items, i, item) {
        if (text_of(item, "session")[0])
            config->attempt_released(config->attempt_user, call->store, text_of(item, "session"),
                                     (int)json_integer_value(json_object_get(item, "number")));
    }
    json_decref(items);
}

void post_exam_release(struct api_call *call) {
    static const char *const fields[] = {"incomplete", NULL};
    struct release release = {.call = call};
    struct error err = {""};
    if (!value_take_body(call, fields) || !value_in_path(call, call->args[0], &release.id))
        return;
    bool incomplete = json_is_true(json_object_get(call->body, "incomplete"));
    enum result result =
        store_release_exam(call->store, release.id, incomplete, make_release, &release, &err);
    if (result == RESULT_OK)
        tell_released(call, release.id);
    if (call_check(call, result, &err))
        answer_exam(call, 200, release.id);
    free(release.text);
}
