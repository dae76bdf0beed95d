#include "xapi/xapi.h"

#include "base/check.h"
#include "base/log.h"
#include "store/attempts.h"
#include "xapi/sender.h"
#include "xapi/statement.h"

#include <stdlib.h>
#include <string.h>

#define PATIENCE_MS 30000
#define RETRY_MS 1000
#define RETRY_MOST_MS 300000

struct xapi {
    char site[XAPI_SITE_MAX];
    bool names;
    struct outbox *outbox;
    struct sender *sender; // NULL: no store
};

static enum result start_sender(const struct xapi_settings *settings, struct xapi *x,
                                struct error *err) {
    const struct sender_config config = {
        .server = settings->server,
        .user = settings->user,
        .password = settings->password,
        .authority = settings->authority,
        .patience_ms = PATIENCE_MS,
        .retry_ms = RETRY_MS,
        .retry_most_ms = RETRY_MOST_MS,
    };
    return settings->server[0] ? sender_start(&config, x->outbox, &x->sender, err) : RESULT_OK;
}

enum result xapi_start(const struct xapi_settings *settings, struct xapi **out, struct error *err) {
    *out = NULL;
    if (!settings->file[0])
        return RESULT_OK;
    struct xapi *x = alloc(1, sizeof *x);
    *out = x;
    x->names = settings->names;
    xapi_usual_site(x->site);
    if (settings->site[0])
        memcpy(x->site, settings->site, sizeof x->site);
    enum result result = xapi_check_site(x->site, err);
    if (result == RESULT_OK)
        result = outbox_open(settings->file, settings->server[0], &x->outbox, err);
    if (result == RESULT_OK)
        result = start_sender(settings, x, err);
    if (result != RESULT_OK)
        xapi_stop(out);
    return result;
}

void xapi_stop(struct xapi **xapi) {
    struct xapi *x = *xapi;
    *xapi = NULL;
    if (!x)
        return;
    sender_stop(&x->sender);
    outbox_close(&x->outbox);
    free(x);
}

// ---- an attempt ---------------------------------------------------------------------------------

struct taken {
    struct store *store;
    const struct xapi_naming *naming;
    json_t *statement;
    enum result result;
    struct error *err;
};

static void take_course(void *names, const struct store_cell *cells, int count) {
    for (int i = 0; i < count; i++)
        if (cells[i].kind == STORE_TEXT && !strcmp(cells[i].column, "name"))
            json_array_append_new(names, json_string(cells[i].text));
}

static const char *trainee_of(const struct store_cell *cells, int count) {
    for (int i = 0; i < count; i++)
        if (cells[i].kind == STORE_TEXT && !strcmp(cells[i].column, "trainee"))
            return cells[i].text;
    return NULL;
}

static void take_attempt(void *user, const struct store_cell *cells, int count) {
    struct taken *taken = user;
    const char *trainee = trainee_of(cells, count);
    json_t *courses = json_array();
    if (trainee)
        taken->result = store_courses_of(taken->store, trainee, take_course, courses, taken->err);
    if (taken->result == RESULT_OK)
        taken->statement = xapi_attempt(cells, count, courses, taken->naming);
    json_decref(courses);
}

static enum result add(struct xapi *x, const json_t *statement, struct error *err) {
    char *line = json_dumps(statement, JSON_COMPACT);
    NEED(line, "memory");
    enum result result = outbox_add(x->outbox, line, err);
    free(line);
    return result;
}

void xapi_attempt_told(struct xapi *x, struct store *store, const char *session, int number) {
    struct error err;
    const struct xapi_naming naming = {x->site, x->names};
    const struct attempt_filter filter = {.session = session, .number = number, .limit = 1};
    struct taken taken = {.store = store, .naming = &naming, .err = &err};
    enum result result = store_attempt_list(store, &filter, take_attempt, &taken, &err);
    if (result == RESULT_OK)
        result = taken.result;
    if (result == RESULT_OK && taken.statement)
        result = add(x, taken.statement, &err);
    if (result != RESULT_OK)
        log_error("xapi", "attempt %d of session %s has no statement: %s", number, session,
                  err.text);
    json_decref(taken.statement);
    sender_wake(x->sender);
}
