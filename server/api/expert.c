#include "api/rehearsals.h"
#include "api/routes.h"
#include "api/tasks.h"
#include "store/exams.h"

#include <stdio.h>
#include <string.h>

static void take_state(void *user, const struct store_cell *cells, int count) {
    for (int i = 0; i < count; i++)
        if (!strcmp(cells[i].column, "state") && !strcmp(cells[i].text, "begun"))
            *(bool *)user = true;
}

// Whether no exam of the trainee goes on; else the request is refused.
static bool is_in_no_exam(struct api_call *call) {
    bool goes_on = false;
    struct error err = {""};
    if (call->principal.role != ROLE_TRAINEE)
        return true;
    enum result result = store_find_exams(call->store, NULL, call->principal.trainee, NULL,
                                          take_state, &goes_on, &err);
    if (!call_check(call, result, &err))
        return false;
    if (goes_on)
        call_refuse(call, 409, "conflict", NULL, "An exam of yours goes on.");
    return !goes_on;
}

// -1 after a refusal.
static int case_of(struct api_call *call) {
    struct call_query query = {.names = {"case"}};
    const struct api_config *config = &call->api->config;
    if (!call_take_query(call, &query))
        return -1;
    for (int i = 0; query.given[0] && i < config->case_count; i++)
        if (!strcmp(config->cases[i].name, query.values[0]))
            return i;
    call_refuse(call, 404, "not_found", NULL, "The server's config has no case '%.63s'.",
                query.values[0]);
    return -1;
}

void get_expert(struct api_call *call) {
    struct web_response *r = call->response;
    const struct task *task = task_need(call, call->args[0]);
    int knee_case = task ? case_of(call) : -1;
    if (knee_case < 0 || !is_in_no_exam(call))
        return;
    call_close_store(call);
    uint8_t *batch = NULL;
    enum result result = rehearsals_take(
        call->api->rehearsals, (int)(task - call->api->config.tasks), knee_case, &batch, &r->size);
    r->body = (char *)batch;
    if (result == RESULT_TIMEOUT) {
        call_refuse(call, 503, "busy", NULL, "The server is computing other hands.");
        r->retry_after_s = 2;
    } else if (result != RESULT_OK) {
        call_refuse(call, 404, "not_found", NULL, "There are no hands of an expert at it.");
    } else {
        r->status = 200;
        r->compress = true;
        snprintf(r->type, sizeof r->type, "application/x-protobuf");
    }
}
