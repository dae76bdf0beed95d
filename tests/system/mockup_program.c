#include "mockup_program.h"

#include "test.h"

#include <signal.h>
#include <stdio.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

static void keep_line(struct mockup *m, const char *line) {
    if (sscanf(line, "modbus-tcp %63s", m->modbus_tcp) == 1 ||
        sscanf(line, "modbus-rtu %127s", m->modbus_rtu) == 1 ||
        sscanf(line, "tracker %63s", m->tracker) == 1)
        return;
    fail_msg("the mock-up says \"%s\"", line);
}

struct mockup started(int lines, const char *const *arguments) {
    const char *argv[32] = {MOCKUP};
    int pipes[2], count = 1;
    while (arguments[count - 1]) {
        argv[count] = arguments[count - 1];
        count++;
    }
    assert_int_equal(0, pipe(pipes));
    struct mockup m = {.pid = fork()};
    if (!m.pid) {
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        dup2(pipes[1], STDOUT_FILENO);
        close(pipes[0]);
        close(pipes[1]);
        execv(MOCKUP, (char *const *)argv);
        _exit(127);
    }
    close(pipes[1]);
    FILE *out = fdopen(pipes[0], "r");
    char line[256];
    for (int i = 0; i < lines; i++) {
        assert_non_null(fgets(line, sizeof line, out));
        keep_line(&m, line);
    }
    fclose(out);
    return m;
}

int ended(struct mockup *m, int signal_number) {
    int status;
    if (signal_number)
        kill(m->pid, signal_number);
    assert_int_equal(m->pid, waitpid(m->pid, &status, 0));
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}
