#include "api/call.h"

#include "api/password.h"
#include "api/secret.h"
#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"
#include "base/number.h"

#include <ctype.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#define DEPTH_MAX 4
#define MEMORY_S 10 // until there may be some again

// ---- answers ------------------------------------------------------------------------------------

void call_answer(struct api_call *call, int status, json_t *json) {
    CHECK(json);
    struct web_response *r = call->response;
    r->status = status;
    r->body = json_dumps(json, JSON_COMPACT | JSON_REAL_PRECISION(15));
    CHECK(r->body);
    r->size = strlen(r->body);
    json_decref(json);
}

void call_done(struct api_call *call) {
    call->response->status = 204;
}

void call_refuse(struct api_call *call, int status, const char *code, const char *field,
                 const char *format, ...) {
    char text[512];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    json_t *error = json_pack("{s:s, s:o}", "code", code, "text", call_string(text));
    if (field)
        json_object_set_new(error, "field", json_string(field));
    call_answer(call, status, json_pack("{s:o}", "error", error));
}

static const struct {
    enum result result;
    int status;
    const char *code;
} statuses[] = {
    {RESULT_INVALID, 400, "wrong_field"}, {RESULT_MISSING, 404, "not_found"},
    {RESULT_REFUSED, 409, "conflict"},    {RESULT_LIMIT, 409, "conflict"},
    {RESULT_TIMEOUT, 503, "busy"},
};

// Without the path of the records, which is nobody's business.
static const char *without_path(const struct api_call *call, const char *text) {
    size_t length = strlen(call->api->config.records);
    bool named = !strncmp(text, call->api->config.records, length) && text[length] == ':';
    return named ? text + length + 2 : text;
}

static void make_sentence(const char *text, char *out, size_t size) {
    size_t length = (size_t)snprintf(out, size - 1, "%s", text);
    if (length == 0 || length >= size - 1)
        return;
    out[0] = (char)toupper((unsigned char)out[0]);
    if (out[length - 1] != '.')
        memcpy(out + length, ".", 2);
}

bool call_check(struct api_call *call, enum result result, const struct error *err) {
    char text[sizeof err->text + 2];
    if (result == RESULT_OK)
        return true;
    for (size_t i = 0; i < sizeof statuses / sizeof *statuses; i++) {
        if (result != statuses[i].result)
            continue;
        make_sentence(without_path(call, err->text), text, sizeof text);
        call_refuse(call, statuses[i].status, statuses[i].code, NULL, "%s", text);
        call->response->retry_after_s = result == RESULT_TIMEOUT ? 1 : 0;
        return false;
    }
    log_error("api", "%s", err->text);
    call_refuse(call, 500, "failed", NULL, "The request failed; the server's log says why.");
    return false;
}

bool call_check_memory(struct api_call *call, enum result result) {
    if (result == RESULT_OK)
        return true;
    if (tally_is_told(tally_add(&call->api->tally, "no memory", clock_now_ns())))
        log_warning("api", "there is no memory to look at a password");
    call_refuse(call, 503, "busy", NULL, "The server is short of memory; try again later.");
    call->response->retry_after_s = MEMORY_S;
    return false;
}

// ---- the body -----------------------------------------------------------------------------------

// How deeply it is nested, whatever else is wrong with it.
static int depth_of(const char *text, size_t size) {
    int depth = 0, most = 0;
    bool quoted = false;
    for (size_t i = 0; i < size; i++) {
        char c = text[i];
        if (quoted && c == '\\')
            i++;
        else if (c == '"')
            quoted = !quoted;
        else if (!quoted && (c == '{' || c == '['))
            most = ++depth > most ? depth : most;
        else if (!quoted && (c == '}' || c == ']'))
            depth--;
    }
    return most;
}

json_t *call_parse_body(struct api_call *call) {
    json_error_t why;
    const struct web_request *r = call->request;
    if (r->size > WEB_BODY_MAX || depth_of(r->body, r->size) > DEPTH_MAX) {
        call_refuse(call, 413, "too_large", NULL,
                    "The body is larger than %d bytes or nested too deeply.", WEB_BODY_MAX);
        return NULL;
    }
    json_t *json =
        r->size ? json_loadb(r->body, r->size, JSON_REJECT_DUPLICATES, &why) : json_object();
    if (!json)
        call_refuse(call, 400, "wrong_body", NULL, "The body is not JSON: line %d: %s.", why.line,
                    why.text);
    else if (!json_is_object(json))
        call_refuse(call, 400, "wrong_body", NULL, "The body is not a JSON object.");
    if (json_is_object(json))
        return json;
    json_decref(json);
    return NULL;
}

static bool is_among(const char *name, const char *const *names) {
    for (; *names; names++)
        if (!strcmp(name, *names))
            return true;
    return false;
}

bool call_take_body(struct api_call *call, const char *const *fields) {
    const char *key;
    json_t *value;
    call->body = call_parse_body(call);
    if (!call->body)
        return false;
    json_object_foreach(call->body, key, value) {
        if (!is_among(key, fields)) {
            call_refuse(call, 400, "wrong_field", NULL, "This request has no field '%.40s'.", key);
            return false;
        }
        if (!json_is_string(value) && !json_is_null(value)) {
            call_refuse(call, 400, "wrong_field", key, "The field '%s' is not a string.", key);
            return false;
        }
    }
    return true;
}

const char *call_text(const struct api_call *call, const char *field) {
    return json_string_value(json_object_get(call->body, field));
}

bool call_need_text(struct api_call *call, const char *field, const char **out_text) {
    *out_text = call_text(call, field);
    if (!*out_text)
        call_refuse(call, 400, "wrong_field", field, "The field '%s' is missing.", field);
    return *out_text;
}

static bool has_control(const char *text) {
    for (; *text; text++)
        if ((unsigned char)*text < 0x20 || *text == 0x7f)
            return true;
    return false;
}

bool call_is_name(const char *text) {
    size_t length = strlen(text);
    return length > 0 && length < STORE_NAME_MAX && !strchr(text, '/') && !has_control(text) &&
           text[0] != ' ' && text[length - 1] != ' ';
}

bool call_need_name(struct api_call *call, const char *field, const char **out_name) {
    if (!call_need_text(call, field, out_name))
        return false;
    bool good = call_is_name(*out_name);
    if (!good)
        call_refuse(call, 400, "wrong_field", field,
                    "The field '%s' needs 1 to %d bytes, no '/', and no blank at either end.",
                    field, STORE_NAME_MAX - 1);
    return good;
}

bool call_need_password(struct api_call *call, const char *field, const char **out_password) {
    struct error err;
    if (!call_need_text(call, field, out_password))
        return false;
    if (password_check(*out_password, &err) == RESULT_OK)
        return true;
    call_refuse(call, 400, "wrong_field", field, "%s", err.text);
    return false;
}

// ---- the query ----------------------------------------------------------------------------------

static int digit(char c) {
    return isdigit((unsigned char)c) ? c - '0' : tolower((unsigned char)c) - 'a' + 10;
}

// Unescapes up to `end` or '&'. Returns where it stopped, or NULL if the text is malformed or too
// long.
static const char *unescape(const char *at, char end, char *out, size_t size) {
    size_t used = 0;
    for (; *at && *at != '&' && *at != end; at++) {
        char c = *at == '+' ? ' ' : *at;
        if (c == '%') {
            if (!isxdigit((unsigned char)at[1]) || !isxdigit((unsigned char)at[2]))
                return NULL;
            c = (char)(digit(at[1]) << 4 | digit(at[2]));
            at += 2;
        }
        if (!c || used + 1 >= size)
            return NULL;
        out[used++] = c;
    }
    out[used] = '\0';
    return at;
}

// Takes one parameter. Returns where the next one begins, or NULL after a refusal.
static const char *take_parameter(struct api_call *call, const char *at, struct call_query *query) {
    char name[32], value[STORE_TEXT_MAX] = "";
    const char *next = unescape(at, '=', name, sizeof name);
    if (next && *next == '=')
        next = unescape(next + 1, '&', value, sizeof value);
    if (!next) {
        call_refuse(call, 400, "wrong_query", NULL,
                    "A parameter of the query is malformed or too long.");
        return NULL;
    }
    for (int i = 0; query->names[i]; i++) {
        if (strcmp(name, query->names[i]) || query->given[i])
            continue;
        memcpy(query->values[i], value, sizeof value);
        query->given[i] = value[0];
        return *next == '&' ? next + 1 : next;
    }
    call_refuse(call, 400, "wrong_query", NULL,
                "This request has no parameter '%s', or the query repeats it.", name);
    return NULL;
}

bool call_take_query(struct api_call *call, struct call_query *query) {
    const char *at = call->request->query;
    while (at && *at)
        at = take_parameter(call, at, query);
    return at;
}

bool call_find_parameter(const struct api_call *call, const char *name, char *out, size_t size) {
    size_t length = strlen(name);
    for (const char *at = call->request->query; at; at = strchr(at, '&')) {
        at += *at == '&';
        if (!strncmp(at, name, length) && at[length] == '=')
            return unescape(at + length + 1, '&', out, size) && out[0];
    }
    return false;
}

const char *call_parameter(const struct call_query *query, int index) {
    return query->given[index] ? query->values[index] : NULL;
}

bool call_take_limit(struct api_call *call, const struct call_query *query, int index, int most,
                     int usual, int *out_limit) {
    int64_t number = usual;
    const char *text = call_parameter(query, index);
    bool good = !text || number_int(text, 1, most, &number);
    if (!good)
        call_refuse(call, 400, "wrong_query", query->names[index],
                    "The parameter '%s' is a number from 1 to %d.", query->names[index], most);
    *out_limit = (int)number;
    return good;
}

// ---- courses ------------------------------------------------------------------------------------

struct membership {
    const char *course;
    bool is_in;
};

static void take_course(void *user, const struct store_cell *cells, int count) {
    struct membership *m = user;
    (void)count;
    m->is_in = m->is_in || !strcmp(cells[0].text, m->course);
}

// A trainee sees that of a course that they are in.
bool call_find_course(struct api_call *call) {
    struct error err = {""};
    json_t *rows = json_array();
    enum result result =
        store_rows(call->store, LIST_COURSES, call->args[0], call_take_row, rows, &err);
    bool there = json_array_size(rows);
    json_decref(rows);
    if (!call_check(call, result, &err))
        return false;
    if (!there)
        call_refuse(call, 404, "not_found", NULL, "There is no course '%s'.", call->args[0]);
    return there;
}

bool call_may_see(struct api_call *call, const char *course) {
    struct membership m = {.course = course};
    struct error err = {""};
    if (call->principal.role != ROLE_TRAINEE)
        return true;
    if (!course) {
        call_refuse(call, 400, "wrong_query", "course", "The parameter 'course' is missing.");
        return false;
    }
    enum result result =
        store_courses_of(call->store, call->principal.trainee, take_course, &m, &err);
    if (!call_check(call, result, &err))
        return false;
    if (!m.is_in)
        call_refuse(call, 404, "not_found", NULL, "You are not in a course '%s'.", course);
    return m.is_in;
}

void call_answer_rows(struct api_call *call, const char *key, json_t *rows, enum result result,
                      const struct error *err) {
    json_t *all = json_pack("{s:o}", key, rows);
    if (call_check(call, result, err))
        call_answer(call, 200, all);
    else
        json_decref(all);
}

enum result call_fill(struct api_call *call, call_writer write, void *user, struct error *err) {
    char *body = NULL;
    size_t size = 0;
    FILE *file = open_memstream(&body, &size);
    NEED(file, "memory");
    enum result result = write(user, file, err);
    fclose(file);
    if (result != RESULT_OK) {
        free(body);
        return result;
    }
    call->response->status = 200;
    call->response->body = body;
    call->response->size = size;
    return RESULT_OK;
}

void call_answer_file(struct api_call *call, const char *dir, const char *name, const char *type) {
    struct web_response *r = call->response;
    struct stat status;
    int length = snprintf(r->file, sizeof r->file, "%s/%s", dir, name);
    if (length >= (int)sizeof r->file || stat(r->file, &status) || !S_ISREG(status.st_mode)) {
        r->file[0] = '\0';
        call_refuse(call, 404, "not_found", NULL, "There is no %s.", name);
        return;
    }
    r->status = 200;
    r->compress = true;
    snprintf(r->type, sizeof r->type, "%s", type);
    snprintf(r->etag, sizeof r->etag, "%" PRIx64 "-%" PRIx64,
             (uint64_t)status.st_mtim.tv_sec * 1000000000 + (uint64_t)status.st_mtim.tv_nsec,
             (uint64_t)status.st_size);
}

// ---- records ------------------------------------------------------------------------------------

bool call_open_store(struct api_call *call) {
    struct error err = {""};
    const char *actor = call->is_signed_in ? call->principal.actor : "server";
    return call_check(
        call, store_open(call->api->config.records, STORE_MAKE, actor, &call->store, &err), &err);
}

void call_close_store(struct api_call *call) {
    store_close(&call->store);
}

bool call_encode_password(struct api_call *call, const char *password, char *out_encoded) {
    struct error err;
    call_close_store(call);
    return call_check_memory(call, password_encode(password, out_encoded, &err)) &&
           call_open_store(call);
}

bool call_is_still_in(struct api_call *call) {
    char hash[SECRET_MAX];
    struct error err = {""};
    secret_hash(call->request->token, hash);
    enum result result = store_find_token(call->store, hash, &call->principal, &err);
    if (result != RESULT_MISSING)
        return call_check(call, result, &err);
    call_refuse(call, 401, "not_signed_in", NULL, "Sign in first.");
    return false;
}

json_t *call_string(const char *text) {
    json_t *string = json_string(text);
    return string ? string : json_string("(not UTF-8)");
}

double call_seconds(int64_t utc_ns) {
    return (double)(utc_ns / 1000000) / 1000;
}

static json_t *value_of(const struct store_cell *cell, bool is_time) {
    if (cell->kind == STORE_INTEGER)
        return is_time ? json_real(call_seconds(cell->integer)) : json_integer(cell->integer);
    if (cell->kind == STORE_REAL)
        return json_real(cell->real);
    json_t *text = cell->kind == STORE_TEXT ? json_string(cell->text) : NULL;
    return text ? text : json_null();
}

json_t *call_row(const struct store_cell *cells, int count) {
    static const char end[] = "_utc_ns";
    json_t *row = json_object();
    for (int i = 0; i < count; i++) {
        char name[64];
        size_t length = (size_t)snprintf(name, sizeof name, "%s", cells[i].column);
        CHECK(length < sizeof name);
        bool is_time = length >= strlen(end) && !strcmp(name + length - strlen(end), end);
        if (!strcmp(name, "utc_ns"))
            is_time = true;
        if (is_time)
            strcpy(name + length - 2, "s");
        json_object_set_new(row, name, value_of(&cells[i], is_time));
    }
    return row;
}

void call_take_row(void *array, const struct store_cell *cells, int count) {
    json_array_append_new(array, call_row(cells, count));
}
