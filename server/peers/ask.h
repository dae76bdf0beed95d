// Asks another server over its HTTPS, as a browser would: one request after the other, each over a
// connection of its own. Its certificate must be of an authority of the system, or of the one that
// the servers share, and for the host that is asked.
#pragma once

#include "base/result.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

struct peers;

// authority: a PEM file, read with each request.
struct peers *peers_create(const char *authority);
// Ends what is being asked, with an error, and refuses all that is asked from now on.
void peers_break_off(struct peers *peers);
void peers_destroy(struct peers **peers); // NULL inside is fine

struct peer_request {
    const char *pages; // HOST:PORT
    const char *method;
    const char *path, *query; // of the URL, escaped; query: without '?', or empty
    const char *token;        // Authorization: Bearer
    const char *via;          // who passes the request on, in the header Via; NULL: nobody
    const char *body;         // JSON; NULL: none
    size_t size;
    const char *range, *if_range; // NULL: none
    int64_t most;                 // bytes of the answer: more is an error
    int silence_s;                // without a byte; also longer is an error
    int patience_s;               // for all of it
};

// Texts are printable, and empty where the answer has none, or none that is.
struct peer_answer {
    int status;
    char type[64];          // Content-Type
    char download[128];     // the file's name of Content-Disposition
    char content_range[64]; // as it came
    int retry_after_s;
};

// Writes the body of the answer, whatever its status, into a file, which gets all of it or is of no
// use. From any thread. RESULT_TIMEOUT: it
// does not answer, or not in time. RESULT_LIMIT: the answer is too large. RESULT_REFUSED: its
// certificate is not good. RESULT_IO: the file. RESULT_CLOSED: peers_break_off.
enum result peer_ask(struct peers *peers, const struct peer_request *request, FILE *body,
                     struct peer_answer *out_answer, struct error *err);

// Escapes a path or a name for a URL; false: it is too long.
bool peer_escape(const char *text, char *out, size_t size);
