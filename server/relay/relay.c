#include "relay/relay.h"

#include "base/check.h"
#include "base/clock.h"
#include "relay/lookup.h"
#include "websocket/ws_server.h"

#include <openssl/ssl.h>
#include <openssl/x509v3.h>
#include <pb_encode.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define OPEN_NS (5 * NS_PER_S) // until the other server has let it in
#define UNKNOWN_NS NS_PER_S    // a token takes some time to be known at all servers
#define STEP_US (20 * LWS_US_PER_MS)
#define PAUSE_NS (200 * NS_PER_MS)
#define NOT_ALLOWED 1008
#define HOST_MAX 128
#define TOKEN_MAX 128

static const char no_answer[] = "it does not answer, or lets no page in";

struct message {
    struct message *next;
    size_t size;
    uint8_t bytes[]; // behind LWS_PRE of libwebsockets'
};

struct relay {
    struct relays *relays;
    struct relay *next;
    struct relay_handler handler; // ended is NULL: the owner has left it
    char host[HOST_MAX], token[TOKEN_MAX];
    int port;
    struct lookup *lookup;
    int tried; // of its addresses
    int64_t begun_ns, retry_ns;
    struct lws *socket; // NULL: none
    bool let_in;
    bool unknown; // the other server does not know the token
    char why[160];
    lws_sorted_usec_list_t step;
    struct message *first, *last;
    int unsaid;
    size_t used;
    uint8_t incoming[RELAY_BATCH_MAX];
};

struct relays {
    struct lws_protocols protocols[2];
    struct lws_context *context;
    struct lws_vhost *vhost;
    SSL_CTX *tls;
    struct task_pool *lookups;
    struct relay *first;
    int count, most;
};

// ---- trust --------------------------------------------------------------------------------------

static struct relay *relay_of(const struct relays *relays, const SSL *tls) {
    struct relay *relay = relays->first;
    while (relay && !(relay->socket && lws_get_ssl(relay->socket) == tls))
        relay = relay->next;
    return relay;
}

static int keep_verdict(int good, X509_STORE_CTX *chain) {
    (void)chain;
    return good;
}

// Instead of libwebsockets' own, which knows no addresses.
static int verify(X509_STORE_CTX *chain, void *argument) {
    SSL *tls = X509_STORE_CTX_get_ex_data(chain, SSL_get_ex_data_X509_STORE_CTX_idx());
    struct relay *relay = relay_of(argument, tls);
    X509_VERIFY_PARAM *expected = X509_STORE_CTX_get0_param(chain);
    X509_STORE_CTX_set_verify_cb(chain, keep_verdict);
    if (!relay || (X509_VERIFY_PARAM_set1_ip_asc(expected, relay->host) != 1 &&
                   X509_VERIFY_PARAM_set1_host(expected, relay->host, 0) != 1))
        return 0;
    int good = X509_verify_cert(chain);
    if (good != 1)
        snprintf(relay->why, sizeof relay->why, "its certificate is not trusted: %s",
                 X509_verify_cert_error_string(X509_STORE_CTX_get_error(chain)));
    return good == 1;
}

static enum result trust(struct relays *relays, const char *authority, struct error *err) {
    relays->tls = SSL_CTX_new(TLS_client_method());
    NEED(relays->tls, "memory");
    SSL_CTX_set_min_proto_version(relays->tls, TLS1_2_VERSION);
    SSL_CTX_set_verify(relays->tls, SSL_VERIFY_PEER, NULL);
    SSL_CTX_set_cert_verify_callback(relays->tls, verify, relays);
    X509_VERIFY_PARAM_set_hostflags(SSL_CTX_get0_param(relays->tls),
                                    X509_CHECK_FLAG_NO_PARTIAL_WILDCARDS);
    SSL_CTX_set_default_verify_paths(relays->tls);
    return SSL_CTX_load_verify_file(relays->tls, authority) == 1
               ? RESULT_OK
               : fail(err, RESULT_FORMAT, "%s: no certificate can be read", authority);
}

// ---- an end -------------------------------------------------------------------------------------

static void forget(struct relay *relay) {
    struct relay **at = &relay->relays->first;
    while (*at != relay)
        at = &(*at)->next;
    *at = relay->next;
    relay->relays->count--;
    lws_sul_cancel(&relay->step);
    lookup_release(&relay->lookup);
    for (struct message *message; (message = relay->first);) {
        relay->first = message->next;
        free(message);
    }
    free(relay);
}

// Its memory goes with its socket.
static void leave(struct relay *relay) {
    relay->handler.ended = NULL;
    lws_sul_cancel(&relay->step);
    if (relay->socket)
        lws_set_timeout(relay->socket, PENDING_TIMEOUT_USER_OK, LWS_TO_KILL_ASYNC);
    else
        forget(relay);
}

static void end(struct relay *relay) {
    struct relay_handler handler = relay->handler;
    char why[sizeof relay->why];
    memcpy(why, relay->why, sizeof why);
    leave(relay);
    handler.ended(handler.user, why);
}

void relay_close(struct relay **relay) {
    if (*relay)
        leave(*relay);
    *relay = NULL;
}

// ---- connecting ---------------------------------------------------------------------------------

static void explain(struct relay *relay, const char *why) {
    if (!relay->why[0])
        snprintf(relay->why, sizeof relay->why, "%s", why);
}

static void connect_next(struct relay *relay) {
    char host[HOST_MAX + 2];
    snprintf(host, sizeof host, strchr(relay->host, ':') ? "[%s]" : "%s", relay->host);
    struct lws_client_connect_info info = {
        .context = relay->relays->context,
        .vhost = relay->relays->vhost,
        .address = relay->lookup->addresses[relay->tried++],
        .port = relay->port,
        .host = host,
        .path = "/live",
        .protocol = WIRE_LIVE_SUBPROTOCOL,
        .alpn = "http/1.1",
        .ssl_connection = LCCSCF_USE_SSL | LCCSCF_SKIP_SERVER_CERT_HOSTNAME_CHECK, // verify() does
        .opaque_user_data = relay,
        .pwsi = &relay->socket,
    };
    if (!lws_client_connect_via_info(&info))
        relay->socket = NULL;
}

static bool may_try_again(struct relay *relay, int64_t now_ns) {
    if (relay->tried < relay->lookup->count)
        return true;
    if (!relay->unknown || now_ns - relay->begun_ns >= UNKNOWN_NS)
        return false;
    relay->tried = 0;
    return true;
}

static void on_step(lws_sorted_usec_list_t *step) {
    struct relay *relay = lws_container_of(step, struct relay, step);
    int64_t now_ns = clock_now_ns();
    if (relay->let_in)
        return;
    if (now_ns - relay->begun_ns >= OPEN_NS) {
        explain(relay, no_answer);
        end(relay);
        return;
    }
    if (!relay->socket && now_ns >= relay->retry_ns && atomic_load(&relay->lookup->done)) {
        if (!may_try_again(relay, now_ns)) {
            explain(relay, relay->lookup->count ? no_answer : "its host is not known");
            end(relay);
            return;
        }
        connect_next(relay);
    }
    lws_sul_schedule(relay->relays->context, 0, &relay->step, on_step, STEP_US);
}

static bool parse(const char *address, struct relay *relay) {
    const char *colon = strrchr(address, ':');
    bool has_brackets = address[0] == '[' && colon && colon > address && colon[-1] == ']';
    if (!colon)
        return false;
    int length = (int)(colon - address) - 2 * has_brackets;
    relay->port = atoi(colon + 1);
    return length > 0 && relay->port > 0 &&
           snprintf(relay->host, HOST_MAX, "%.*s", length, address + has_brackets) < HOST_MAX;
}

struct relay *relay_open(struct relays *relays, const char *address, const char *token,
                         const struct relay_handler *handler) {
    if (!relays->context || relays->count >= relays->most)
        return NULL;
    struct relay *relay = alloc(1, sizeof *relay);
    relay->relays = relays;
    relay->handler = *handler;
    relay->next = relays->first;
    relays->first = relay;
    relays->count++;
    relay->begun_ns = clock_now_ns();
    snprintf(relay->token, sizeof relay->token, "%s", token);
    if (!parse(address, relay))
        explain(relay, "its address of pages is none");
    relay->lookup = lookup_begin(relays->lookups, relay->host);
    lws_sul_schedule(relays->context, 0, &relay->step, on_step, 1);
    return relay;
}

// ---- what it says -------------------------------------------------------------------------------

bool relay_say(struct relay *relay, const arthron_Page *said) {
    if (relay->unsaid >= RELAY_UNSAID_MAX)
        return false;
    struct message *message = alloc(1, sizeof *message + LWS_PRE + WIRE_PAGE_MAX);
    pb_ostream_t stream = pb_ostream_from_buffer(message->bytes + LWS_PRE, WIRE_PAGE_MAX);
    if (!pb_encode(&stream, arthron_Page_fields, said)) {
        free(message);
        return false;
    }
    message->size = stream.bytes_written;
    if (relay->last && relay->first)
        relay->last->next = message;
    else
        relay->first = message;
    relay->last = message;
    relay->unsaid++;
    if (relay->let_in)
        lws_callback_on_writable(relay->socket);
    return true;
}

static int write_next(struct relay *relay) {
    struct message *message = relay->first;
    if (!message || !relay->let_in)
        return 0;
    int size = (int)message->size;
    int written =
        lws_write(relay->socket, message->bytes + LWS_PRE, message->size, LWS_WRITE_BINARY);
    relay->first = message->next;
    relay->unsaid--;
    free(message);
    if (relay->first)
        lws_callback_on_writable(relay->socket);
    return written < size ? -1 : 0;
}

static int say_who(struct relay *relay, uint8_t **at, size_t room) {
    char text[TOKEN_MAX + 8];
    int length = snprintf(text, sizeof text, "Bearer %s", relay->token);
    return lws_add_http_header_by_token(relay->socket, WSI_TOKEN_HTTP_AUTHORIZATION,
                                        (const uint8_t *)text, length, at, *at + room);
}

// ---- what it hears ------------------------------------------------------------------------------

static int hear(struct relay *relay, const void *bytes, size_t size) {
    struct lws *socket = relay->socket;
    if (!relay->handler.ended)
        return 0; // it is left
    if (size > sizeof relay->incoming - relay->used || !lws_frame_is_binary(socket)) {
        explain(relay, "what it sends is no batch");
        return ws_end(socket);
    }
    memcpy(relay->incoming + relay->used, bytes, size);
    relay->used += size;
    if (lws_remaining_packet_payload(socket) || !lws_is_final_fragment(socket))
        return 0;
    size_t whole = relay->used;
    relay->used = 0;
    relay->let_in = true;
    relay->why[0] = '\0';
    relay->handler.heard(relay->handler.user, relay->incoming, whole);
    lws_callback_on_writable(socket);
    return 0;
}

static void hear_close(struct relay *relay, const uint8_t *bytes, size_t size) {
    int status = size >= 2 ? bytes[0] << 8 | bytes[1] : 0;
    relay->unknown = !relay->let_in && status == NOT_ALLOWED;
    explain(relay, relay->unknown ? "it does not know who has signed in here"
                                  : "it closed the connection");
}

static void lost_socket(struct relay *relay) {
    relay->socket = NULL;
    relay->used = 0;
    if (!relay->handler.ended) {
        forget(relay);
    } else if (relay->let_in) {
        explain(relay, "the connection was lost");
        end(relay);
    } else if (relay->unknown) {
        relay->retry_ns = clock_now_ns() + PAUSE_NS;
    }
}

static int on_event(struct lws *socket, enum lws_callback_reasons reason, void *user, void *bytes,
                    size_t size) {
    (void)user;
    struct relay *relay = lws_get_opaque_user_data(socket);
    if (!relay)
        return 0;
    switch (reason) {
    case LWS_CALLBACK_CLIENT_APPEND_HANDSHAKE_HEADER:
        return say_who(relay, bytes, size);
    case LWS_CALLBACK_CLIENT_ESTABLISHED:
        ws_keep_queue_short(socket);
        return 0;
    case LWS_CALLBACK_CLIENT_RECEIVE:
        return hear(relay, bytes, size);
    case LWS_CALLBACK_CLIENT_WRITEABLE:
        return write_next(relay);
    case LWS_CALLBACK_WS_PEER_INITIATED_CLOSE:
        hear_close(relay, bytes, size);
        return ws_closed(socket, false);
    case LWS_CALLBACK_WSI_DESTROY: // the one event that every end of a connection has
        if (socket == relay->socket)
            lost_socket(relay);
        return 0;
    default:
        return 0;
    }
}

// ---- life ---------------------------------------------------------------------------------------

enum result relays_create(const char *authority, struct relays **out_relays, struct error *err) {
    struct relays *relays = alloc(1, sizeof *relays);
    relays->protocols[0] =
        (struct lws_protocols){.name = WIRE_LIVE_SUBPROTOCOL, .callback = on_event};
    relays->lookups =
        task_pool_create(&(struct task_pool_settings){.threads = 2, .tasks_max = RELAYS_MAX});
    enum result result = trust(relays, authority, err);
    if (result != RESULT_OK)
        relays_destroy(&relays);
    *out_relays = relays;
    return result;
}

enum result relays_begin(struct relays *relays, struct lws_context *context, int most,
                         struct error *err) {
    const struct lws_context_creation_info info = {
        .port = CONTEXT_PORT_NO_LISTEN,
        .protocols = relays->protocols,
        .provided_client_ssl_ctx = relays->tls,
        .options = LWS_SERVER_OPTION_DO_SSL_GLOBAL_INIT,
        .vhost_name = "relays",
    };
    relays->context = context;
    relays->most = most;
    relays->vhost = lws_create_vhost(context, &info);
    return relays->vhost ? RESULT_OK
                         : fail(err, RESULT_IO, "connections to other servers cannot be set up");
}

void relays_destroy(struct relays **owned) {
    struct relays *relays = *owned;
    *owned = NULL;
    if (!relays)
        return;
    task_pool_destroy(&relays->lookups);
    SSL_CTX_free(relays->tls);
    free(relays);
}
