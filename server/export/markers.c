// The markers of a session as a table (CSV.md).
#include "base/clock.h"
#include "base/csv.h"
#include "export/export.h"
#include "trace/player.h"

#include <errno.h>
#include <inttypes.h>
#include <string.h>

struct marker_table {
    const struct export_request *request;
    FILE *file;
    int64_t start_ns;
    struct trace_reader *reader;
    bool failed;
};

static bool on_marker(void *user, const struct marker *marker) {
    struct marker_table *t = user;
    double seconds = (double)(marker->time_ns - t->start_ns) / (double)NS_PER_S;
    if (seconds < t->request->from_s || seconds > t->request->to_s)
        return true;
    fprintf(t->file, "%.9f,%" PRId64 ",%s,", seconds, marker->time_ns, marker->name);
    csv_put_text(t->file, marker->device);
    t->failed = fprintf(t->file, ",%.17g,%" PRIu64 "\n", marker->value, marker->number) < 0;
    return !t->failed;
}

static bool on_record(void *user, const struct trace_record *record) {
    const struct marker_table *t = user;
    (void)record;
    if (t->request->progress)
        t->request->progress(trace_reader_offset(t->reader), trace_reader_size(t->reader));
    return true;
}

enum result export_markers(const struct export_request *request, FILE *out, struct error *err) {
    struct marker_table table = {.request = request, .file = out};
    struct trace_player player = {.user = &table, .record = on_record, .marker = on_marker};
    enum result result = trace_reader_create(request->trace, &table.reader, err);
    if (result != RESULT_OK)
        return result;
    table.start_ns = trace_reader_header(table.reader)->start_ns;
    fputs("t_seconds,time_ns,marker,device,value,number\n", out);
    result = trace_play(table.reader, &player, err);
    trace_reader_destroy(&table.reader);
    if (table.failed || fflush(out) != 0)
        return fail(err, RESULT_IO, "%s", strerror(errno));
    return result == RESULT_CLOSED ? RESULT_OK : result;
}
