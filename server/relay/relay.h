// Connections to /live of other servers, each as an account of a page that looks on here. They live
// in the thread of the web server and wait for nothing: names of hosts are looked up on threads of
// this room.
//
// The other server's certificate must be for the host that was called, and of the authority of the
// servers or one that this machine trusts.
#pragma once

#include "base/result.h"
#include "wire/wire.h"

#define RELAYS_MAX 256 // at a time
#define RELAY_BATCH_MAX 65536
#define RELAY_UNSAID_MAX 32 // messages that wait for the connection

struct lws_context;
struct relays;
struct relay;

// authority: the path of a PEM file. RESULT_FORMAT names it.
enum result relays_create(const char *authority, struct relays **out_relays, struct error *err);
// Before the thread of the context runs. most: relays at a time.
enum result relays_begin(struct relays *relays, struct lws_context *context, int most,
                         struct error *err);
void relays_destroy(struct relays **relays); // after the context; NULL inside is fine

// ---- the thread of the context

struct relay_handler {
    void *user;
    // A batch came. The first one shows that the other server let it in.
    void (*heard)(void *user, const uint8_t *batch, size_t size);
    // There is no connection, or no more. The relay is gone.
    void (*ended)(void *user, const char *why);
};

// address: HOST:PORT. A token that the other server does not know yet is tried again for a second.
// NULL: there are too many. The handler is called later at the earliest.
struct relay *relay_open(struct relays *relays, const char *address, const char *token,
                         const struct relay_handler *handler);
// False: too many messages wait.
bool relay_say(struct relay *relay, const arthron_Page *message);
void relay_close(struct relay **relay); // its handler is not called any more; NULL inside is fine
