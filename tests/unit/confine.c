// This program starts itself, as the programs of the project do: with words, it is the confined
// one.
#include "confine/confine.h"

#include "base/check.h"
#include "test.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#ifdef CONFINE_SANITIZED
#define IS_SANITIZED 1
#else
#define IS_SANITIZED 0
#endif

static const struct confine_limits limits = {.memory_mb = 200, .cpu_s = 1};

// ---- the confined one ---------------------------------------------------------------------------

static void *do_nothing(void *argument) {
    return argument;
}

// What it could do, as letters.
static int try_all(void) {
    char did[16] = "";
    pthread_t thread;
    int file;
    if (socket(AF_INET, SOCK_STREAM, 0) >= 0 || socket(AF_UNIX, SOCK_STREAM, 0) >= 0)
        strcat(did, "s");
    if ((file = open("/tmp/arthron-test-confined", O_WRONLY | O_CREAT, 0600)) >= 0)
        strcat(did, "w");
    if (unlink("/tmp/arthron-test-confined") == 0 || mkdir("/tmp/arthron-test-confined", 0700) == 0)
        strcat(did, "u");
    if (mmap(NULL, (size_t)400 << 20, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0) !=
        MAP_FAILED)
        strcat(did, "m");
    if (fork() >= 0)
        strcat(did, "f");
    if (kill(getppid(), 0) == 0)
        strcat(did, "k");
    execl("/bin/true", "true", NULL);
    if ((file = open("/proc/self/status", O_RDONLY)) >= 0)
        strcat(did, "R"); // this, and what follows, it may
    if (!pthread_create(&thread, NULL, do_nothing, NULL) && !pthread_join(thread, NULL))
        strcat(did, "T");
    if (fcntl(100, F_GETFD) < 0)
        strcat(did, "C"); // what the other had open
    return confine_answer(RESULT_OK, NULL, did, strlen(did));
}

static int answer_much(size_t size) {
    char *much = alloc(size, 1);
    memset(much, 'x', size);
    int code = confine_answer(RESULT_OK, NULL, much, size);
    free(much);
    return code;
}

static int be_confined(const char *word) {
    struct error why = {"the file has\na fault"};
    confine_self(&limits);
    if (!strcmp(word, "try"))
        return try_all();
    if (!strcmp(word, "refuse"))
        return confine_answer(RESULT_CORRUPT, &why, NULL, 0);
    if (!strcmp(word, "much"))
        return answer_much(1000000);
    if (!strcmp(word, "memory"))
        return answer_much((size_t)300 << 20);
    if (!strcmp(word, "abort"))
        abort();
    if (!strcmp(word, "linger")) { // says all, and stays
        confine_answer(RESULT_OK, NULL, "x", 1);
        close(STDOUT_FILENO);
        sleep(60);
    }
    if (!strcmp(word, "busy"))
        for (volatile unsigned i = 0;; i++)
            continue;
    return EXIT_FAILURE; // without a word
}

// ---- the other ----------------------------------------------------------------------------------

static enum result ask(const char *word, size_t size_max, char **out, size_t *out_size,
                       struct error *err) {
    const char *const arguments[] = {"test-confine", word, NULL};
    uint8_t *payload;
    enum result result = confine_run(arguments, &limits, size_max, &payload, out_size, err);
    *out = (char *)payload;
    return result;
}

static void it_reads_and_computes_and_does_nothing_else(void **state) {
    (void)state;
    char *did;
    size_t size;
    struct error err;
    if (IS_SANITIZED)
        skip();
    int held = fcntl(open("/dev/null", O_RDONLY), F_DUPFD, 100); // not closed by exec
    assert_int_equal(held, 100);
    assert_int_equal(ask("try", 100, &did, &size, &err), RESULT_OK);
    close(held);
    assert_int_equal(size, 3);
    assert_memory_equal(did, "RTC", 3);
    free(did);
}

static void an_answer_arrives_whole(void **state) {
    (void)state;
    char *answer;
    size_t size;
    assert_int_equal(ask("much", 1000000, &answer, &size, NULL), RESULT_OK);
    assert_int_equal(size, 1000000);
    for (size_t i = 0; i < size; i++)
        assert_int_equal(answer[i], 'x');
    free(answer);
}

static void what_it_refuses_is_told_in_its_words_on_one_line(void **state) {
    (void)state;
    char *answer;
    size_t size;
    struct error err;
    assert_int_equal(ask("refuse", 100, &answer, &size, &err), RESULT_CORRUPT);
    assert_string_equal(err.text, "the file has a fault");
    assert_null(answer);
}

static void one_that_is_ended_or_answers_too_much_leaves_an_error(void **state) {
    (void)state;
    static const char *const words[] = {"abort", "busy", "nothing", "much", "memory", "linger"};
    for (size_t i = 0; i < sizeof words / sizeof *words; i++) {
        char *answer;
        size_t size;
        struct error err;
        assert_int_equal(ask(words[i], 1000, &answer, &size, &err), RESULT_LIMIT);
        assert_non_null(strstr(err.text, "200 MB"));
        assert_null(answer);
    }
    assert_int_equal(waitpid(-1, NULL, WNOHANG), -1); // and none behind
}

static void an_ignored_signal_of_children_changes_nothing(void **state) {
    (void)state;
    char *answer;
    size_t size;
    signal(SIGCHLD, SIG_IGN); // as some parents leave it to their children
    assert_int_equal(ask("much", 1000000, &answer, &size, NULL), RESULT_OK);
    free(answer);
}

int main(int argc, char **argv) {
    if (argc > 1)
        return be_confined(argv[1]);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_reads_and_computes_and_does_nothing_else),
        cmocka_unit_test(an_answer_arrives_whole),
        cmocka_unit_test(what_it_refuses_is_told_in_its_words_on_one_line),
        cmocka_unit_test(one_that_is_ended_or_answers_too_much_leaves_an_error),
        cmocka_unit_test(an_ignored_signal_of_children_changes_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
