// Sign-on at a provider: a browser leaves with a cookie, and comes back with a code. Of the
// cookie's random number the server's key makes all that binds the two, so that any server with
// this key can take the browser back.
#include "api/routes.h"
#include "api/sign_in.h"
#include "api/tries.h"
#include "base/chance.h"
#include "base/check.h"
#include "base/clock.h"
#include "base/log.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define SIGN_ON_S 600
#define SKEW_S 60   // between the clocks of servers that share a key
#define HEAD_MAX 49 // digits: when the browser left, and a random number
#define CODE_MAX 2048
#define COOKIE "arthron-sign-on=%s; Path=/api/v1/sign-on; Max-Age=%d; HttpOnly; SameSite=Lax"

_Static_assert(SIGNON_SECRET_MAX == SECRET_MAX, "a keyed hash is a state, a nonce and a verifier");

static const struct throttle_rule once = {1, SIGN_ON_S, SIGN_ON_S};

// What later answers, on a thread that may wait for the provider.
struct sign_on {
    struct api *api;
    char address[48], redirect[WEB_HOST_MAX + 32];
    char head[HEAD_MAX];
    struct signon_secrets secrets;
    struct tries tries;
    char code[CODE_MAX];
};

// ---- what binds a browser -----------------------------------------------------------------------

static void make_head(int64_t now_utc_ns, char out[HEAD_MAX]) {
    uint64_t number[2];
    chance_fill(number, sizeof number);
    snprintf(out, HEAD_MAX, "%016" PRIx64 "%016" PRIx64 "%016" PRIx64, (uint64_t)now_utc_ns,
             number[0], number[1]);
}

static void make_secrets(const struct secret_key *key, const char *head,
                         struct signon_secrets *out) {
    secret_keyed_hash(key, "sign-on state", head, out->state);
    secret_keyed_hash(key, "sign-on nonce", head, out->nonce);
    secret_keyed_hash(key, "sign-on verifier", head, out->verifier);
}

static bool is_recent(const char *head, int64_t now_utc_ns) {
    uint64_t left_utc_ns;
    if (sscanf(head, "%16" SCNx64, &left_utc_ns) != 1)
        return false;
    int64_t age_ns = now_utc_ns - (int64_t)left_utc_ns;
    return age_ns > -SKEW_S * NS_PER_S && age_ns < SIGN_ON_S * NS_PER_S;
}

// Whether the query is of this browser's own sign-on, for the first time.
static bool began_here(const struct api_call *call, struct sign_on *s) {
    char state[SIGNON_SECRET_MAX];
    int wait_s;
    const char *head = call->request->sign_on;
    if (!head || strlen(head) != HEAD_MAX - 1)
        return false;
    memcpy(s->head, head, HEAD_MAX);
    make_secrets(&s->api->key, head, &s->secrets);
    return call_find_parameter(call, "state", state, sizeof state) &&
           secret_is(s->secrets.state, state) && is_recent(head, clock_utc_ns()) &&
           throttle_try(&s->api->throttle, head, &once, clock_now_ns(), &wait_s);
}

// ---- where the browser goes ---------------------------------------------------------------------

__attribute__((format(printf, 2, 3))) static void send_to(struct web_response *response,
                                                          const char *format, ...) {
    va_list args;
    va_start(args, format);
    int length = vsnprintf(response->location, sizeof response->location, format, args);
    va_end(args);
    CHECK(length < (int)sizeof response->location);
    free(response->body); // of a refusal
    response->body = NULL;
    response->size = 0;
    response->status = 303;
}

// Back to the pages with a word that they explain. The cookie has served.
static void send_back(struct web_response *response, const char *why) {
    snprintf(response->second_cookie, sizeof response->second_cookie, COOKIE, "", 0);
    send_to(response, "/#/sign-in?sign-on=%s", why);
}

// Each fault is told at its first, second, fourth ... time within an hour.
static void tell(struct sign_on *s, const char *text) {
    if (tally_is_told(tally_add(&s->api->tally, text, clock_now_ns())))
        log_warning("api", "a sign-on from %s failed: %s", s->address, text);
}

// The fault is on the provider's side, or this server ends.
static void send_away(struct sign_on *s, enum result result, const struct error *err,
                      struct web_response *response) {
    if (result != RESULT_CLOSED)
        tell(s, err->text);
    send_back(response, "away");
}

// The fault is on the browser's side. The try stays counted.
static void refuse_sign_on(struct api_call *call, struct sign_on *s, const char *why,
                           const char *subject, const char *text) {
    tell(s, text);
    if (call->store || call_open_store(call))
        tries_note_wrong(call, "wrong sign-on", subject);
    send_back(call->response, why);
}

// ---- away ---------------------------------------------------------------------------------------

static struct sign_on *begin_sign_on(const struct api_call *call) {
    struct sign_on *s = alloc(1, sizeof *s);
    s->api = call->api;
    snprintf(s->address, sizeof s->address, "%s", call->request->address);
    snprintf(s->redirect, sizeof s->redirect, "https://%s/api/v1/sign-on/back",
             call->request->host);
    return s;
}

static bool has_provider(struct api_call *call) {
    if (!call->api->signon)
        call_refuse(call, 404, "not_found", NULL, "This server has no sign-on.");
    return call->api->signon;
}

void get_sign_on(struct api_call *call) {
    const struct signon *signon = call->api->signon;
    call_answer(
        call, 200,
        json_pack("{s:o}", "name", signon ? call_string(signon_name(signon)) : json_null()));
}

static void leave_to_provider(struct sign_on *s, struct web_response *out) {
    char url[SIGNON_URL_MAX];
    struct error err;
    if (!signon_take_place(s->api->signon)) {
        send_back(out, "busy");
        return;
    }
    enum result result = signon_begin(s->api->signon, &s->secrets, s->redirect, url, &err);
    signon_leave_place(s->api->signon);
    if (result != RESULT_OK) {
        send_away(s, result, &err, out);
        return;
    }
    snprintf(out->cookie, sizeof out->cookie, COOKIE, s->head, SIGN_ON_S);
    send_to(out, "%s", url);
}

static void leave_later(void *data, struct web_response *out) {
    if (out)
        leave_to_provider(data, out);
    free(data);
}

void get_sign_on_start(struct api_call *call) {
    if (!has_provider(call))
        return;
    struct sign_on *s = begin_sign_on(call);
    make_head(clock_utc_ns(), s->head);
    make_secrets(&s->api->key, s->head, &s->secrets);
    call->response->later = leave_later;
    call->response->later_data = s;
}

// ---- back ---------------------------------------------------------------------------------------

static void note_sign_on(struct api_call *call) {
    char subject[STORE_NAME_MAX];
    struct error err;
    snprintf(subject, sizeof subject, "account %lld", (long long)call->principal.number);
    if (store_note(call->store, "sign on", subject, &err) != RESULT_OK)
        log_error("api", "the sign-on of %s is not in the audit log: %s", subject, err.text);
}

// With the store open. RESULT_MISSING: there is no such account that may sign in, or somebody has
// signed it out meanwhile.
static enum result enter_as(struct api_call *call, const char *name) {
    struct error err = {""};
    enum result result = store_find_account(call->store, name, &call->principal, &err);
    if (result == RESULT_MISSING || !call_check(call, result, &err))
        return result;
    if (!call->principal.password[0])
        return RESULT_MISSING;
    if (!tries_may_enter(call, call->principal.actor))
        return RESULT_LIMIT;
    return sign_in_set_cookie(call);
}

static void come_in(struct api_call *call, struct sign_on *s, const char *name) {
    if (!call_is_name(name)) {
        refuse_sign_on(call, s, "refused", "a name",
                       "the provider's name is no name of an account");
        return;
    }
    enum result result = call_open_store(call) ? enter_as(call, name) : RESULT_IO;
    if (result == RESULT_MISSING) {
        refuse_sign_on(call, s, "unknown", "no account",
                       "the provider names somebody who has no account here");
        return;
    }
    tries_was_right(call, &s->tries);
    if (result == RESULT_OK)
        note_sign_on(call);
    send_back(call->response, result == RESULT_LIMIT ? "too-many" : "failed");
    if (result == RESULT_OK)
        send_to(call->response, "/#/signed-on");
}

static void come_back(struct sign_on *s, struct web_response *out) {
    char name[STORE_NAME_MAX];
    struct error err;
    const struct web_request request = {.address = s->address, .query = ""};
    struct api_call call = {.api = s->api, .request = &request, .response = out};
    if (!signon_take_place(s->api->signon)) {
        tries_was_right(&call, &s->tries);
        send_back(out, "busy");
        return;
    }
    enum result result =
        signon_end(s->api->signon, &s->secrets, s->redirect, s->code, name, sizeof name, &err);
    signon_leave_place(s->api->signon);
    if (result == RESULT_OK) {
        come_in(&call, s, name);
    } else if (result == RESULT_REFUSED) {
        refuse_sign_on(&call, s, "refused", "a code", err.text);
    } else {
        tries_was_right(&call, &s->tries);
        send_away(s, result, &err, out);
    }
    call_close_store(&call);
}

static void come_back_later(void *data, struct web_response *out) {
    if (out)
        come_back(data, out);
    explicit_bzero(data, sizeof(struct sign_on));
    free(data);
}

// What the provider says instead of a code (RFC 6749, 4.1.2.1).
static void refuse_error(struct api_call *call, struct sign_on *s) {
    char word[SIGNON_WORD_MAX], text[SIGNON_WORD_MAX + 48];
    bool is_told = call_find_parameter(call, "error", word, sizeof word) && signon_is_word(word);
    snprintf(text, sizeof text, "the provider gives no code: %s", is_told ? word : "no reason");
    if (!is_told || strcmp(word, "access_denied") != 0) {
        refuse_sign_on(call, s, "refused", "no code", text);
        return;
    }
    tries_was_right(call, &s->tries);
    send_back(call->response, "cancelled");
}

// False: the browser has its answer. What it brings counts as a try only where it has left from
// here: else any page could use up the tries of its address.
static bool may_ask(struct api_call *call, struct sign_on *s) {
    if (!began_here(call, s)) {
        tell(s, "the browser brings no cookie that fits, or one that has served");
        send_back(call->response, "again");
        return false;
    }
    if (!tries_begin(call, NULL, &s->tries)) {
        send_back(call->response, "too-many");
        return false;
    }
    if (call_find_parameter(call, "code", s->code, sizeof s->code))
        return true;
    refuse_error(call, s);
    return false;
}

void get_sign_on_back(struct api_call *call) {
    if (!has_provider(call))
        return;
    struct sign_on *s = begin_sign_on(call);
    if (may_ask(call, s)) {
        call->response->later = come_back_later;
        call->response->later_data = s;
    } else {
        free(s);
    }
}
