// ASSET: what raters say of an attempt.
#include "api/attempts.h"
#include "api/routes.h"
#include "api/values.h"
#include "base/check.h"
#include "curve/agreement.h"
#include "store/exams.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---- as JSON ------------------------------------------------------------------------------------

struct ratings {
    const struct api_call *call;
    json_t *own, *others; // lists
};

static void set_sum(json_t *rating) {
    int sum = 0;
    bool competent = true;
    for (int i = 0; i < RATING_DOMAINS; i++) {
        int level = (int)json_integer_value(json_object_get(rating, rating_domain_names[i]));
        sum += level;
        competent = competent && level >= RATING_COMPETENT;
    }
    json_object_set_new(rating, "sum", json_integer(sum));
    json_object_set_new(rating, "competent", json_boolean(competent));
}

static void take_rating(void *user, const struct store_cell *cells, int count) {
    struct ratings *r = user;
    json_t *rating = call_row(cells, count);
    const char *rater = json_string_value(json_object_get(rating, "rater"));
    bool own = r->call->principal.role == ROLE_INSTRUCTOR && rater &&
               !strcmp(rater, r->call->principal.name);
    json_object_del(rating, "session");
    json_object_del(rating, "number");
    json_object_set_new(rating, "own", json_boolean(own));
    if (r->call->principal.role == ROLE_TRAINEE)
        json_object_set_new(rating, "rater", json_null());
    set_sum(rating);
    json_array_append_new(own ? r->own : r->others, rating);
}

// Of the first two.
static json_t *agreement_json(const json_t *ratings) {
    const json_t *a = json_array_get(ratings, 0), *b = json_array_get(ratings, 1);
    if (!b)
        return json_null();
    json_int_t difference = json_integer_value(json_object_get(a, "sum")) -
                            json_integer_value(json_object_get(b, "sum"));
    bool same = json_is_true(json_object_get(a, "competent")) ==
                json_is_true(json_object_get(b, "competent"));
    return json_pack("{s:b, s:I}", "same_verdict", (int)same, "difference",
                     difference < 0 ? -difference : difference);
}

// A rater sees the others' ratings only after giving an own one; others see them at once.
static bool sees_others(struct api_call *call, const struct ratings *r) {
    return json_array_size(r->own) || !attempt_is_blind(call, call->args[0]);
}

// False after a refusal. The lists are released by the caller.
static bool read_ratings(struct api_call *call, int number, struct ratings *out) {
    struct error err = {""};
    *out = (struct ratings){call, json_array(), json_array()};
    enum result result =
        store_ratings_of(call->store, call->args[0], number, take_rating, out, &err);
    return call_check(call, result, &err);
}

static void ratings_fini(struct ratings *r) {
    json_decref(r->own);
    json_decref(r->others);
}

void get_ratings(struct api_call *call) {
    int64_t number;
    struct ratings r;
    json_t *attempt = attempt_of_path(call, &number);
    if (!attempt)
        return;
    bool withheld =
        call->principal.role == ROLE_TRAINEE && json_is_true(json_object_get(attempt, "withheld"));
    json_decref(attempt);
    bool good = read_ratings(call, (int)number, &r);
    bool all = good && !withheld && sees_others(call, &r);
    size_t others = withheld ? 0 : json_array_size(r.others);
    if (all)
        json_array_extend(r.own, r.others);
    if (good && !call->response->status)
        call_answer(call, 200,
                    json_pack("{s:O, s:i, s:o}", "ratings", r.own, "others", all ? 0 : (int)others,
                              "agreement", agreement_json(r.own)));
    ratings_fini(&r);
}

// ---- rating -------------------------------------------------------------------------------------

static bool take_levels(struct api_call *call, int levels[RATING_DOMAINS],
                        char remark[STORE_TEXT_MAX]) {
    const char *fields[RATING_DOMAINS + 2] = {0};
    for (int i = 0; i < RATING_DOMAINS; i++)
        fields[i] = rating_domain_names[i];
    fields[RATING_DOMAINS] = "remark";
    remark[0] = '\0';
    if (!value_take_body(call, fields))
        return false;
    for (int i = 0; i < RATING_DOMAINS; i++) {
        int64_t level;
        if (!value_int(call, call->body, fields[i], 1, rating_domain_most((enum rating_domain)i),
                       &level))
            return false;
        levels[i] = (int)level;
    }
    return !value_is_given(call->body, "remark") ||
           value_text(call, call->body, "remark", STORE_TEXT_MAX, remark);
}

void post_rating(struct api_call *call) {
    int levels[RATING_DOMAINS];
    char remark[STORE_TEXT_MAX];
    struct error err = {""};
    struct ratings r;
    int64_t number;
    if (!value_in_path(call, call->args[1], &number) || !take_levels(call, levels, remark))
        return;
    enum result result =
        store_put_rating(call->store, call->args[0], (int)number, call->principal.number, levels,
                         remark[0] ? remark : NULL, &err);
    if (!call_check(call, result, &err))
        return;
    if (read_ratings(call, (int)number, &r))
        call_answer(call, 201, json_pack("{s:O}", "rating", json_array_get(r.own, 0)));
    ratings_fini(&r);
}

void get_rate(struct api_call *call) {
    struct error err = {""};
    json_t *rows = json_array();
    enum result result =
        store_to_rate(call->store, call->principal.number, call_take_row, rows, &err);
    call_answer_rows(call, "attempts", rows, result, &err);
}

// ---- agreement over a course --------------------------------------------------------------------

// The first two ratings of each attempt.
struct pairs {
    int64_t attempt;
    int of_attempt;
    int count;
    size_t room;
    double *sums;        // two an attempt
    int *first, *second; // competent or not
};

static void make_room(struct pairs *p) {
    if ((size_t)p->count < p->room)
        return;
    p->room = 2 * p->room + 64;
    p->sums = alloc_resize(p->sums, 2 * p->room, sizeof *p->sums);
    p->first = alloc_resize(p->first, p->room, sizeof *p->first);
    p->second = alloc_resize(p->second, p->room, sizeof *p->second);
}

static void take_pair(void *user, const struct store_cell *cells, int count) {
    struct pairs *p = user;
    CHECK(count == 3);
    p->of_attempt = cells[0].integer == p->attempt ? p->of_attempt + 1 : 0;
    p->attempt = cells[0].integer;
    if (p->of_attempt > 1)
        return;
    make_room(p);
    p->sums[2 * p->count + p->of_attempt] = (double)cells[1].integer;
    (p->of_attempt ? p->second : p->first)[p->count] = (int)cells[2].integer;
    p->count += p->of_attempt;
}

static json_t *icc_of(const struct pairs *p) {
    struct intraclass icc;
    struct error err;
    enum result result = intraclass(p->sums, p->count, 2, &icc, &err);
    return result == RESULT_OK ? json_real(icc.icc_1_1) : json_null();
}

static json_t *kappa_of(const struct pairs *p) {
    double value;
    struct error err;
    enum result result = kappa(p->first, p->second, p->count, 2, KAPPA_PLAIN, &value, &err);
    return result == RESULT_OK ? json_real(value) : json_null();
}

void get_agreement(struct api_call *call) {
    struct pairs p = {.attempt = -1};
    struct error err = {""};
    if (!call_find_course(call))
        return;
    enum result result = store_rated_twice(call->store, call->args[0], take_pair, &p, &err);
    if (call_check(call, result, &err))
        call_answer(call, 200,
                    json_pack("{s:i, s:o, s:o}", "pairs", p.count, "icc", icc_of(&p), "kappa",
                              kappa_of(&p)));
    free(p.sums);
    free(p.first);
    free(p.second);
}
