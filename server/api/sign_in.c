#include "api/sign_in.h"

#include "api/device.h"
#include "api/password.h"
#include "api/routes.h"
#include "api/tries.h"
#include "base/clock.h"

#include <stdio.h>
#include <string.h>

// ---- in -----------------------------------------------------------------------------------------

static json_t *account_json(const struct store_principal *p) {
    return json_pack("{s:s, s:s, s:s}", "name", p->name, "role", store_role_name(p->role),
                     "trainee", p->trainee);
}

// Unless the browser is known already.
static void set_device(struct api_call *call) {
    const char *who = call->principal.by_account ? call->principal.name : "";
    char device[DEVICE_MAX], id[DEVICE_ID_MAX];
    int64_t now_ns = clock_utc_ns();
    if (device_is_known(&call->api->key, call->request->device, who, now_ns, id))
        return;
    device_make(&call->api->key, who, now_ns, device);
    snprintf(call->response->second_cookie, sizeof call->response->second_cookie,
             "arthron-device=%s; Path=/api/v1; Max-Age=%d; HttpOnly; SameSite=Strict", device,
             DEVICE_S);
}

enum result sign_in_set_cookie(struct api_call *call) {
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
             "arthron=%s; Path=/; HttpOnly; SameSite=Strict", secret);
    tries_entered(call, call->principal.actor);
    return RESULT_OK;
}

static enum result let_in(struct api_call *call, int status) {
    enum result result = sign_in_set_cookie(call);
    if (result != RESULT_OK)
        return result;
    set_device(call);
    call_answer(call, status, json_pack("{s:o}", "account", account_json(&call->principal)));
    return RESULT_OK;
}

// Finds the account without revealing whether it exists.
static bool find_account(struct api_call *call, const char *name, bool *out_there) {
    struct error err = {""};
    enum result result = store_find_account(call->store, name, &call->principal, &err);
    if (result == RESULT_MISSING)
        call->principal = (struct store_principal){0};
    *out_there = result == RESULT_OK && call->principal.password[0];
    return result == RESULT_MISSING || call_check(call, result, &err);
}

// The records are closed meanwhile, for that takes its time. False after a refusal, too.
static bool password_fits(struct api_call *call, bool there, const char *password) {
    bool right;
    struct error err;
    if (strlen(password) > PASSWORD_MOST)
        return false;
    call_close_store(call);
    const char *encoded = there ? call->principal.password : NULL;
    return call_check_memory(call, password_is(encoded, password, &right, &err)) &&
           call_open_store(call) && right;
}

// Unless the request was refused before: then nobody knows whether it is right.
static void refuse_password(struct api_call *call, const struct tries *tries, const char *field,
                            const char *text) {
    char subject[STORE_NAME_MAX] = "no account";
    if (call->response->status) {
        tries_was_right(call, tries);
        return;
    }
    if (call->principal.number)
        snprintf(subject, sizeof subject, "account %lld", (long long)call->principal.number);
    tries_note_wrong(call, "wrong password", subject);
    call_refuse(call, 401, "wrong_password", field, "%s", text);
}

static void sign_in_by_password(struct api_call *call) {
    const char *name, *password;
    struct tries tries;
    bool there;
    if (!call_need_text(call, "name", &name) || !call_need_text(call, "password", &password) ||
        !tries_begin(call, name, &tries))
        return;
    if (!find_account(call, name, &there) ||
        (there && !tries_may_enter(call, call->principal.actor))) {
        tries_was_right(call, &tries); // it was not tried
        return;
    }
    enum result result = RESULT_MISSING;
    if (password_fits(call, there, password))
        result = let_in(call, 200);
    if (result != RESULT_MISSING)
        tries_was_right(call, &tries);
    else
        refuse_password(call, &tries, NULL, "The name or the password is wrong.");
}

static void sign_in_by_code(struct api_call *call, const char *typed) {
    char code[SECRET_CODE_MAX], hash[SECRET_MAX];
    struct error err = {""};
    struct tries tries;
    enum result result = RESULT_MISSING;
    if (!tries_begin(call, NULL, &tries))
        return;
    if (secret_read_code(typed, code)) {
        secret_keyed_hash(&call->api->key, "code", code, hash);
        result = store_find_code(call->store, hash, &call->principal, &err);
    }
    if (result != RESULT_MISSING)
        tries_was_right(call, &tries);
    if (result == RESULT_OK && !tries_may_enter(call, call->principal.actor))
        return;
    if (result == RESULT_OK)
        result = let_in(call, 200);
    if (result == RESULT_MISSING) {
        tries_note_wrong(call, "wrong code", "code");
        call_refuse(call, 401, "wrong_code", "code", "The code is wrong or has ended.");
    } else if (!call->response->status) {
        call_check(call, result, &err);
    }
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
    if (!fits) {
        tries_note_wrong(call, "wrong link", "first instructor");
        call_refuse(call, 401, "wrong_secret", "secret",
                    "The link is wrong, or somebody has used it.");
    }
    return fits;
}

void post_first(struct api_call *call) {
    static const char *const fields[] = {"secret", "name", "password", NULL};
    const char *secret, *name, *password;
    char encoded[PASSWORD_ENCODED];
    struct tries tries;
    if (!call_take_body(call, fields) || !call_need_text(call, "secret", &secret) ||
        !tries_begin(call, NULL, &tries) || !secret_fits(call, secret))
        return;
    tries_was_right(call, &tries);
    if (!call_need_name(call, "name", &name) || !call_need_password(call, "password", &password))
        return;
    if (!call_encode_password(call, password, encoded))
        return;
    pthread_mutex_lock(&call->api->first_lock);
    bool made = make_first(call, name, encoded);
    if (made)
        call->api->first_secret[0] = '\0';
    pthread_mutex_unlock(&call->api->first_lock);
    if (made && let_in(call, 201) == RESULT_MISSING)
        call_refuse(call, 401, "not_signed_in", NULL, "Sign in first.");
}

// ---- out, and who -------------------------------------------------------------------------------

static void drop_cookie(struct api_call *call) {
    snprintf(call->response->cookie, sizeof call->response->cookie,
             "arthron=; Path=/; Max-Age=0; HttpOnly; SameSite=Strict");
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

static void take_sign_in_name(void *array, const struct store_cell *cells, int count) {
    (void)count;
    json_array_append_new(array, json_string(cells[0].text));
}

void get_me(struct api_call *call) {
    struct error err = {""};
    json_t *courses = json_array();
    enum result result =
        store_courses_of(call->store, call->principal.trainee, take_sign_in_name, courses, &err);
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
    struct tries tries;
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
    if (!tries_begin(call, name, &tries))
        return;
    if (!find_account(call, name, &there) || !password_fits(call, there, old)) {
        refuse_password(call, &tries, "password", "The old password is wrong.");
        return;
    }
    tries_was_right(call, &tries);
    if (!call_encode_password(call, new, encoded))
        return;
    enum result result = store_change_password(call->store, &call->principal, encoded, &err);
    if (result == RESULT_MISSING)
        call_refuse(call, 401, "wrong_password", "password", "The old password is wrong.");
    else if (call_check(call, result, &err))
        call_done(call);
}
