// The server's local socket, both ends.
#include "net/console.h"

#include "folder.h"
#include "test.h"

#include <pthread.h>
#include <pwd.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

static char dir[FOLDER_MAX], path[FOLDER_MAX + 8];
static arthron_Command last;

static char last_actor[64];
static atomic_bool blocks; // no COPY is answered while it is set
static atomic_int copying; // how many were begun

static void on_command(void *user, const char *actor, const arthron_Command *command,
                       arthron_CommandReply *reply) {
    (void)user;
    if (command->kind == arthron_Command_Kind_COPY) {
        atomic_fetch_add(&copying, 1);
        while (atomic_load(&blocks))
            usleep(1000);
        reply->ok = true;
        snprintf(reply->text, sizeof reply->text, "copied to %s", command->station);
        return;
    }
    last = *command;
    snprintf(last_actor, sizeof last_actor, "%s", actor);
    reply->ok = command->kind != arthron_Command_Kind_STOP;
    snprintf(reply->text, sizeof reply->text, "about %s", command->station);
    reply->sessions_count = sizeof reply->sessions / sizeof *reply->sessions;
    for (pb_size_t i = 0; i < reply->sessions_count; i++) {
        memset(reply->sessions[i].trace, 'x', sizeof reply->sessions[i].trace - 1);
        reply->sessions[i].steps = i;
    }
}

static bool on_metrics(void *user, const char *station, arthron_Metrics *out) {
    (void)user;
    out->metrics_count = sizeof out->metrics / sizeof *out->metrics;
    for (pb_size_t i = 0; i < out->metrics_count; i++) {
        arthron_Metric *m = &out->metrics[i];
        *m = (arthron_Metric){.version = UINT32_MAX, .value = i, .below_floor = true};
        memset(m->name, 'n', sizeof m->name - 1);
        memset(m->subject, 's', sizeof m->subject - 1);
        memset(m->unit, 'u', sizeof m->unit - 1);
    }
    return !strcmp(station, "anna");
}

static const struct console_handler handler = {.on_command = on_command, .on_metrics = on_metrics};

static struct console *open_console(void) {
    struct console *console;
    struct error err;
    if (console_create(path, &handler, &console, &err) != RESULT_OK)
        fail_msg("%s", err.text);
    return console;
}

static enum result call(enum _arthron_Command_Kind kind, arthron_CommandReply *reply,
                        struct error *err) {
    arthron_Command command = {.kind = kind, .station = "anna", .case_name = "healthy"};
    return console_call(path, &command, reply, err);
}

static void a_command_is_answered(void **state) {
    (void)state;
    static arthron_CommandReply reply;
    struct error err;
    struct console *console = open_console();
    for (int i = 0; i < 20; i++) {
        assert_int_equal(call(arthron_Command_Kind_CASE, &reply, &err), RESULT_OK);
        assert_true(reply.ok);
        assert_string_equal(reply.text, "about anna");
        assert_int_equal(last.kind, arthron_Command_Kind_CASE);
        assert_string_equal(last.case_name, "healthy");
    }
    assert_int_equal(call(arthron_Command_Kind_STOP, &reply, &err), RESULT_OK);
    assert_false(reply.ok);
    console_destroy(&console);
}

static void the_longest_reply_arrives_whole(void **state) {
    (void)state;
    static arthron_CommandReply reply;
    struct error err;
    struct console *console = open_console();
    assert_int_equal(call(arthron_Command_Kind_LIST, &reply, &err), RESULT_OK);
    const int most = sizeof reply.sessions / sizeof *reply.sessions;
    assert_int_equal(reply.sessions_count, most);
    for (int i = 0; i < most; i++) {
        assert_int_equal(reply.sessions[i].steps, i);
        assert_int_equal(strlen(reply.sessions[i].trace), 255);
    }
    console_destroy(&console);
}

static void the_most_metrics_arrive_whole(void **state) {
    (void)state;
    static arthron_Metrics metrics;
    struct error err;
    struct console *console = open_console();
    assert_int_equal(console_ask_metrics(path, "anna", &metrics, &err), RESULT_OK);
    assert_int_equal(metrics.metrics_count, sizeof metrics.metrics / sizeof *metrics.metrics);
    for (pb_size_t i = 0; i < metrics.metrics_count; i++) {
        assert_true(metrics.metrics[i].value == i);
        assert_int_equal(strlen(metrics.metrics[i].subject), 63);
    }
    assert_int_equal(console_ask_metrics(path, "otto", &metrics, &err), RESULT_REFUSED);
    assert_non_null(strstr(err.text, "otto"));
    console_destroy(&console);
}

static void the_actor_of_a_command_is_known(void **state) {
    (void)state;
    static arthron_CommandReply reply;
    struct console *console = open_console();
    const struct passwd *user = getpwuid(getuid());
    assert_non_null(user);
    assert_int_equal(call(arthron_Command_Kind_CASE, &reply, NULL), RESULT_OK);
    assert_string_equal(last_actor, user->pw_name);
    console_destroy(&console);
}

static void *call_twenty_times(void *argument) {
    arthron_CommandReply *reply = calloc(1, sizeof *reply);
    long *answered = argument;
    for (int i = 0; i < 20; i++)
        *answered += call(arthron_Command_Kind_LIST, reply, NULL) == RESULT_OK;
    free(reply);
    return NULL;
}

static void callers_at_the_same_time_are_all_answered(void **state) {
    (void)state;
    struct console *console = open_console();
    pthread_t threads[4];
    long answered[4] = {0};
    for (int i = 0; i < 4; i++)
        pthread_create(&threads[i], NULL, call_twenty_times, &answered[i]);
    for (int i = 0; i < 4; i++) {
        pthread_join(threads[i], NULL);
        assert_int_equal(answered[i], 20);
    }
    console_destroy(&console);
}

static void the_socket_is_for_its_owner_alone(void **state) {
    (void)state;
    struct stat status;
    struct console *console = open_console();
    assert_int_equal(stat(path, &status), 0);
    assert_true(S_ISSOCK(status.st_mode));
    assert_int_equal(status.st_mode & 0777, 0600);
    console_destroy(&console);
}

static void a_second_server_is_refused(void **state) {
    (void)state;
    static arthron_CommandReply reply;
    struct console *second, *first = open_console();
    struct error err;
    assert_int_equal(console_create(path, &handler, &second, &err), RESULT_REFUSED);
    assert_null(second);
    assert_non_null(strstr(err.text, path));
    assert_int_equal(call(arthron_Command_Kind_LIST, &reply, &err), RESULT_OK);
    console_destroy(&first);
}

static void a_stale_socket_is_replaced(void **state) {
    (void)state;
    static arthron_CommandReply reply;
    struct error err;
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    strcpy(address.sun_path, path);
    int stale = socket(AF_UNIX, SOCK_STREAM, 0);
    assert_int_equal(bind(stale, (struct sockaddr *)&address, sizeof address), 0);
    close(stale);
    assert_int_equal(call(arthron_Command_Kind_LIST, &reply, &err), RESULT_MISSING);
    struct console *console = open_console();
    assert_int_equal(call(arthron_Command_Kind_LIST, &reply, &err), RESULT_OK);
    console_destroy(&console);
}

static void a_file_that_is_no_socket_is_left_alone(void **state) {
    (void)state;
    struct console *console;
    struct error err;
    FILE *file = fopen(path, "w");
    fclose(file);
    assert_int_equal(console_create(path, &handler, &console, &err), RESULT_REFUSED);
    assert_int_equal(access(path, F_OK), 0);
    assert_int_equal(unlink(path), 0);
}

static void without_a_server_a_call_says_so(void **state) {
    (void)state;
    static arthron_CommandReply reply;
    struct error err;
    assert_int_equal(call(arthron_Command_Kind_LIST, &reply, &err), RESULT_MISSING);
    assert_non_null(strstr(err.text, path));
}

static void a_path_too_long_for_a_socket_is_refused_at_both_ends(void **state) {
    (void)state;
    char longest[300];
    static arthron_CommandReply reply;
    struct console *console;
    struct error err;
    arthron_Command command = {0};
    memset(longest, 'x', sizeof longest - 1);
    longest[0] = '/';
    longest[sizeof longest - 1] = '\0';
    assert_int_equal(console_create(longest, &handler, &console, &err), RESULT_LIMIT);
    assert_int_equal(console_call(longest, &command, &reply, &err), RESULT_LIMIT);
}

static int make_dir(void **state) {
    (void)state;
    folder_make(dir);
    snprintf(path, sizeof path, "%s/socket", dir);
    return 0;
}

static int remove_dir(void **state) {
    (void)state;
    unlink(path);
    return rmdir(dir);
}

// ---- what takes long ----

struct copier {
    pthread_t thread;
    arthron_CommandReply reply;
    enum result result;
};

static void *copy(void *user) {
    struct copier *copier = user;
    copier->result = call(arthron_Command_Kind_COPY, &copier->reply, NULL);
    return NULL;
}

static void wait_for_copies(int count) {
    for (int i = 0; i < 10000 && atomic_load(&copying) < count; i++)
        usleep(1000);
    assert_int_equal(atomic_load(&copying), count);
}

static void others_are_answered_while_a_copy_is_made(void **state) {
    (void)state;
    static struct copier copiers[4];
    static arthron_CommandReply reply;
    struct console *console = open_console();
    atomic_store(&blocks, true);
    atomic_store(&copying, 0);
    for (int i = 0; i < 4; i++)
        assert_int_equal(pthread_create(&copiers[i].thread, NULL, copy, &copiers[i]), 0);
    wait_for_copies(4);
    for (int i = 0; i < 5; i++) {
        assert_int_equal(call(arthron_Command_Kind_LIST, &reply, NULL), RESULT_OK);
        assert_true(reply.ok);
    }
    assert_int_equal(call(arthron_Command_Kind_COPY, &reply, NULL), RESULT_OK); // one too many
    assert_false(reply.ok);
    assert_non_null(strstr(reply.text, "too many"));
    atomic_store(&blocks, false);
    for (int i = 0; i < 4; i++) {
        pthread_join(copiers[i].thread, NULL);
        assert_int_equal(copiers[i].result, RESULT_OK);
        assert_string_equal(copiers[i].reply.text, "copied to anna");
    }
    assert_int_equal(call(arthron_Command_Kind_COPY, &reply, NULL), RESULT_OK);
    assert_true(reply.ok);
    console_destroy(&console);
}

// Its caller is gone before it is done; and a console that ends waits for it.
static void a_copy_outlives_its_caller_and_not_the_console(void **state) {
    (void)state;
    static arthron_CommandReply reply;
    atomic_store(&blocks, true);
    atomic_store(&copying, 0);
    pid_t caller = fork(); // while there are no threads
    if (caller == 0) {
        while (call(arthron_Command_Kind_COPY, &reply, NULL) == RESULT_MISSING)
            usleep(1000);
        _exit(0);
    }
    struct console *console = open_console();
    wait_for_copies(1);
    assert_int_equal(kill(caller, SIGKILL), 0);
    assert_int_equal(waitpid(caller, NULL, 0), caller);
    assert_int_equal(call(arthron_Command_Kind_LIST, &reply, NULL), RESULT_OK);
    atomic_store(&blocks, false);
    assert_int_equal(call(arthron_Command_Kind_LIST, &reply, NULL), RESULT_OK);
    console_destroy(&console);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_command_is_answered),
        cmocka_unit_test(the_longest_reply_arrives_whole),
        cmocka_unit_test(the_most_metrics_arrive_whole),
        cmocka_unit_test(the_actor_of_a_command_is_known),
        cmocka_unit_test(callers_at_the_same_time_are_all_answered),
        cmocka_unit_test(others_are_answered_while_a_copy_is_made),
        cmocka_unit_test(a_copy_outlives_its_caller_and_not_the_console),
        cmocka_unit_test(the_socket_is_for_its_owner_alone),
        cmocka_unit_test(a_second_server_is_refused),
        cmocka_unit_test(a_stale_socket_is_replaced),
        cmocka_unit_test(a_file_that_is_no_socket_is_left_alone),
        cmocka_unit_test(without_a_server_a_call_says_so),
        cmocka_unit_test(a_path_too_long_for_a_socket_is_refused_at_both_ends),
    };
    return cmocka_run_group_tests(tests, make_dir, remove_dir);
}
