// The caller's end of the local socket.
#include "base/check.h"
#include "net/console.h"
#include "net/console_parts.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/un.h>
#include <unistd.h>

#define CALL_TIMEOUT_S 10
#define LONG_TIMEOUT_S 600

struct console_call {
    const char *path;
    struct exchange exchange;
    pb_size_t wanted; // which message answers
    arthron_Console asked, answer;
    lws_sorted_usec_list_t timeout;
    bool connected, done;
    int timeout_s;
    enum result result;
    struct error *err;
};

static void finish(struct console_call *call, enum result result, const char *text) {
    if (call->done)
        return;
    call->done = true;
    call->result = result;
    if (result != RESULT_OK)
        fail(call->err, result, "%s: %s", call->path, text);
}

static void read_reply(struct console_call *call) {
    struct exchange *x = &call->exchange;
    struct error err;
    if (wire_decode_console(x->in, x->in_size, &call->answer, &err) != RESULT_OK)
        finish(call, RESULT_FORMAT, err.text);
    else if (call->answer.which_message == call->wanted)
        finish(call, RESULT_OK, NULL);
    else if (call->answer.which_message == arthron_Console_command_reply_tag)
        finish(call, RESULT_REFUSED, call->answer.message.command_reply.text);
    else
        finish(call, RESULT_FORMAT, "the server's answer does not match the question");
}

static int receive_reply(struct console_call *call, struct lws *socket, const void *bytes,
                         size_t size) {
    bool whole = false;
    if (!console_collect(&call->exchange, socket, bytes, size, &whole))
        finish(call, RESULT_LIMIT, "the server's answer is too long");
    else if (whole)
        read_reply(call);
    return call->done ? -1 : 0;
}

static int on_server(struct lws *socket, enum lws_callback_reasons reason, void *user, void *bytes,
                     size_t size) {
    (void)user;
    struct console_call *call = lws_context_user(lws_get_context(socket));
    switch (reason) {
    case LWS_CALLBACK_CLIENT_ESTABLISHED:
        call->connected = true;
        lws_callback_on_writable(socket);
        return 0;
    case LWS_CALLBACK_CLIENT_WRITEABLE:
        return console_write(&call->exchange, socket);
    case LWS_CALLBACK_CLIENT_RECEIVE:
        return receive_reply(call, socket, bytes, size);
    case LWS_CALLBACK_WSI_DESTROY: // the one event that every end of a connection has
        if (call->connected)
            finish(call, RESULT_CLOSED, "the server closed the connection without an answer");
        else
            finish(call, RESULT_MISSING, "no server answers there");
        return 0;
    default:
        return 0;
    }
}

static void on_timeout(lws_sorted_usec_list_t *timeout) {
    struct console_call *call = lws_container_of(timeout, struct console_call, timeout);
    char text[48];
    snprintf(text, sizeof text, "no answer within %d s", call->timeout_s);
    finish(call, RESULT_TIMEOUT, text);
}

static void make_call(struct console_call *call) {
    static const struct lws_protocols protocols[] = {
        {.name = WIRE_CONSOLE_SUBPROTOCOL, .callback = on_server},
        {0},
    };
    char address[sizeof((struct sockaddr_un *)0)->sun_path + 2];
    struct lws_context_creation_info info = {
        .port = CONTEXT_PORT_NO_LISTEN,
        .protocols = protocols,
        .user = call,
        .gid = -1,
        .uid = -1,
    };
    lws_set_log_level(0, NULL);
    struct lws_context *context = lws_create_context(&info);
    NEED(context, "memory");
    snprintf(address, sizeof address, "+%s", call->path); // "+": a UNIX socket
    struct lws_client_connect_info to = {
        .context = context,
        .address = address,
        .host = "localhost",
        .origin = "localhost",
        .path = "/",
        .protocol = WIRE_CONSOLE_SUBPROTOCOL,
    };
    lws_sul_schedule(context, 0, &call->timeout, on_timeout, call->timeout_s * LWS_USEC_PER_SEC);
    if (!lws_client_connect_via_info(&to))
        finish(call, RESULT_MISSING, "no server answers there");
    while (!call->done)
        lws_service(context, 0);
    lws_context_destroy(context);
}

// What libwebsockets does not tell: why a connection would fail.
static enum result check_way(const char *path, struct error *err) {
    if (access(path, R_OK | W_OK) == 0)
        return RESULT_OK;
    if (errno == ENOENT)
        return fail(err, RESULT_MISSING, "%s: there is no such socket; does the server run?", path);
    return errno == EACCES ? console_refuse_user(path, err)
                           : fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
}

static int timeout_of(const arthron_Console *asked) {
    if (asked->which_message != arthron_Console_command_tag)
        return CALL_TIMEOUT_S;
    return console_is_long(asked->message.command.kind) ? LONG_TIMEOUT_S : CALL_TIMEOUT_S;
}

// `call` is all zero but for what is asked and wanted.
static enum result ask(const char *socket_path, struct console_call *call, struct error *err) {
    enum result result = console_check_length(socket_path, err);
    if (result == RESULT_OK)
        result = check_way(socket_path, err);
    if (result != RESULT_OK)
        return result;
    call->path = socket_path;
    call->err = err;
    call->timeout_s = timeout_of(&call->asked);
    result = wire_encode_console(&call->asked, call->exchange.out, sizeof call->exchange.out,
                                 &call->exchange.out_size);
    CHECK(result == RESULT_OK); // every message of the schema fits WIRE_CONSOLE_MAX
    make_call(call);
    return call->result;
}

enum result console_call(const char *socket_path, const arthron_Command *command,
                         arthron_CommandReply *out_reply, struct error *err) {
    struct console_call *call = alloc(1, sizeof *call);
    call->asked.which_message = arthron_Console_command_tag;
    call->asked.message.command = *command;
    call->wanted = arthron_Console_command_reply_tag;
    enum result result = ask(socket_path, call, err);
    if (result == RESULT_OK)
        *out_reply = call->answer.message.command_reply;
    free(call);
    return result;
}

enum result console_ask_metrics(const char *socket_path, const char *station,
                                arthron_Metrics *out_metrics, struct error *err) {
    struct console_call *call = alloc(1, sizeof *call);
    call->asked.which_message = arthron_Console_metrics_ask_tag;
    snprintf(call->asked.message.metrics_ask.station,
             sizeof call->asked.message.metrics_ask.station, "%s", station);
    call->wanted = arthron_Console_metrics_tag;
    enum result result = ask(socket_path, call, err);
    if (result == RESULT_OK)
        *out_metrics = call->answer.message.metrics;
    free(call);
    return result;
}
