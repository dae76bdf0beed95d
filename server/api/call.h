// A request in progress: its principal, its arguments and its response.
#pragma once

#include "api/api.h"
#include "api/secret.h"
#include "api/tally.h"
#include "api/throttle.h"
#include "net/signer.h"
#include "signon/signon.h"
#include "store/store.h"

#include <jansson.h>
#include <stdatomic.h>

struct case_summaries; // case_summary.h
struct peer_cases;     // peer_cases.h
struct rehearsals;     // rehearsals.h
struct forwards;       // forward.h

#define API_REPORTS_MAX 2         // at a time
#define API_REPORTS_OF_TRAINEES 1 // of these

struct api {
    struct api_config config;
    int64_t started_ns;
    struct secret_key key; // of codes, and of cookies of devices and of sign-ons
    struct signer *signer; // of results of exams
    struct throttle throttle;
    struct tally tally;
    pthread_mutex_t reports_lock;
    char reporting[API_REPORTS_MAX][STORE_NAME_MAX]; // who waits for a report; empty: a free place
    atomic_bool failing; // the log says that accounts cannot be looked up
    atomic_uint_fast64_t wrong_sign_ins;
    struct case_summaries *summaries;
    struct peer_cases *peer_cases;
    struct forwards *forwards; // NULL: this server is alone
    struct signon *signon;     // NULL: passwords and codes alone
    struct rehearsals *rehearsals;
    pthread_mutex_t first_lock;
    char first_secret[65]; // guarded by first_lock; empty: none, or used
};

struct api_call {
    struct api *api;
    const struct web_request *request;
    struct web_response *response;
    struct store *store;              // open, or NULL
    struct store_principal principal; // if is_signed_in
    bool is_signed_in;
    char args[2][STORE_NAME_MAX]; // the parts of the path that match each *
    json_t *body;                 // an object, or NULL
};

// ---- answers ------------------------------------------------------------------------------------

// Takes the json.
void call_answer(struct api_call *call, int status, json_t *json);
void call_done(struct api_call *call); // 204

// field: the field at fault, or NULL. The text is a sentence for people.
void call_refuse(struct api_call *call, int status, const char *code, const char *field,
                 const char *format, ...) __attribute__((format(printf, 5, 6)));

// Answers an error of another room, and returns whether there was none. An error that concerns only
// the server's administrator goes to the log.
bool call_check(struct api_call *call, enum result result, const struct error *err);

// Answers that the server has no memory for a password now, and returns whether it had.
bool call_check_memory(struct api_call *call, enum result result);

// ---- arguments ----------------------------------------------------------------------------------

// The body as an object, which is empty where there is none; the caller releases it. NULL after a
// refusal.
json_t *call_parse_body(struct api_call *call);

// Reads the body: an object of strings with no fields but these (NULL ends them). False, here and
// below: the request has been refused.
bool call_take_body(struct api_call *call, const char *const *fields);

// NULL: left out, or null.
const char *call_text(const struct api_call *call, const char *field);
bool call_need_text(struct api_call *call, const char *field, const char **out_text);
// A name that can be a part of a path: 1 to 63 bytes, printable, without '/'.
bool call_is_name(const char *text);
bool call_need_name(struct api_call *call, const char *field, const char **out_name);
bool call_need_password(struct api_call *call, const char *field, const char **out_password);

// Reads the parameters of the query. Refuses one that is unknown, repeated or too long.
#define CALL_PARAMETERS_MAX 10
struct call_query {
    const char *names[CALL_PARAMETERS_MAX + 1]; // that are known; NULL behind the last
    char values[CALL_PARAMETERS_MAX][STORE_TEXT_MAX];
    bool given[CALL_PARAMETERS_MAX];
};
bool call_take_query(struct api_call *call, struct call_query *query);
const char *call_parameter(const struct call_query *query, int index); // NULL: not given
bool call_take_limit(struct api_call *call, const struct call_query *query, int index, int most,
                     int usual, int *out_limit);

// One parameter of a query that may have others, which this server does not know. False: it is not
// there, empty, malformed or too long.
bool call_find_parameter(const struct api_call *call, const char *name, char *out, size_t size);

// Whether the principal may see the figures of a course (NULL: of all trainees): a trainee only of
// a course that they are in.
bool call_may_see(struct api_call *call, const char *course);
// Whether the course that the path names is there; otherwise 404 is answered.
bool call_find_course(struct api_call *call);

// Answers a file of a case.
void call_answer_file(struct api_call *call, const char *dir, const char *name, const char *type);

static inline bool call_is_trainee(const struct api_call *call) {
    return call->principal.role == ROLE_TRAINEE;
}

// Answers {key: rows}, or the error of reading them; takes the rows.
void call_answer_rows(struct api_call *call, const char *key, json_t *rows, enum result result,
                      const struct error *err);

// Answers 200 with what `write` puts into the stream. After an error there is no answer yet.
typedef enum result (*call_writer)(void *user, FILE *file, struct error *err);
enum result call_fill(struct api_call *call, call_writer write, void *user, struct error *err);

// ---- records ------------------------------------------------------------------------------------

// Close them before anything that takes long.
bool call_open_store(struct api_call *call);
void call_close_store(struct api_call *call);

// Takes some tenths of a second, in which the records are closed. out_encoded: PASSWORD_ENCODED.
bool call_encode_password(struct api_call *call, const char *password, char *out_encoded);

// Whether the principal is still signed in, after the records were closed for a while.
bool call_is_still_in(struct api_call *call);

// A row as an object: times in ns (x_utc_ns) become seconds (x_utc_s).
json_t *call_row(const struct store_cell *cells, int count);
void call_take_row(void *array, const struct store_cell *cells, int count); // store_row_handler

// A text that may come from a file. One that is not UTF-8 is replaced by words that say so.
json_t *call_string(const char *text);

// Seconds of a time in ns, to the millisecond.
double call_seconds(int64_t utc_ns);
