#include "base/clock.h"
#include "trace/fields.h"
#include "trace_commands.h"
#include "trace_survey.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char help[] =
    "Usage: arthron-trace export FILE --csv OUT [--from S] [--to S]\n"
    "\n"
    "Writes a table with a row for each step: time since the session's start, step, state, "
    "events,\n"
    "the joint, the bones, and for each instrument that was seen its measured and its warped "
    "pose,\n"
    "displacement, gradient, gain and nearest group; and for cuts the blade's move, where it was\n"
    "asked for, and the resection's figures, where it took effect. Columns are named with their\n"
    "units and as in motion files. What is not there has empty cells. NAME_nearest counts the "
    "groups\n"
    "of `arthron-case info` from 0 (-1: none), job_tissue and landed_tissue those that are "
    "cuttable.\n"
    "\n"
    "  --csv OUT   the file to write; - for stdout\n"
    "  --from S    leave out what was before S seconds\n"
    "  --to S      and after S seconds\n"
    "\n"
    "Exits 1 where the trace is not whole (what can be read is written).\n";

struct request {
    const char *file, *out;
    double from_s, to_s;
};

struct table {
    FILE *file;
    int64_t start_ns;
    struct trace_field columns[TRACE_FIELDS_MAX];
    int count;
};

static bool ever_there(const struct trace_field *field, const struct survey *survey) {
    if (field->owner == OWNER_STEP)
        return true;
    return field->owner < 0 ? survey->jobs > 0 : survey->present[field->owner] > 0;
}

// All fields but those of instruments that never came, and of cuts where there was none.
static void choose_columns(struct table *table, const struct survey *survey) {
    struct trace_field fields[TRACE_FIELDS_MAX];
    int count = trace_fields(fields);
    for (int i = 0; i < count; i++)
        if (ever_there(&fields[i], survey))
            table->columns[table->count++] = fields[i];
}

static void print_names(const struct table *table) {
    fputs("t_seconds", table->file);
    for (int i = 0; i < table->count; i++)
        fprintf(table->file, ",%s", table->columns[i].name);
    fputc('\n', table->file);
}

static void print_row(const struct table *table, const struct session_output *output,
                      double seconds) {
    fprintf(table->file, "%.9f", seconds);
    for (int i = 0; i < table->count; i++) {
        const struct trace_field *column = &table->columns[i];
        char text[TRACE_FIELD_TEXT_MAX];
        trace_field_text(column, output, text);
        fprintf(table->file, ",%s", trace_field_is_there(column, output) ? text : "");
    }
    fputc('\n', table->file);
}

static enum result print_rows(const struct table *table, const struct request *request,
                              struct trace_reader *reader, struct error *err) {
    struct trace_record record;
    enum result result;
    while ((result = trace_read(reader, &record, err)) == RESULT_OK) {
        if (record.type != TRACE_STEP)
            continue;
        double seconds = (double)(record.output.time_ns - table->start_ns) / (double)NS_PER_S;
        if (seconds >= request->from_s && seconds <= request->to_s)
            print_row(table, &record.output, seconds);
        if (table->file != stdout)
            show_progress(trace_reader_offset(reader), trace_reader_size(reader));
    }
    return result;
}

static enum result write_table(const struct request *request, FILE *out, struct error *err) {
    struct trace_reader *reader;
    struct survey survey;
    enum result result = trace_reader_create(request->file, &reader, err);
    if (result != RESULT_OK)
        return result;
    survey_read(reader, &survey);
    trace_reader_destroy(&reader);
    result = trace_reader_create(request->file, &reader, err);
    if (result != RESULT_OK)
        return result;
    struct table table = {.file = out, .start_ns = trace_reader_header(reader)->start_ns};
    choose_columns(&table, &survey);
    print_names(&table);
    result = print_rows(&table, request, reader, err);
    trace_reader_destroy(&reader);
    return result;
}

static int export(const struct request *request) {
    struct error err;
    bool to_stdout = !strcmp(request->out, "-");
    FILE *out = to_stdout ? stdout : fopen(request->out, "we");
    if (!out) {
        fail(&err, RESULT_IO, "%s: %s", request->out, strerror(errno));
        return failed("export", &err);
    }
    enum result result = write_table(request, out, &err);
    bool written = !ferror(out) && fflush(out) == 0;
    if (!written)
        fail(&err, RESULT_IO, "%s: %s", request->out, strerror(errno));
    if (!to_stdout)
        fclose(out);
    return written && result == RESULT_CLOSED ? EXIT_GOOD : failed("export", &err);
}

static bool parse_seconds(const char *text, double *out_seconds) {
    char *end;
    *out_seconds = strtod(text, &end);
    return end != text && *end == '\0' && isfinite(*out_seconds);
}

int command_export(int argc, char **argv) {
    static const struct option options[] = {{"csv", required_argument, NULL, 'c'},
                                            {"from", required_argument, NULL, 'f'},
                                            {"to", required_argument, NULL, 't'},
                                            {"help", no_argument, NULL, 'h'},
                                            {NULL, 0, NULL, 0}};
    struct request request = {.from_s = -INFINITY, .to_s = INFINITY};
    for (int c; (c = getopt_long(argc, argv, "", options, NULL)) != -1;) {
        if (c == 'h')
            return fputs(help, stdout) < 0;
        if (c == 'c')
            request.out = optarg;
        else if (c != 'f' && c != 't')
            return usage_error(argv[0], "unknown option");
        else if (!parse_seconds(optarg, c == 'f' ? &request.from_s : &request.to_s))
            return usage_error(argv[0], "'%s' is not a number of seconds", optarg);
    }
    if (take_file(argc, argv, &request.file) != EXIT_GOOD)
        return EXIT_USAGE;
    if (!request.out)
        return usage_error(argv[0], "--csv OUT is missing");
    return export(&request);
}
