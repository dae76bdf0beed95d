#include "api/case_summary.h"
#include "api/rehearsals.h"
#include "api/routes.h"
#include "api/tasks.h"
#include "store/exams.h"

#include <stdio.h>
#include <string.h>

static void take_expert_state(void *user, const struct store_cell *cells, int count) {
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
                                          take_expert_state, &goes_on, &err);
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

// Whether there are hands in the response's body; else the request is refused.
static bool take_expert_hands(struct api_call *call, const struct rehearsal_wish *wish) {
    struct web_response *r = call->response;
    uint8_t *batch = NULL;
    int wait_s = 2;
    enum result result = rehearsals_take(call->api->rehearsals, wish, call->principal.actor, &batch,
                                         &r->size, &wait_s);
    r->body = (char *)batch;
    if (result == RESULT_TIMEOUT)
        call_refuse(call, 503, "busy", NULL, "The server is computing other hands.");
    else if (result == RESULT_LIMIT)
        call_refuse(call, 429, "too_many", NULL, "Too many hands for one person; wait %d s.",
                    wait_s);
    else if (result != RESULT_OK)
        call_refuse(call, 404, "not_found", NULL, "There are no hands of an expert at it.");
    if (result == RESULT_TIMEOUT || result == RESULT_LIMIT)
        r->retry_after_s = wait_s;
    return result == RESULT_OK;
}

// Whether the case can be read; else the request is refused.
static bool take_hash(struct api_call *call, int knee_case, uint64_t *out_hash) {
    enum result result = case_summary_hash(call->api->summaries, knee_case, out_hash);
    if (result == RESULT_TIMEOUT) {
        call_refuse(call, 503, "busy", NULL, "The server is reading the case.");
        call->response->retry_after_s = 2;
    } else if (result != RESULT_OK) {
        call_refuse(call, 404, "not_found", NULL, "There are no hands of an expert at it.");
    }
    return result == RESULT_OK;
}

void get_expert(struct api_call *call) {
    struct web_response *r = call->response;
    const struct task *task = task_need(call, call->args[0]);
    int knee_case = task ? case_of(call) : -1;
    if (knee_case < 0 || !is_in_no_exam(call))
        return;
    call_close_store(call);
    struct rehearsal_wish wish = {(int)(task - call->api->config.tasks), knee_case, 0};
    if (!take_hash(call, knee_case, &wish.case_hash) || !take_expert_hands(call, &wish))
        return;
    r->status = 200;
    r->compress = true;
    snprintf(r->type, sizeof r->type, "application/x-protobuf");
}
