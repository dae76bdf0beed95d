#include "sim/ledger.h"

#include "base/check.h"
#include "base/clock.h"
#include "sim/disk.h"
#include "sim/report.h"
#include "trace/player.h"
#include "trace/replay.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LEDGERS 256
#define NOTES 256
// What a killed program may lose: the 20 ms between two writes, and what a write takes.
#define KILLED_NS (24 * NS_PER_MS)
// What a machine without power may lose: the second between two calls of fdatasync, and what these
// take.
#define POWER_NS (1200 * NS_PER_MS)
#define STALLED_NS (15 * NS_PER_MS)
#define EXCUSED_NS (3 * NS_PER_S) // around a time at which the disk failed

struct entry {
    uint64_t step, hash;
    int64_t when_ns;
};

struct note {
    char text[32];
    int64_t when_ns;
    bool found;
};

struct ledger {
    char path[320];
    char id[33];
    int station;
    uint64_t serial;
    const struct trace_writer *writer; // NULL: not open
    bool closed;                       // all was put on disk
    bool goes_on;                      // it was open when the server died, and can go on
    bool has_gap, left;
    // The disk failed at its end, or as its server died; or its server died and none went on.
    bool spoiled;
    struct entry *entries;
    size_t count, room;
    struct note notes[NOTES];
    int note_count;
};

static struct {
    struct ledger *all[LEDGERS];
    int count;
    int64_t killed_ns; // 0: not yet
    bool power;
    uint64_t resumes, replayed, lost_steps;
} ledgers;

// ---- all ----------------------------------------------------------------------------------------

void ledgers_begin(void) {
    memset(&ledgers, 0, sizeof ledgers);
}

void ledgers_end(void) {
    for (int i = 0; i < ledgers.count; i++) {
        free(ledgers.all[i]->entries);
        free(ledgers.all[i]);
    }
    ledgers.count = 0;
}

void ledgers_count(struct watch_counts *counts) {
    counts->traces = (uint64_t)ledgers.count;
    counts->resumes = ledgers.resumes;
    counts->replayed = ledgers.replayed;
    counts->lost_steps = ledgers.lost_steps;
}

struct ledger *ledger_of(const struct trace_writer *writer) {
    for (int i = ledgers.count - 1; i >= 0; i--)
        if (ledgers.all[i]->writer == writer)
            return ledgers.all[i];
    broken("a step has an open trace", "none was opened");
}

int ledger_station(const struct ledger *ledger) {
    return ledger->station;
}

uint64_t ledger_serial(const struct ledger *ledger) {
    return ledger->serial;
}

void ledger_leave(struct ledger *ledger) {
    ledger->left = true;
}

bool ledger_is_left(const struct ledger *ledger) {
    return ledger->left;
}

void ledger_some_id(int station, char out_id[256]) {
    out_id[0] = '\0';
    for (int i = 0; i < ledgers.count; i++)
        if (ledgers.all[i]->station == station)
            snprintf(out_id, 256, "%s", ledgers.all[i]->id);
}

// The disk failed around that time.
static bool is_excused(int64_t when_ns) {
    int64_t trouble_ns = disk_trouble_ns();
    return trouble_ns && trouble_ns > when_ns - EXCUSED_NS;
}

// ---- writing ------------------------------------------------------------------------------------

void ledger_step(struct ledger *l, const struct session_output *output, bool put) {
    if (!put)
        return;
    if (l->count == l->room) {
        l->room = l->room ? 2 * l->room : 1024;
        l->entries = alloc_resize(l->entries, l->room, sizeof *l->entries);
    }
    l->entries[l->count++] = (struct entry){output->step, output->hash, sim_now_ns()};
}

void ledger_note(struct ledger *l, const char *text) {
    if (l->note_count == NOTES)
        return;
    struct note *note = &l->notes[l->note_count++];
    *note = (struct note){.when_ns = sim_now_ns()};
    snprintf(note->text, sizeof note->text, "%.31s", text);
}

static struct ledger *find_path(const char *path) {
    for (int i = 0; i < ledgers.count; i++)
        if (!strcmp(ledgers.all[i]->path, path))
            return ledgers.all[i];
    return NULL;
}

void watch_renamed(const char *from, const char *to) {
    struct ledger *l = find_path(from);
    if (l)
        snprintf(l->path, sizeof l->path, "%s", to);
}

static struct ledger *begin_ledger(const char *path, const struct trace_header *header) {
    CHECK(ledgers.count < LEDGERS);
    struct ledger *l = alloc(1, sizeof *l);
    snprintf(l->path, sizeof l->path, "%s", path);
    for (int i = 0; i < 16; i++)
        snprintf(l->id + 2 * i, 3, "%02x", header->session_id[i]);
    l->station = header->station[strlen("room-")] - '1';
    l->serial = (uint64_t)ledgers.count + 1;
    ledgers.all[ledgers.count++] = l;
    return l;
}

// Of a trace whose server died as it was begun.
static struct ledger *begin_unseen(const char *path, const struct trace_place *end) {
    struct trace_reader *reader;
    if (end->records || trace_reader_create(path, &reader, NULL) != RESULT_OK)
        broken("a trace that is gone on with was begun", "%s was not", path);
    struct ledger *l = begin_ledger(path, trace_reader_header(reader));
    trace_reader_destroy(&reader);
    return l;
}

enum result __real_trace_writer_create(const char *path, const struct trace_header *header,
                                       const struct trace_signer *signer,
                                       const struct trace_tap *tap,
                                       struct trace_writer **out_writer, struct error *err);
enum result __wrap_trace_writer_create(const char *path, const struct trace_header *header,
                                       const struct trace_signer *signer,
                                       const struct trace_tap *tap,
                                       struct trace_writer **out_writer, struct error *err);
enum result __wrap_trace_writer_create(const char *path, const struct trace_header *header,
                                       const struct trace_signer *signer,
                                       const struct trace_tap *tap,
                                       struct trace_writer **out_writer, struct error *err) {
    enum result result = __real_trace_writer_create(path, header, signer, tap, out_writer, err);
    if (result != RESULT_OK || sim_is_dead())
        return result;
    struct ledger *l = begin_ledger(path, header);
    l->writer = *out_writer;
    happened("session %.8s of room-%d begins", l->id, l->station + 1);
    return result;
}

enum result __real_trace_writer_resume(const char *path, const struct trace_place *end,
                                       int64_t utc_ns, const struct trace_signer *signer,
                                       const struct trace_tap *tap,
                                       struct trace_writer **out_writer, struct error *err);
enum result __wrap_trace_writer_resume(const char *path, const struct trace_place *end,
                                       int64_t utc_ns, const struct trace_signer *signer,
                                       const struct trace_tap *tap,
                                       struct trace_writer **out_writer, struct error *err);
enum result __wrap_trace_writer_resume(const char *path, const struct trace_place *end,
                                       int64_t utc_ns, const struct trace_signer *signer,
                                       const struct trace_tap *tap,
                                       struct trace_writer **out_writer, struct error *err) {
    enum result result =
        __real_trace_writer_resume(path, end, utc_ns, signer, tap, out_writer, err);
    struct ledger *l = find_path(path);
    if (result != RESULT_OK || sim_is_dead())
        return result;
    if (!l)
        l = begin_unseen(path, end);
    if (l->writer)
        broken("no session is served by two", "%s has a writer already", l->id);
    if (l->count && !end->missing && end->step != l->entries[l->count - 1].step)
        broken("a session goes on behind the last step of its trace",
               "%s goes on after step %llu instead of %llu", l->id, (unsigned long long)end->step,
               (unsigned long long)l->entries[l->count - 1].step);
    l->writer = *out_writer;
    l->closed = l->goes_on = l->spoiled = l->left = false;
    ledgers.resumes++;
    happened("session %.8s of room-%d goes on after step %llu", l->id, l->station + 1,
             (unsigned long long)end->step);
    return result;
}

static enum result read_steps(struct ledger *ledger, struct error *why);

// All is on disk now, unless that failed.
static void note_closed(const struct trace_writer *writer) {
    struct error why;
    for (int i = 0; i < ledgers.count && writer && !sim_is_dead(); i++)
        if (ledgers.all[i]->writer == writer) {
            ledgers.all[i]->writer = NULL;
            ledgers.all[i]->closed = true;
            ledgers.all[i]->spoiled |= is_excused(sim_now_ns());
            read_steps(ledgers.all[i], &why);
        }
}

void __real_trace_writer_destroy(struct trace_writer **writer);
void __wrap_trace_writer_destroy(struct trace_writer **writer);
void __wrap_trace_writer_destroy(struct trace_writer **writer) {
    const struct trace_writer *gone = *writer;
    __real_trace_writer_destroy(writer);
    note_closed(gone);
}

void __real_trace_writer_leave(struct trace_writer **writer);
void __wrap_trace_writer_leave(struct trace_writer **writer);
void __wrap_trace_writer_leave(struct trace_writer **writer) {
    const struct trace_writer *gone = *writer;
    __real_trace_writer_leave(writer);
    note_closed(gone);
}

// ---- looking at the disk ------------------------------------------------------------------------

static bool is_newest(const struct ledger *l) {
    for (int i = 0; i < ledgers.count; i++)
        if (ledgers.all[i]->station == l->station && ledgers.all[i]->serial > l->serial)
            return false;
    return true;
}

void watch_killed(bool power) {
    ledgers.killed_ns = sim_now_ns();
    ledgers.power = power;
    for (int i = 0; i < ledgers.count; i++) {
        struct ledger *l = ledgers.all[i];
        l->goes_on = l->writer && is_newest(l);
        l->spoiled |= l->writer ? is_excused(sim_now_ns()) : !l->closed; // nobody put it on disk
        l->writer = NULL;
    }
}

// Whether what was recorded then must be there now.
static bool must_be_there(const struct ledger *l, int64_t when_ns) {
    if (l->spoiled)
        return false;
    if (l->closed)
        return true;
    int64_t window_ns = ledgers.power ? POWER_NS : KILLED_NS;
    if (sim_stalls.last_ns > when_ns - NS_PER_S)
        window_ns += 2 * STALLED_NS;
    return when_ns < ledgers.killed_ns - window_ns;
}

struct look {
    struct ledger *ledger;
    size_t at; // entries that were found
};

static bool look_at_step(void *user, const struct trace_record *record) {
    struct look *look = user;
    const struct ledger *l = look->ledger;
    const struct entry *e = look->at < l->count ? &l->entries[look->at] : NULL;
    if (!e || e->step != record->output.step || e->hash != record->output.hash)
        broken("a trace has the steps that were made", "%s: step %llu of the file is step %llu",
               l->path, (unsigned long long)record->output.step,
               (unsigned long long)(e ? e->step : 0));
    look->at++;
    return true;
}

static bool look_at_gap(void *user, uint64_t missing) {
    ((struct look *)user)->ledger->has_gap |= missing > 0;
    return true;
}

static bool look_at_remark(void *user, const struct remark *remark) {
    struct ledger *l = ((struct look *)user)->ledger;
    for (int i = 0; i < l->note_count; i++)
        if (!strcmp(l->notes[i].text, remark->text))
            l->notes[i].found = true;
    return true;
}

static void check_notes(struct ledger *l) {
    int kept = 0;
    for (int i = 0; i < l->note_count; i++) {
        if (!l->notes[i].found && must_be_there(l, l->notes[i].when_ns))
            broken("a remark that was confirmed is in the trace", "%s lacks \"%s\"", l->path,
                   l->notes[i].text);
        if (l->notes[i].found)
            l->notes[kept++] = l->notes[i];
    }
    l->note_count = kept;
}

static enum result read_steps(struct ledger *l, struct error *why) {
    struct look look = {.ledger = l};
    struct trace_player player = {
        .user = &look, .step = look_at_step, .gap = look_at_gap, .remark = look_at_remark};
    struct trace_reader *reader;
    for (int i = 0; i < l->note_count; i++)
        l->notes[i].found = false;
    enum result result = trace_reader_create(l->path, &reader, why);
    if (result == RESULT_OK) {
        result = trace_play(reader, &player, why);
        trace_reader_destroy(&reader);
    }
    if (look.at < l->count && must_be_there(l, l->entries[look.at].when_ns))
        broken("what was recorded before the last moments is in the trace",
               "%s ends before step %llu, recorded %.1f ms before the end: %s", l->path,
               (unsigned long long)l->entries[look.at].step,
               (double)(ledgers.killed_ns - l->entries[look.at].when_ns) / 1e6, why->text);
    ledgers.lost_steps += l->count - look.at;
    l->count = look.at;
    check_notes(l);
    return result;
}

void watch_look_at_traces(void) {
    for (int i = 0; i < ledgers.count; i++) {
        struct error why = {0};
        struct ledger *l = ledgers.all[i];
        enum result result = read_steps(l, &why);
        l->goes_on = l->goes_on && l->count && !l->has_gap && result != RESULT_CLOSED;
        if (result != RESULT_CLOSED)
            happened("session %.8s of room-%d has %zu steps on disk: %s", l->id, l->station + 1,
                     l->count, why.text);
    }
    ledgers.killed_ns = 0;
}

// The server is up again, within the time that a session waits for its station.
void watch_up(int64_t wait_ns) {
    for (int i = 0; i < ledgers.count; i++) {
        struct ledger *l = ledgers.all[i];
        bool late = l->count && sim_now_ns() - l->entries[l->count - 1].when_ns > wait_ns;
        if (l->goes_on && !is_excused(sim_now_ns()) && !late)
            broken("a session that was open when the server died goes on", "%s does not", l->path);
        l->goes_on = false;
    }
}

static void replay(const struct ledger *l, const struct scene *scene) {
    struct trace_reader *reader;
    struct replay_report report;
    struct error err;
    if (trace_reader_create(l->path, &reader, &err) != RESULT_OK)
        return; // power was lost as it began
    if (trace_replay(reader, scene, NULL, NULL, &report, &err) != RESULT_OK ||
        report.verdict != REPLAY_IDENTICAL)
        broken("a trace replays to the same hashes", "%s: step %llu, %s: %s, %s", l->path,
               (unsigned long long)report.first.step, report.first.field, report.first.recorded,
               report.first.replayed);
    trace_reader_destroy(&reader);
    ledgers.replayed += report.steps;
}

void watch_replay_all(const struct scene *scene) {
    for (int i = 0; i < ledgers.count; i++) {
        struct error why = {0};
        struct ledger *l = ledgers.all[i];
        if (read_steps(l, &why) != RESULT_CLOSED && l->count && !l->spoiled)
            broken("in the end every trace has its end", "%s", why.text);
        replay(l, scene);
    }
}
