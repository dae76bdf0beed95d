#include "base/argument.h"
#include "base/clock.h"
#include "base/output.h"
#include "mesh/library_memory.h"
#include "trace_commands.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const struct {
    const char *name;
    int (*run)(int argc, char **argv);
    const char *what;
} commands[] = {
    {"info", command_info, "prints a session's origin and a summary of its steps"},
    {"verify", command_verify, "checks that the file is whole, unchanged and signed"},
    {"replay", command_replay, "runs the session again: compares every step, or tries settings"},
    {"cut", command_cut, "writes a piece of a session as a trace"},
    {"export", command_export, "writes the steps as a table, an image, a scene or a recording"},
    {"judge", command_judge, "judges a session by a task"},
    {"score", command_score, "computes the metrics: time, paths, smoothness, contacts, resection"},
    {"serve", command_serve, "plays a session to programs that speak OpenIGTLink"},
    {"picture", command_picture, "draws a meniscus after its cuts"},
    {"report", command_report, "writes a page: paths, warp, joint, resection, metrics"},
};

#define COMMAND_COUNT (sizeof commands / sizeof commands[0])

bool take_seconds(const char *text, double *out_s) {
    char *end;
    *out_s = strtod(text, &end);
    return end != text && !*end && *out_s >= 0 && *out_s < 1e9;
}

int usage_error(const char *command, const char *format, ...) {
    fprintf(stderr, "arthron-trace %s: ", command);
    va_list args;
    va_start(args, format);
    vfprintf(stderr, format, args);
    va_end(args);
    fprintf(stderr, "\nTry: arthron-trace %s --help\n", command);
    return EXIT_USAGE;
}

int failed(const char *command, const struct error *err) {
    fprintf(stderr, "arthron-trace %s: %s\n", command, err->text);
    return EXIT_FAULT;
}

void wrote(const char *command, const char *path) {
    fprintf(stderr, "arthron-trace %s: wrote %s\n", command, path);
}

int take_file(int argc, char **argv, const char **out_file) {
    if (argc - optind != 1)
        return usage_error(argv[0], optind == argc ? "FILE is missing" : "one FILE, no more");
    *out_file = argv[optind];
    return EXIT_GOOD;
}

enum result load_scene(const struct trace_reader *reader, const char *case_dir,
                       struct scene **out_scene, struct error *err) {
    struct case_limits limits = case_limits_default();
    const struct trace_header *header = trace_reader_header(reader);
    struct knee_case *knee;
    enum result result = case_load(case_dir ? case_dir : header->case_dir, &limits, &knee, err);
    if (result != RESULT_OK)
        return fail_in(err, result, "the case (--case DIR tells where it is): ");
    result = scene_create(&knee, out_scene, err);
    if (result != RESULT_OK)
        case_destroy(&knee);
    return result;
}

enum result load_scene_if_there(const char *command, const struct trace_reader *reader,
                                const char *case_dir, const char *what, struct scene **out_scene,
                                struct error *err) {
    enum result result = load_scene(reader, case_dir, out_scene, err);
    if (result == RESULT_OK &&
        scene_case(*out_scene)->hash != trace_reader_header(reader)->case_hash) {
        result =
            fail(err, RESULT_REFUSED, "the case is not the one that the session was recorded with");
        scene_destroy(out_scene);
    }
    if (result == RESULT_OK)
        return RESULT_OK;
    *out_scene = NULL;
    if (case_dir)
        return result;
    fprintf(stderr, "arthron-trace %s: %s are left out: %s\n", command, what, err->text);
    return RESULT_OK;
}

void show_progress(uint64_t done, uint64_t all) {
    static int64_t shown_ns;
    static bool begun;
    bool ends = done >= all;
    int64_t now_ns = clock_now_ns();
    if (!shown_ns)
        shown_ns = now_ns;
    if (!isatty(STDERR_FILENO) || (ends && !begun) ||
        (!ends && now_ns - shown_ns < 300 * NS_PER_MS))
        return;
    fprintf(stderr, "\r%3.0f %%%s", 100 * (double)done / (double)all, ends ? "\n" : "");
    shown_ns = now_ns;
    begun = !ends;
}

static void print_help(void) {
    fputs("Usage: arthron-trace COMMAND FILE [OPTIONS]\n"
          "\n"
          "Reads the trace of a session: its inputs, and the outputs that they led to.\n"
          "\n"
          "Commands:\n",
          stdout);
    for (size_t i = 0; i < COMMAND_COUNT; i++)
        printf("  %-8s  %s\n", commands[i].name, commands[i].what);
    fputs("\n"
          "arthron-trace COMMAND --help explains a command.\n"
          "  --help      show this\n"
          "  --version   show the version\n",
          stdout);
}

static int run_command(int argc, char **argv) {
    cxx_libraries_use_our_memory();
    if (argc > 1 && !strcmp(argv[1], "--help")) {
        print_help();
        return EXIT_GOOD;
    }
    if (argc > 1 && !strcmp(argv[1], "--version")) {
        puts("arthron-trace " ARTHRON_VERSION);
        return EXIT_GOOD;
    }
    for (size_t i = 0; argc > 1 && i < COMMAND_COUNT; i++)
        if (!strcmp(argv[1], commands[i].name))
            return commands[i].run(argc - 1, argv + 1);
    if (argc == 1)
        return argument_wrong("arthron-trace", "the command is missing");
    const char *names[COMMAND_COUNT + 1] = {NULL};
    for (size_t i = 0; i < COMMAND_COUNT; i++)
        names[i] = commands[i].name;
    return argument_unknown("arthron-trace", "command", argv[1], names);
}

int main(int argc, char **argv) {
    return output_end("arthron-trace", run_command(argc, argv));
}
