// This program starts itself, as the programs of the project do: with words, it is the confined
// one.
#include "confine/confine.h"

#include "base/check.h"
#include "test.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/ptrace.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
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

static bool may_write(const char *path) {
    char new_path[128];
    snprintf(new_path, sizeof new_path, "%s.new", path);
    return open(new_path, O_WRONLY | O_CREAT, 0600) >= 0 || open(path, O_RDWR) >= 0 ||
           open(path, O_WRONLY) >= 0 || open(path, O_RDONLY | O_TRUNC) >= 0;
}

static bool may_change(const char *path) {
    char new_path[128];
    snprintf(new_path, sizeof new_path, "%s.new", path);
    return mkdir(new_path, 0700) == 0 || link(path, new_path) == 0 ||
           symlink(path, new_path) == 0 || chmod(path, 0644) == 0 || truncate(path, 1) == 0 ||
           rename(path, new_path) == 0 || unlink(path) == 0;
}

static pid_t starter; // asked for before it may no longer be

static bool may_reach(pid_t other) {
    char byte;
    struct iovec here = {&byte, 1}, there = {&byte, 1};
    return kill(other, 0) == 0 || syscall(SYS_tgkill, other, other, 0) == 0 ||
           ptrace(PTRACE_TRACEME, 0, NULL, NULL) == 0 ||
           process_vm_readv(other, &here, 1, &there, 1, 0) >= 0 || errno != EPERM;
}

static bool file_tells(const char *path, const char *const lines[]) {
    static char text[8192];
    FILE *file = fopen(path, "r");
    if (!file)
        return false;
    text[fread(text, 1, sizeof text - 1, file)] = '\0';
    fclose(file);
    for (int i = 0; lines[i]; i++)
        if (!strstr(text, lines[i]))
            return false;
    return true;
}

// What it could do, as letters.
static int try_all(void) {
    static const char *const least[] = {"Max cpu time              1                    1 ",
                                        "Max file size             0                    0 ",
                                        "Max core file size        0                    0 ",
                                        "Max address space         209715200            209715200 ",
                                        NULL};
    char did[16] = "";
    pthread_t thread;
    const char *path = getenv("CONFINED_FILE");
    if (socket(AF_INET, SOCK_STREAM, 0) >= 0 || socket(AF_UNIX, SOCK_STREAM, 0) >= 0)
        strcat(did, "s");
    if (may_write(path))
        strcat(did, "w");
    if (may_change(path))
        strcat(did, "u");
    if (mmap(NULL, (size_t)400 << 20, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0) !=
        MAP_FAILED)
        strcat(did, "m");
    if (fork() >= 0)
        strcat(did, "f");
    if (may_reach(starter))
        strcat(did, "k");
    if (ioctl(STDOUT_FILENO, FIONREAD, &(int){0}) == 0)
        strcat(did, "i");
    execl("/bin/true", "true", NULL);
    if (file_tells("/proc/self/limits", least))
        strcat(did, "L"); // these, and what follows, should be
    if (file_tells("/proc/self/status",
                   (const char *const[]){"NoNewPrivs:\t1", "Seccomp:\t2", NULL}))
        strcat(did, "N");
    if (open(path, O_RDONLY) >= 0)
        strcat(did, "R");
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
    starter = getppid();
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
    if (!strcmp(word, "stay")) {
        fputs("x", stderr);
        sleep(3600); // longer than the test has
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
    char path[] = "/tmp/arthron-test-XXXXXX";
    close(mkstemp(path));
    setenv("CONFINED_FILE", path, 1);
    int held = fcntl(open("/dev/null", O_RDONLY), F_DUPFD, 100); // not closed by exec
    assert_int_equal(held, 100);
    assert_int_equal(ask("try", 100, &did, &size, &err), RESULT_OK);
    close(held);
    assert_int_equal(unlink(path), 0);
    assert_int_equal(size, 5);
    assert_memory_equal(did, "LNRTC", 5);
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

static void one_that_says_nothing_for_too_long_is_ended(void **state) {
    (void)state;
    static const struct confine_limits at_once = {.memory_mb = 200, .cpu_s = 0};
    const char *const arguments[] = {"test-confine", "stay", NULL};
    uint8_t *payload;
    size_t size;
    assert_int_equal(confine_run(arguments, &at_once, 100, &payload, &size, NULL), RESULT_LIMIT);
    assert_int_equal(waitpid(-1, NULL, WNOHANG), -1);
}

static void *cancel(void *cancelled) {
    usleep(100000);
    atomic_store((atomic_bool *)cancelled, true);
    return NULL;
}

static void one_that_is_cancelled_is_ended(void **state) {
    (void)state;
    static atomic_bool cancelled;
    const struct confine_limits patient = {.memory_mb = 200, .cpu_s = 100, .cancelled = &cancelled};
    const char *const arguments[] = {"test-confine", "stay", NULL};
    pthread_t thread;
    uint8_t *payload;
    size_t size;
    assert_int_equal(pthread_create(&thread, NULL, cancel, &cancelled), 0);
    assert_int_equal(confine_run(arguments, &patient, 100, &payload, &size, NULL), RESULT_LIMIT);
    pthread_join(thread, NULL);
    assert_int_equal(waitpid(-1, NULL, WNOHANG), -1);
}

// Its standard error is open until it ends.
static void it_ends_with_the_process_that_started_it(void **state) {
    (void)state;
    int ends[2];
    char said[2];
    assert_int_equal(pipe2(ends, O_CLOEXEC), 0);
    pid_t parent = fork();
    if (parent == 0) {
        char *answer;
        size_t size;
        dup2(ends[1], STDERR_FILENO);
        close(ends[1]);
        ask("stay", 100, &answer, &size, NULL);
        _exit(0);
    }
    close(ends[1]);
    assert_int_equal(read(ends[0], said, 1), 1); // it is confined
    kill(parent, SIGKILL);
    assert_int_equal(waitpid(parent, NULL, 0), parent);
    assert_int_equal(poll(&(struct pollfd){ends[0], POLLIN, 0}, 1, 5000), 1);
    assert_int_equal(read(ends[0], said, 1), 0);
    close(ends[0]);
}

// The one who starts it by hand and looks into a file.
static void an_answer_into_a_file_is_refused_in_words(void **state) {
    (void)state;
    char said[200] = "";
    int ends[2], status;
    FILE *file = tmpfile();
    assert_int_equal(pipe2(ends, O_CLOEXEC), 0);
    pid_t child = fork();
    if (child == 0) {
        dup2(fileno(file), STDOUT_FILENO);
        dup2(ends[1], STDERR_FILENO);
        execl("/proc/self/exe", "test-confine", "much", NULL);
        _exit(99);
    }
    close(ends[1]);
    assert_true(read(ends[0], said, sizeof said - 1) > 0);
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 3);
    assert_non_null(strstr(said, "to a pipe, not to a file"));
    close(ends[0]);
    fclose(file);
}

int main(int argc, char **argv) {
    if (argc > 1)
        return be_confined(argv[1]);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_reads_and_computes_and_does_nothing_else),
        cmocka_unit_test(an_answer_arrives_whole),
        cmocka_unit_test(what_it_refuses_is_told_in_its_words_on_one_line),
        cmocka_unit_test(one_that_is_ended_or_answers_too_much_leaves_an_error),
        cmocka_unit_test(one_that_says_nothing_for_too_long_is_ended),
        cmocka_unit_test(one_that_is_cancelled_is_ended),
        cmocka_unit_test(it_ends_with_the_process_that_started_it),
        cmocka_unit_test(an_ignored_signal_of_children_changes_nothing),
        cmocka_unit_test(an_answer_into_a_file_is_refused_in_words),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
