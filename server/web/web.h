// Browsers: HTTPS with static pages, requests to /api/v1, and the WebSocket /live (subprotocol
// WIRE_LIVE_SUBPROTOCOL), served by a thread of this room's own. It knows who may connect and how
// much, and nothing of what is said: that is the handler's.
//
// Host must be a name of the server's certificate, one of `names`, localhost or an address; Origin,
// where it is sent, that very host. A request that changes something and comes with a cookie must
// have one.
#pragma once

#include "base/result.h"
#include "web/pages.h"
#include "wire/wire.h"

#define WEB_VIEWERS_MAX 64
#define WEB_BODY_MAX 65536  // of a request
#define WEB_BATCH_MAX 65536 // an encoded LiveBatch
#define WEB_BATCHES_ON_WAY 2
#define WEB_NAMES_MAX 8

struct web;

// Who is signed in; what it means is the handler's.
struct web_account {
    char name[64];
    char role[16];
    char trainee[64]; // empty: none
};

// Texts are never NULL but where it is said, and live until on_request returns.
struct web_request {
    const char *method; // "GET" (also for HEAD), "POST", "PATCH", "DELETE"
    const char *path;   // "/api/v1/...": unescaped, without the query
    const char *query;  // as it came, without '?'
    const char *body;   // of `size` bytes, and a 0 behind them
    size_t size;
    const char *token;   // of the cookie `arthron` or of `Authorization: Bearer`; NULL: none
    bool by_cookie;      // the token is the cookie's
    const char *address; // the browser's
};

// All zero is 204 with no body. Security headers, ETag with If-None-Match, Range and the length are
// this room's.
struct web_response {
    int status;
    char type[64]; // empty: application/json
    char *body;    // of alloc or malloc, released by this room; or
    size_t size;
    char file[512];     // a path whose bytes are sent, with Range; 404 where it cannot be read
    bool stands_alone;  // a page with a style of its own, without scripts and links to others
    bool compress;      // send it gzipped to who takes that; of a file that is kept
    char etag[80];      // without quotes; empty: not to be kept
    char cookie[256];   // the value of Set-Cookie
    char download[128]; // the name under which a browser stores it
    int retry_after_s;
};

struct web_handler {
    void *user;

    // ---- out of two threads for requests, at once; may take time --------------------------------

    // *out_response is all zero.
    void (*on_request)(void *user, const struct web_request *request,
                       struct web_response *out_response);

    // Whose token it is; RESULT_MISSING where nobody's; any other error: it cannot be found out
    // now. Asked when /live is opened and each second while it is open: a viewer whose account is
    // no longer the same is closed. Of whom it cannot be found out, who is new is closed, to try
    // later, and who is in stays.
    enum result (*on_enter)(void *user, const char *token, struct web_account *out_account);

    // ---- /live: out of the web thread; none may block -------------------------------------------

    // A new viewer: what is returned is given to the others. NULL: no room for one more.
    void *(*on_viewer)(void *user, const struct web_account *account);

    // A message of the page, but for Drawn, which is this room's. False where the page may not say
    // so: it is closed.
    bool (*on_page)(void *user, void *live, const arthron_Page *message);

    // Asked when the page has drawn all but WEB_BATCHES_ON_WAY - 1 batches, its socket can take
    // one, and *out_next_ns of the last time is past, web_wake was called or the page said
    // something. Writes the next batch (at most `size`, WEB_BATCH_MAX, bytes) and returns its size;
    // 0: nothing now. *out_next_ns (monotonic; it is `now_ns` before) is when to ask again: at once
    // where it stays so behind a batch, not by itself where it stays so and there was nothing.
    size_t (*on_batch)(void *user, void *live, int64_t now_ns, uint8_t *out, size_t size,
                       int64_t *out_next_ns);

    void (*on_left)(void *user, void *live);
};

struct web_config {
    const char *address;     // to listen on; NULL for all
    int port;                // 0: any free one, web_port tells which
    const char *certificate; // PEM, the chain behind it; taken anew within a second
    const char *key;
    const char *names[WEB_NAMES_MAX + 1]; // what the server is called besides; NULL behind the last
    struct web_pages pages;
    int timeout_s; // with who does not go on: headers, a body, reading what it is sent; 0: 20
};

// Listens and starts the threads. RESULT_MISSING names a file that is not there, RESULT_IO address
// and port.
enum result web_create(const struct web_config *config, const struct web_handler *handler,
                       struct web **out_web, struct error *err);

int web_port(const struct web *web);

// Tells every page (1001), waits for the requests that are being answered, joins the threads; the
// handler is not called any more. *web becomes NULL.
void web_destroy(struct web **web);

// From any thread, never waits: some viewer may have something.
void web_wake(struct web *web);
