// What the system does not give: the program ends in order, and what is kept back bridges a
// shortage.
#include "base/check.h"
#include "test.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

// Runs it in a process of its own. Returns the exit status, and what it wrote to stderr.
static int run_apart(void (*run)(void), char *out_said, size_t size) {
    int ends[2];
    assert_int_equal(pipe(ends), 0);
    pid_t pid = fork();
    if (pid == 0) {
        dup2(ends[1], STDERR_FILENO);
        run();
        _exit(0);
    }
    close(ends[1]);
    size_t used = 0;
    for (ssize_t got; (got = read(ends[0], out_said + used, size - 1 - used)) > 0;)
        used += (size_t)got;
    out_said[used] = '\0';
    close(ends[0]);
    int status;
    assert_int_equal(waitpid(pid, &status, 0), pid);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

static void exit_by_signal(int number) {
    _exit(number == SIGABRT ? 3 : 2);
}

static void last_words(void *context) {
    dprintf(STDERR_FILENO, "last: %s\n", (const char *)context);
    NEED(0, "thread"); // a second one, on the way to the end
}

static void lacks_a_descriptor(void) {
    need_before_end(last_words, "the traces");
    need_before_end(last_words, "the audit log");
    NEED(0, "descriptor");
}

static void the_last(void *context) {
    dprintf(STDERR_FILENO, "last: %s\n", (const char *)context);
}

static void has_a_bug(void) {
    signal(SIGABRT, exit_by_signal);
    need_before_end(the_last, "the traces");
    need_before_end(the_last, "the audit log");
    CHECK(1 > 2);
}

static void hangs(void) {
    need_before_end(the_last, "the traces");
    say_last_words();
    say_last_words();
    _exit(4);
}

static void a_bug_and_a_hang_have_last_words_too(void **state) {
    (void)state;
    char said[1024];
    assert_int_equal(run_apart(has_a_bug, said, sizeof said), 3);
    assert_non_null(strstr(said, "check failed: 1 > 2\nlast: the traces\nlast: the audit log\n"));
    assert_int_equal(run_apart(hangs, said, sizeof said), 4);
    assert_string_equal(said, "last: the traces\n");
}

static void a_need_that_is_not_met_ends_the_program_in_order(void **state) {
    (void)state;
    char said[1024];
    assert_int_equal(run_apart(lacks_a_descriptor, said, sizeof said), 1);
    assert_non_null(strstr(said, "the system gives no descriptor ("));
    assert_non_null(strstr(said, "need.c"));
    assert_non_null(strstr(said, "last: the traces\nlast: the audit log\n"));
    assert_null(strstr(said, "no thread"));
}

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__) // they map what they like
#define MIB ((size_t)1 << 20)

static void limit_to(size_t more) {
    unsigned long pages;
    FILE *file = fopen("/proc/self/statm", "r");
    CHECK(file && fscanf(file, "%lu", &pages) == 1);
    fclose(file);
    rlim_t bytes = pages * (rlim_t)getpagesize() + more;
    CHECK(setrlimit(RLIMIT_AS, &(struct rlimit){bytes, bytes}) == 0);
}

static void runs_short(void) {
    memory_keep_back(64 * MIB);
    limit_to(8 * MIB);
    CHECK(!memory_is_short());
    char *memory = alloc(1, 32 * MIB);
    memory[32 * MIB - 1] = 1;
    CHECK(memory_is_short());
    free(memory);
    CHECK(!memory_is_short());
}

static void runs_out(void) {
    runs_short();
    alloc(3, 50 * MIB);
}

static void memory_that_is_kept_back_bridges_a_shortage(void **state) {
    (void)state;
    char said[1024];
    assert_int_equal(run_apart(runs_short, said, sizeof said), 0);
    assert_string_equal(said, "");
}

static void memory_that_is_not_there_ends_the_program_in_order(void **state) {
    (void)state;
    char said[1024];
    assert_int_equal(run_apart(runs_out, said, sizeof said), 1);
    assert_non_null(strstr(said, "the system gives no memory (3 times 52428800 bytes)"));
}
#endif

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_need_that_is_not_met_ends_the_program_in_order),
        cmocka_unit_test(a_bug_and_a_hang_have_last_words_too),
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
        cmocka_unit_test(memory_that_is_kept_back_bridges_a_shortage),
        cmocka_unit_test(memory_that_is_not_there_ends_the_program_in_order),
#endif
    };
    return cmocka_run_group_tests_name("need", tests, NULL, NULL);
}
