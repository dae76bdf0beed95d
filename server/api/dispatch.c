#include "api/api.h"
#include "api/case_summary.h"
#include "api/forward.h"
#include "api/peer_cases.h"
#include "api/rehearsals.h"
#include "api/routes.h"
#include "api/secret.h"
#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"

#include <stdlib.h>
#include <string.h>

// ---- the first instructor -----------------------------------------------------------------------

static enum result look_for_instructor(struct api *api, struct error *err) {
    struct store *store;
    bool has = true;
    enum result result = store_open(api->config.records, STORE_MAKE, "server", &store, err);
    if (result != RESULT_OK)
        return result;
    result = store_has_instructor(store, &has, err);
    store_close(&store);
    if (has)
        return result;
    secret_make(api->first_secret);
    log_warning("api", "there is no instructor; make the first one at %s#/first/%s",
                api->config.link, api->first_secret);
    return result;
}

uint64_t api_wrong_sign_ins(const struct api *api) {
    return atomic_load(&api->wrong_sign_ins);
}

const char *api_first_secret(const struct api *api) {
    return api->first_secret;
}

// ---- begin, end ---------------------------------------------------------------------------------

enum result api_create(const struct api_config *config, struct api **out_api, struct error *err) {
    struct api *api = alloc(1, sizeof *api);
    api->config = *config;
    api->started_ns = clock_now_ns();
    api->summaries = case_summaries_create(config->cases, config->case_count, config->check_case);
    api->peer_cases = peer_cases_create(config->cases, config->case_count);
    api->forwards = config->cluster ? forwards_create(config->keys_dir) : NULL;
    api->rehearsals = rehearsals_create(&api->config, &api->throttle);
    pthread_mutex_init(&api->reports_lock, NULL);
    pthread_mutex_init(&api->throttle.lock, NULL);
    pthread_mutex_init(&api->tally.lock, NULL);
    pthread_mutex_init(&api->first_lock, NULL);
    enum result result = secret_key_load(config->keys_dir, &api->key, err);
    if (result == RESULT_OK)
        result = signer_create(config->keys_dir, &api->signer, err);
    if (result == RESULT_OK && config->sign_on)
        result = signon_create(config->sign_on, &api->signon, err);
    if (result == RESULT_OK)
        result = look_for_instructor(api, err);
    if (result != RESULT_OK)
        api_destroy(&api);
    *out_api = api;
    return result;
}

void api_break_off(struct api *api) {
    if (api->forwards)
        forwards_break_off(api->forwards);
    if (api->signon)
        signon_break_off(api->signon);
}

void api_destroy(struct api **api) {
    struct api *a = *api;
    if (!a)
        return;
    forwards_destroy(&a->forwards);
    signon_destroy(&a->signon);
    peer_cases_destroy(&a->peer_cases);
    case_summaries_destroy(&a->summaries);
    rehearsals_destroy(&a->rehearsals);
    signer_destroy(&a->signer);
    pthread_mutex_destroy(&a->reports_lock);
    pthread_mutex_destroy(&a->throttle.lock);
    pthread_mutex_destroy(&a->tally.lock);
    pthread_mutex_destroy(&a->first_lock);
    free(a);
    *api = NULL;
}

// ---- who ----------------------------------------------------------------------------------------

static enum result find_principal(struct store *store, const char *token, bool *out_is,
                                  struct store_principal *out, struct error *err) {
    char hash[SECRET_MAX];
    *out_is = false;
    if (!token)
        return RESULT_OK;
    secret_hash(token, hash);
    enum result result = store_find_token(store, hash, out, err);
    *out_is = result == RESULT_OK;
    return result == RESULT_MISSING ? RESULT_OK : result;
}

// Pages ask each second: once is enough.
static void log_failing(struct api *api, enum result result, const struct error *err) {
    bool failed = atomic_exchange(&api->failing, result != RESULT_OK);
    if (result != RESULT_OK && !failed)
        log_error("api", "accounts cannot be looked up, so open pages stay signed in: %s",
                  err->text);
    else if (result == RESULT_OK && failed)
        log_info("api", "accounts can be looked up again");
}

static void tell_account(const struct store_principal *principal, struct web_account *out) {
    snprintf(out->name, sizeof out->name, "%s", principal->name);
    snprintf(out->role, sizeof out->role, "%s", store_role_name(principal->role));
    snprintf(out->trainee, sizeof out->trainee, "%s", principal->trainee);
    out->keeps_one = principal->role == ROLE_INSTRUCTOR;
}

enum result api_enter(void *user, const char *token, struct web_account *out) {
    struct api *api = user;
    struct store_principal principal;
    struct store *store;
    struct error err = {""};
    bool is = false;
    enum result result = store_open(api->config.records, STORE_MAKE, "server", &store, &err);
    if (result == RESULT_OK)
        result = find_principal(store, token, &is, &principal, &err);
    store_close(&store);
    log_failing(api, result, &err);
    if (result != RESULT_OK)
        return result == RESULT_MISSING ? RESULT_IO : result;
    if (!is)
        return RESULT_MISSING;
    tell_account(&principal, out);
    return RESULT_OK;
}

static bool is_server(const struct api_call *call) {
    const struct api_cluster *cluster = call->api->config.cluster;
    struct cluster_peer self;
    if (!cluster || !call->request->token)
        return false;
    cluster->self(cluster->user, &self);
    return secret_is(self.secret, call->request->token);
}

// Whether the principal may use the route; else refuses the request.
static bool authorize(struct api_call *call, const struct route *route) {
    struct error err = {""};
    enum result result = find_principal(call->store, call->request->token, &call->is_signed_in,
                                        &call->principal, &err);
    if (!call_check(call, result, &err))
        return false;
    if (call->is_signed_in) {
        store_set_actor(call->store, call->principal.actor);
        tell_account(&call->principal, &call->response->account);
    }
    if (route->roles & SERVER && is_server(call))
        return true;
    if (route->roles & NOBODY || (call->is_signed_in && route->roles & 1 << call->principal.role))
        return true;
    if (call->is_signed_in)
        call_refuse(call, 403, "not_allowed", NULL, "A %s may not do that.",
                    store_role_name(call->principal.role));
    else
        call_refuse(call, 401, "not_signed_in", NULL, "Sign in first.");
    return false;
}

bool api_is_slow(const char *method, const char *path) {
    char args[2][STORE_NAME_MAX];
    bool there;
    const struct route *route = routes_find(method, path, args, &there);
    return route && route->slow;
}

void api_answer(void *user, const struct web_request *request, struct web_response *response) {
    struct api_call call = {.api = user, .request = request, .response = response};
    bool there;
    const struct route *route = routes_find(request->method, request->path, call.args, &there);
    if (!route && there)
        call_refuse(&call, 405, "wrong_method", NULL, "This path does not support %.16s.",
                    request->method);
    else if (!route)
        call_refuse(&call, 404, "not_found", NULL, "There is nothing at this path.");
    else if (route->roles & ALWAYS)
        route->answer(&call);
    else if (call_open_store(&call) && authorize(&call, route) && !forward_takes(&call, route))
        route->answer(&call);
    call_close_store(&call);
    json_decref(call.body);
}
