// Reads an ID token that came from the provider's token endpoint over TLS. That connection stands
// for the token's signature (OpenID Connect Core, 3.1.3.7, 6), so one from elsewhere must not come
// here.
#pragma once

#include "base/result.h"

#include <stdint.h>

struct id_token_wanted {
    const char *issuer, *client_id, *nonce;
    const char *claim; // whose text is the name
};

// RESULT_FORMAT: it is no ID token. RESULT_REFUSED: it is another's, has ended, or has no such
// claim. size: of out_name; what is longer is refused.
enum result id_token_read(const char *token, const struct id_token_wanted *wanted, int64_t now_s,
                          char *out_name, size_t size, struct error *err);
