// What the tests of the web room share: a server with a certificate and three pages, and a handler
// that writes down what it is asked.
#pragma once

#include "folder.h"
#include "web/web.h"

#include <stdatomic.h>

#define RECEPTION_FILE_SIZE 3000017 // bytes of /api/v1/file; byte i is i * 7 + i / 256

struct reception {
    char dir[FOLDER_MAX];
    struct web *web;
    int port;
    int patience_s;             // before reception_open
    atomic_int requests;        // answered, of /api/v1
    atomic_bool blocks;         // /api/v1/slow is not answered while it is set
    atomic_int waiting;         // in /api/v1/slow
    atomic_int later, released; // answers of /api/v1/later that began, and whose data are gone
    atomic_bool signed_out;     // no token is anybody's
    atomic_bool promoted;       // the account has another role
    atomic_bool forgetful;      // whose a token is cannot be found out
    atomic_int entered;         // how often it was asked for a good token
    atomic_int viewers, left;   // in all
    atomic_int asked;           // for a batch
    atomic_int pages;           // messages
    atomic_size_t batch_size;   // of each batch, 0: there is none; a counter, then zeros
    atomic_llong batch_gap_ns;  // between two of them
    atomic_bool refuses_pages;  // on_page says no
};

void reception_open(struct reception *reception);
void reception_close(struct reception *reception);

extern struct reception reception; // the test's that runs

// What a test begins and ends with: a fresh one, with 2 s of patience, or with the room's own.
int reception_begin(void **state);
int reception_begin_patiently(void **state);
int reception_end(void **state);

// "good" is an account's token, "slow" too, after 300 ms; others are nobody's. To /api/v1 each one
// that begins with "good" is the token of another account; that of "good-host" keeps_one.

// True as soon as *counter is at least `wanted`; false after 10 s.
bool reception_wait(atomic_int *counter, int wanted);
