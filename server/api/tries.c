#include "api/tries.h"

#include "api/device.h"
#include "base/clock.h"
#include "base/log.h"

#include <stdio.h>
#include <string.h>

static const struct throttle_rule of_device = {5, 5, 300};
static const struct throttle_rule of_pair = {5, 5, 300};   // address and name
static const struct throttle_rule of_name = {30, 2, 60};   // from all addresses
static const struct throttle_rule of_address = {60, 1, 2}; // for all names
static const struct throttle_rule of_codes = {60, 1, 2};   // from one address; 40 bits each
static const struct throttle_rule of_entries = {30, 1, 60};

static bool too_many(struct api_call *call, int wait_s) {
    char what[80];
    snprintf(what, sizeof what, "refused %.60s", call->request->address);
    int count = tally_add(&call->api->tally, what, clock_now_ns());
    if (tally_is_told(count))
        log_warning("api", "too many sign-ins from %s (%d refused within an hour)",
                    call->request->address, count);
    call_refuse(call, 429, "too_many", NULL, "Too many attempts; wait %d s.", wait_s);
    call->response->retry_after_s = wait_s;
    return false;
}

__attribute__((format(printf, 3, 4))) static void
add_key(struct tries *tries, const struct throttle_rule *rule, const char *format, ...) {
    va_list args;
    va_start(args, format);
    vsnprintf(tries->keys[tries->count], sizeof tries->keys[0], format, args);
    va_end(args);
    tries->rules[tries->count++] = rule;
}

// A cookie by which the account is signed in proves as much as a device cookie.
static bool is_known(struct api_call *call, const char *name, char out_id[24]) {
    if (name && call->is_signed_in && call->principal.by_account &&
        !strcmp(call->principal.name, name)) {
        snprintf(out_id, 24, "%lld", (long long)call->principal.token);
        return true;
    }
    return device_is_known(&call->api->key, call->request->device, name ? name : "", clock_utc_ns(),
                           out_id);
}

static void choose_keys(struct api_call *call, const char *name, struct tries *out) {
    char address[64], id[24];
    throttle_address(call->request->address, call->request->is_near, address);
    *out = (struct tries){0};
    if (is_known(call, name, id)) {
        add_key(out, &of_device, "device %s %s", id, name ? name : "");
    } else if (name) {
        add_key(out, &of_pair, "%s name %.*s", address, STORE_NAME_MAX, name);
        add_key(out, &of_name, "name %.*s", STORE_NAME_MAX, name);
        add_key(out, &of_address, "%s", address);
    } else {
        add_key(out, &of_codes, "%s code", address);
    }
}

bool tries_begin(struct api_call *call, const char *name, struct tries *out) {
    struct throttle *throttle = &call->api->throttle;
    int64_t now_ns = clock_now_ns();
    int wait_s;
    choose_keys(call, name, out);
    out->begun_ns = now_ns;
    for (int i = 0; i < out->count; i++) {
        if (throttle_try(throttle, out->keys[i], out->rules[i], now_ns, &wait_s))
            continue;
        while (i-- > 0)
            throttle_take_back(throttle, out->keys[i], now_ns);
        return too_many(call, wait_s);
    }
    return true;
}

void tries_was_right(struct api_call *call, const struct tries *tries) {
    for (int i = 0; i < tries->count; i++)
        throttle_take_back(&call->api->throttle, tries->keys[i], tries->begun_ns);
}

bool tries_may_enter(struct api_call *call, const char *actor) {
    char key[STORE_NAME_MAX + 8];
    int wait_s;
    snprintf(key, sizeof key, "enter %s", actor);
    return throttle_may(&call->api->throttle, key, &of_entries, clock_now_ns(), &wait_s) ||
           too_many(call, wait_s);
}

void tries_entered(struct api_call *call, const char *actor) {
    char key[STORE_NAME_MAX + 8];
    int wait_s;
    snprintf(key, sizeof key, "enter %s", actor);
    throttle_try(&call->api->throttle, key, &of_entries, clock_now_ns(), &wait_s);
}

void tries_note_wrong(struct api_call *call, const char *action, const char *subject) {
    char text[STORE_TEXT_MAX];
    struct error err;
    atomic_fetch_add(&call->api->wrong_sign_ins, 1);
    snprintf(text, sizeof text, "%s of %s", action, subject);
    int count = tally_add(&call->api->tally, text, clock_now_ns());
    if (!tally_is_told(count))
        return;
    store_set_actor(call->store, "server"); // nobody has proved who they are
    snprintf(text, sizeof text, count > 1 ? "%s, %d within an hour" : "%s", subject, count);
    if (store_note(call->store, action, text, &err) != RESULT_OK)
        log_error("api", "%s of %s is not in the audit log: %s", action, text, err.text);
}

void api_note_reading(struct api *api, const char *actor, const char *session) {
    char subject[STORE_TEXT_MAX];
    struct store *store;
    struct error err;
    snprintf(subject, sizeof subject, "%s reads %s", actor, session);
    if (tally_add(&api->tally, subject, clock_now_ns()) > 1)
        return;
    snprintf(subject, sizeof subject, "session %s", session);
    enum result result = store_open(api->config.records, STORE_THERE, actor, &store, &err);
    if (result == RESULT_OK)
        result = store_note(store, "read", subject, &err);
    store_close(&store);
    if (result != RESULT_OK)
        log_error("api", "that %s reads %s is not in the audit log: %s", actor, subject, err.text);
}
