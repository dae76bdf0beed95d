// What a station trusts a server by: a certificate of the authority it knows, for the host it
// called, over TLS 1.3.
#pragma once

#include "base/result.h"
#include "wire/code.h"

#include <stdatomic.h>
#include <stdbool.h>

struct trust {
    struct ssl_ctx_st *context;
    const struct code *code; // while enrolling: its fingerprint names the authority
    const char *host;        // the caller's
    char problem[256];       // what is wrong with the server's certificate, empty: nothing
    bool clock_is_wrong;     // by our clock it is not valid yet, or no more
    atomic_int_fast64_t server_until_s; // when it ends, seconds since 1970; 0: none was good yet
};

// For a station with a certificate. RESULT_MISSING or RESULT_FORMAT name the file in keys_dir.
// `trust` must stay where it is until trust_fini.
enum result trust_init(struct trust *trust, const char *keys_dir, struct error *err);

// For a station that has none yet.
void trust_init_code(struct trust *trust, const struct code *code);

// Connections to come are to this host, which must stay where it is; before the first one, too.
// RESULT_INVALID: it can be none.
enum result trust_expect(struct trust *trust, const char *host, struct error *err);

// Whether the files in keys_dir can be used; RESULT_MISSING or RESULT_FORMAT name the one at fault.
enum result trust_check(const char *keys_dir, struct error *err);

// Connections to come use the files as they are now. Where these cannot be used all stays as it is.
enum result trust_renew(struct trust *trust, const char *keys_dir, struct error *err);

void trust_fini(struct trust *trust);
