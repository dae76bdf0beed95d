#include "base/argument.h"
#include "base/output.h"
#include "case/library_memory.h"
#include "commands/commands.h"
#include "mesh/library_memory.h"
#include "websocket/library_memory.h"

#include <stdio.h>
#include <string.h>

static const char help[] =
    "Usage: arthron-server COMMAND [ARGUMENT ...]\n"
    "\n"
    "The training server: receives poses from stations, warps them, records every session.\n"
    "\n"
    "Commands:\n"
    "  run       serves stations and browsers until SIGTERM\n"
    "  keys      makes the server's keys, enrols and revokes stations\n"
    "  session   lists and controls the sessions of a running server\n"
    "  records   lists and changes trainees, courses, accounts; exports sessions and results;\n"
    "            erases a trainee's personal data\n"
    "  backup    copies the records, also of a running server\n"
    "  restore   replaces the records by a backup, also of a running server\n"
    "\n"
    "arthron-server COMMAND --help explains a command.\n"
    "  --help      show this\n"
    "  --version   show the version\n";

static const struct {
    const char *name;
    int (*run)(int argc, char **argv);
} commands[] = {
    {"run", command_run},         {"keys", command_keys},     {"session", command_session},
    {"records", command_records}, {"backup", command_backup}, {"restore", command_restore},
};

enum { COMMAND_COUNT = sizeof commands / sizeof *commands };

static int run(int argc, char **argv) {
    libraries_use_our_memory();
    cxx_libraries_use_our_memory();
    json_uses_our_memory();
    if (argc > 1 && !strcmp(argv[1], "--help")) {
        fputs(help, stdout);
        return 0;
    }
    if (argc > 1 && !strcmp(argv[1], "--version")) {
        puts("arthron-server " ARTHRON_VERSION);
        return 0;
    }
    if (argc > 1 && !strcmp(argv[1], "read-case"))
        return command_read_case(argc - 1, argv + 1);
    if (argc > 1 && !strcmp(argv[1], "rehearse"))
        return command_rehearse(argc - 1, argv + 1);
    for (size_t i = 0; argc > 1 && i < COMMAND_COUNT; i++)
        if (!strcmp(argv[1], commands[i].name))
            return commands[i].run(argc - 1, argv + 1);
    if (argc == 1)
        return argument_wrong("arthron-server", "the command is missing");
    const char *names[COMMAND_COUNT + 1] = {NULL};
    for (size_t i = 0; i < COMMAND_COUNT; i++)
        names[i] = commands[i].name;
    return argument_unknown("arthron-server", "command", argv[1], names);
}

int main(int argc, char **argv) {
    return output_end("arthron-server", run(argc, argv));
}
