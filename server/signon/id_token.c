#include "signon/id_token.h"

#include "signon/base64url.h"

#include <jansson.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define SKEW_S 60 // between the provider's clock and this one
#define AGE_S 600 // it was made for a sign-on that began so long ago at most

// HEADER.PAYLOAD.SIGNATURE. NULL: it is something else.
static json_t *payload_of(const char *token) {
    const char *first = strchr(token, '.'), *second = first ? strchr(first + 1, '.') : NULL;
    size_t size;
    if (!second || strchr(second + 1, '.'))
        return NULL;
    char *text = base64url_decode(first + 1, (size_t)(second - first - 1), &size);
    json_t *payload = text ? json_loadb(text, size, JSON_REJECT_DUPLICATES, NULL) : NULL;
    free(text);
    return payload;
}

static bool is_text(const json_t *value, const char *text) {
    return json_is_string(value) && !strcmp(json_string_value(value), text);
}

// For this client alone: no other one is trusted with what is for it.
static bool is_for(const json_t *payload, const char *client_id) {
    const json_t *aud = json_object_get(payload, "aud"), *azp = json_object_get(payload, "azp");
    const json_t *only = json_array_size(aud) == 1 ? json_array_get(aud, 0) : aud;
    return is_text(only, client_id) && (!azp || is_text(azp, client_id));
}

static bool is_timely(const json_t *payload, int64_t now_s) {
    const json_t *exp = json_object_get(payload, "exp"), *iat = json_object_get(payload, "iat");
    double now = (double)now_s, made_s = json_number_value(iat);
    return json_is_number(exp) && json_is_number(iat) && json_number_value(exp) > now - SKEW_S &&
           made_s < now + SKEW_S && made_s > now - AGE_S - SKEW_S;
}

// An address that the provider has not verified may be anybody's.
static bool is_verified(const json_t *payload, const char *claim) {
    return strcmp(claim, "email") != 0 || json_is_true(json_object_get(payload, "email_verified"));
}

static enum result check_claims(const json_t *payload, const struct id_token_wanted *wanted,
                                int64_t now_s, struct error *err) {
    const char *wrong = !is_text(json_object_get(payload, "iss"), wanted->issuer) ? "issuer (iss)"
                        : !is_for(payload, wanted->client_id) ? "client (aud, azp)"
                        : !is_timely(payload, now_s)          ? "time (exp, iat)"
                        : !is_text(json_object_get(payload, "nonce"), wanted->nonce)
                            ? "sign-on (nonce)"
                            : NULL;
    if (wrong)
        return fail(err, RESULT_REFUSED, "the ID token is of another %s", wrong);
    return RESULT_OK;
}

static enum result take_name(const json_t *payload, const char *claim, char *out, size_t size,
                             struct error *err) {
    const char *name = json_string_value(json_object_get(payload, claim));
    if (!is_verified(payload, claim))
        return fail(err, RESULT_REFUSED, "the ID token's email is not verified");
    if (!name || strlen(name) >= size)
        return fail(err, RESULT_REFUSED, "the ID token has no %s of 1 to %zu bytes", claim,
                    size - 1);
    snprintf(out, size, "%s", name);
    return RESULT_OK;
}

enum result id_token_read(const char *token, const struct id_token_wanted *wanted, int64_t now_s,
                          char *out_name, size_t size, struct error *err) {
    json_t *payload = payload_of(token);
    enum result result = json_is_object(payload)
                             ? check_claims(payload, wanted, now_s, err)
                             : fail(err, RESULT_FORMAT, "the ID token cannot be read");
    if (result == RESULT_OK)
        result = take_name(payload, wanted->claim, out_name, size, err);
    json_decref(payload);
    return result;
}
