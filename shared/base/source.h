// Who is at the other end of a connection, for limits: an IPv4 address, or an IPv6 network of 64
// bits, which one person commonly has whole.
#pragma once

#include <netinet/in.h>
#include <stdbool.h>

#define SOURCE_TEXT_SIZE 48

struct source {
    struct in6_addr address; // IPv4 as ::ffff:a.b.c.d; of an IPv6 address the first 64 bits
};

// False if the other end of the socket is gone, or has no address.
bool source_of(int fd, struct source *out_source);
bool source_is(const struct source *a, const struct source *b);

// "10.0.0.7" or "2001:db8::/64".
void source_write(const struct source *source, char out_text[SOURCE_TEXT_SIZE]);
