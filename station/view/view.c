#include "view/view.h"

#include "base/check.h"
#include "base/newest.h"
#include "view/admission.h"
#include "websocket/ws_server.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

#define HANDSHAKE_S 5
#define STRANGERS_MAX 16 // that have not said yet what they want
#define SEND_BUFFER 4096 // of each viewer: what waits in the kernel grows old

struct view_client {
    struct lws *socket;
    uint64_t serial; // of what it was sent last
};

struct view {
    struct view_config config;
    char token[TOKEN_LENGTH + 1];
    struct ws_server *server;
    struct newest *newest; // of arthron_View
    uint64_t shown;        // the caller's thread only
    atomic_int viewer_count;
    // The view's thread only.
    struct view_client viewers[VIEW_VIEWERS_MAX];
    uint64_t serial; // of the message below
    size_t size;
    uint8_t header[LWS_PRE]; // libwebsockets writes its own before the bytes
    uint8_t bytes[WIRE_VIEW_MAX];
};

// ---- viewers ------------------------------------------------------------------------------------

static struct view_client *find_viewer(struct view *view, const struct lws *socket) {
    for (int i = 0; i < VIEW_VIEWERS_MAX; i++)
        if (view->viewers[i].socket == socket)
            return &view->viewers[i];
    return NULL;
}

// It begins with the next message: the last one may be from long ago.
static int let_in(struct view *view, struct lws *socket) {
    struct view_client *viewer = find_viewer(view, NULL);
    int size = SEND_BUFFER;
    if (!viewer)
        return -1;
    setsockopt(lws_get_socket_fd(socket), SOL_SOCKET, SO_SNDBUF, &size, sizeof size);
    *viewer = (struct view_client){socket, view->serial};
    atomic_fetch_add(&view->viewer_count, 1);
    return 0;
}

static int let_go(struct view *view, const struct lws *socket) {
    struct view_client *viewer = find_viewer(view, socket);
    if (viewer) {
        viewer->socket = NULL;
        atomic_fetch_sub(&view->viewer_count, 1);
    }
    return 0;
}

static int write_newest(struct view *view, struct lws *socket) {
    struct view_client *viewer = find_viewer(view, socket);
    if (!viewer || viewer->serial == view->serial)
        return 0;
    viewer->serial = view->serial;
    int written = lws_write(socket, view->bytes, view->size, LWS_WRITE_BINARY);
    return written < (int)view->size ? -1 : 0;
}

// The most of everything does not fit: then the attempt is told without its goals and errors.
static void encode(struct view *view, arthron_View *message) {
    if (wire_encode_view(message, view->bytes, sizeof view->bytes, &view->size) == RESULT_OK)
        return;
    message->attempt.goals_count = message->attempt.errors_count = 0;
    enum result result = wire_encode_view(message, view->bytes, sizeof view->bytes, &view->size);
    CHECK(result == RESULT_OK);
}

static void take_newest(void *user) {
    struct view *view = user;
    arthron_View message;
    if (!newest_take(view->newest, &message))
        return;
    encode(view, &message);
    view->serial++;
    for (int i = 0; i < VIEW_VIEWERS_MAX; i++)
        if (view->viewers[i].socket)
            lws_callback_on_writable(view->viewers[i].socket);
}

// ---- admission ----------------------------------------------------------------------------------

// Empty where it was not sent or is too long to be one of ours.
static const char *header(struct lws *socket, enum lws_token_indexes token, char *out, int size) {
    if (lws_hdr_copy(socket, out, size, token) < 0)
        out[0] = '\0';
    return out;
}

static int judge(struct view *view, struct lws *socket) {
    char path[128], host[128], origin[128], subprotocol[128], argument[128];
    const char *token = lws_get_urlarg_by_name(socket, "token=", argument, sizeof argument);
    int origin_length = lws_hdr_total_length(socket, WSI_TOKEN_ORIGIN);
    struct admission_request request = {
        .path = header(socket, WSI_TOKEN_GET_URI, path, sizeof path),
        .host = header(socket, WSI_TOKEN_HOST, host, sizeof host),
        .origin = header(socket, WSI_TOKEN_ORIGIN, origin, sizeof origin),
        .subprotocol = header(socket, WSI_TOKEN_PROTOCOL, subprotocol, sizeof subprotocol),
        .token = token ? token : "",
    };
    if (origin_length > 0 && !origin[0])
        return HTTP_STATUS_FORBIDDEN;
    int status = admission_status(&view->config, view->token, &request);
    return status || find_viewer(view, NULL) ? status : HTTP_STATUS_SERVICE_UNAVAILABLE;
}

static int answer_upgrade(struct view *view, struct lws *socket) {
    int status = judge(view, socket);
    if (!status)
        return 0;
    return lws_return_http_status(socket, (unsigned)status, NULL) < 0 ? -1 : 1;
}

// ---- libwebsockets ------------------------------------------------------------------------------

static int on_event(struct lws *socket, enum lws_callback_reasons reason, void *user, void *bytes,
                    size_t size) {
    (void)user, (void)bytes, (void)size;
    struct view *view = lws_context_user(lws_get_context(socket));
    switch (reason) {
    case LWS_CALLBACK_HTTP_CONFIRM_UPGRADE:
        return answer_upgrade(view, socket);
    case LWS_CALLBACK_HTTP: // not even a WebSocket
        return lws_return_http_status(socket, HTTP_STATUS_NOT_FOUND, NULL) < 0 ||
                       lws_http_transaction_completed(socket)
                   ? -1
                   : 0;
    case LWS_CALLBACK_RAW_ADOPT: // CONNECT: nobody would time it out
        return -1;
    case LWS_CALLBACK_ESTABLISHED:
        return let_in(view, socket);
    case LWS_CALLBACK_SERVER_WRITEABLE:
        return write_newest(view, socket);
    case LWS_CALLBACK_RECEIVE: // a viewer looks on, no more
        lws_close_reason(socket, LWS_CLOSE_STATUS_POLICY_VIOLATION, NULL, 0);
        return -1;
    case LWS_CALLBACK_CLOSED:
        return let_go(view, socket);
    default:
        return 0;
    }
}

static const struct lws_protocols protocols[] = {
    {.name = WIRE_VIEW_SUBPROTOCOL, .callback = on_event},
    {0},
};

static enum result listen_at(struct view *view, struct error *err) {
    const struct lws_context_creation_info info = {
        .iface = "127.0.0.1",
        .port = view->config.port,
        .protocols = protocols,
        .timeout_secs = HANDSHAKE_S,
        .fd_limit_per_thread = VIEW_VIEWERS_MAX + STRANGERS_MAX,
        .vhost_name = "view",
    };
    const struct ws_server_handler handler = {.user = view, .on_wake = take_newest};
    if (ws_server_create(WS_SERVER_PLAIN, &info, &handler, &view->server, err) == RESULT_OK)
        return RESULT_OK;
    return fail_in(err, RESULT_IO, "view: ");
}

// ---- life ---------------------------------------------------------------------------------------

static void release(struct view *view) {
    ws_server_destroy(&view->server);
    newest_destroy(&view->newest);
    free(view);
}

enum result view_create(const struct view_config *config, struct view **out_view,
                        struct error *err) {
    struct view *view = alloc(1, sizeof *view);
    view->config = *config;
    view->newest = newest_create(sizeof(arthron_View));
    *out_view = NULL;
    enum result result = token_get(config->token_path, view->token, err);
    if (result == RESULT_OK)
        result = listen_at(view, err);
    if (result != RESULT_OK) {
        release(view);
        return result;
    }
    ws_server_start(view->server);
    *out_view = view;
    return RESULT_OK;
}

void view_destroy(struct view **view) {
    if (!*view)
        return;
    ws_server_stop((*view)->server);
    release(*view);
    *view = NULL;
}

// ---- any thread ---------------------------------------------------------------------------------

int view_port(const struct view *view) {
    return ws_server_port(view->server);
}

bool view_is_watched(const struct view *view) {
    return atomic_load(&view->viewer_count) > 0;
}

void view_show(struct view *view, arthron_View *message) {
    message->number = ++view->shown;
    if (newest_put(view->newest, message))
        ws_server_wake(view->server);
}
