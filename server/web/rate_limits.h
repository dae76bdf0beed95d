// Limits of each address: connections, and requests over time. For one thread.
#pragma once

#include "base/bucket.h"
#include "base/source.h"

#define WEB_CONNECTIONS_MAX 384
#define WEB_CONNECTIONS_PER_ADDRESS 256 // of them; a hall may have one, and a browser takes six
#define WEB_CONNECTIONS_PER_ACCOUNT 96  // of them, but for one that keeps_one
#define WEB_CONNECTIONS_OF_BROWSER 6    // that an account has even where there are few places
#define WEB_REQUESTS_PER_S 40           // of an account, and of whoever has none at an address
#define WEB_REQUESTS_BURST 200

struct rate_limits;

struct rate_limit { // of an IPv4 address, or an IPv6 network of 64 bits
    bool known;
    struct source source;
    int connections, strangers; // that stay; strangers: those of nobody who is known
    int ends;                   // all that have not ended
    struct bucket requests;     // without a token
    struct bucket proofs;       // with a token that is not known yet
    int64_t left_ns;
};

struct rate_limits *rate_limits_create(void);
void rate_limits_destroy(struct rate_limits **limits); // *limits becomes NULL

// The limit of the address at the other end of a socket. NULL if it has disconnected.
struct rate_limit *rate_limits_find(struct rate_limits *limits, int fd);

// has_token: with one that nobody is known to have.
bool rate_limit_may_request(struct rate_limit *limit, bool has_token, int64_t now_ns);
