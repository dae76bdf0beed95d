// Who is at the other end of a connection, for limits: an IPv4 address, or an IPv6 network of 64
// bits, which one person commonly has whole. In the network of this end, where the hall's stations
// are, each IPv6 address is one of its own.
#pragma once

#include <netinet/in.h>
#include <stdbool.h>

#define SOURCE_TEXT_SIZE 48

struct source {
    struct in6_addr address; // IPv4 as ::ffff:a.b.c.d; of a far IPv6 address the first 64 bits
    bool near;               // an IPv6 address of this end's network, whole
};

// False if the other end of the socket is gone, or has no address.
bool source_of(int fd, struct source *out_source);
bool source_is(const struct source *a, const struct source *b);

// "10.0.0.7", "2001:db8::/64", or "fe80::7" where it is near.
void source_write(const struct source *source, char out_text[SOURCE_TEXT_SIZE]);
