// One request on its way through the room: what it brings, who it is from, and what is answered.
#pragma once

#include "api/api.h"
#include "api/throttle.h"
#include "store/store.h"

#include <jansson.h>
#include <stdatomic.h>

struct case_summaries; // case_summary.h

struct api {
    struct api_config config;
    int64_t started_ns;
    struct throttle throttle;
    atomic_flag reporting;
    atomic_bool failing; // nobody can be looked up in the records, as was logged
    struct case_summaries *summaries;
    pthread_mutex_t first_lock;
    char first_secret[65]; // of first_lock; empty: there is none, or it was used
};

struct call {
    struct api *api;
    const struct web_request *request;
    struct web_response *response;
    struct store *store;              // open, or NULL
    struct store_principal principal; // where somebody has signed in
    bool is_signed_in;
    char args[2][STORE_NAME_MAX]; // of the path: what stands for each *
    json_t *body;                 // an object of texts, or NULL
};

// ---- answers ------------------------------------------------------------------------------------

// Takes the json.
void call_answer(struct call *call, int status, json_t *json);
void call_done(struct call *call); // 204

// field: whose fault it is, or NULL.
void call_refuse(struct call *call, int status, const char *code, const char *field,
                 const char *format, ...) __attribute__((format(printf, 5, 6)));

// What a function of another room could not do; texts that are for the server's own are logged, and
// not told. Returns whether there was nothing of the kind.
bool call_check(struct call *call, enum result result, const struct error *err);

// ---- what it brings -----------------------------------------------------------------------------

// The body, an object of texts with none but these fields, the last of them NULL. After false, here
// and below, it has been answered.
bool call_take_body(struct call *call, const char *const *fields);

// NULL: left out, or null.
const char *call_text(const struct call *call, const char *field);
bool call_need_text(struct call *call, const char *field, const char **out_text);
// One that becomes part of a path or a list: 1 to 63 bytes, printable, without '/'.
bool call_need_name(struct call *call, const char *field, const char **out_name);
bool call_need_password(struct call *call, const char *field, const char **out_password);

// The parameters of the query; false where one is unknown, twice there or too long.
#define CALL_PARAMETERS_MAX 8
struct call_query {
    const char *names[CALL_PARAMETERS_MAX]; // that are known; NULL behind the last
    char values[CALL_PARAMETERS_MAX][STORE_TEXT_MAX];
    bool given[CALL_PARAMETERS_MAX];
};
bool call_take_query(struct call *call, struct call_query *query);
const char *call_parameter(const struct call_query *query, int index); // NULL: not given
bool call_take_limit(struct call *call, const struct call_query *query, int index, int most,
                     int usual, int *out_limit);

// ---- records ------------------------------------------------------------------------------------

// They are not kept open over what takes long.
bool call_open_store(struct call *call);
void call_close_store(struct call *call);

// Whether the principal is still signed in, after the records were closed for a while.
bool call_is_still_in(struct call *call);

// A row as an object: times in ns (x_utc_ns) become seconds (x_utc_s).
json_t *call_row(const struct store_cell *cells, int count);
void call_take_row(void *array, const struct store_cell *cells, int count); // a store_row_handler

// A text that may come from a file: what is no UTF-8 cannot be told.
json_t *call_string(const char *text);

// Seconds of a time in ns, to the millisecond.
double call_seconds(int64_t utc_ns);
