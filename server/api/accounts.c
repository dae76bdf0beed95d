#include "api/password.h"
#include "api/routes.h"
#include "api/secret.h"
#include "base/number.h"

#include <stdio.h>
#include <string.h>

// ---- tokens -------------------------------------------------------------------------------------

struct own {
    json_t *array;
    const struct store_principal *principal;
};

// A list of an account may have tokens of a trainee of that name, and the other way about.
static void take_token(void *user, const struct store_cell *cells, int count) {
    struct own *own = user;
    json_t *row = call_row(cells, count);
    bool is_code = !strcmp(json_string_value(json_object_get(row, "kind")), "code");
    bool by_account = json_is_string(json_object_get(row, "account"));
    if (by_account == own->principal->by_account && !is_code) {
        int64_t id = json_integer_value(json_object_get(row, "id"));
        json_object_set_new(row, "current", json_boolean(id == own->principal->token));
        json_object_del(row, "account");
        json_object_del(row, "trainee");
        json_array_append(own->array, row);
    }
    json_decref(row);
}

void get_tokens(struct api_call *call) {
    struct error err = {""};
    struct own own = {json_array(), &call->principal};
    enum result result =
        store_rows(call->store, LIST_TOKENS, call->principal.name, take_token, &own, &err);
    json_t *all = json_pack("{s:o}", "tokens", own.array);
    if (call_check(call, result, &err))
        call_answer(call, 200, all);
    else
        json_decref(all);
}

void post_tokens(struct api_call *call) {
    static const char *const fields[] = {"name", NULL};
    char secret[SECRET_MAX], hash[SECRET_MAX];
    const char *name;
    int64_t id, until_ns;
    struct error err = {""};
    if (!call->principal.by_account) { // it would outlive the code by far
        call_refuse(call, 403, "not_allowed", NULL,
                    "After a sign-in with a code you cannot make tokens.");
        return;
    }
    if (!call_take_body(call, fields) || !call_need_name(call, "name", &name))
        return;
    secret_make(secret);
    secret_hash(secret, hash);
    enum result result = store_add_token(call->store, TOKEN_BEARER, hash, &call->principal, name,
                                         &id, &until_ns, &err);
    if (result == RESULT_MISSING)
        call_refuse(call, 401, "not_signed_in", NULL, "Sign in first.");
    else if (call_check(call, result, &err))
        call_answer(call, 201,
                    json_pack("{s:I, s:s, s:s, s:f}", "id", (json_int_t)id, "name", name, "token",
                              secret, "until_utc_s", call_seconds(until_ns)));
}

void delete_token(struct api_call *call) {
    struct error err = {""};
    int64_t id;
    if (!number_int(call->args[0], 1, INT64_MAX, &id))
        call_refuse(call, 404, "not_found", NULL, "There is no token with this number.");
    else if (call_check(call, store_remove_token(call->store, &call->principal, id, &err), &err))
        call_done(call);
}

// ---- accounts -----------------------------------------------------------------------------------

static void take_account(void *array, const struct store_cell *cells, int count) {
    json_t *row = call_row(cells, count);
    json_t *can = json_object_get(row, "can_log_in");
    json_object_set_new(row, "can_sign_in", json_boolean(json_integer_value(can)));
    json_object_del(row, "can_log_in");
    if (json_is_null(json_object_get(row, "trainee")))
        json_object_set_new(row, "trainee", json_string(""));
    json_array_append_new(array, row);
}

void get_accounts(struct api_call *call) {
    struct error err = {""};
    json_t *accounts = json_array();
    enum result result = store_rows(call->store, LIST_ACCOUNTS, NULL, take_account, accounts, &err);
    json_t *all = json_pack("{s:o}", "accounts", accounts);
    if (call_check(call, result, &err))
        call_answer(call, 200, all);
    else
        json_decref(all);
}

// Otherwise a technician could make an instructor, and sign in as one.
static bool may_manage(struct api_call *call, enum store_role role) {
    if (call->principal.role == ROLE_INSTRUCTOR || role == call->principal.role)
        return true;
    call_refuse(call, 403, "not_allowed", NULL, "A %s manages accounts of that role only.",
                store_role_name(call->principal.role));
    return false;
}

// The account of the path.
static bool find_managed(struct api_call *call, struct store_principal *out) {
    struct error err = {""};
    return call_check(call, store_find_account(call->store, call->args[0], out, &err), &err) &&
           may_manage(call, out->role);
}

static bool need_role(struct api_call *call, enum store_role *out_role) {
    const char *role;
    if (!call_need_text(call, "role", &role))
        return false;
    if (store_role_from_name(role, out_role))
        return true;
    call_refuse(call, 400, "wrong_field", "role", "The role is instructor, technician or trainee.");
    return false;
}

// Somebody may have signed the caller out meanwhile.
static bool encode(struct api_call *call, const char *password, char encoded[PASSWORD_ENCODED]) {
    return call_encode_password(call, password, encoded) && call_is_still_in(call);
}

// An account with the role trainee belongs to a trainee, any other to none.
static bool take_trainee(struct api_call *call, enum store_role role, const char **out_trainee) {
    const char *trainee = call_text(call, "trainee");
    *out_trainee = trainee && trainee[0] ? trainee : NULL;
    if ((role == ROLE_TRAINEE) == (*out_trainee != NULL))
        return true;
    call_refuse(call, 400, "wrong_field", "trainee", "%s",
                *out_trainee ? "Only an account with the role trainee belongs to a trainee."
                             : "The trainee of this account is missing.");
    return false;
}

void post_accounts(struct api_call *call) {
    static const char *const fields[] = {"name", "role", "password", "trainee", NULL};
    const char *name, *password, *trainee;
    char encoded[PASSWORD_ENCODED];
    enum store_role role;
    struct error err = {""};
    if (!call_take_body(call, fields) || !call_need_name(call, "name", &name) ||
        !need_role(call, &role) || !may_manage(call, role) || !take_trainee(call, role, &trainee) ||
        !call_need_password(call, "password", &password) || !encode(call, password, encoded))
        return;
    enum result result = store_add_account(call->store, name, role, encoded, trainee, &err);
    if (call_check(call, result, &err))
        call_answer(call, 201,
                    json_pack("{s:{s:s, s:s, s:s}}", "account", "name", name, "role",
                              store_role_name(role), "trainee", trainee ? trainee : ""));
}

static bool change_role(struct api_call *call, const struct store_principal *account) {
    enum store_role role;
    struct error err = {""};
    if (!call_text(call, "role"))
        return true;
    if (!need_role(call, &role) || !may_manage(call, role))
        return false;
    if ((role == ROLE_TRAINEE) != (account->trainee[0] != '\0')) {
        call_refuse(call, 400, "wrong_field", "role", "%s",
                    account->trainee[0] ? "The account of a trainee keeps the role trainee."
                                        : "This account belongs to no trainee.");
        return false;
    }
    return call_check(call, store_set_role(call->store, call->args[0], role, &err), &err);
}

// The path's argument becomes the new name.
static bool change_name(struct api_call *call) {
    const char *name;
    struct error err = {""};
    if (!call_text(call, "name"))
        return true;
    if (!call_need_name(call, "name", &name) ||
        !call_check(call, store_rename_account(call->store, call->args[0], name, &err), &err))
        return false;
    snprintf(call->args[0], sizeof call->args[0], "%s", name);
    return true;
}

static bool change_password(struct api_call *call, const char *encoded) {
    struct error err = {""};
    return !encoded[0] ||
           call_check(call, store_set_password(call->store, call->args[0], encoded, &err), &err);
}

void patch_account(struct api_call *call) {
    static const char *const fields[] = {"password", "role", "name", NULL};
    const char *password = NULL;
    char encoded[PASSWORD_ENCODED] = "";
    struct store_principal account;
    if (!call_take_body(call, fields))
        return;
    if (call_text(call, "password") && !call_need_password(call, "password", &password))
        return;
    if (!password && !call_text(call, "role") && !call_text(call, "name")) {
        call_refuse(call, 400, "wrong_body", NULL, "The body names nothing to change.");
        return;
    }
    if (!find_managed(call, &account) || (password && !encode(call, password, encoded)))
        return;
    // Looked at again: encoding takes its time.
    if (find_managed(call, &account) && change_name(call) && change_role(call, &account) &&
        change_password(call, encoded))
        call_done(call);
}

void post_account_sign_out(struct api_call *call) {
    static const char *const fields[] = {NULL};
    struct store_principal account;
    struct error err = {""};
    if (call_take_body(call, fields) && find_managed(call, &account) &&
        call_check(call, store_sign_out_account(call->store, call->args[0], &err), &err))
        call_done(call);
}

void delete_account(struct api_call *call) {
    struct store_principal account;
    struct error err = {""};
    if (find_managed(call, &account) &&
        call_check(call, store_remove_account(call->store, call->args[0], &err), &err))
        call_done(call);
}
