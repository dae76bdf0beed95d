#include "lease_sim.h"

#include "../random.h"
#include "base/check.h"
#include "cluster/ownership.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TICK_NS (250 * NS_PER_MS)
#define ASK_NS (200 * NS_PER_MS)

// ---- what happens when
// ----------------------------------------------------------------------------

enum what { TICK, REQUEST, ANSWER, SEEN, ASK, FAULT, HEAL };

struct event {
    int64_t at_ns;
    uint64_t number; // of two at one time the first that was put
    enum what what;
    int server, station; // station: also the kind of fault
    uint64_t life;       // of the process that it concerns
    enum write_answer answer;
    uint64_t revision;
    struct key_write write;
    char server_key[SERVER_NAME_SIZE]; // of `write`, or of what is seen
};

struct key {
    uint64_t revision;
    struct server_value of_server;
    struct station_value of_station;
};

struct node {
    struct world *world;
    int index;
    char name[SERVER_NAME_SIZE];
    struct ownership *ownership; // NULL: the process does not run
    uint64_t process;            // counts up with each
    uint64_t life_before;
    bool cut_off;
    int64_t paused_until_ns;
    double rate;          // of its clock
    int64_t watched_ns;   // what it sees comes in order
    struct event *missed; // while it is cut off: seen once it is not
    int missed_count;
};

struct asking {
    int server;
    int64_t since_ns; // unserved
    uint64_t token;   // of the last owner
};

struct world {
    const struct lease_sim *sim;
    struct random random;
    int64_t now_ns, trouble_ns;
    struct event *heap;
    size_t count, room;
    uint64_t numbers, revisions;
    struct key *server_keys, *station_keys;
    struct node *nodes;
    struct asking *stations;
    struct lease_figures figures;
};

static bool is_before(const struct event *a, const struct event *b) {
    return a->at_ns != b->at_ns ? a->at_ns < b->at_ns : a->number < b->number;
}

static void put(struct world *w, struct event event) {
    event.number = ++w->numbers;
    if (w->count == w->room) {
        w->room = w->room ? 2 * w->room : 1024;
        w->heap = alloc_resize(w->heap, w->room, sizeof *w->heap);
    }
    size_t i = w->count++;
    while (i && is_before(&event, &w->heap[(i - 1) / 2])) {
        w->heap[i] = w->heap[(i - 1) / 2];
        i = (i - 1) / 2;
    }
    w->heap[i] = event;
}

static struct event take_first(struct world *w) {
    struct event first = w->heap[0], last = w->heap[--w->count];
    size_t i = 0;
    for (size_t child; (child = 2 * i + 1) < w->count; i = child) {
        if (child + 1 < w->count && is_before(&w->heap[child + 1], &w->heap[child]))
            child++;
        if (!is_before(&w->heap[child], &last))
            break;
        w->heap[i] = w->heap[child];
    }
    w->heap[i] = last;
    return first;
}

static int64_t seconds(double s) {
    return (int64_t)(s * (double)NS_PER_S);
}

static int64_t clock_of(const struct node *node) {
    return (int64_t)((double)node->world->now_ns * node->rate) + (int64_t)node->index * NS_PER_S;
}

// Mostly some milliseconds; now and then, while something is wrong, seconds.
static int64_t delay(struct world *w) {
    bool slow = w->now_ns < w->trouble_ns && random_between(&w->random, 0, 1) < 0.02;
    return seconds(slow ? random_between(&w->random, 0.1, 6)
                        : random_between(&w->random, 0.001, 0.02));
}

static bool is_lost(struct world *w) {
    return w->now_ns < w->trouble_ns && random_between(&w->random, 0, 1) < 0.02;
}

// ---- a server's process
// ---------------------------------------------------------------------------

static void on_write(void *user, const struct key_write *write) {
    struct node *node = user;
    struct world *w = node->world;
    struct event event = {.at_ns = w->now_ns + delay(w),
                          .what = REQUEST,
                          .server = node->index,
                          .life = node->process,
                          .write = *write};
    w->figures.writes++;
    if (write->server)
        snprintf(event.server_key, sizeof event.server_key, "%s", write->server);
    if (node->cut_off || is_lost(w)) {
        event.at_ns = w->now_ns + LEASE_ANSWER_NS;
        event.what = ANSWER;
        event.answer = WRITE_UNKNOWN;
    }
    put(w, event);
}

static void on_changed(void *user, int station, enum station_owner owner) {
    struct node *node = user;
    struct world *w = node->world;
    struct asking *asking = &w->stations[station];
    w->figures.lives_lost += owner == OWNER_DOUBTFUL;
    if (owner != OWNER_SELF)
        return;
    w->figures.takes++;
    uint64_t token = w->station_keys[station].revision;
    w->figures.sinking_tokens += token < asking->token;
    asking->token = token;
}

static uint64_t on_new_life(void *user) {
    struct node *node = user;
    return node->life_before = random_bits(&node->world->random) | 1;
}

static void start(struct node *node) {
    struct world *w = node->world;
    struct ownership_handler handler = {node, on_write, on_changed, on_new_life};
    uint64_t before = node->life_before;
    node->process++;
    node->ownership = ownership_create(node->name, &(struct server_value){0}, before,
                                       w->sim->stations, &handler, clock_of(node));
    put(w, (struct event){
               .at_ns = w->now_ns, .what = TICK, .server = node->index, .life = node->process});
    for (int i = 0; i < w->sim->servers; i++)
        if (w->server_keys[i].revision)
            put(w,
                (struct event){.at_ns = w->now_ns + delay(w),
                               .what = SEEN,
                               .server = node->index,
                               .life = node->process,
                               .revision = w->server_keys[i].revision,
                               .station = i,
                               .write = {.server = "", .of_server = w->server_keys[i].of_server}});
    for (int i = 0; i < w->sim->stations; i++)
        if (w->station_keys[i].revision)
            put(w, (struct event){.at_ns = w->now_ns + delay(w),
                                  .what = SEEN,
                                  .server = node->index,
                                  .life = node->process,
                                  .revision = w->station_keys[i].revision,
                                  .station = i,
                                  .write = {.of_station = w->station_keys[i].of_station}});
}

// ---- the keys
// -------------------------------------------------------------------------------------

static void show(struct world *w, struct event seen) {
    for (int i = 0; i < w->sim->servers; i++) {
        struct node *node = &w->nodes[i];
        int64_t at_ns = w->now_ns + delay(w);
        node->watched_ns = at_ns > node->watched_ns ? at_ns : node->watched_ns;
        seen.server = i;
        seen.life = node->process;
        seen.at_ns = node->watched_ns;
        put(w, seen);
    }
}

static void serve_write(struct world *w, const struct event *event) {
    const struct key_write *write = &event->write;
    int index = write->server ? atoi(event->server_key + 1) : write->station;
    struct key *key = write->server ? &w->server_keys[index] : &w->station_keys[index];
    struct event answer = *event;
    answer.what = ANSWER;
    answer.at_ns = w->now_ns + delay(w);
    answer.answer = key->revision == write->replaces ? WRITE_DONE : WRITE_LATE;
    if (answer.answer == WRITE_DONE) {
        key->revision = answer.revision = ++w->revisions;
        key->of_server = write->of_server;
        key->of_station = write->of_station;
        w->figures.deposals += write->server && !write->of_server.life;
        struct event seen = {
            .what = SEEN, .revision = key->revision, .station = index, .write = *write};
        show(w, seen);
    }
    if (w->nodes[event->server].cut_off || is_lost(w)) {
        answer.answer = WRITE_UNKNOWN;
        answer.at_ns = w->now_ns + LEASE_ANSWER_NS;
    }
    put(w, answer);
}

// ---- faults
// ---------------------------------------------------------------------------------------

enum fault { KILL, PAUSE, CUT, FAULTS };

static void strike(struct world *w) {
    struct node *node = &w->nodes[random_bits(&w->random) % (uint64_t)w->sim->servers];
    enum fault fault = (enum fault)(random_bits(&w->random) % FAULTS);
    double long_s = random_between(&w->random, 0.5, 25);
    struct event heal = {.at_ns = w->now_ns + seconds(long_s),
                         .what = HEAL,
                         .server = node->index,
                         .station = (int)fault};
    put(w, (struct event){.at_ns = w->now_ns +
                                   seconds(random_between(&w->random, 0, 2 * w->sim->fault_s)),
                          .what = FAULT});
    if (w->now_ns >= w->trouble_ns || !node->ownership || node->cut_off ||
        node->paused_until_ns > w->now_ns)
        return;
    if (fault == KILL)
        ownership_destroy(&node->ownership);
    else if (fault == PAUSE)
        node->paused_until_ns = heal.at_ns;
    else
        node->cut_off = true;
    put(w, heal);
}

static void heal(struct world *w, const struct event *event) {
    struct node *node = &w->nodes[event->server];
    if (event->station == KILL && !node->ownership) {
        start(node);
    } else if (event->station == CUT) {
        node->cut_off = false;
        for (int i = 0; i < node->missed_count; i++) {
            node->missed[i].at_ns = w->now_ns + NS_PER_MS;
            put(w, node->missed[i]);
        }
        node->missed_count = 0;
    }
}

// ---- stations
// -------------------------------------------------------------------------------------

static bool answers(const struct world *w, const struct node *node) {
    return node->ownership && node->paused_until_ns <= w->now_ns;
}

static void ask(struct world *w, int station) {
    struct asking *asking = &w->stations[station];
    struct node *node = &w->nodes[asking->server];
    int64_t again_ns = ASK_NS;
    enum station_owner owner = OWNER_NONE;
    if (answers(w, node))
        owner = ownership_want(node->ownership, station, clock_of(node));
    else
        again_ns = 3 * NS_PER_S; // it finds out that nobody answers
    bool roams = random_between(&w->random, 0, 1) < 0.0005;
    if (owner == OWNER_ELSEWHERE && !roams)
        asking->server = atoi(ownership_named(node->ownership, station) + 1);
    else if (!answers(w, node) || (owner == OWNER_NONE && random_between(&w->random, 0, 1) < 0.3) ||
             roams)
        asking->server = (int)(random_bits(&w->random) % (uint64_t)w->sim->servers);
    if (owner == OWNER_SELF || w->now_ns < w->trouble_ns + LEASE_DEAD_NS + 10 * NS_PER_S)
        asking->since_ns = w->now_ns;
    double gap_s = (double)(w->now_ns - asking->since_ns) / 1e9;
    w->figures.longest_gap_s = fmax(w->figures.longest_gap_s, gap_s);
    bool leaves = w->now_ns < w->trouble_ns && random_between(&w->random, 0, 1) < 0.001;
    if (owner == OWNER_SELF && leaves)
        ownership_release(node->ownership, station, clock_of(node));
    put(w, (struct event){.at_ns = w->now_ns + again_ns, .what = ASK, .station = station});
}

// ---- what must never be -------------------------------------------------------------------------

static int owners_of(const struct world *w, int station) {
    int count = 0;
    for (int i = 0; i < w->sim->servers; i++) {
        const struct node *node = &w->nodes[i];
        count += node->ownership && ownership_of(node->ownership, station) == OWNER_SELF &&
                 ownership_is_valid(node->ownership, clock_of(node));
    }
    return count;
}

// A station gets an owner as its key is seen or the write of it is answered; and all of a server's
// get theirs back as its renewal is answered.
static void look(struct world *w, const struct event *event) {
    if (event->what != ANSWER && event->what != SEEN)
        return;
    const struct ownership *o = w->nodes[event->server].ownership;
    if (!event->write.server)
        w->figures.double_owners += owners_of(w, event->write.station) > 1;
    for (int i = 0; event->write.server && event->what == ANSWER && o && i < w->sim->stations; i++)
        if (ownership_of(o, i) == OWNER_SELF)
            w->figures.double_owners += owners_of(w, i) > 1;
}

// ---- the course ---------------------------------------------------------------------------------

static void see(struct node *node, const struct event *event) {
    char name[SERVER_NAME_SIZE];
    snprintf(name, sizeof name, "s%d", event->station);
    if (event->write.server)
        ownership_saw_server(node->ownership, name, &event->write.of_server, event->revision,
                             clock_of(node));
    else
        ownership_saw_station(node->ownership, event->station, &event->write.of_station,
                              event->revision, clock_of(node));
}

static void miss(struct node *node, const struct event *event) {
    node->missed = alloc_resize(node->missed, (size_t)node->missed_count + 1, sizeof *node->missed);
    node->missed[node->missed_count++] = *event;
}

static void run_in_process(struct world *w, struct event *event) {
    struct node *node = &w->nodes[event->server];
    if (!node->ownership || node->process != event->life)
        return;
    if (node->paused_until_ns > w->now_ns) {
        event->at_ns = node->paused_until_ns;
        put(w, *event);
    } else if (event->what == SEEN && node->cut_off) {
        miss(node, event);
    } else if (event->what == SEEN) {
        see(node, event);
    } else if (event->what == ANSWER) {
        ownership_answered(node->ownership, event->write.id, event->answer, event->revision,
                           clock_of(node));
    } else {
        ownership_tick(node->ownership, clock_of(node));
        event->at_ns = w->now_ns + TICK_NS;
        put(w, *event);
    }
}

static void run(struct world *w, struct event *event) {
    w->now_ns = event->at_ns;
    switch (event->what) {
    case TICK:
    case ANSWER:
    case SEEN:
        run_in_process(w, event);
        break;
    case REQUEST:
        serve_write(w, event);
        break;
    case ASK:
        ask(w, event->station);
        break;
    case FAULT:
        strike(w);
        break;
    case HEAL:
        heal(w, event);
        break;
    }
    look(w, event);
}

static void begin(struct world *w) {
    const struct lease_sim *sim = w->sim;
    w->trouble_ns = seconds(sim->trouble_s);
    w->server_keys = alloc((size_t)sim->servers, sizeof *w->server_keys);
    w->station_keys = alloc((size_t)sim->stations, sizeof *w->station_keys);
    w->nodes = alloc((size_t)sim->servers, sizeof *w->nodes);
    w->stations = alloc((size_t)sim->stations, sizeof *w->stations);
    for (int i = 0; i < sim->servers; i++) {
        struct node *node = &w->nodes[i];
        *node = (struct node){.world = w, .index = i};
        node->rate = 1 + random_between(&w->random, -sim->drift, sim->drift);
        snprintf(node->name, sizeof node->name, "s%d", i);
        start(node);
    }
    for (int i = 0; i < sim->stations; i++) {
        w->stations[i].server = i % sim->servers;
        put(w, (struct event){.at_ns = i, .what = ASK, .station = i});
    }
    if (sim->fault_s > 0)
        put(w, (struct event){.at_ns = NS_PER_S, .what = FAULT});
}

static void end(struct world *w) {
    for (int i = 0; i < w->sim->stations; i++)
        w->figures.unserved += owners_of(w, i) != 1;
    for (int i = 0; i < w->sim->servers; i++) {
        ownership_destroy(&w->nodes[i].ownership);
        free(w->nodes[i].missed);
    }
    free(w->heap);
    free(w->server_keys);
    free(w->station_keys);
    free(w->nodes);
    free(w->stations);
}

struct lease_figures lease_sim_run(const struct lease_sim *sim) {
    struct world w = {.sim = sim, .random = {sim->seed}};
    int64_t end_ns = seconds(sim->trouble_s + sim->quiet_s);
    begin(&w);
    while (w.count && w.heap[0].at_ns < end_ns) {
        struct event event = take_first(&w);
        run(&w, &event);
    }
    end(&w);
    return w.figures;
}
