#include "trace_commands.h"
#include "trace_survey.h"

#include <inttypes.h>
#include <jansson.h>
#include <stdio.h>

static const char help[] =
    "Usage: arthron-trace verify FILE [--json]\n"
    "\n"
    "Reads every record and tells whether the file is whole, or up to which byte. A session that\n"
    "still runs, or whose server was killed, has no end record: all before that can be used.\n"
    "Exits 1 where anything is damaged, cut off or missing.\n";

static void print_json(const struct survey *s) {
    json_t *root = json_pack(
        "{s:b, s:s, s:I, s:I, s:I, s:I, s:I}", "whole", s->end == RESULT_CLOSED, "end",
        s->end == RESULT_CLOSED ? "" : s->why.text, "whole_bytes", (json_int_t)s->whole_bytes,
        "file_bytes", (json_int_t)s->file_bytes, "records", (json_int_t)s->steps, "gaps",
        (json_int_t)s->gaps, "missing", (json_int_t)s->missing);
    json_object_set_new(root, "lost_samples", json_integer((json_int_t)s->lost_samples));
    json_dumpf(root, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(12));
    putchar('\n');
    json_decref(root);
}

static void print_text(const struct survey *s) {
    if (s->end == RESULT_CLOSED)
        printf("whole: %" PRIu64 " bytes\n", s->whole_bytes);
    else
        printf("not whole: %s\n%" PRIu64 " bytes of %" PRIu64 " are\n", s->why.text, s->whole_bytes,
               s->file_bytes);
    printf("%" PRIu64 " steps, %" PRIu64 " missing in %" PRIu64 " gaps, %" PRIu64
           " samples lost at the station\n",
           s->steps, s->missing, s->gaps, s->lost_samples);
}

int command_verify(int argc, char **argv) {
    static const struct option options[] = {
        {"json", no_argument, NULL, 'j'}, {"help", no_argument, NULL, 'h'}, {NULL, 0, NULL, 0}};
    bool json = false;
    for (int c; (c = getopt_long(argc, argv, "", options, NULL)) != -1;) {
        if (c == 'h')
            return fputs(help, stdout) < 0;
        if (c != 'j')
            return usage_error(argv[0], "unknown option");
        json = true;
    }
    const char *file;
    if (take_file(argc, argv, &file) != EXIT_GOOD)
        return EXIT_USAGE;
    struct trace_reader *reader;
    struct error err;
    if (trace_reader_create(file, &reader, &err) != RESULT_OK)
        return failed(argv[0], &err);
    struct survey survey;
    survey_read(reader, &survey);
    trace_reader_destroy(&reader);
    (json ? print_json : print_text)(&survey);
    return survey.end == RESULT_CLOSED && survey.missing == 0 ? EXIT_GOOD : EXIT_FAULT;
}
