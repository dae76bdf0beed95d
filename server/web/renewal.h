// The server's certificate and key, which somebody may replace while it runs (certbot does each
// other month). It belongs to the web thread.
#pragma once

#include "base/result.h"

#include <libwebsockets.h>
#include <stdbool.h>

struct renewal;

// Of files that can be used: RESULT_MISSING or RESULT_FORMAT name the one at fault.
enum result renewal_create(const char *certificate, const char *key, struct renewal **out_renewal,
                           struct error *err);
void renewal_destroy(struct renewal **renewal); // NULL inside is fine

// Where the files are others than before, and fit each other: connections to come get them, and
// true. Else the old ones stay; what is wrong with new ones is logged once.
bool renewal_check(struct renewal *renewal, struct lws_context *context);
