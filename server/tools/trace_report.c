#include "base/check.h"
#include "base/draft.h"
#include "review/page.h"
#include "trace_commands.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

static const char report_help[] =
    "Usage: arthron-trace report FILE --out REPORT.html [--case DIR]\n"
    "                            [--records FILE [--course NAME]]\n"
    "\n"
    "Writes a page about a session: its origin, the paths of the instruments' tips as measured "
    "and\n"
    "as seen, the warp and how noticeable it was, the joint, the resection, and the metrics of "
    "the\n"
    "command score. The page needs no other files.\n"
    "\n"
    "  --out FILE      write the page here; it replaces an existing file\n"
    "  --case DIR      the case, for the names of its groups (default: the trace's case; without "
    "it\n"
    "                  groups have numbers)\n"
    "  --records FILE  draw each figure beside those of the sessions on the same case in the\n"
    "                  server's records\n"
    "  --course NAME   only of the trainees of this course\n"
    "\n"
    "Exits 1 if the trace is not whole or steps are missing. All readable steps are reported.\n";

struct report_request {
    const char *out, *records;
    struct review_source source;
};

static enum result make_page(const struct report_request *request, FILE *file, bool *out_whole,
                             struct error *err) {
    struct review_source source = request->source;
    enum result result = RESULT_OK;
    if (request->records)
        result = store_open(request->records, STORE_THERE, "report", &source.records, err);
    if (result == RESULT_OK)
        result = review_write_page(&source, file, out_whole, err);
    store_close(&source.records);
    return result;
}

static int report(const struct report_request *request) {
    struct error err = {""};
    char *page = NULL;
    size_t size = 0;
    bool whole = false;
    FILE *memory = open_memstream(&page, &size);
    NEED(memory, "memory");
    enum result result = make_page(request, memory, &whole, &err);
    fclose(memory);
    if (result == RESULT_OK)
        result = draft_write(request->out, page, size, &err);
    free(page);
    if (result != RESULT_OK)
        return failed("report", &err);
    wrote("report", request->out);
    return whole ? EXIT_GOOD : EXIT_FAULT;
}

int command_report(int argc, char **argv) {
    static const struct option options[] = {
        {"out", required_argument, NULL, 'o'},     {"case", required_argument, NULL, 'c'},
        {"records", required_argument, NULL, 'r'}, {"course", required_argument, NULL, 'k'},
        {"help", no_argument, NULL, 'h'},          {NULL, 0, NULL, 0}};
    struct report_request request = {.source.progress = show_progress};
    for (int c; (c = getopt_long(argc, argv, "", options, NULL)) != -1;) {
        if (c == 'h')
            return fputs(report_help, stdout) < 0;
        if (c == 'o')
            request.out = optarg;
        else if (c == 'c')
            request.source.case_dir = optarg;
        else if (c == 'r')
            request.records = optarg;
        else if (c == 'k')
            request.source.course = optarg;
        else
            return usage_error(argv[0], "unknown option");
    }
    if (take_file(argc, argv, &request.source.trace) != EXIT_GOOD)
        return EXIT_USAGE;
    if (!request.out)
        return usage_error(argv[0], "--out is missing");
    if (request.source.course && !request.records)
        return usage_error(argv[0], "--course needs --records");
    return report(&request);
}
