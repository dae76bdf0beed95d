#include "commands/commands.h"

#include <stdio.h>
#include <string.h>

static const char help[] =
    "Usage: arthron-server COMMAND [ARGUMENT ...]\n"
    "\n"
    "The training server: takes stations' poses, warps them, records every session.\n"
    "\n"
    "Commands:\n"
    "  run       serve until SIGTERM\n"
    "  keys      make the server's keys, enrol and revoke stations\n"
    "  session   list, show, start, pause, stop, reset and give another case to the sessions\n"
    "            of a running server\n"
    "  records   keep trainees and courses, list and export sessions and results, erase a\n"
    "            trainee's personal data\n"
    "  backup    copy the records while the server runs\n"
    "  restore   put a backup of the records in their place\n"
    "\n"
    "arthron-server COMMAND --help tells more.\n"
    "  --help      show this\n"
    "  --version   show the version\n";

static const struct {
    const char *name;
    int (*run)(int argc, char **argv);
} commands[] = {
    {"run", command_run},         {"keys", command_keys},     {"session", command_session},
    {"records", command_records}, {"backup", command_backup}, {"restore", command_restore},
};

int main(int argc, char **argv) {
    if (argc > 1 && !strcmp(argv[1], "--help")) {
        fputs(help, stdout);
        return 0;
    }
    if (argc > 1 && !strcmp(argv[1], "--version")) {
        puts("arthron-server " ARTHRON_VERSION);
        return 0;
    }
    for (size_t i = 0; argc > 1 && i < sizeof commands / sizeof *commands; i++)
        if (!strcmp(argv[1], commands[i].name))
            return commands[i].run(argc - 1, argv + 1);
    if (argc > 1)
        fprintf(stderr, "arthron-server: no command '%s'\n", argv[1]);
    fputs(help, stderr);
    return 2;
}
