#include "api/case_summary.h"
#include "api/routes.h"
#include "check/grade.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

void get_cases(struct api_call *call) {
    char hash[17];
    call_close_store(call);
    json_t *cases = json_array();
    for (int i = 0; i < call->api->config.case_count; i++)
        json_array_append_new(cases, case_summary(call->api->summaries, i, hash));
    call_answer(call, 200, json_pack("{s:o}", "cases", cases));
}

// -1 after a refusal.
static int find_case(struct api_call *call) {
    call_close_store(call);
    for (int i = 0; i < call->api->config.case_count; i++)
        if (!strcmp(call->api->config.cases[i].name, call->args[0]))
            return i;
    call_refuse(call, 404, "not_found", NULL, "The server's config has no case '%s'.",
                call->args[0]);
    return -1;
}

void get_case(struct api_call *call) {
    char path[sizeof call->response->file], hash[17];
    int index = find_case(call);
    if (index < 0)
        return;
    snprintf(path, sizeof path, "%s/%s", call->api->config.cases[index].dir, GRADE_FILE);
    json_t *check = json_load_file(path, JSON_REJECT_DUPLICATES, NULL);
    call_answer(call, 200,
                json_pack("{s:o, s:o}", "case", case_summary(call->api->summaries, index, hash),
                          "check", check ? check : json_null()));
}

// A file of the case; its ETag is the hash of the case.
static void answer_case_file(struct api_call *call, const char *name, const char *type) {
    char hash[17];
    int index = find_case(call);
    if (index < 0)
        return;
    json_decref(case_summary(call->api->summaries, index, hash));
    call_answer_file(call, call->api->config.cases[index].dir, name, type);
    if (hash[0] && call->response->etag[0])
        snprintf(call->response->etag, sizeof call->response->etag, "%s", hash);
}

void get_case_manifest(struct api_call *call) {
    answer_case_file(call, "case.json", "application/json");
}

void get_case_anatomy(struct api_call *call) {
    answer_case_file(call, "anatomy.glb", "model/gltf-binary");
}

void get_case_check(struct api_call *call) {
    int index = find_case(call);
    if (index >= 0)
        call_answer_file(call, call->api->config.cases[index].dir, GRADE_FILE, "application/json");
}
