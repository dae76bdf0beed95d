// The server for browsers: HTTPS with static pages, requests to /api/v1, and the WebSocket /live
// (subprotocol WIRE_LIVE_SUBPROTOCOL), on a thread of its own. This room limits connections and
// requests. The handler answers them. /metrics, /healthz and /readyz are the handler's, too, as
// /api/v1/metrics and so on.
//
// Host must be a name of the server's certificate, one of `names`, localhost or an IP address.
// Origin, if it is there, must be the same host. A request that changes something needs it if it
// carries the cookie. Without TLS, Host must be localhost or one of its addresses, whatever else
// this machine is called.
#pragma once

#include "base/result.h"
#include "web/pages.h"
#include "wire/wire.h"

#include <stdio.h>

#define WEB_VIEWERS_MAX 64
#define WEB_BODY_MAX 65536  // of a request
#define WEB_BATCH_MAX 65536 // an encoded LiveBatch
#define WEB_BATCHES_ON_WAY 2
#define WEB_NAMES_MAX 8
#define WEB_HOST_MAX 300 // of the header Host

struct web;
struct lws_context;

// The account that is signed in. Only the handler interprets it.
struct web_account {
    char name[64];
    char role[16];
    char trainee[64]; // empty: none
    bool keeps_one;   // one of its connections makes room for nobody
};

#define WEB_VIA "arthron-server" // in the header Via of what a server passes on
#define WEB_LATER_THREADS 8

// Texts live until on_request returns. Only `token`, `device`, `sign_on`, `range` and
// `if_range` may be NULL.
struct web_request {
    const char *method; // "GET" (also for HEAD), "POST", "PUT", "PATCH", "DELETE"
    const char *path;   // "/api/v1/...": unescaped, without the query
    const char *query;  // as received, without '?'
    const char *body;   // of `size` bytes, and a 0 behind them
    size_t size;
    const char *token;      // of the cookie `arthron` or of `Authorization: Bearer`; NULL: none
    bool by_cookie;         // the token is the cookie's
    const char *device;     // of the cookie `arthron-device`; NULL: none
    const char *sign_on;    // of the cookie `arthron-sign-on`; NULL: none
    const char *host;       // a name of this server, as the browser calls it: "hall.example:4880"
    const char *address;    // the browser's
    bool is_near;           // an IPv6 address of the server's own network (base/source.h)
    bool is_passed_on;      // by another server (WEB_VIA)
    bool takes_openmetrics; // by its Accept
    const char *range, *if_range; // the headers, for who passes it on; NULL: none
};

// All zero is a 204 without a body. This room adds the security headers, handles If-None-Match and
// Range, and sets the length.
struct web_response {
    int status;
    struct web_account account; // whose the token is; no name: nobody's, or not known
    char type[64];              // empty: application/json
    char *body;                 // of alloc or malloc; this room releases it
    size_t size;
    char file[512];  // instead of body: the path of a file, with Range; 404 if it cannot be read
    FILE *open_file; // instead of both: this room reads it from its begin, and closes it
    char content_range[64];  // of a 206 or 416 that was made elsewhere, as it is
    char owner[64];          // who downloads the file; a few at a time for each owner, else 503
    bool stands_alone;       // a page with its own style, without scripts and links to other files
    bool compress;           // with gzip, for browsers that accept it; a compressed file is cached
    char etag[80];           // without quotes; empty: browsers must not store it
    char cookie[256];        // the value of Set-Cookie; this room adds Secure where there is TLS
    char second_cookie[256]; // the value of another one
    char location[2048];     // where a 303 sends the browser to
    char download[128];      // the file name for a browser's download
    int retry_after_s;
    // The answer has to be waited for: `later` makes it, on one of WEB_LATER_THREADS threads that
    // hold up no other request, and the rest (but the account) is not looked at. It is called once,
    // and releases its data. out_response: as of on_request; NULL: nobody wants it any more.
    void (*later)(void *data, struct web_response *out_response);
    void *later_data;
};

struct web_handler {
    void *user;

    // ---- from several threads at the same time; may take time -----------------------------------

    // *out_response is all zero.
    void (*on_request)(void *user, const struct web_request *request,
                       struct web_response *out_response);

    // The account of a token. RESULT_MISSING: there is none. Any other error: the account cannot
    // be looked up now. Called when /live opens, and each second while it is open. /live closes
    // when the account changes or ends. If the account cannot be looked up, a new /live is closed
    // with "try later", and an open one stays.
    enum result (*on_enter)(void *user, const char *token, struct web_account *out_account);

    // ---- /live: from the web thread; must not block ---------------------------------------------

    // A new viewer, and its token. The other functions get the returned pointer. NULL: there is no
    // room.
    void *(*on_viewer)(void *user, const struct web_account *account, const char *token);

    // A message of the page, except Drawn, which this room handles. False if the page may not send
    // it: /live is closed.
    bool (*on_page)(void *user, void *viewer, const arthron_Page *message);

    // Writes the next batch, of at most `size` (WEB_BATCH_MAX) bytes, and returns its size; 0:
    // there is nothing now. Called when the page has drawn all but WEB_BATCHES_ON_WAY - 1 batches
    // and its socket is writable; and then only after the previous *out_next_ns, a web_wake or a
    // message of the page. *out_next_ns (monotonic) is when to call again. It is `now_ns` at
    // first. If it stays so, the next call comes at once after a batch, and without a batch only
    // after a web_wake or a message.
    size_t (*on_batch)(void *user, void *viewer, int64_t now_ns, uint8_t *out, size_t size,
                       int64_t *out_next_ns);

    void (*on_left)(void *user, void *viewer);

    // Whether a request may take long. Such requests have threads of their own, at a low priority.
    // From the web thread; must not block. NULL: none does.
    bool (*is_slow)(const char *method, const char *path);

    // Before the web thread runs: its context, for connections of the handler's own, and how many
    // it may have. NULL: it has none.
    enum result (*on_start)(void *user, struct lws_context *context, int outgoing,
                            struct error *err);
};

struct web_config {
    const char *address;     // to listen on; NULL for all
    int port;                // 0: any free port, see web_port
    const char *certificate; // PEM, with its chain; a new file is loaded within a second
    const char *key;         // NULL, as the certificate: HTTP without TLS, for this machine alone
    const char *names[WEB_NAMES_MAX + 1]; // other names of the server; NULL behind the last
    struct web_pages pages;
    int timeout_s; // of a browser that stops sending or reading; 0: 20
    int outgoing;  // connections that the handler wants of its own in the web thread
};

// Listens and starts the threads. RESULT_MISSING names a missing file, RESULT_IO the address and
// port.
enum result web_create(const struct web_config *config, const struct web_handler *handler,
                       struct web **out_web, struct error *err);

int web_port(const struct web *web);

struct web_counts {
    uint64_t answers[6]; // by the first digit of their status
    int connections, pages;
    int64_t certificate_until_s; // since 1970
};
struct web_counts web_counts(const struct web *web); // from any thread

// Closes every /live (1001), waits for running requests and joins the threads. Afterwards the
// handler is not called. *web becomes NULL.
void web_destroy(struct web **web);

// There may be something new for some viewer. Any thread may call; never waits.
void web_wake(struct web *web);
// The same for this one alone. The web thread.
void web_wake_viewer(struct web *web, const void *viewer);
