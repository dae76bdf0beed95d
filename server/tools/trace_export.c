#include "export/export.h"
#include "review/survey.h"
#include "trace_commands.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

static const char help[] =
    "Usage: arthron-trace export FILE --csv OUT | --exr OUT | --gltf OUT [--from S]\n"
    "                                 [--to S] [--case DIR]\n"
    "\n"
    "Writes what others can read. --csv: a table with a row for each step: time since the "
    "session's\n"
    "start, step, state, events, the joint, the bones, and for each instrument that was seen its\n"
    "measured and its warped pose, displacement, gradient, gain and nearest group; and for cuts "
    "the\n"
    "blade's move, where it was asked for, and the resection's figures, where it took effect.\n"
    "Columns are named with their units and as in motion files. What is not there has empty "
    "cells.\n"
    "NAME_nearest counts the groups of `arthron-case info` from 0 (-1: none), job_tissue and\n"
    "landed_tissue those that are cuttable.\n"
    "--exr: the same as an image of many channels with every bit of them, and what each cut made\n"
    "of the touch as maps over the meniscus (server/export/EXR.md).\n"
    "--gltf: an animated scene for Blender and others (server/export/GLTF.md): the knee, the\n"
    "instruments and the tissue as they were seen, and beside them the mock-up as it was.\n"
    "\n"
    "  --csv OUT   the file to write; - for stdout\n"
    "  --exr OUT   the file to write\n"
    "  --gltf OUT  the file to write, GLB\n"
    "  --from S    leave out what was before S seconds\n"
    "  --to S      and after S seconds\n"
    "  --case DIR  the case, where it is not where the trace says; a table needs none, an\n"
    "              image one only for cuts\n"
    "\n"
    "Exits 1 where the trace is not whole (what can be read is written).\n";

struct request {
    const char *csv, *exr, *gltf, *case_dir;
    struct export_request export;
};

static int write_csv(struct request *request) {
    struct error err;
    bool to_stdout = !strcmp(request->csv, "-");
    FILE *out = to_stdout ? stdout : fopen(request->csv, "we");
    if (!out) {
        fail(&err, RESULT_IO, "%s: %s", request->csv, strerror(errno));
        return failed("export", &err);
    }
    if (to_stdout)
        request->export.progress = NULL;
    enum result result = export_csv(&request->export, out, &err);
    if (!to_stdout && fclose(out) != 0 && result == RESULT_OK)
        result = fail(&err, RESULT_IO, "%s: %s", request->csv, strerror(errno));
    if (result != RESULT_OK)
        return failed("export", &err);
    if (!to_stdout)
        wrote("export", request->csv);
    return EXIT_GOOD;
}

// An image needs it only where something was cut.
static enum result load_needed(struct request *request, struct scene **out_scene,
                               struct error *err) {
    struct trace_reader *reader;
    struct survey survey;
    *out_scene = NULL;
    enum result result = trace_reader_create(request->export.trace, &reader, err);
    if (result != RESULT_OK)
        return result;
    survey_read(reader, show_progress, &survey);
    if (survey.jobs || request->gltf)
        result = load_scene(reader, request->case_dir, out_scene, err);
    trace_reader_destroy(&reader);
    request->export.scene = *out_scene;
    return result;
}

static int write_with_case(struct request *request) {
    struct error err;
    struct scene *scene;
    enum result result = load_needed(request, &scene, &err);
    if (result == RESULT_OK)
        result = request->gltf ? export_gltf(&request->export, request->gltf, &err)
                               : export_exr(&request->export, request->exr, &err);
    if (scene)
        scene_destroy(&scene);
    if (result != RESULT_OK)
        return failed("export", &err);
    wrote("export", request->gltf ? request->gltf : request->exr);
    return EXIT_GOOD;
}

static bool parse_seconds(const char *text, double *out_seconds) {
    char *end;
    *out_seconds = strtod(text, &end);
    return end != text && *end == '\0' && isfinite(*out_seconds);
}

static bool parse_option(int option, struct request *request) {
    switch (option) {
    case 'c':
        request->csv = optarg;
        return true;
    case 'e':
        request->exr = optarg;
        return true;
    case 'g':
        request->gltf = optarg;
        return true;
    case 'k':
        request->case_dir = optarg;
        return true;
    case 'f':
        return parse_seconds(optarg, &request->export.from_s);
    default:
        return option == 't' && parse_seconds(optarg, &request->export.to_s);
    }
}

static bool same_file(const char *a, const char *b) {
    struct stat of_a, of_b;
    return stat(a, &of_a) == 0 && stat(b, &of_b) == 0 && of_a.st_dev == of_b.st_dev &&
           of_a.st_ino == of_b.st_ino;
}

int command_export(int argc, char **argv) {
    static const struct option options[] = {
        {"csv", required_argument, NULL, 'c'},  {"exr", required_argument, NULL, 'e'},
        {"gltf", required_argument, NULL, 'g'}, {"from", required_argument, NULL, 'f'},
        {"to", required_argument, NULL, 't'},   {"case", required_argument, NULL, 'k'},
        {"help", no_argument, NULL, 'h'},       {NULL, 0, NULL, 0}};
    struct request request = {
        .export = {.from_s = -INFINITY, .to_s = INFINITY, .progress = show_progress}};
    for (int c; (c = getopt_long(argc, argv, "", options, NULL)) != -1;) {
        if (c == 'h')
            return fputs(help, stdout) < 0;
        if (!parse_option(c, &request))
            return usage_error(argv[0], "unknown option, or a value that is no number of seconds");
    }
    if (take_file(argc, argv, &request.export.trace) != EXIT_GOOD)
        return EXIT_USAGE;
    if (!!request.csv + !!request.exr + !!request.gltf != 1)
        return usage_error(argv[0], "one of --csv OUT, --exr OUT and --gltf OUT is needed");
    const char *out = request.csv ? request.csv : request.exr ? request.exr : request.gltf;
    if (same_file(request.export.trace, out))
        return usage_error(argv[0], "%s is the trace itself", out);
    return request.csv ? write_csv(&request) : write_with_case(&request);
}
