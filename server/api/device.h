// The device cookie: where somebody has signed in, the browser can prove so for 90 days. It signs
// nobody in. Who guesses elsewhere does not keep this browser out.
#pragma once

#include "api/secret.h"

#define DEVICE_ID_MAX 17
#define DEVICE_MAX 97 // the cookie's value
#define DEVICE_S (90 * 24 * 3600)

// who: the account's name, or "" for a code.
void device_make(const struct secret_key *key, const char *who, int64_t now_utc_ns,
                 char out_device[DEVICE_MAX]);

// Whether `device` is a cookie of this server for this person (NULL: there is none). *out_id tells
// it from others.
bool device_is_known(const struct secret_key *key, const char *device, const char *who,
                     int64_t now_utc_ns, char out_id[DEVICE_ID_MAX]);
