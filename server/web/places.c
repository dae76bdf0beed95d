// Which connections of browsers may stay. Whoever has not shown a token that is somebody's is a
// stranger. Where all places are taken, each new connection takes that of a stranger of the address
// with the most; without strangers, that of the account with the most.
#include "base/clock.h"
#include "web/connection.h"

#include <sys/socket.h>

static void leave_place(struct web_connection *c) {
    if (c->leaves)
        return;
    c->leaves = true;
    c->web->staying--;
    c->limit->connections--;
    if (c->guest)
        c->guest->connections--;
    else
        c->limit->strangers--;
}

static void shut(struct web_connection *c) {
    leave_place(c);
    shutdown(lws_get_socket_fd(c->socket),
             SHUT_RDWR); // it then ends like one that the browser ended
}

// Of two that stay, whether the first is the one to go.
static bool goes_before(const struct web_connection *a, const struct web_connection *b) {
    if (!b || !a->guest != !b->guest)
        return !b || !a->guest;
    int of_a = a->guest ? a->guest->connections : a->limit->strangers;
    int of_b = b->guest ? b->guest->connections : b->limit->strangers;
    if (of_a != of_b)
        return of_a > of_b;
    return !a->live != !b->live ? !a->live : a->since_ns < b->since_ns;
}

static bool may_go(const struct web_connection *c) {
    return !c->leaves && !(c->guest && c->guest->account.keeps_one && c->guest->connections == 1);
}

// limit, guest: only of this address, of this account; NULL: any. NULL: all must stay.
static struct web_connection *first_to_go(struct web *web, const struct rate_limit *limit,
                                          const struct guest *guest) {
    struct web_connection *first = NULL;
    for (int i = 0; i < WEB_CONNECTIONS_ALL; i++) {
        struct web_connection *c = web->connections[i];
        if (c && may_go(c) && (!limit || c->limit == limit) && (!guest || c->guest == guest) &&
            goes_before(c, first))
            first = c;
    }
    return first;
}

static int free_slot(const struct web *web) {
    for (int i = 0; i < WEB_CONNECTIONS_ALL; i++)
        if (!web->connections[i])
            return i;
    return -1;
}

bool places_let_in(struct web *web, struct rate_limit *limit) {
    int of_address = web->places * WEB_CONNECTIONS_PER_ADDRESS / WEB_CONNECTIONS_MAX;
    bool is_full = web->staying >= web->places, is_full_of_it = limit->connections >= of_address;
    if (web->here >= web->places + web->spare || free_slot(web) < 0)
        return false; // those that were shut have not gone yet
    if (!is_full && !is_full_of_it)
        return true;
    struct web_connection *first = first_to_go(web, is_full_of_it ? limit : NULL, NULL);
    if (first)
        shut(first);
    return first;
}

bool places_open(struct web_connection *c) {
    int slot = free_slot(c->web);
    if (slot < 0)
        return false;
    c->web->connections[slot] = c;
    c->slot = slot;
    c->since_ns = clock_now_ns();
    c->web->here++;
    c->web->staying++;
    c->limit->ends++;
    c->limit->connections++;
    c->limit->strangers++;
    return true;
}

void places_close(struct web_connection *c) {
    leave_place(c);
    c->web->connections[c->slot] = NULL;
    c->web->here--;
    c->limit->ends--;
    c->limit->left_ns = clock_now_ns();
}

static int most_of_account(const struct web *web) {
    int most = web->places * WEB_CONNECTIONS_PER_ACCOUNT / WEB_CONNECTIONS_MAX;
    return most > WEB_CONNECTIONS_OF_BROWSER ? most : WEB_CONNECTIONS_OF_BROWSER;
}

void places_prove(struct web_connection *c, struct guest *guest) {
    if (c->leaves || c->guest == guest)
        return;
    if (c->guest)
        c->guest->connections--;
    else
        c->limit->strangers--;
    c->guest = guest;
    guest->connections++;
    if (!guest->account.keeps_one && guest->connections > most_of_account(c->web))
        shut(first_to_go(c->web, NULL, guest));
}
