// Asks the provider of a sign-on, over HTTPS alone: what it says of itself, and tokens. Whatever it
// does, a request ends after 10 s and reads 64 KiB at most. No redirect is followed.
#pragma once

#include "base/result.h"
#include "signon/settings.h"

#include <jansson.h>
#include <stdbool.h>

#define PROVIDER_URL_MAX 512

struct provider;

// settings: as long as the provider lives.
struct provider *provider_create(const struct signon_settings *settings);
// Ends what is being asked, and refuses all that is asked from now on: RESULT_CLOSED.
void provider_break_off(struct provider *provider);
void provider_destroy(struct provider **provider); // NULL inside is fine

// An address by HTTPS that can stand in a header.
bool provider_is_url(const char *text);

struct provider_places {
    char authorization[PROVIDER_URL_MAX], token[PROVIDER_URL_MAX];
    bool by_post; // it takes the secret in the body alone
};

// From its discovery document, or as it was within the last hour. From any thread.
enum result provider_places(struct provider *provider, struct provider_places *out_places,
                            struct error *err);

// Posts a form. user: of Basic authentication; NULL: none. RESULT_REFUSED: its answer says no. The
// caller releases the answer, an object.
enum result provider_post(struct provider *provider, const char *url, const char *form,
                          const char *user, const char *password, json_t **out_answer,
                          struct error *err);
