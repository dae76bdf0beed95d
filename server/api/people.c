#include "api/routes.h"
#include "api/secret.h"

#include <string.h>

// ---- trainees -----------------------------------------------------------------------------------

static void take_trainee_row(void *array, const struct store_cell *cells, int count) {
    json_t *row = call_row(cells, count);
    bool erased = !json_is_null(json_object_get(row, "erased_utc_s"));
    json_object_set_new(row, "erased", json_boolean(erased));
    json_object_del(row, "erased_utc_s");
    json_array_append_new(array, row);
}

void get_trainees(struct api_call *call) {
    struct error err = {""};
    json_t *rows = json_array();
    enum result result = store_rows(call->store, LIST_TRAINEES, NULL, take_trainee_row, rows, &err);
    call_answer_rows(call, "trainees", rows, result, &err);
}

void post_trainees(struct api_call *call) {
    static const char *const fields[] = {"name", "full_name", NULL};
    const char *name;
    struct error err = {""};
    if (!call_take_body(call, fields) || !call_need_name(call, "name", &name))
        return;
    const char *full_name = call_text(call, "full_name");
    if (full_name && !full_name[0])
        full_name = NULL;
    if (call_check(call, store_add_trainee(call->store, name, full_name, &err), &err))
        call_answer(call, 201,
                    json_pack("{s:{s:s, s:s?}}", "trainee", "name", name, "full_name", full_name));
}

// False after a refusal. *out_name: the new one, or NULL.
static bool take_new_name(struct api_call *call, const char **out_name) {
    *out_name = call_text(call, "name");
    return !*out_name || call_need_name(call, "name", out_name);
}

void patch_trainee(struct api_call *call) {
    static const char *const fields[] = {"name", "full_name", NULL};
    const char *name;
    struct error err = {""};
    if (!call_take_body(call, fields) || !take_new_name(call, &name))
        return;
    json_t *full_name = json_object_get(call->body, "full_name");
    const char *text = full_name && json_is_null(full_name) ? "" : call_text(call, "full_name");
    if (!name && !text)
        call_refuse(call, 400, "wrong_body", NULL, "The body names nothing to change.");
    else if (call_check(call, store_change_trainee(call->store, call->args[0], name, text, &err),
                        &err))
        call_done(call);
}

void delete_trainee(struct api_call *call) {
    struct error err = {""};
    if (call_check(call, store_remove_trainee(call->store, call->args[0], &err), &err))
        call_done(call);
}

static void take_id(void *array, const struct store_cell *cells, int count) {
    (void)count;
    json_array_append_new(array, json_string(cells[0].text));
}

void post_trainee_erase(struct api_call *call) {
    static const char *const fields[] = {NULL};
    char pseudonym[STORE_NAME_MAX];
    struct error err = {""};
    if (!call_take_body(call, fields) ||
        !call_check(call, store_erase_trainee(call->store, call->args[0], pseudonym, &err), &err))
        return;
    json_t *ids = json_array();
    enum result result = store_sessions_of(call->store, pseudonym, take_id, ids, &err);
    json_t *all = json_pack("{s:s, s:o}", "pseudonym", pseudonym, "sessions", ids);
    if (call_check(call, result, &err))
        call_answer(call, 200, all);
    else
        json_decref(all);
}

void post_trainee_sign_out(struct api_call *call) {
    static const char *const fields[] = {NULL};
    struct error err = {""};
    if (call_take_body(call, fields) &&
        call_check(call, store_sign_out_trainee(call->store, call->args[0], &err), &err))
        call_done(call);
}

void post_trainee_code(struct api_call *call) {
    static const char *const fields[] = {NULL};
    char code[SECRET_CODE_MAX], hash[SECRET_MAX];
    int64_t until_ns;
    struct error err = {""};
    if (!call_take_body(call, fields))
        return;
    secret_make_code(code);
    secret_keyed_hash(&call->api->key, "code", code, hash);
    if (call_check(call, store_add_code(call->store, call->args[0], hash, &until_ns, &err), &err))
        call_answer(call, 201,
                    json_pack("{s:s, s:f}", "code", code, "until_utc_s", call_seconds(until_ns)));
}

// ---- courses ------------------------------------------------------------------------------------

void get_courses(struct api_call *call) {
    struct error err = {""};
    json_t *rows = json_array();
    enum result result = store_rows(call->store, LIST_COURSES, NULL, call_take_row, rows, &err);
    call_answer_rows(call, "courses", rows, result, &err);
}

void post_courses(struct api_call *call) {
    static const char *const fields[] = {"name", NULL};
    const char *name;
    struct error err = {""};
    if (call_take_body(call, fields) && call_need_name(call, "name", &name) &&
        call_check(call, store_add_course(call->store, name, &err), &err))
        call_answer(call, 201, json_pack("{s:{s:s}}", "course", "name", name));
}

void get_course(struct api_call *call) {
    struct error err = {""};
    if (!call_find_course(call))
        return;
    json_t *rows = json_array();
    enum result result = store_trainees_in(call->store, call->args[0], call_take_row, rows, &err);
    json_t *all = json_pack("{s:{s:s, s:o}}", "course", "name", call->args[0], "trainees", rows);
    if (call_check(call, result, &err))
        call_answer(call, 200, all);
    else
        json_decref(all);
}

void post_course_trainees(struct api_call *call) {
    static const char *const fields[] = {"trainee", NULL};
    const char *trainee;
    struct error err = {""};
    if (call_take_body(call, fields) && call_need_text(call, "trainee", &trainee) &&
        call_check(call, store_enrol(call->store, trainee, call->args[0], &err), &err))
        call_done(call);
}

void patch_course(struct api_call *call) {
    static const char *const fields[] = {"name", NULL};
    const char *name;
    struct error err = {""};
    if (call_take_body(call, fields) && call_need_name(call, "name", &name) &&
        call_check(call, store_rename_course(call->store, call->args[0], name, &err), &err))
        call_done(call);
}

void delete_course(struct api_call *call) {
    struct error err = {""};
    if (call_check(call, store_remove_course(call->store, call->args[0], &err), &err))
        call_done(call);
}

void delete_course_trainee(struct api_call *call) {
    struct error err = {""};
    if (call_check(call, store_unenrol(call->store, call->args[1], call->args[0], &err), &err))
        call_done(call);
}
