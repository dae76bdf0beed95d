#include "base/check.h"
#include "confine/confine.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <sched.h>
#include <seccomp.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#define EXIT_NOT_CONFINED 3

static _Noreturn void give_up(const char *what) {
    fprintf(stderr, "arthron: a reader cannot be confined: %s: %s\n", what, strerror(errno));
    _exit(EXIT_NOT_CONFINED);
}

// It may write no file, and the kernel would end it at its first byte.
static void need_reader_of_answer(void) {
    struct stat status;
    if (fstat(STDOUT_FILENO, &status) || !S_ISREG(status.st_mode))
        return;
    fputs("arthron: the answer of this command goes to a pipe, not to a file\n", stderr);
    _exit(EXIT_NOT_CONFINED);
}

static void set_limit(__rlimit_resource_t resource, rlim_t value, const char *name) {
    struct rlimit limit = {value, value};
    if (setrlimit(resource, &limit))
        give_up(name);
}

// What a reader of files needs: memory, files to read, threads of its own libraries, time.
static const char *const calls[] = {
    "brk",
    "clock_gettime",
    "clock_nanosleep",
    "close",
    "exit",
    "exit_group",
    "fcntl",
    "fstat",
    "fstatfs",
    "futex",
    "getcpu",
    "getcwd",
    "getdents64",
    "getpid",
    "getrandom",
    "gettid",
    "getuid",
    "geteuid",
    "lseek",
    "lstat",
    "madvise",
    "mmap",
    "mprotect",
    "mremap",
    "munmap",
    "newfstatat",
    "pread64",
    "read",
    "readlink",
    "readlinkat",
    "readv",
    "restart_syscall",
    "rseq",
    "rt_sigaction",
    "rt_sigprocmask",
    "rt_sigreturn",
    "sched_getaffinity",
    "sched_yield",
    "set_robust_list",
    "sigaltstack",
    "stat",
    "statx",
    "sysinfo",
    "uname",
    "write",
    "writev",
};

static int allow_calls(scmp_filter_ctx filter) {
    int failed = 0;
    for (size_t i = 0; i < sizeof calls / sizeof *calls && !failed; i++) {
        int number = seccomp_syscall_resolve_name(calls[i]);
        if (number != __NR_SCMP_ERROR)
            failed = seccomp_rule_add(filter, SCMP_ACT_ALLOW, number, 0);
    }
    return failed;
}

// Files to read, and threads of this process.
static int allow_some(scmp_filter_ctx filter) {
    const scmp_datum_t writes = O_WRONLY | O_RDWR | O_CREAT | O_TRUNC;
    int failed = seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(openat), 1,
                                  SCMP_A2(SCMP_CMP_MASKED_EQ, writes, 0));
    if (!failed)
        failed = seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(open), 1,
                                  SCMP_A1(SCMP_CMP_MASKED_EQ, writes, 0));
    if (!failed)
        failed = seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(clone), 1,
                                  SCMP_A0(SCMP_CMP_MASKED_EQ, CLONE_THREAD, CLONE_THREAD));
    if (!failed) // to end itself, and nobody else
        failed = seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(tgkill), 1,
                                  SCMP_A0(SCMP_CMP_EQ, (scmp_datum_t)getpid()));
    if (!failed) // its flags lie in memory: the C library then takes clone
        failed = seccomp_rule_add(filter, SCMP_ACT_ERRNO(ENOSYS), SCMP_SYS(clone3), 0);
    return failed;
}

static void filter_calls(void) {
    scmp_filter_ctx filter = seccomp_init(SCMP_ACT_ERRNO(EPERM));
    int failed = filter ? 0 : -ENOMEM;
    if (!failed)
        failed = allow_calls(filter);
    if (!failed)
        failed = allow_some(filter);
    if (!failed)
        failed = seccomp_load(filter);
    seccomp_release(filter);
    if (failed)
        fprintf(stderr, "arthron: a reader runs without seccomp: %s\n", strerror(-failed));
}

void confine_self(const struct confine_limits *limits) {
    pid_t parent = getppid();
    if (prctl(PR_SET_PDEATHSIG, SIGKILL) || prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0))
        give_up("prctl");
    if (getppid() != parent)
        _exit(EXIT_NOT_CONFINED);
    need_reader_of_answer();
    signal(SIGXFSZ, SIG_IGN); // of what goes to stderr, where that is a file
    close_range(STDERR_FILENO + 1, UINT_MAX, 0);
    set_limit(RLIMIT_CPU, (rlim_t)limits->cpu_s, "processor time");
    set_limit(RLIMIT_CORE, 0, "core files");
#ifndef CONFINE_SANITIZED
    set_limit(RLIMIT_FSIZE, 0, "size of files");
    set_limit(RLIMIT_AS, (rlim_t)limits->memory_mb << 20, "memory");
    filter_calls();
#else
    (void)filter_calls, (void)calls;
#endif
}

// ---- the answer ---------------------------------------------------------------------------------

static bool put(const void *bytes, size_t size) {
    const char *at = bytes;
    while (size) {
        ssize_t written = write(STDOUT_FILENO, at, size);
        if (written < 0 && errno != EINTR)
            return false;
        if (written > 0) {
            at += written;
            size -= (size_t)written;
        }
    }
    return true;
}

int confine_answer_pieces(const struct confine_piece *pieces, int count) {
    uint8_t code = RESULT_OK;
    bool good = put(&code, 1);
    for (int i = 0; i < count && good; i++)
        good = put(pieces[i].bytes, pieces[i].size);
    return good ? EXIT_SUCCESS : EXIT_FAILURE;
}

int confine_answer(enum result result, const struct error *err, const void *payload, size_t size) {
    const struct confine_piece piece = {payload, size};
    uint8_t code = (uint8_t)result;
    if (result == RESULT_OK)
        return confine_answer_pieces(&piece, 1);
    return put(&code, 1) && put(err->text, strlen(err->text)) ? EXIT_SUCCESS : EXIT_FAILURE;
}
