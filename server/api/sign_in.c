#include "api/password.h"
#include "api/routes.h"
#include "api/secret.h"
#include "base/clock.h"
#include "base/log.h"

#include <stdio.h>
#include <string.h>

// ---- not too often ------------------------------------------------------------------------------

// One try, by its address and its name (NULL: none).
struct try {
    char address[64], name[STORE_NAME_MAX + 8];
    bool named;
    int64_t at_ns;
};

static bool too_many(struct api_call *call, int wait_s) {
    log_warning("api", "too many failed sign-ins from %s", call->request->address);
    call_refuse(call, 429, "too_many", NULL, "Too many failed attempts; wait %d s.", wait_s);
    call->response->retry_after_s = wait_s;
    return false;
}

static bool try_begin(struct api_call *call, const char *name, struct try *out) {
    struct throttle *throttle = &call->api->throttle;
    int wait_s;
    *out = (struct try){.named = name, .at_ns = clock_now_ns()};
    throttle_address(call->request->address, out->address);
    snprintf(out->name, sizeof out->name, "name %s", name ? name : "");
    if (!throttle_try(throttle, out->address, THROTTLE_ADDRESS_TRIES, out->at_ns, &wait_s))
        return too_many(call, wait_s);
    if (!out->named || throttle_try(throttle, out->name, THROTTLE_NAME_TRIES, out->at_ns, &wait_s))
        return true;
    throttle_take_back(throttle, out->address, out->at_ns);
    return too_many(call, wait_s);
}

static void try_was_right(struct api_call *call, const struct try *try) {
    throttle_take_back(&call->api->throttle, try->address, try->at_ns);
    if (try->named)
        throttle_take_back(&call->api->throttle, try->name, try->at_ns);
}

// ---- in -----------------------------------------------------------------------------------------

static json_t *account_json(const struct store_principal *p) {
    return json_pack("{s:s, s:s, s:s}", "name", p->name, "role", store_role_name(p->role),
                     "trainee", p->trainee);
}

// Sets a cookie for the principal. RESULT_MISSING if the password or code has changed meanwhile;
// then the caller answers.
static enum result set_cookie(struct api_call *call, int status) {
    char secret[SECRET_MAX], hash[SECRET_MAX];
    int64_t id, until_ns;
    struct error err = {""};
    secret_make(secret);
    secret_hash(secret, hash);
    store_set_actor(call->store, call->principal.actor);
    enum result result = store_add_token(call->store, TOKEN_COOKIE, hash, &call->principal, NULL,
                                         &id, &until_ns, &err);
    if (result == RESULT_MISSING || !call_check(call, result, &err))
        return result;
    snprintf(call->response->cookie, sizeof call->response->cookie,
             "arthron=%s; Path=/; Secure; HttpOnly; SameSite=Strict", secret);
    call_answer(call, status, json_pack("{s:o}", "account", account_json(&call->principal)));
    return RESULT_OK;
}

// Finds the account without revealing whether it exists.
static bool find_account(struct api_call *call, const char *name, bool *out_there) {
    struct error err = {""};
    enum result result = store_find_account(call->store, name, &call->principal, &err);
    *out_there = result == RESULT_OK && call->principal.password[0];
    return result == RESULT_MISSING || call_check(call, result, &err);
}

// The records are closed meanwhile, for that takes its time.
static bool password_fits(struct api_call *call, bool there, const char *password) {
    call_close_store(call);
    bool fits = password_is(there ? call->principal.password : NULL, password);
    return call_open_store(call) && fits;
}

static void sign_in_by_password(struct api_call *call) {
    const char *name, *password;
    struct try try;
    bool there;
    if (!call_need_text(call, "name", &name) || !call_need_text(call, "password", &password) ||
        !find_account(call, name, &there) || !try_begin(call, name, &try))
        return;
    enum result result = RESULT_MISSING;
    if (strlen(password) <= PASSWORD_MOST && password_fits(call, there, password))
        result = set_cookie(call, 200);
    if (result != RESULT_MISSING)
        try_was_right(call, &try);
    else if (!call->response->status)
        call_refuse(call, 401, "wrong_password", NULL, "The name or the password is wrong.");
}

static void sign_in_by_code(struct api_call *call, const char *typed) {
    char code[SECRET_CODE_MAX], hash[SECRET_MAX];
    struct error err = {""};
    struct try try;
    enum result result = RESULT_MISSING;
    if (!try_begin(call, NULL, &try))
        return;
    if (secret_read_code(typed, code)) {
        secret_hash(code, hash);
        result = store_find_code(call->store, hash, &call->principal, &err);
    }
    if (result == RESULT_OK)
        result = set_cookie(call, 200);
    if (result == RESULT_MISSING)
        call_refuse(call, 401, "wrong_code", "code", "The code is wrong or has ended.");
    else if (call->response->status || call_check(call, result, &err))
        try_was_right(call, &try);
}

void post_sign_in(struct api_call *call) {
    static const char *const fields[] = {"name", "password", "code", NULL};
    if (!call_take_body(call, fields))
        return;
    const char *code = call_text(call, "code");
    if (code && (call_text(call, "name") || call_text(call, "password")))
        call_refuse(call, 400, "wrong_field", "code",
                    "Send either a code, or a name and a password.");
    else if (code)
        sign_in_by_code(call, code);
    else
        sign_in_by_password(call);
}

// ---- the first instructor -----------------------------------------------------------------------

// With first_lock.
static bool make_first(struct api_call *call, const char *name, const char *encoded) {
    struct error err = {""};
    bool has;
    if (!call_check(call, store_has_instructor(call->store, &has, &err), &err))
        return false;
    if (has) {
        call_refuse(call, 409, "conflict", NULL, "There is already an instructor.");
        return false;
    }
    if (!call_check(
            call, store_add_account(call->store, name, ROLE_INSTRUCTOR, encoded, NULL, &err), &err))
        return false;
    return call_check(call, store_find_account(call->store, name, &call->principal, &err), &err);
}

static bool secret_fits(struct api_call *call, const char *secret) {
    struct api *api = call->api;
    pthread_mutex_lock(&api->first_lock);
    bool fits = api->first_secret[0] && secret_is(api->first_secret, secret);
    pthread_mutex_unlock(&api->first_lock);
    if (!fits)
        call_refuse(call, 401, "wrong_secret", "secret",
                    "The link is wrong, or somebody has used it.");
    return fits;
}

void post_first(struct api_call *call) {
    static const char *const fields[] = {"secret", "name", "password", NULL};
    const char *secret, *name, *password;
    char encoded[PASSWORD_ENCODED];
    struct try try;
    if (!call_take_body(call, fields) || !call_need_text(call, "secret", &secret) ||
        !try_begin(call, NULL, &try) || !secret_fits(call, secret))
        return;
    try_was_right(call, &try);
    if (!call_need_name(call, "name", &name) || !call_need_password(call, "password", &password))
        return;
    call_close_store(call);
    password_encode(password, encoded);
    if (!call_open_store(call))
        return;
    pthread_mutex_lock(&call->api->first_lock);
    bool made = make_first(call, name, encoded);
    if (made)
        call->api->first_secret[0] = '\0';
    pthread_mutex_unlock(&call->api->first_lock);
    if (made && set_cookie(call, 201) == RESULT_MISSING)
        call_refuse(call, 401, "not_signed_in", NULL, "Sign in first.");
}

// ---- out, and who -------------------------------------------------------------------------------

static void drop_cookie(struct api_call *call) {
    snprintf(call->response->cookie, sizeof call->response->cookie,
             "arthron=; Path=/; Max-Age=0; Secure; HttpOnly; SameSite=Strict");
    call_done(call);
}

void post_sign_out(struct api_call *call) {
    static const char *const fields[] = {NULL};
    struct error err = {""};
    if (call_take_body(call, fields) &&
        (!call->is_signed_in ||
         call_check(call,
                    store_remove_token(call->store, &call->principal, call->principal.token, &err),
                    &err)))
        drop_cookie(call);
}

void post_my_sign_out(struct api_call *call) {
    static const char *const fields[] = {NULL};
    struct error err = {""};
    if (call_take_body(call, fields) &&
        call_check(call, store_sign_out(call->store, &call->principal, &err), &err))
        drop_cookie(call);
}

static void take_name(void *array, const struct store_cell *cells, int count) {
    (void)count;
    json_array_append_new(array, json_string(cells[0].text));
}

void get_me(struct api_call *call) {
    struct error err = {""};
    json_t *courses = json_array();
    enum result result =
        store_courses_of(call->store, call->principal.trainee, take_name, courses, &err);
    json_t *me =
        json_pack("{s:o, s:o}", "account", account_json(&call->principal), "courses", courses);
    if (call_check(call, result, &err))
        call_answer(call, 200, me);
    else
        json_decref(me);
}

void patch_me(struct api_call *call) {
    static const char *const fields[] = {"password", "new_password", NULL};
    const char *old, *new;
    char encoded[PASSWORD_ENCODED], name[STORE_NAME_MAX];
    struct error err = {""};
    struct try try;
    bool there;
    memcpy(name, call->principal.name, sizeof name);
    if (!call_take_body(call, fields) || !call_need_text(call, "password", &old) ||
        !call_need_password(call, "new_password", &new))
        return;
    if (!call->principal.by_account) {
        call_refuse(call, 403, "not_allowed", NULL,
                    "After a sign-in with a code there is no password to change.");
        return;
    }
    if (!find_account(call, name, &there) || !try_begin(call, name, &try))
        return;
    if (strlen(old) > PASSWORD_MOST || !password_fits(call, there, old)) {
        if (!call->response->status)
            call_refuse(call, 401, "wrong_password", "password", "The old password is wrong.");
        return;
    }
    try_was_right(call, &try);
    call_close_store(call);
    password_encode(new, encoded);
    if (!call_open_store(call))
        return;
    enum result result = store_change_password(call->store, &call->principal, encoded, &err);
    if (result == RESULT_MISSING)
        call_refuse(call, 401, "wrong_password", "password", "The old password is wrong.");
    else if (call_check(call, result, &err))
        call_done(call);
}
