#include "signon/signon.h"

#include "base/check.h"
#include "base/clock.h"
#include "base/password_file.h"
#include "signon/base64url.h"
#include "signon/id_token.h"
#include "signon/provider.h"

#include <curl/curl.h>
#include <errno.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define PLACES 4
#define CLIENT_SECRET_MAX 256

static const char of_client[] = "the client of the sign-on"; // the secret

struct signon {
    struct signon_settings settings;
    struct provider *provider;
    atomic_int taken; // places
};

// ---- life ---------------------------------------------------------------------------------------

static enum result read_secret(const struct signon_settings *settings, char out[CLIENT_SECRET_MAX],
                               struct error *err) {
    out[0] = '\0';
    if (!settings->client_secret[0])
        return RESULT_OK;
    enum result result =
        password_file_read(settings->client_secret, of_client, out, CLIENT_SECRET_MAX, err);
    if (result == RESULT_OK && (!out[0] || strlen(out) == CLIENT_SECRET_MAX - 1))
        result = fail(err, RESULT_FORMAT, "%s: the first line must have 1 to %d bytes",
                      settings->client_secret, CLIENT_SECRET_MAX - 2);
    return result;
}

static enum result check_settings(const struct signon_settings *settings, struct error *err) {
    char secret[CLIENT_SECRET_MAX];
    if (!provider_is_url(settings->issuer) || strchr(settings->issuer, '?'))
        return fail(err, RESULT_INVALID,
                    "[sign_on] issuer = %s: not an address like https://sso.example.org",
                    settings->issuer);
    if (settings->authority[0] && access(settings->authority, R_OK) != 0)
        return fail(err, RESULT_MISSING, "[sign_on] authority = %s: %s", settings->authority,
                    strerror(errno));
    enum result result = read_secret(settings, secret, err);
    explicit_bzero(secret, sizeof secret);
    return result == RESULT_OK ? result : fail_in(err, result, "[sign_on] ");
}

enum result signon_create(const struct signon_settings *settings, struct signon **out,
                          struct error *err) {
    enum result result = check_settings(settings, err);
    *out = NULL;
    if (result != RESULT_OK)
        return result;
    struct signon *s = *out = alloc(1, sizeof *s);
    s->settings = *settings;
    s->provider = provider_create(&s->settings);
    return RESULT_OK;
}

void signon_break_off(struct signon *s) {
    provider_break_off(s->provider);
}

void signon_destroy(struct signon **signon) {
    if (*signon)
        provider_destroy(&(*signon)->provider);
    free(*signon);
    *signon = NULL;
}

const char *signon_name(const struct signon *s) {
    return s->settings.name;
}

bool signon_take_place(struct signon *s) {
    if (atomic_fetch_add(&s->taken, 1) < PLACES)
        return true;
    signon_leave_place(s);
    return false;
}

void signon_leave_place(struct signon *s) {
    atomic_fetch_sub(&s->taken, 1);
}

bool signon_is_word(const char *text) {
    size_t length = strlen(text);
    return length > 0 && length < SIGNON_WORD_MAX &&
           strspn(text, "abcdefghijklmnopqrstuvwxyz_") == length;
}

// ---- forms --------------------------------------------------------------------------------------

static void put(FILE *form, const char *before, const char *name, const char *value) {
    char *escaped = curl_easy_escape(NULL, value, 0);
    NEED(escaped, "memory");
    fprintf(form, "%s%s=%s", before, name, escaped);
    explicit_bzero(escaped, strlen(escaped));
    curl_free(escaped);
}

enum result signon_begin(struct signon *s, const struct signon_secrets *secrets,
                         const char *redirect, char out_url[SIGNON_URL_MAX], struct error *err) {
    struct provider_places places;
    char challenge[BASE64URL_SHA256_MAX];
    enum result result = provider_places(s->provider, &places, err);
    if (result != RESULT_OK)
        return result;
    base64url_of_sha256(secrets->verifier, challenge);
    FILE *url = fmemopen(out_url, SIGNON_URL_MAX, "w");
    NEED(url, "memory");
    fputs(places.authorization, url);
    put(url, strchr(places.authorization, '?') ? "&" : "?", "response_type", "code");
    put(url, "&", "client_id", s->settings.client_id);
    put(url, "&", "redirect_uri", redirect);
    put(url, "&", "scope", "openid profile email");
    put(url, "&", "prompt", "login"); // the one before may not have signed out there
    put(url, "&", "state", secrets->state);
    put(url, "&", "nonce", secrets->nonce);
    put(url, "&", "code_challenge", challenge);
    put(url, "&", "code_challenge_method", "S256");
    bool whole = !fflush(url) && ftell(url) < SIGNON_URL_MAX;
    if (fclose(url) || !whole)
        return fail(err, RESULT_LIMIT, "%s: with what is asked the address is too long",
                    places.authorization);
    return RESULT_OK;
}

// ---- the code -----------------------------------------------------------------------------------

// RFC 6749, 2.3.1: both parts of Basic authentication are escaped, too.
static enum result post(struct signon *s, const struct provider_places *places, const char *form,
                        const char *secret, json_t **out, struct error *err) {
    char *user = curl_easy_escape(NULL, s->settings.client_id, 0);
    char *password = curl_easy_escape(NULL, secret, 0);
    NEED(user && password, "memory");
    bool by_basic = secret[0] && !places->by_post;
    enum result result = provider_post(s->provider, places->token, form, by_basic ? user : NULL,
                                       by_basic ? password : NULL, out, err);
    explicit_bzero(password, strlen(password));
    curl_free(password);
    curl_free(user);
    return result;
}

static enum result exchange(struct signon *s, const struct provider_places *places,
                            const struct signon_secrets *secrets, const char *redirect,
                            const char *code, json_t **out, struct error *err) {
    char secret[CLIENT_SECRET_MAX], *text = NULL;
    size_t size = 0;
    enum result result = read_secret(&s->settings, secret, err);
    if (result != RESULT_OK)
        return result;
    FILE *form = open_memstream(&text, &size);
    NEED(form, "memory");
    put(form, "", "grant_type", "authorization_code");
    put(form, "&", "code", code);
    put(form, "&", "redirect_uri", redirect);
    put(form, "&", "code_verifier", secrets->verifier);
    if (!secret[0] || places->by_post)
        put(form, "&", "client_id", s->settings.client_id);
    if (secret[0] && places->by_post)
        put(form, "&", "client_secret", secret);
    fclose(form);
    result = post(s, places, text, secret, out, err);
    explicit_bzero(text, size);
    explicit_bzero(secret, sizeof secret);
    free(text);
    return result;
}

enum result signon_end(struct signon *s, const struct signon_secrets *secrets, const char *redirect,
                       const char *code, char *out_name, size_t size, struct error *err) {
    struct provider_places places;
    json_t *answer;
    const struct id_token_wanted wanted = {s->settings.issuer, s->settings.client_id,
                                           secrets->nonce, s->settings.claim};
    enum result result = provider_places(s->provider, &places, err);
    if (result == RESULT_OK)
        result = exchange(s, &places, secrets, redirect, code, &answer, err);
    if (result != RESULT_OK)
        return result;
    const char *token = json_string_value(json_object_get(answer, "id_token"));
    result = token ? id_token_read(token, &wanted, clock_utc_ns() / NS_PER_S, out_name, size, err)
                   : fail(err, RESULT_FORMAT, "its answer has no ID token");
    json_decref(answer);
    return result == RESULT_OK ? result : fail_in(err, result, "%s: ", places.token);
}
