#include "journal_sim.h"

#include "base/check.h"
#include "cluster/posting.h"
#include "made_state.h"
#include "moments.h"

#include <stdlib.h>
#include <string.h>

#define SOON_NS (5 * NS_PER_MS)
#define PATIENCE_NS (5 * NS_PER_S) // for the first word of an owner
#define FLUSH_NS (2 * NS_PER_S)
#define FOUND_OUT_NS (5 * NS_PER_S) // a server that is cut off learns it after so long

struct post {
    struct jet_message message;
    uint64_t sequence;
    uint8_t bytes[];
};

struct stream {
    struct post **posts;
    size_t count, room;
    uint32_t safe; // what no later owner may lack; 0: nothing
};

// One server's part in a station, as server/sessions has it.
struct part {
    struct journal_writer *writer;
    struct posting posting;
    uint64_t token, ready, begun;
    uint64_t takes; // the token by which it takes, 0: it does not
    bool moves, leaves;
    uint32_t session, kept, ended; // moments: the newest, that of the state, the last end
    uint32_t next;                 // the one from which it is about to go on
    int64_t until_ns;              // it waits for its first word, or for the flush
    int64_t arrives_ns;            // messages keep their order
};

struct journals {
    struct moments moments;
    struct stream *streams;
    uint64_t sequences;
    struct trace_header header;
};

// ---- a stream -----------------------------------------------------------------------------------

static void store(struct world *w, struct happening *event) {
    struct stream *stream = &w->journals->streams[event->station];
    struct post *post = event->post;
    post->sequence = ++w->journals->sequences;
    if (stream->count == stream->room) {
        stream->room = 2 * stream->room + 16;
        stream->posts = alloc_resize(stream->posts, stream->room, sizeof *stream->posts);
    }
    stream->posts[stream->count++] = post;
    if (event->answer != WRITE_DONE)
        return; // it was answered, as unknown
    bool is_heard = !w->nodes[event->server].cut_off && !is_lost(w);
    event->what = POSTED;
    event->at_ns = w->now_ns + (is_heard ? delay(w) : LEASE_ANSWER_NS);
    event->answer = is_heard ? WRITE_DONE : WRITE_UNKNOWN;
    event->revision = post->sequence;
    put(w, *event);
}

static void purge(struct world *w, int station, uint64_t before) {
    struct stream *stream = &w->journals->streams[station];
    size_t gone = 0;
    while (gone < stream->count && stream->posts[gone]->sequence < before)
        free(stream->posts[gone++]);
    stream->count -= gone;
    if (gone)
        memmove(stream->posts, stream->posts + gone, stream->count * sizeof *stream->posts);
}

// Answered in two seconds at most; what is cut off may arrive once it is not.
static void send(struct node *node, int station, struct part *part,
                 const struct jet_message *message, bool begins_base) {
    struct world *w = node->world;
    int64_t way_ns = node->cut_off ? seconds(random_between(&w->random, 1, 25)) : delay(w);
    int64_t at_ns = w->now_ns + way_ns;
    part->arrives_ns = at_ns > part->arrives_ns ? at_ns : part->arrives_ns;
    struct happening event = {.at_ns = part->arrives_ns,
                              .what = STORED,
                              .server = node->index,
                              .station = station,
                              .process = node->process,
                              .begins_base = begins_base,
                              .id = message->token,
                              .answer = WRITE_DONE};
    if (node->cut_off || event.at_ns - w->now_ns >= LEASE_ANSWER_NS || is_lost(w))
        event.answer = WRITE_UNKNOWN;
    if (event.answer == WRITE_UNKNOWN) {
        struct happening unknown = event;
        unknown.what = POSTED;
        unknown.at_ns = w->now_ns + LEASE_ANSWER_NS;
        put(w, unknown);
        if (happens(w, 0.5))
            return; // it never arrives
    }
    event.post = alloc(1, sizeof *event.post + message->size);
    event.post->message = *message;
    if (message->size)
        memcpy(event.post->bytes, message->data, message->size);
    event.post->message.data = event.post->bytes;
    put(w, event);
}

// ---- a server's journals, as server/cluster serves them -----------------------------------------

static bool is_away(const struct node *node) {
    return node->cut_off && node->world->now_ns - node->cut_ns > FOUND_OUT_NS;
}

static bool is_whole(const struct node *node, const struct part *part) {
    return journal_is_whole(part->writer) && posting_is_done(&part->posting) && !is_away(node);
}

static void put_state(struct node *node, struct part *part) {
    struct journals *j = node->world->journals;
    size_t size;
    uint8_t *bytes = made_state(moments_offset(&j->moments, part->kept) + 1, part->kept, &size);
    CHECK(journal_put_state(part->writer, bytes, size, clock_of(node)));
    free(bytes);
}

// What this server may rely on: another one that goes on has at least that.
static void note_safe(struct node *node, int station, const struct part *part) {
    struct world *w = node->world;
    struct journals *j = w->journals;
    uint32_t *safe = &j->streams[station].safe;
    if (!part->token || ownership_of(node->ownership, station) != OWNER_SELF ||
        !ownership_is_valid(node->ownership, clock_of(node)))
        return;
    if (part->session && is_whole(node, part)) {
        bool is_next = !*safe || moments_root(&j->moments, *safe)->ended ||
                       moments_follow(&j->moments, *safe, part->session);
        w->figures.lost += !is_next;
        *safe = part->session;
    }
    if (!part->session && part->ended && posting_is_done(&part->posting) && !is_away(node))
        moments_root(&j->moments, part->ended)->ended_is_kept = true;
}

static void serve(struct node *node, int station) {
    struct world *w = node->world;
    struct part *part = node->of[station];
    struct jet_message message;
    bool begins_base;
    if (posting_has_lost(&part->posting) || is_away(node))
        journal_break(part->writer);
    if (is_away(node) ? journal_newer_state(part->writer)
                      : journal_wants_state(part->writer, clock_of(node)))
        put_state(node, part);
    if (is_away(node))
        return;
    while (posting_next(&part->posting, part->writer, &message, &begins_base))
        send(node, station, part, &message, begins_base);
    bool serves = ownership_of(node->ownership, station) == OWNER_SELF &&
                  ownership_is_valid(node->ownership, clock_of(node));
    uint64_t before = posting_purges(&part->posting, serves);
    if (before && !node->cut_off)
        put(w, (struct happening){.at_ns = w->now_ns + delay(w),
                                  .what = PURGED,
                                  .station = station,
                                  .revision = before});
    note_safe(node, station, part);
}

void journal_tick(struct node *node) {
    for (int i = 0; i < node->part_count; i++)
        serve(node, node->parts[i]);
}

static void put_soon(struct node *node, int station, enum what what, int64_t in_ns) {
    struct world *w = node->world;
    put(w, (struct happening){.at_ns = w->now_ns + in_ns,
                              .what = what,
                              .server = node->index,
                              .station = station,
                              .process = node->process});
}

// ---- whose session it is, as server/sessions knows it -------------------------------------------

static struct part *part_of(struct node *node, int station) {
    if (!node->of[station]) {
        node->of[station] = alloc(1, sizeof **node->of);
        node->of[station]->writer = journal_writer_create();
        node->parts[node->part_count++] = station;
    }
    return node->of[station];
}

static void take_soon(struct node *node, int station) {
    struct part *part = node->of[station];
    if (part->takes)
        return;
    part->takes = part->token;
    part->until_ns = node->world->now_ns + PATIENCE_NS;
    put_soon(node, station, TAKEN, seconds(random_between(&node->world->random, 0.001, 0.05)));
}

void journal_owned(struct node *node, int station, uint64_t token) {
    struct part *part = part_of(node, station);
    journal_own(part->writer, token);
    posting_own(&part->posting, token);
    part->token = token;
    part->ended = 0; // an end that was not told by now is not
    part->moves = false;
    take_soon(node, station);
}

static int64_t leaving_lasts(struct world *w) {
    return seconds(random_between(&w->random, 0.001, happens(w, 0.2) ? 5 : 0.3));
}

void journal_lost(struct node *node, int station) {
    struct part *part = node->of[station];
    if (!part)
        return;
    posting_own(&part->posting, 0);
    part->token = part->ready = 0;
    if (!part->leaves)
        put_soon(node, station, LEFT, leaving_lasts(node->world));
    part->leaves = true;
}

void journal_killed(struct node *node) {
    for (int i = 0; i < node->part_count; i++) {
        struct part *part = node->of[node->parts[i]];
        journal_writer_destroy(&part->writer);
        free(part);
        node->of[node->parts[i]] = NULL;
    }
    node->part_count = 0;
}

static void leave_session(struct part *part) {
    part->session = part->kept = 0;
    part->begun = 0;
    journal_leave(part->writer);
}

static void leave(struct node *node, int station) {
    struct part *part = node->of[station];
    if (part->takes) { // behind it
        put_soon(node, station, LEFT, SOON_NS);
        return;
    }
    part->leaves = false;
    if (!part->token && !part->moves && part->session)
        leave_session(part);
}

// A new trace, whose state is still to be kept.
static void begin_session(struct node *node, int station, uint32_t moment) {
    static const struct job none;
    struct journals *j = node->world->journals;
    struct part *part = node->of[station];
    part->session = moment;
    part->kept = part->ended = 0;
    part->begun = part->token;
    journal_begin(part->writer, &j->header, "simulated", &none);
}

static void tell_remarks(const struct moments *m, struct part *part, uint32_t moment) {
    if (m->of[moment].kind == MOMENT_ROOT)
        return;
    tell_remarks(m, part, m->of[moment].before);
    if (m->of[moment].kind == MOMENT_REMARK)
        moments_tell(m, moment, part->writer);
}

// ---- what is read -------------------------------------------------------------------------------

// The moment that a reader of the stream goes on from; 0: none.
static uint32_t read_session(struct world *w, int station, struct journal_session *out) {
    struct journals *j = w->journals;
    struct stream *stream = &j->streams[station];
    struct trace_state state;
    uint32_t moment = 0;
    struct journal_reader *reader = journal_reader_create();
    bool lags = w->now_ns < w->trouble_ns && happens(w, 0.1); // the server of NATS that is asked
    size_t lacks = lags ? 1 + random_bits(&w->random) % 4 : 0;
    for (size_t i = 0; i + lacks < stream->count; i++)
        journal_take(reader, &stream->posts[i]->message);
    enum result result = journal_read(reader, out, NULL);
    if (result == RESULT_OK) {
        CHECK(trace_state_parse(out->state, out->state_size, &state, NULL) == RESULT_OK);
        memcpy(&moment, state.content, sizeof moment);
        w->figures.torn += !moments_join(&j->moments, reader, &moment);
    }
    w->figures.torn += result != RESULT_OK && result != RESULT_MISSING;
    out->state = NULL; // the reader's
    journal_reader_destroy(&reader);
    return moment;
}

// What is read must not lack what was safe, nor bring back what ended.
static void compare(struct world *w, int station, uint32_t moment, bool has_ended) {
    struct journals *j = w->journals;
    uint32_t safe = j->streams[station].safe;
    bool is_over = !safe || moments_root(&j->moments, safe)->ended;
    if (!is_over)
        w->figures.lost += !moment || has_ended || !moments_follow(&j->moments, safe, moment);
    if (moment && !has_ended)
        w->figures.risen += moments_root(&j->moments, moment)->ended_is_kept;
}

static void taken(struct node *node, int station) {
    struct world *w = node->world;
    struct part *part = node->of[station];
    struct journal_session session;
    bool is_answered = journal_owns(part->writer) && posting_is_done(&part->posting);
    if (!part->token || part->ready == part->token) {
        part->takes = 0;
        return;
    }
    if (!is_answered && w->now_ns < part->until_ns && !atomic_load(&part->posting.lost)) {
        serve(node, station);
        put_soon(node, station, TAKEN, SOON_NS);
        return;
    }
    if (!is_answered || node->cut_off) { // the station will ask again
        part->takes = 0;
        return;
    }
    uint32_t moment = read_session(w, station, &session);
    if (session.newest_token != part->token) {
        part->takes = 0;
        return;
    }
    if (part->session && moment && session.token > part->begun)
        leave_session(part);
    bool goes_on = !part->session && moment && !session.has_ended;
    if (!part->session)
        compare(w, station, moment, session.has_ended);
    w->figures.restored += goes_on;
    part->next = goes_on ? moment : 0;
    put_soon(node, station, BEGUN, goes_on ? seconds(random_between(&w->random, 0.01, 0.3)) : 0);
}

// part->takes is the token by which the journal was read.
static void begun(struct node *node, int station) {
    struct part *part = node->of[station];
    if (part->next) {
        begin_session(node, station, part->next);
        tell_remarks(&node->world->journals->moments, part, part->next);
    }
    journal_go_on(part->writer, part->takes);
    part->ready = part->takes;
    part->takes = 0;
}

// ---- what a station does ------------------------------------------------------------------------

bool journal_serves(struct node *node, int station) {
    struct part *part = node->of[station];
    if (!part || !part->token || part->moves)
        return false;
    if (part->ready == part->token)
        return true;
    take_soon(node, station);
    return false;
}

static void end_session(struct world *w, struct part *part) {
    moments_root(&w->journals->moments, part->session)->ended = true;
    part->ended = part->session;
    part->session = part->kept = 0;
    part->begun = 0;
    journal_end(part->writer);
}

void journal_play(struct node *node, int station) {
    struct world *w = node->world;
    struct part *part = node->of[station];
    if (!part->session) {
        begin_session(node, station, moments_add(&w->journals->moments, 0, MOMENT_ROOT));
    } else if (happens(w, 0.005)) {
        end_session(w, part);
    } else if (happens(w, 0.5)) {
        enum moment_kind kind =
            1 + (enum moment_kind)(random_bits(&w->random) % (MOMENT_KINDS - 1));
        part->session = moments_add(&w->journals->moments, part->session, kind);
        moments_tell(&w->journals->moments, part->session, part->writer);
    }
    if (part->session && happens(w, 0.1)) {
        part->kept = part->session;
        journal_kept(part->writer);
    }
    serve(node, station);
}

bool journal_move(struct node *node, int station) {
    struct part *part = node->of[station];
    if (!part || part->moves || part->takes)
        return false;
    part->moves = true;
    part->ready = 0;
    part->until_ns = node->world->now_ns + FLUSH_NS;
    put_soon(node, station, MOVED, SOON_NS);
    return true;
}

static void moved(struct node *node, int station) {
    struct part *part = node->of[station];
    if (!part->moves) // it is this server's anew
        return;
    serve(node, station);
    if (part->session && !is_whole(node, part) && !journal_is_empty(part->writer) &&
        node->world->now_ns < part->until_ns) {
        put_soon(node, station, MOVED, SOON_NS);
        return;
    }
    leave_session(part);
    part->moves = false;
    part->token = 0;
    ownership_release(node->ownership, station, clock_of(node));
}

// ---- all ----------------------------------------------------------------------------------------

void journal_happens(struct world *w, struct happening *event) {
    struct node *node = &w->nodes[event->server];
    struct part *part = node->of[event->station];
    switch (event->what) {
    case STORED:
        store(w, event);
        break;
    case POSTED:
        posting_answered(&part->posting, event->id, event->begins_base, event->answer,
                         event->revision);
        break;
    case PURGED:
        purge(w, event->station, event->revision);
        break;
    case TAKEN:
        taken(node, event->station);
        break;
    case BEGUN:
        begun(node, event->station);
        break;
    case LEFT:
        leave(node, event->station);
        break;
    default:
        moved(node, event->station);
    }
}

void journals_create(struct world *w) {
    struct journals *j = w->journals = alloc(1, sizeof *j);
    j->streams = alloc((size_t)w->sim->stations, sizeof *j->streams);
    j->header = made_header();
    moments_add(&w->journals->moments, 0, MOMENT_ROOT); // 0 is none
}

void journals_destroy(struct world *w) {
    struct journals *j = w->journals;
    for (int i = 0; i < w->sim->stations; i++) {
        purge(w, i, UINT64_MAX);
        free(j->streams[i].posts);
    }
    free(j->streams);
    free(j->moments.of);
    free(j);
}
