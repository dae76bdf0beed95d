// An HTTPS client of the tests' own, on OpenSSL alone: it says what no browser would. Blocking,
// with 10 s of patience.
#pragma once

#include <stdbool.h>
#include <stddef.h>

struct browser;

// To localhost. NULL where the connection or its TLS is refused.
struct browser *browser_open(int port);
struct browser *browser_open_with(int port, int tls_version); // that and no other: TLS1_2_VERSION
void browser_close(struct browser *browser);
int browser_fd(const struct browser *browser);

// The SHA-256 of the server's certificate.
void browser_certificate(const struct browser *browser, char out[65]);

bool browser_say(struct browser *browser, const void *bytes, size_t size);

struct answered {
    int status; // -1: the connection ended, or nothing came
    char head[4096];
    char *body; // the caller's, with a 0 behind it; NULL where status is -1
    size_t size;
};

// One answer; `bodiless`: to HEAD.
struct answered browser_hear(struct browser *browser, bool bodiless);

// "GET /path" and further lines, each with its "\r\n"; then hears the answer.
struct answered browser_ask(struct browser *browser, const char *line, const char *headers);

// A header's value; "" where there is none.
const char *answered_header(const struct answered *answered, const char *name, char out[512]);

// Reads on until the server ends the connection; false where it does not within 10 s.
bool browser_is_ended(struct browser *browser);
