// Limits of each address: connections, and requests over time. For one thread.
#pragma once

#include "base/bucket.h"

#define WEB_CONNECTIONS_MAX 384
#define WEB_CONNECTIONS_PER_ADDRESS 256 // a hall may have one, and a browser takes six
#define WEB_REQUESTS_PER_S 40
#define WEB_REQUESTS_BURST 200

struct rate_limits;
struct rate_limit; // an IPv4 address, or an IPv6 network of 64 bits

struct rate_limits *rate_limits_create(void);
void rate_limits_destroy(struct rate_limits **limits); // *limits becomes NULL

// The limit of the address at the other end of a socket. NULL if it has disconnected.
struct rate_limit *rate_limits_find(struct rate_limits *limits, int fd);

// False if this address, or all together, have as many connections as allowed.
bool rate_limit_may_connect(const struct rate_limits *limits, const struct rate_limit *limit);
void rate_limit_connected(struct rate_limits *limits, struct rate_limit *limit);
void rate_limit_disconnected(struct rate_limits *limits, struct rate_limit *limit);

bool rate_limit_may_request(struct rate_limit *limit, int64_t now_ns);
