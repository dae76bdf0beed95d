#include "base/argument.h"
#include "base/output.h"
#include "tools/tools.h"
#include "websocket/library_memory.h"

#include <stdio.h>
#include <string.h>

static const char help[] =
    "Usage: arthron-station COMMAND [ARGUMENT ...]\n"
    "\n"
    "Reads a mock-up's devices and sends what they say to the server.\n"
    "\n"
    "Commands:\n"
    "  run        sends what the devices measure, until SIGTERM or SIGINT\n"
    "  enrol      gets a certificate with a code of `arthron-server keys enrol`\n"
    "  probe      lists devices with live values, and prints a config for them\n"
    "  calibrate  finds a tip, where the tracker stands, zero and scale of an encoder\n"
    "  check      tests the whole station before class, and says what to do\n"
    "\n"
    "arthron-station COMMAND --help tells more.\n"
    "  --help      show this\n"
    "  --version   show the version\n";

static const struct {
    const char *name;
    int (*run)(int argc, char **argv);
} tools[] = {
    {"run", tool_run},     {"enrol", tool_enrol},
    {"probe", tool_probe}, {"calibrate", tool_calibrate},
    {"check", tool_check},
};

enum { TOOL_COUNT = sizeof tools / sizeof *tools };

static int run(int argc, char **argv) {
    libraries_use_our_memory();
    if (argc > 1 && !strcmp(argv[1], "--help")) {
        fputs(help, stdout);
        return 0;
    }
    if (argc > 1 && !strcmp(argv[1], "--version")) {
        puts("arthron-station " ARTHRON_VERSION);
        return 0;
    }
    for (size_t i = 0; argc > 1 && i < TOOL_COUNT; i++)
        if (!strcmp(argv[1], tools[i].name))
            return tools[i].run(argc - 1, argv + 1);
    if (argc == 1)
        return argument_wrong("arthron-station", "the command is missing");
    const char *names[TOOL_COUNT + 1] = {NULL};
    for (size_t i = 0; i < TOOL_COUNT; i++)
        names[i] = tools[i].name;
    return argument_unknown("arthron-station", "command", argv[1], names);
}

int main(int argc, char **argv) {
    return output_end("arthron-station", run(argc, argv));
}
