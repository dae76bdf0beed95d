#include "lease_sim.h"

#include "base/check.h"
#include "journal_sim.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TICK_NS (500 * NS_PER_MS)
#define ASK_NS (200 * NS_PER_MS)
#define FAULT_MOST_S 25

// ---- owners -------------------------------------------------------------------------------------

static void add_owner(struct owners *owners, int server) {
    if (owners->count == owners->room) {
        owners->room = 2 * owners->room + 4;
        owners->of = alloc_resize(owners->of, (size_t)owners->room, sizeof *owners->of);
    }
    owners->of[owners->count++] = server;
}

static void remove_owner(struct owners *owners, int server) {
    for (int i = 0; i < owners->count; i++)
        if (owners->of[i] == server)
            owners->of[i] = owners->of[--owners->count];
}

// Those that may serve it.
static int owners_of(const struct world *w, int station) {
    int count = 0;
    for (int i = 0; i < w->owners[station].count; i++) {
        const struct node *node = &w->nodes[w->owners[station].of[i]];
        count += ownership_is_valid(node->ownership, clock_of(node));
    }
    return count;
}

static bool is_slow(struct world *w) {
    return w->now_ns < w->trouble_ns && happens(w, 0.3);
}

// ---- a server's process -------------------------------------------------------------------------

static void on_write(void *user, const struct key_write *write) {
    struct node *node = user;
    struct world *w = node->world;
    struct happening event = {.at_ns = w->now_ns + delay(w),
                              .what = REQUEST,
                              .server = node->index,
                              .process = node->process,
                              .id = write->id};
    w->figures.writes++;
    if (node->cut_off || is_lost(w)) {
        event.at_ns = w->now_ns + LEASE_ANSWER_NS;
        event.what = ANSWER;
        event.answer = WRITE_UNKNOWN;
    } else {
        event.request = alloc(1, sizeof *event.request);
        *event.request = (struct request){
            .of_server = write->server,
            .index = write->server ? atoi(write->server + 1) : write->station,
            .replaces = write->replaces,
            .server = write->of_server,
            .station = write->of_station,
        };
    }
    put(w, event);
}

static void note_owner(struct node *node, int station) {
    struct world *w = node->world;
    struct asking *asking = &w->stations[station];
    uint64_t token = ownership_token(node->ownership, station);
    bool is_valid = ownership_is_valid(node->ownership, clock_of(node));
    add_owner(&w->owners[station], node->index);
    w->figures.takes++;
    w->figures.sinking_tokens += is_valid && token < asking->token;
    asking->token = token > asking->token ? token : asking->token;
    journal_owned(node, station, token);
}

static void on_changed(void *user, int station, enum station_owner owner) {
    struct node *node = user;
    remove_owner(&node->world->owners[station], node->index);
    node->world->figures.lives_lost += owner == OWNER_DOUBTFUL;
    if (owner == OWNER_SELF)
        note_owner(node, station);
    else if (owner == OWNER_NONE || owner == OWNER_ELSEWHERE)
        journal_lost(node, station);
}

static uint64_t on_new_life(void *user) {
    struct node *node = user;
    return node->life_before = random_bits(&node->world->random) | 1;
}

// Until a watch begins, it sees nothing.
static void watch_in(struct node *node, double s) {
    struct world *w = node->world;
    node->looks = true;
    put(w, (struct happening){.at_ns = w->now_ns + seconds(s),
                              .what = WATCH,
                              .server = node->index,
                              .process = node->process,
                              .id = ++node->watch});
}

static void start(struct node *node) {
    struct world *w = node->world;
    struct ownership_handler handler = {node, on_write, on_changed, on_new_life};
    uint64_t before = node->life_before;
    node->process++;
    node->ownership =
        ownership_create(node->name, &(struct server_value){0}, before, w->sim->stations, &handler);
    put(w, (struct happening){
               .at_ns = w->now_ns, .what = TICK, .server = node->index, .process = node->process});
    watch_in(node, random_between(&w->random, 0, is_slow(w) ? 20 : 0.1));
}

static void end_process(struct node *node) {
    struct world *w = node->world;
    for (int i = 0; i < w->sim->stations; i++)
        remove_owner(&w->owners[i], node->index);
    journal_killed(node);
    ownership_destroy(&node->ownership);
}

// ---- the keys -----------------------------------------------------------------------------------

// Changes come in order. True: the next one does now.
static bool look_on(struct node *node) {
    struct world *w = node->world;
    if (node->looks || !node->ownership || node->seen == w->change_count)
        return false;
    int64_t at_ns = w->changes[node->seen]->done_ns + delay(w);
    at_ns = at_ns > node->shown_ns ? at_ns : node->shown_ns;
    if (at_ns <= w->now_ns)
        return true;
    node->looks = true;
    put(w, (struct happening){.at_ns = at_ns,
                              .what = SEEN,
                              .server = node->index,
                              .process = node->process,
                              .id = node->watch});
    return false;
}

static int by_revision(const void *a, const void *b) {
    const struct request *one = *(const struct request *const *)a;
    const struct request *other = *(const struct request *const *)b;
    return one->revision < other->revision ? -1 : 1;
}

// First the newest value of each key, as they were written.
static void watch(struct node *node) {
    struct world *w = node->world;
    size_t most = (size_t)(w->sim->servers + w->sim->stations), count = 0;
    const struct request **keys = alloc(most, sizeof *keys);
    for (int i = 0; i < w->sim->servers; i++)
        if (w->server_keys[i])
            keys[count++] = w->server_keys[i];
    for (int i = 0; i < w->sim->stations; i++)
        if (w->station_keys[i])
            keys[count++] = w->station_keys[i];
    if (count)
        qsort(keys, count, sizeof *keys, by_revision);
    node->shown_ns = w->now_ns + delay(w);
    for (size_t i = 0; i < count; i++) {
        node->shown_ns += seconds(random_between(&w->random, 0, 1 / (double)most));
        put(w, (struct happening){.at_ns = node->shown_ns,
                                  .what = SEEN,
                                  .server = node->index,
                                  .process = node->process,
                                  .id = node->watch,
                                  .request = (struct request *)keys[i]});
    }
    free(keys);
    node->seen = w->change_count;
    node->looks = false;
}

static void do_write(struct world *w, struct request *request) {
    if (w->change_count == w->change_room) {
        w->change_room = 2 * w->change_room + 1024;
        w->changes = alloc_resize(w->changes, w->change_room, sizeof(struct request *));
    }
    w->changes[w->change_count++] = request;
    request->revision = w->change_count;
    request->done_ns = w->now_ns;
    w->figures.deposals += request->of_server && !request->server.life;
    for (int i = 0; i < w->sim->servers; i++)
        look_on(&w->nodes[i]);
}

static void serve_write(struct world *w, const struct happening *event) {
    struct request *request = event->request;
    const struct request **key =
        &(request->of_server ? w->server_keys : w->station_keys)[request->index];
    bool is_done = (*key ? (*key)->revision : 0) == request->replaces;
    struct happening answer = *event;
    answer.what = ANSWER;
    answer.at_ns = w->now_ns + delay(w);
    answer.answer = is_done ? WRITE_DONE : WRITE_LATE;
    answer.request = NULL;
    if (is_done) {
        do_write(w, request);
        *key = request;
        answer.revision = request->revision;
    } else {
        free(request);
    }
    if (w->nodes[event->server].cut_off || is_lost(w)) {
        answer.answer = WRITE_UNKNOWN;
        answer.at_ns = w->now_ns + LEASE_ANSWER_NS;
    }
    put(w, answer);
}

// ---- faults -------------------------------------------------------------------------------------

enum fault { KILL, PAUSE, CUT, FAULTS };

static void strike(struct world *w) {
    struct node *node = &w->nodes[random_bits(&w->random) % (uint64_t)w->sim->servers];
    enum fault fault = (enum fault)(random_bits(&w->random) % FAULTS);
    double long_s = random_between(&w->random, 0.5, FAULT_MOST_S);
    struct happening heal = {.at_ns = w->now_ns + seconds(long_s),
                             .what = HEAL,
                             .server = node->index,
                             .station = (int)fault};
    put(w, (struct happening){.at_ns = w->now_ns +
                                       seconds(random_between(&w->random, 0, 2 * w->sim->fault_s)),
                              .what = FAULT});
    if (w->now_ns >= w->trouble_ns || !node->ownership || node->cut_off ||
        node->paused_until_ns > w->now_ns)
        return;
    if (fault == KILL)
        end_process(node);
    else if (fault == PAUSE)
        node->paused_until_ns = heal.at_ns;
    else
        node->cut_off = true;
    node->cut_ns = w->now_ns;
    put(w, heal);
}

static void heal(struct world *w, const struct happening *event) {
    struct node *node = &w->nodes[event->server];
    if (event->station == KILL && !node->ownership)
        start(node);
    else if (event->station == CUT)
        node->cut_off = false;
    if (event->station != KILL && (event->station == CUT || is_slow(w))) // NATS forgot its watch
        watch_in(node, random_between(&w->random, 0, is_slow(w) ? 9 : 0.1));
}

// ---- stations -----------------------------------------------------------------------------------

static bool answers(const struct world *w, const struct node *node) {
    return node->ownership && node->paused_until_ns <= w->now_ns;
}

// A station leaves a server whose token is below one that it had.
static bool is_served(struct node *node, int station) {
    struct asking *asking = &node->world->stations[station];
    uint64_t token = ownership_token(node->ownership, station);
    if (!journal_serves(node, station) || token < asking->welcomed)
        return false;
    asking->welcomed = token;
    return true;
}

static void go_on(struct world *w, int station, enum station_owner owner) {
    struct asking *asking = &w->stations[station];
    struct node *node = &w->nodes[asking->server];
    bool roams = happens(w, 0.0005);
    if (owner == OWNER_ELSEWHERE && !roams)
        asking->server = atoi(ownership_named(node->ownership, station) + 1);
    else if (!answers(w, node) || (owner == OWNER_NONE && happens(w, 0.3)) || roams)
        asking->server = (int)(random_bits(&w->random) % (uint64_t)w->sim->servers);
}

static void ask(struct world *w, int station) {
    struct asking *asking = &w->stations[station];
    struct node *node = &w->nodes[asking->server];
    int64_t again_ns = ASK_NS;
    enum station_owner owner = OWNER_NONE;
    bool served = false;
    if (answers(w, node)) {
        owner = ownership_want(node->ownership, station, clock_of(node));
        served = owner == OWNER_SELF && is_served(node, station);
    } else {
        again_ns = 3 * NS_PER_S; // it finds out that nobody answers
    }
    if (served)
        journal_play(node, station);
    if (served && w->now_ns < w->trouble_ns && happens(w, 0.01))
        journal_move(node, station);
    go_on(w, station, owner);
    if (served || w->now_ns < w->calm_ns)
        asking->since_ns = w->now_ns;
    double gap_s = (double)(w->now_ns - asking->since_ns) / 1e9;
    w->figures.longest_gap_s = fmax(w->figures.longest_gap_s, gap_s);
    put(w, (struct happening){.at_ns = w->now_ns + again_ns, .what = ASK, .station = station});
}

// ---- what must never be -------------------------------------------------------------------------

// A station gets an owner as its key is seen or the write of it is answered; and all of a server's
// get theirs back as its renewal is answered.
static void look(struct world *w, const struct node *node) {
    for (int i = 0; i < node->part_count; i++)
        w->figures.double_owners += owners_of(w, node->parts[i]) > 1;
}

// ---- the course ---------------------------------------------------------------------------------

static void show(struct node *node, const struct request *key) {
    const char *name = node->world->nodes[key->index].name;
    if (key->of_server)
        ownership_saw_server(node->ownership, name, &key->server, key->revision, clock_of(node));
    else
        ownership_saw_station(node->ownership, key->index, &key->station, key->revision,
                              clock_of(node));
}

static void see(struct world *w, struct node *node, const struct happening *event) {
    if (node->cut_off || event->id != node->watch)
        return;
    if (event->request) {
        show(node, event->request);
        return;
    }
    node->looks = false;
    do
        show(node, w->changes[node->seen++]);
    while (look_on(node));
}

static void run_in_process(struct world *w, struct happening *event) {
    struct node *node = &w->nodes[event->server];
    if (!node->ownership || node->process != event->process)
        return;
    if (node->paused_until_ns > w->now_ns) {
        event->at_ns = node->paused_until_ns;
        put(w, *event);
    } else if (event->what == WATCH) {
        if (event->id == node->watch && !node->cut_off)
            watch(node);
    } else if (event->what == SEEN) {
        see(w, node, event);
    } else if (event->what == ANSWER) {
        ownership_answered(node->ownership, event->id, event->answer, event->revision,
                           clock_of(node));
        look(w, node);
    } else if (event->what == TICK) {
        ownership_tick(node->ownership, clock_of(node));
        journal_tick(node);
        event->at_ns = w->now_ns + TICK_NS;
        put(w, *event);
    } else {
        journal_happens(w, event);
    }
}

static void run(struct world *w, struct happening *event) {
    w->now_ns = event->at_ns;
    switch (event->what) {
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
    case STORED:
    case PURGED:
        journal_happens(w, event);
        break;
    default:
        run_in_process(w, event);
    }
}

static void begin(struct world *w) {
    const struct lease_sim *sim = w->sim;
    size_t servers = (size_t)sim->servers, stations = (size_t)sim->stations;
    w->trouble_ns = seconds(sim->trouble_s);
    w->calm_ns = w->trouble_ns + seconds(FAULT_MOST_S + 5) + LEASE_DEAD_NS;
    w->server_keys = alloc(servers, sizeof *w->server_keys);
    w->station_keys = alloc(stations, sizeof *w->station_keys);
    w->nodes = alloc(servers, sizeof *w->nodes);
    w->stations = alloc(stations, sizeof *w->stations);
    w->owners = alloc(stations, sizeof *w->owners);
    journals_create(w);
    for (int i = 0; i < sim->servers; i++) {
        struct node *node = &w->nodes[i];
        *node = (struct node){.world = w, .index = i};
        node->of = alloc(stations, sizeof *node->of);
        node->parts = alloc(stations, sizeof *node->parts);
        node->rate = 1 + random_between(&w->random, -sim->drift, sim->drift);
        snprintf(node->name, sizeof node->name, "s%d", i);
        start(node);
    }
    for (int i = 0; i < sim->stations; i++) {
        w->stations[i].server = i % sim->servers;
        put(w, (struct happening){.at_ns = i, .what = ASK, .station = i});
    }
    if (sim->fault_s > 0)
        put(w, (struct happening){.at_ns = NS_PER_S, .what = FAULT});
}

static void end(struct world *w) {
    for (int i = 0; i < w->sim->stations; i++) {
        w->figures.unserved += owners_of(w, i) != 1;
    }
    for (int i = 0; i < w->sim->servers; i++) {
        if (w->nodes[i].ownership)
            end_process(&w->nodes[i]);
        free(w->nodes[i].of);
        free(w->nodes[i].parts);
    }
    while (w->count) {
        struct happening event = take_first(w);
        free(event.what == REQUEST ? event.request : NULL);
        free(event.post);
    }
    for (size_t i = 0; i < w->change_count; i++)
        free(w->changes[i]);
    for (int i = 0; i < w->sim->stations; i++)
        free(w->owners[i].of);
    journals_destroy(w);
    free(w->heap);
    free(w->changes);
    free(w->server_keys);
    free(w->station_keys);
    free(w->nodes);
    free(w->stations);
    free(w->owners);
}

struct lease_figures lease_sim_run(const struct lease_sim *sim) {
    struct world w = {.sim = sim, .random = {sim->seed}};
    int64_t end_ns = seconds(sim->trouble_s + sim->quiet_s);
    begin(&w);
    while (w.count && w.heap[0].at_ns < end_ns) {
        struct happening event = take_first(&w);
        run(&w, &event);
    }
    end(&w);
    return w.figures;
}
