#include "net/console.h"

#include "base/check.h"
#include "net/console_parts.h"
#include "websocket/ws_server.h"

#include <errno.h>
#include <libgen.h>
#include <limits.h>
#include <pthread.h>
#include <pwd.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#define CALLERS_MAX 32
#define ACTOR_MAX 64
#define LONG_COMMANDS_MAX 4 // of that, at once

// A command that takes long, on a thread of its own, so that other callers are answered meanwhile.
struct long_command {
    struct console *console;
    struct long_command *next;
    struct lws *socket;        // who asked; NULL: gone
    struct exchange *exchange; // of that socket
    pthread_t thread;
    atomic_bool done;
    char actor[ACTOR_MAX];
    arthron_Command asked;
    arthron_Console answer;
};

struct console {
    struct console_handler handler;
    struct ws_server *server;
    arthron_Console asked, answer;
    struct long_command *long_commands;
    int long_count;
};

// The user of the process at the other end, or its number. False: the system does not tell.
static bool name_caller(struct lws *socket, char out[ACTOR_MAX]) {
    struct ucred caller;
    socklen_t size = sizeof caller;
    struct passwd entry, *found = NULL;
    char texts[1024];
    if (getsockopt(lws_get_socket_fd(socket), SOL_SOCKET, SO_PEERCRED, &caller, &size) != 0)
        return false;
    if (getpwuid_r(caller.uid, &entry, texts, sizeof texts, &found) == 0 && found)
        snprintf(out, ACTOR_MAX, "%s", found->pw_name);
    else
        snprintf(out, ACTOR_MAX, "user %u", (unsigned)caller.uid);
    return true;
}

static void answer_command(struct console *console, struct lws *socket) {
    char actor[ACTOR_MAX];
    if (!name_caller(socket, actor))
        strcpy(console->answer.message.command_reply.text,
               "the system does not tell whose command this is; try again");
    else
        console->handler.on_command(console->handler.user, actor, &console->asked.message.command,
                                    &console->answer.message.command_reply);
}

static void answer_metrics_ask(struct console *console) {
    const char *station = console->asked.message.metrics_ask.station;
    console->answer.which_message = arthron_Console_metrics_tag;
    if (console->handler.on_metrics(console->handler.user, station,
                                    &console->answer.message.metrics))
        return;
    console->answer = (arthron_Console){.which_message = arthron_Console_command_reply_tag};
    snprintf(console->answer.message.command_reply.text,
             sizeof console->answer.message.command_reply.text, "there is no station %s", station);
}

static void send_answer(struct exchange *x, struct lws *socket, const arthron_Console *answer) {
    enum result result = wire_encode_console(answer, x->out, sizeof x->out, &x->out_size);
    CHECK(result == RESULT_OK); // every message of the schema fits WIRE_CONSOLE_MAX
    lws_callback_on_writable(socket);
}

// ---- long commands

static void *run_long_command(void *argument) {
    struct long_command *command = argument;
    const struct console_handler *handler = &command->console->handler;
    struct ws_server *server = command->console->server;
    handler->on_command(handler->user, command->actor, &command->asked,
                        &command->answer.message.command_reply);
    atomic_store(&command->done, true);
    ws_server_wake(server); // it is joined before that goes
    return NULL;
}

// False where there are too many already, no thread, or nobody knows whose it is.
static bool start_long_command(struct console *console, struct exchange *x, struct lws *socket) {
    if (console->long_count == LONG_COMMANDS_MAX)
        return false;
    struct long_command *command = alloc(1, sizeof *command);
    command->console = console;
    command->socket = socket;
    command->exchange = x;
    command->asked = console->asked.message.command;
    command->answer.which_message = arthron_Console_command_reply_tag;
    if (!name_caller(socket, command->actor) ||
        pthread_create(&command->thread, NULL, run_long_command, command) != 0) {
        free(command);
        return false;
    }
    command->next = console->long_commands;
    console->long_commands = command;
    console->long_count++;
    x->waits = true;
    return true;
}

static void end_long_commands(struct console *console, bool all) {
    for (struct long_command **at = &console->long_commands; *at;) {
        struct long_command *command = *at;
        if (!all && !atomic_load(&command->done)) {
            at = &command->next;
            continue;
        }
        pthread_join(command->thread, NULL);
        if (command->socket && !all) {
            command->exchange->waits = false;
            send_answer(command->exchange, command->socket, &command->answer);
        }
        *at = command->next;
        console->long_count--;
        free(command);
    }
}

static void forget_caller(struct console *console, const struct lws *socket) {
    for (struct long_command *command = console->long_commands; command; command = command->next)
        if (command->socket == socket)
            command->socket = NULL;
}

// ---- the console's thread

static int answer(struct console *console, struct exchange *x, struct lws *socket) {
    struct error err;
    size_t size = x->in_size;
    x->in_size = 0;
    if (wire_decode_console(x->in, size, &console->asked, &err) != RESULT_OK)
        return -1;
    bool commands = console->asked.which_message == arthron_Console_command_tag;
    bool long_one = commands && console_is_long(console->asked.message.command.kind);
    if (long_one && start_long_command(console, x, socket))
        return 0;
    console->answer = (arthron_Console){.which_message = arthron_Console_command_reply_tag};
    if (long_one)
        strcpy(console->answer.message.command_reply.text,
               "too many undos and copies are running, or the system gives no thread; try again");
    else if (commands)
        answer_command(console, socket);
    else if (console->asked.which_message == arthron_Console_metrics_ask_tag)
        answer_metrics_ask(console);
    else
        strcpy(console->answer.message.command_reply.text,
               "this server does not know this message");
    send_answer(x, socket, &console->answer);
    return 0;
}

static int receive_exchange(struct console *console, struct exchange *x, struct lws *socket,
                            const void *bytes, size_t size) {
    bool whole;
    if (x->out_size || x->waits || !console_collect(x, socket, bytes, size, &whole))
        return -1;
    return whole ? answer(console, x, socket) : 0;
}

static int on_caller(struct lws *socket, enum lws_callback_reasons reason, void *user, void *bytes,
                     size_t size) {
    struct console *console = lws_context_user(lws_get_context(socket));
    switch (reason) {
    case LWS_CALLBACK_RECEIVE:
        return receive_exchange(console, user, socket, bytes, size);
    case LWS_CALLBACK_SERVER_WRITEABLE:
        return console_write(user, socket);
    case LWS_CALLBACK_CLOSED:
        forget_caller(console, socket);
        return 0;
    default:
        return 0;
    }
}

static int on_console_other(struct lws *socket, enum lws_callback_reasons reason, void *user,
                            void *bytes, size_t size) {
    (void)socket, (void)user, (void)bytes, (void)size;
    return reason == LWS_CALLBACK_HTTP || reason == LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION ? -1
                                                                                            : 0;
}

static void on_console_wake(void *user) {
    end_long_commands(user, false);
}

static enum result check_folder(const char *path, struct error *err) {
    char copy[PATH_MAX];
    snprintf(copy, sizeof copy, "%s", path);
    const char *folder = dirname(copy);
    if (access(folder, W_OK | X_OK))
        return fail(err, RESULT_IO, "%s: no socket can be made in %s: %s", path, folder,
                    strerror(errno));
    return RESULT_OK;
}

static enum result check_path(const char *path, struct error *err) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    enum result result = console_check_length(path, err);
    if (result != RESULT_OK)
        return result;
    strcpy(address.sun_path, path);
    struct stat status;
    if (lstat(path, &status) == 0 && !S_ISSOCK(status.st_mode))
        return fail(err, RESULT_REFUSED, "%s exists and is not a socket", path);
    int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd < 0)
        return fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    bool answers = connect(fd, (struct sockaddr *)&address, sizeof address) == 0;
    bool is_foreign = !answers && errno == EACCES;
    close(fd);
    if (answers)
        return fail(err, RESULT_REFUSED, "%s is in use: another server is running", path);
    return is_foreign ? console_refuse_user(path, err) : check_folder(path, err);
}

static enum result listen_at_path(struct console *console, const char *path, struct error *err) {
    static const struct lws_protocols protocols[] = {
        {.name = "other", .callback = on_console_other},
        {.name = WIRE_CONSOLE_SUBPROTOCOL,
         .callback = on_caller,
         .per_session_data_size = sizeof(struct exchange)},
        {0},
    };
    const struct lws_context_creation_info info = {
        .iface = path,
        .protocols = protocols,
        .fd_limit_per_thread = CALLERS_MAX,
        .vhost_name = "console",
    };
    const struct ws_server_handler handler = {.user = console, .on_wake = on_console_wake};
    mode_t before = umask(0177); // the socket is never open to others, not for a moment
    enum result result = ws_server_create(WS_SERVER_LOCAL, &info, &handler, &console->server, err);
    umask(before);
    if (result == RESULT_OK && chmod(path, 0600))
        result = fail(err, RESULT_IO, "%s: %s", path, strerror(errno));
    return result;
}

enum result console_create(const char *socket_path, const struct console_handler *handler,
                           struct console **out_console, struct error *err) {
    *out_console = NULL;
    enum result result = check_path(socket_path, err);
    if (result != RESULT_OK)
        return result;
    struct console *console = alloc(1, sizeof *console);
    console->handler = *handler;
    result = listen_at_path(console, socket_path, err);
    if (result != RESULT_OK) {
        ws_server_destroy(&console->server);
        free(console);
        return result;
    }
    *out_console = console; // before the thread runs: its handler may ask for it
    ws_server_start(console->server);
    return RESULT_OK;
}

void console_destroy(struct console **console) {
    struct console *c = *console;
    ws_server_stop(c->server);
    end_long_commands(c, true);
    ws_server_destroy(&c->server); // not before: until now it could still be woken
    free(c);
    *console = NULL;
}
