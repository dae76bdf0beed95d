#include "base/draft.h"
#include "export/export.h"
#include "review/survey.h"
#include "trace_commands.h"

#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

static const char export_help[] =
    "Usage: arthron-trace export FILE --csv OUT | --markers OUT | --exr OUT | --gltf OUT | --mcap "
    "OUT\n"
    "                                 [--columns LIST] [--from S] [--to S] [--case DIR]\n"
    "\n"
    "Converts a session for other programs.\n"
    "\n"
    "  --csv OUT       write a table with a row for each step; - for stdout "
    "(server/export/CSV.md)\n"
    "  --markers OUT   write a table of the devices' markers, each with its own time; - for "
    "stdout\n"
    "  --exr OUT       write an image of many channels, with every bit of inputs and outputs, and\n"
    "                  maps of what each cut changed (server/export/EXR.md)\n"
    "  --gltf OUT      write an animated scene, GLB, for Blender and others\n"
    "                  (server/export/GLTF.md)\n"
    "  --mcap OUT      write a recording, MCAP, for Foxglove, rerun and others\n"
    "                  (server/export/MCAP.md)\n"
    "  --columns LIST  columns of the table, in this order: names or patterns, separated by "
    "commas,\n"
    "                  as 't_seconds,probe_t?_mm,*_time_ns'; '*' selects all of them. An unknown\n"
    "                  name is an error that lists all columns (server/export/CSV.md)\n"
    "  --from S        leave out everything before S seconds\n"
    "  --to S          leave out everything after S seconds\n"
    "  --case DIR      the folder of the case, if it has moved. A table needs the case for names\n"
    "                  of groups, a recording for meshes, and an image for maps. A scene always\n"
    "                  needs it\n"
    "\n"
    "The column 'input' names the input of each step. For one row for each frame, keep the rows\n"
    "with 'frame'. measured_NAME_time_ns is the time at which NAME was measured; use it to "
    "compute\n"
    "speeds. The table has measured values (measured_*) only if --columns selects them. A cell\n"
    "without a value is empty.\n"
    "\n"
    "Exits 1 if the trace is not whole. Everything that can be read is written.\n";

struct trace_export_request {
    const char *csv, *markers, *exr, *gltf, *mcap, *case_dir;
    struct export_request export;
};

// Where the trace is not whole, what can be read was written. A pipe tells no place.
static bool is_made(enum result result, FILE *file) {
    bool damaged = result == RESULT_MISSING || result == RESULT_CORRUPT || result == RESULT_FORMAT;
    return result == RESULT_OK || (damaged && ftello(file) != 0);
}

static enum result write_table(struct trace_export_request *request, struct error *err) {
    struct draft draft;
    const char *out = request->csv ? request->csv : request->markers;
    enum result (*export)(const struct export_request *, FILE *, struct error *) =
        request->csv ? export_csv : export_markers;
    if (!strcmp(out, "-")) {
        request->export.progress = NULL;
        return export(&request->export, stdout, err);
    }
    enum result result = draft_open(out, &draft, err);
    if (result != RESULT_OK)
        return result;
    result = export(&request->export, draft.file, err);
    if (!is_made(result, draft.file)) {
        draft_drop(&draft);
        return result;
    }
    enum result kept = draft_keep(&draft, result == RESULT_OK ? err : NULL);
    return result == RESULT_OK ? kept : result;
}

// A table has the names of groups where the case is there; an image needs it only for cuts.
static enum result load_needed(struct trace_export_request *request, struct scene **out_scene,
                               struct error *err) {
    struct trace_reader *reader;
    struct survey survey = {0};
    *out_scene = NULL;
    enum result result = trace_reader_create(request->export.trace, &reader, err);
    if (result != RESULT_OK)
        return result;
    instruments_name_channels(&trace_reader_header(reader)->settings.instruments);
    if (request->exr)
        survey_read(reader, show_progress, &survey);
    if (request->csv || request->mcap)
        result =
            load_scene_if_there("export", reader, request->case_dir,
                                request->csv ? "the names of groups" : "meshes", out_scene, err);
    else if (survey.jobs || request->gltf || request->case_dir)
        result = load_scene(reader, request->case_dir, out_scene, err);
    trace_reader_destroy(&reader);
    request->export.scene = *out_scene;
    return result;
}

static void print_known(const char *name) {
    fprintf(stderr, "  %s\n", name);
}

static int write_export(struct trace_export_request *request, const char *out) {
    struct error err;
    struct scene *scene;
    enum result result = load_needed(request, &scene, &err);
    if (result == RESULT_OK)
        result = request->csv || request->markers ? write_table(request, &err)
                 : request->gltf ? export_gltf(&request->export, request->gltf, &err)
                 : request->mcap ? export_mcap(&request->export, request->mcap, &err)
                                 : export_exr(&request->export, request->exr, &err);
    scene_destroy(&scene);
    if (result != RESULT_OK)
        return failed("export", &err);
    if (strcmp(out, "-") != 0)
        wrote("export", out);
    return EXIT_GOOD;
}

static bool parse_seconds(const char *text, double *out_seconds) {
    char *end;
    *out_seconds = strtod(text, &end);
    return end != text && *end == '\0' && isfinite(*out_seconds);
}

static bool parse_export_option(int option, struct trace_export_request *request) {
    switch (option) {
    case 'c':
        request->csv = optarg;
        return true;
    case 'M':
        request->markers = optarg;
        return true;
    case 'e':
        request->exr = optarg;
        return true;
    case 'g':
        request->gltf = optarg;
        return true;
    case 'm':
        request->mcap = optarg;
        return true;
    case 'k':
        request->case_dir = optarg;
        return true;
    case 'n':
        request->export.columns = optarg;
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
    static const struct option options[] = {{"csv", required_argument, NULL, 'c'},
                                            {"markers", required_argument, NULL, 'M'},
                                            {"exr", required_argument, NULL, 'e'},
                                            {"gltf", required_argument, NULL, 'g'},
                                            {"mcap", required_argument, NULL, 'm'},
                                            {"from", required_argument, NULL, 'f'},
                                            {"to", required_argument, NULL, 't'},
                                            {"case", required_argument, NULL, 'k'},
                                            {"columns", required_argument, NULL, 'n'},
                                            {"help", no_argument, NULL, 'h'},
                                            {NULL, 0, NULL, 0}};
    struct trace_export_request request = {.export = {.from_s = -INFINITY,
                                                      .to_s = INFINITY,
                                                      .progress = show_progress,
                                                      .known_column = print_known}};
    for (int c; (c = getopt_long(argc, argv, "", options, NULL)) != -1;) {
        if (c == 'h')
            return fputs(export_help, stdout) < 0;
        if (!parse_export_option(c, &request))
            return usage_error(argv[0], "unknown option, or a value that is no number of seconds");
    }
    if (take_file(argc, argv, &request.export.trace) != EXIT_GOOD)
        return EXIT_USAGE;
    if (!!request.csv + !!request.markers + !!request.exr + !!request.gltf + !!request.mcap != 1)
        return usage_error(
            argv[0],
            "one of --csv OUT, --markers OUT, --exr OUT, --gltf OUT and --mcap OUT is needed");
    if (request.export.columns && !request.csv)
        return usage_error(argv[0], "--columns needs --csv");
    const char *out = request.csv       ? request.csv
                      : request.markers ? request.markers
                      : request.exr     ? request.exr
                      : request.gltf    ? request.gltf
                                        : request.mcap;
    if (same_file(request.export.trace, out))
        return usage_error(argv[0], "%s is the trace itself", out);
    return write_export(&request, out);
}
