#include "case_commands.h"

#include <getopt.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const struct {
    const char *name;
    int (*run)(int argc, char **argv);
    const char *what;
} commands[] = {
    {"generate", command_generate, "make a case of a parametric knee from a recipe"},
    {"info", command_info, "what a case holds"},
    {"check", command_check, "whether its structure, units and places make sense"},
    {"import", command_import, "make a case from meshes of a scan"},
    {"deform", command_deform, "add a cavity to a case"},
    {"maxcut", command_maxcut, "make what a whole resection leaves of the menisci"},
    {"motion", command_motion, "compute a trainee's hands and the joint from a script"},
    {"picture", command_picture, "draw it"},
    {"record-pose", command_record_pose,
     "take a running station's pose as a key of a torn ligament"},
};

#define COMMAND_COUNT (sizeof commands / sizeof commands[0])

int usage_error(const char *command, const char *format, ...) {
    fprintf(stderr, "arthron-case %s: ", command);
    va_list args;
    va_start(args, format);
    vfprintf(stderr, format, args);
    va_end(args);
    fprintf(stderr, "\nTry: arthron-case %s --help\n", command);
    return EXIT_USAGE;
}

int failed(const char *command, const struct error *err) {
    fprintf(stderr, "arthron-case %s: %s\n", command, err->text);
    return EXIT_FAULT;
}

bool parse_numbers(const char *text, double *out_values, int count) {
    for (int i = 0; i < count; i++) {
        char *end;
        out_values[i] = strtod(text, &end);
        if (end == text || !isfinite(out_values[i]) || *end != (i + 1 < count ? ',' : '\0'))
            return false;
        text = end + 1;
    }
    return true;
}

static void print_help(void) {
    puts("Usage: arthron-case COMMAND [OPTION...]\n\n"
         "Makes and looks at cases: folders with case.json and anatomy.glb.\n");
    for (size_t i = 0; i < COMMAND_COUNT; i++)
        printf("  %-11s %s\n", commands[i].name, commands[i].what);
    puts("\n  --help      this text, or that of a command: arthron-case COMMAND --help\n"
         "  --version   the version");
}

int main(int argc, char **argv) {
    static const struct option options[] = {
        {"help", no_argument, NULL, 'h'}, {"version", no_argument, NULL, 'V'}, {0}};
    int option;
    while ((option = getopt_long(argc, argv, "+", options, NULL)) != -1) {
        if (option == 'h')
            print_help();
        else if (option == 'V')
            puts("arthron-case " ARTHRON_VERSION);
        return option == 'h' || option == 'V' ? EXIT_OK : EXIT_USAGE;
    }
    if (optind == argc) {
        fputs("arthron-case: which command? Try: arthron-case --help\n", stderr);
        return EXIT_USAGE;
    }
    const char *name = argv[optind];
    int first = optind;
    for (size_t i = 0; i < COMMAND_COUNT; i++) {
        if (strcmp(commands[i].name, name) == 0) {
            optind = 0; // getopt starts again with the command's own options
            return commands[i].run(argc - first, argv + first);
        }
    }
    fprintf(stderr, "arthron-case: no command \"%s\". Try: arthron-case --help\n", name);
    return EXIT_USAGE;
}
