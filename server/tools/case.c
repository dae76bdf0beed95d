#include "base/argument.h"
#include "base/instrument.h"
#include "base/output.h"
#include "case/library_memory.h"
#include "case_commands.h"
#include "mesh/library_memory.h"

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
    {"generate", command_generate, "makes a case of a parametric knee from a recipe"},
    {"info", command_info, "lists what a case holds"},
    {"check", command_check, "grades a case: fit, fit with warnings, or unfit"},
    {"import", command_import, "makes a case from meshes of a scan"},
    {"cavity", command_cavity, "hollows out a bone, and what lies on it"},
    {"tear", command_tear, "tears a meniscus, with a planned resection"},
    {"plan", command_plan, "plans another resection of a meniscus"},
    {"ligament", command_ligament, "tears a ligament: the joint goes further"},
    {"deform", command_deform, "hollows out groups of your choice"},
    {"tissue", command_tissue, "describes a group, or adds one"},
    {"wear", command_wear, "wears a bone's cartilage"},
    {"loose", command_loose, "adds loose bodies"},
    {"maxcut", command_maxcut, "makes the shape that the greatest resection leaves of a meniscus"},
    {"landmarks", command_landmarks, "proposes joint, portals and places of the anatomy"},
    {"motion", command_motion, "computes the motion of hands and joint from a script"},
    {"task", command_task, "says whether a task can be done on a case"},
    {"picture", command_picture, "draws a case"},
    {"record-pose", command_record_pose,
     "records a running station's pose as a key of a torn ligament"},
};

#define COMMAND_COUNT (sizeof commands / sizeof commands[0])

int usage_error(const char *command, const char *format, ...) {
    char text[256], program[64];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    snprintf(program, sizeof program, "arthron-case %s", command);
    return argument_wrong(program, "%s", text);
}

int unknown_choice(const char *command, const char *argument, const char *word,
                   const char *const *choices) {
    char program[64];
    snprintf(program, sizeof program, "arthron-case %s", command);
    return argument_unknown(program, argument, word, choices);
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
         "Makes, checks and draws cases: folders with case.json and anatomy.glb.\n");
    for (size_t i = 0; i < COMMAND_COUNT; i++)
        printf("  %-11s %s\n", commands[i].name, commands[i].what);
    puts("\n  --help      shows this; arthron-case COMMAND --help explains a command\n"
         "  --version   shows the version");
}

static int run_command(int argc, char **argv) {
    cxx_libraries_use_our_memory();
    json_uses_our_memory();
    instruments_name_channels(instruments_of_hands());
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
    if (optind == argc)
        return argument_wrong("arthron-case", "the command is missing");
    const char *name = argv[optind];
    int first = optind;
    if (!strcmp(name, "read-surface"))
        return command_read_surface(argc - first, argv + first);
    for (size_t i = 0; i < COMMAND_COUNT; i++) {
        if (strcmp(commands[i].name, name) == 0) {
            optind = 0; // getopt starts again with the command's own options
            return commands[i].run(argc - first, argv + first);
        }
    }
    const char *names[COMMAND_COUNT + 1] = {NULL};
    for (size_t i = 0; i < COMMAND_COUNT; i++)
        names[i] = commands[i].name;
    return argument_unknown("arthron-case", "command", name, names);
}

int main(int argc, char **argv) {
    return output_end("arthron-case", run_command(argc, argv));
}
