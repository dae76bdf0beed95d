#include "study/study.h"

#include "api/routes.h"
#include "api/values.h"
#include "base/clock.h"

#include <stdio.h>
#include <string.h>

#define UTC_MAX_S 9007199254.0

static bool take_study_times(struct api_call *call, const struct call_query *query,
                             struct study_request *request) {
    double from_s = 0, to_s = 0;
    if (!value_parameter(call, query, 1, 0, UTC_MAX_S, &from_s) ||
        !value_parameter(call, query, 2, 0, UTC_MAX_S, &to_s))
        return false;
    request->from_utc_ns = (int64_t)(from_s * 1000) * NS_PER_MS;
    request->to_utc_ns = (int64_t)(to_s * 1000) * NS_PER_MS;
    return true;
}

// The log has it before anybody gets it.
static bool note_export(struct api_call *call) {
    struct error err = {""};
    char subject[STORE_TEXT_MAX];
    snprintf(subject, sizeof subject, "attempts of course %s", call->args[0]);
    return call_check(call, store_note(call->store, "export", subject, &err), &err);
}

struct study_call {
    struct store *store;
    const struct study_request *request;
};

static enum result write_study(void *user, FILE *file, struct error *err) {
    const struct study_call *study = user;
    return study_write(study->store, study->request, file, err);
}

static void answer_study(struct api_call *call, const struct study_request *request) {
    struct study_call study = {call->store, request};
    struct web_response *r = call->response;
    struct error err = {""};
    if (!call_check(call, call_fill(call, write_study, &study, &err), &err))
        return;
    snprintf(r->type, sizeof r->type, "application/zip");
    snprintf(r->download, sizeof r->download, "attempts.zip");
}

void get_course_export(struct api_call *call) {
    struct call_query query = {.names = {"task", "from", "to"}};
    struct study_request request = {.course = call->args[0]};
    if (!call_take_query(call, &query) || !take_study_times(call, &query, &request) ||
        !note_export(call))
        return;
    request.task = call_parameter(&query, 0);
    answer_study(call, &request);
}
