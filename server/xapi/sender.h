// Brings the lines of an outbox to a learning record store by HTTPS, in a thread of its own: POST
// SERVER/statements, in batches, in order. What the store did not take is sent again, after 1 s, 2
// s and so on up to retry_most_ms, for as long as it takes.
//
// Of a batch that the store refuses as a whole (400, 409, 413, 422) the halves are sent, down to
// single statements. One that it has already (409) counts as sent; one that it refuses is logged
// and left out.
#pragma once

#include "xapi/outbox.h"

#include <stdint.h>

// Texts are copied.
struct sender_config {
    const char *server;   // https://lrs.example.org/xapi
    const char *user;     // of Basic authentication
    const char *password; // a file whose first line it is; read before each batch
    const char
        *authority; // a PEM file of authorities for the store's certificate; empty: the system's
    int64_t patience_ms; // with one request
    int64_t retry_ms, retry_most_ms;
};

struct sender;

// The outbox lives longer than the sender. RESULT_INVALID: no address of HTTPS; RESULT_MISSING: the
// password cannot be read.
enum result sender_start(const struct sender_config *config, struct outbox *outbox,
                         struct sender **out, struct error *err);
void sender_wake(struct sender *sender); // there are more lines; any thread. NULL is fine
// Breaks off what is under way: it is sent again later. NULL inside is fine.
void sender_stop(struct sender **sender);
