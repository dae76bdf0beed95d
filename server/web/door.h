// Which hosts this server is, and which pages may speak to it. A page of another site reaches the
// server too, through its visitor's browser, with the visitor's cookie (RFC 6265, 8.8): so what
// changes something must come from a page of the very host that was called, and that host must be
// one of ours, not a stranger's name that points here.
#pragma once

#include "base/result.h"

#include <stdbool.h>
#include <stddef.h>

#define DOOR_TOKEN_MAX 128

struct door;

// names: what the server is called besides, NULL behind the last. RESULT_MISSING or RESULT_FORMAT
// name the certificate's file.
enum result door_create(const char *certificate_path, const char *const *names,
                        struct door **out_door, struct error *err);
void door_renew(struct door *door); // its certificate's file is another one; where it can be read
void door_destroy(struct door **door); // NULL inside is fine; *door becomes NULL

// host: as in the header of that name, with or without a port.
bool door_is_own_host(const struct door *door, const char *host);

// What browsers reach it as: `name` where it is its own, else the first name of its certificate,
// else localhost. size: of out_name, above 0.
void door_reached_as(const struct door *door, const char *name, char *out_name, size_t size);

// Whether `origin` is the page that the host itself serves.
bool door_is_origin_of(const char *origin, const char *host);

// The value of the cookie, or of `Bearer`; false where there is none, or it cannot be a token.
bool door_token_of_cookies(const char *cookies, char out_token[DOOR_TOKEN_MAX]);
bool door_token_of_authorization(const char *authorization, char out_token[DOOR_TOKEN_MAX]);
