// A station's certificate while the station runs, on a thread of its own: it is renewed in time,
// and the link is told when its files have changed, whoever changed them.
#pragma once

#include "link/config.h"

#define RENEWAL_DAYS 60         // before its end a certificate is renewed
#define RENEWAL_WARNING_DAYS 30 // and where that does not succeed, the log warns from here on

struct renewal;

// Neither may wait; they come from the thread. The config outlives the renewal.
struct renewal_handler {
    void *user;
    // Whether a server can be asked now, and which.
    bool (*may_ask)(void *user, struct server_address *out_server);
    void (*on_changed)(void *user); // other files, which can be used
};

struct renewal *renewal_create(const struct link_config *config,
                               const struct renewal_handler *handler);
void renewal_destroy(struct renewal **renewal); // NULL inside is fine; joins the thread
