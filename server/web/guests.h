// Who is signed in, as far as the handler's answers have told: requests and connections count for
// an account, wherever it is. For one thread.
#pragma once

#include "base/bucket.h"
#include "web/web.h"

struct guests;

struct guest { // an account
    struct web_account account;
    struct bucket requests;
    int connections; // that stay; while it has one, the guest does not become another one
};

struct guests *guests_create(void);
void guests_destroy(struct guests **guests); // *guests becomes NULL

// Whose token it is, as far as it is known. NULL: it may be anybody's, or nobody's.
struct guest *guests_find(struct guests *guests, const char *token, int64_t now_ns);

// The handler says that the token is this account's; or that it is nobody's.
struct guest *guests_enter(struct guests *guests, const char *token,
                           const struct web_account *account, int64_t now_ns);
void guests_forget(struct guests *guests, const char *token);

bool guest_may_request(struct guest *guest, int64_t now_ns);
