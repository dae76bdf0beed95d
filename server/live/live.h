// What pages see of sessions and of recorded sessions, as batches of /live (PROTOCOL.md, "Live").
// The web server asks for a viewer's next batch when its page can take one. A slow page skips to
// the newest state.
//
// Only the web server's thread calls these functions, except live_server_create, _destroy and
// _on_news. They wait for nothing but copies. Commands and recorded sessions run on threads of this
// room.
#pragma once

#include "live/account.h"
#include "relay/relay.h"
#include "sessions/sessions.h"
#include "wire/wire.h"

#define LIVE_VIEWERS_MAX 64
#define LIVE_VIEWERS_OF_STAFF 24    // of one account
#define LIVE_VIEWERS_OF_TRAINEE 6   // of one trainee, by account and by code
#define LIVE_VIEWERS_OF_TRAINEES 48 // of all trainees together
#define LIVE_BATCH_MAX 65536        // bytes

struct live_server;
struct viewer;

struct live_config {
    void *user;
    // Whether the account may see a recorded session (32 hexadecimal digits). Called from a thread
    // that may wait for the records.
    bool (*allowed)(void *user, const struct live_account *account, const char *session);
    // Whether it must not learn whose session it is; NULL: it may. Called from that thread, too.
    bool (*is_blind)(void *user, const struct live_account *account, const char *session);
    each_blind *each_blind; // called as is_blind; NULL: there are none
    // How long a page may take less than 64 KiB of a recorded session while other pages wait for
    // the thread that plays it; 0: 10 s.
    int patience_ms;
    struct relays *relays; // to other servers; NULL: this one is alone
};

struct live_server *live_server_create(struct sessions *sessions, const struct live_config *config);
// Call before sessions_destroy, and after the web server has ended. NULL inside is fine.
void live_server_destroy(struct live_server **live);

// From now on `on_news` is called when some viewer may have a batch: from any thread, at any time;
// and `on_news_of` when this one may: from the web server's thread. They must not wait. NULL ends
// this; no call is under way when the function returns.
void live_server_on_news(struct live_server *live, void (*on_news)(void *user),
                         void (*on_news_of)(void *user, struct viewer *viewer), void *user);

// NULL if there are LIVE_VIEWERS_MAX viewers, or the account has as many as it may.
// token: of the account, for other servers.
struct viewer *live_server_join(struct live_server *live, const struct live_account *account,
                                const char *token);
void live_server_leave(struct live_server *live, struct viewer *viewer);

// What the page may not ask for, or asks too often, is answered, or waits.
void live_server_take(struct live_server *live, struct viewer *viewer, const arthron_Page *message);

// The next batch: an encoded LiveBatch. `size` is at least LIVE_BATCH_MAX. Returns 0 if there is
// nothing to send now. *out_next_ns: when to ask again, unless `on_news` is called before.
size_t live_server_batch(struct live_server *live, struct viewer *viewer, int64_t now_ns,
                         uint8_t *out, size_t size, int64_t *out_next_ns);
