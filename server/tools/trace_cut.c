#include "base/clock.h"
#include "trace/player.h"
#include "trace_commands.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

static const char cut_help[] =
    "Usage: arthron-trace cut FILE [--from S] [--to S] --out OUT\n"
    "\n"
    "Writes a piece of a session as a trace of its own. The piece also has the inputs before it,\n"
    "without their outputs, so it can be replayed. It names the whole trace by its last hash. A\n"
    "piece has no signature: only the whole trace proves anything. Traces of version 2 cannot be\n"
    "cut.\n"
    "\n"
    "  --from S   the piece begins S seconds after the session's start (default: 0)\n"
    "  --to S     the piece ends S seconds after the session's start (default: the end)\n"
    "  --out OUT  the file to write; it must not exist\n"
    "\n"
    "Exits 1 if the trace cannot be read up to there. Everything that can be read is written.\n";

struct cut_request {
    const char *file, *out;
    double from_s, to_s;
};

static void show_first_half(uint64_t done, uint64_t all) {
    show_progress(done, 2 * all);
}

static void show_second_half(uint64_t done, uint64_t all) {
    show_progress(all + done, 2 * all);
}

// The hash that the piece names as its parent is the last of the file, so it is read first.
static enum result last_hash(const char *file, uint8_t out_hash[TRACE_HASH_SIZE],
                             struct error *err) {
    struct trace_reader *reader;
    struct trace_player player = {.progress = show_first_half};
    enum result result = trace_reader_create(file, &reader, err);
    if (result != RESULT_OK)
        return result;
    if (trace_reader_header(reader)->version < 3)
        result = fail(err, RESULT_VERSION, "%s: of version %u nothing can be cut", file,
                      trace_reader_header(reader)->version);
    if (result == RESULT_OK && trace_reader_header(reader)->part > 1)
        result = fail(err, RESULT_REFUSED, "%s: of part %u of a session nothing can be cut", file,
                      trace_reader_header(reader)->part);
    struct error why;
    if (result == RESULT_OK && trace_play(reader, &player, &why) == RESULT_IO)
        result = fail(err, RESULT_IO, "%s", why.text);
    memcpy(out_hash, trace_reader_place(reader).hash, TRACE_HASH_SIZE);
    trace_reader_destroy(&reader);
    return result;
}

struct trace_piece {
    const struct cut_request *request;
    struct trace_writer *writer;
    int64_t start_ns;
    uint64_t steps;
    bool inside;  // its first step was read
    bool attempt; // the piece has the begin of the last one
    bool over;    // the time: only markers that came late may still be of it
    enum result result;
    struct error *err;
};

static double seconds_of(const struct trace_piece *c, int64_t time_ns) {
    return (double)(time_ns - c->start_ns) / (double)NS_PER_S;
}

static void take_input(struct trace_piece *c, struct trace_record *copy) {
    double seconds = seconds_of(c, copy->input.time_ns);
    c->over |= seconds > c->request->to_s;
    if (seconds < c->request->from_s)
        copy->type = TRACE_PAST;
    c->inside = seconds >= c->request->from_s;
    c->steps += !c->over && copy->type == TRACE_STEP;
}

// Of an attempt that began before the piece, nothing is left.
static bool has_begun(struct trace_piece *c, const struct trace_record *record) {
    if (record->type == TRACE_BEGUN)
        c->attempt = c->inside && !c->over;
    return c->attempt;
}

static bool is_of_piece(struct trace_piece *c, const struct trace_record *record) {
    if (record->type == TRACE_BEGUN || record->type == TRACE_ENDED)
        return has_begun(c, record) && !c->over;
    double seconds = seconds_of(c, record->marker.time_ns);
    return record->type == TRACE_MARKER
               ? seconds >= c->request->from_s && seconds <= c->request->to_s
               : !c->over;
}

static bool copy_record(void *user, const struct trace_record *record) {
    struct trace_piece *c = user;
    struct trace_record copy = *record;
    if (record->type == TRACE_STEP || record->type == TRACE_PAST)
        take_input(c, &copy);
    if (!is_of_piece(c, record))
        return true;
    c->result = trace_append_record(c->writer, &copy, c->err);
    return c->result == RESULT_OK;
}

static enum result copy(const struct cut_request *request, struct trace_reader *reader,
                        struct trace_writer *writer, uint64_t *out_steps, struct error *err) {
    struct trace_piece c = {.request = request,
                            .writer = writer,
                            .start_ns = trace_reader_header(reader)->start_ns,
                            .err = err};
    struct trace_player player = {.user = &c, .record = copy_record, .progress = show_second_half};
    enum result result = trace_play(reader, &player, err);
    *out_steps = c.steps;
    if (c.result != RESULT_OK)
        return c.result;
    if (!c.steps)
        return fail(err, RESULT_MISSING, "%s has no step in that time", request->file);
    return c.over ? RESULT_CLOSED : result;
}

static enum result cut(const struct cut_request *request, struct error *err) {
    struct trace_reader *reader;
    struct trace_writer *writer = NULL;
    uint64_t steps = 1; // until they were counted
    uint8_t parent[TRACE_HASH_SIZE];
    enum result result = last_hash(request->file, parent, err);
    if (result == RESULT_OK)
        result = trace_reader_create(request->file, &reader, err);
    if (result != RESULT_OK)
        return result;
    struct trace_header header = *trace_reader_header(reader);
    memcpy(header.parent, parent, sizeof header.parent);
    memcpy(header.parent_id, header.session_id, sizeof header.parent_id);
    result = trace_writer_create(request->out, &header, NULL, NULL, &writer, err);
    if (result == RESULT_OK)
        result = copy(request, reader, writer, &steps, err);
    trace_writer_destroy(&writer);
    if (!steps)
        unlink(request->out);
    trace_reader_destroy(&reader);
    return result;
}

int command_cut(int argc, char **argv) {
    static const struct option options[] = {{"from", required_argument, NULL, 'F'},
                                            {"to", required_argument, NULL, 'T'},
                                            {"out", required_argument, NULL, 'o'},
                                            {"help", no_argument, NULL, 'h'},
                                            {NULL, 0, NULL, 0}};
    struct cut_request request = {.from_s = 0, .to_s = INFINITY};
    bool good = true;
    for (int c; good && (c = getopt_long(argc, argv, "", options, NULL)) != -1;) {
        if (c == 'h')
            return fputs(cut_help, stdout) < 0;
        if (c == 'F')
            good = take_seconds(optarg, &request.from_s);
        else if (c == 'T')
            good = take_seconds(optarg, &request.to_s);
        else if (c == 'o')
            request.out = optarg;
        else
            good = false;
    }
    if (!good || !request.out || request.from_s > request.to_s)
        return usage_error(argv[0], "--out OUT, and from one time to a later one");
    if (take_file(argc, argv, &request.file) != EXIT_GOOD)
        return EXIT_USAGE;
    struct error err;
    if (cut(&request, &err) != RESULT_CLOSED)
        return failed(argv[0], &err);
    wrote(argv[0], request.out);
    return EXIT_GOOD;
}
