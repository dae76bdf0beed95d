// A course's attempts for researchers, as a zip.
#include "study/study.h"

#include "api/routes.h"
#include "base/check.h"
#include "base/clock.h"
#include "base/number.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define SECONDS_MAX 9e9 // the year 2255

// Seconds since 1970; 0 where it is not given. False after a refusal.
static bool take_time(struct api_call *call, const struct call_query *query, int index,
                      int64_t *out_utc_ns) {
    const char *text = call_parameter(query, index);
    double seconds = 0;
    bool good = !text || number_double(text, 0, SECONDS_MAX, &seconds);
    if (!good)
        call_refuse(call, 400, "wrong_query", query->names[index],
                    "The parameter '%s' is a time in seconds since 1970.", query->names[index]);
    *out_utc_ns = (int64_t)(seconds * (double)NS_PER_S);
    return good;
}

// The log has it before anybody gets it.
static bool note_export(struct api_call *call) {
    struct error err = {""};
    char subject[STORE_TEXT_MAX];
    snprintf(subject, sizeof subject, "attempts of course %s", call->args[0]);
    return call_check(call, store_note(call->store, "export", subject, &err), &err);
}

static void answer_study(struct api_call *call, const struct study_request *request) {
    struct web_response *r = call->response;
    struct error err = {""};
    char *zip = NULL;
    size_t size = 0;
    FILE *file = open_memstream(&zip, &size);
    NEED(file, "memory");
    enum result result = study_write(call->store, request, file, &err);
    fclose(file);
    if (!call_check(call, result, &err)) {
        free(zip);
        return;
    }
    r->status = 200;
    r->body = zip;
    r->size = size;
    snprintf(r->type, sizeof r->type, "application/zip");
    snprintf(r->download, sizeof r->download, "attempts.zip");
}

void get_course_export(struct api_call *call) {
    struct call_query query = {.names = {"task", "from", "to"}};
    struct study_request request = {.course = call->args[0]};
    if (!call_take_query(call, &query) || !take_time(call, &query, 1, &request.from_utc_ns) ||
        !take_time(call, &query, 2, &request.to_utc_ns) || !note_export(call))
        return;
    request.task = call_parameter(&query, 0);
    answer_study(call, &request);
}
