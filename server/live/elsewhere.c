#include "live/elsewhere.h"

#include "base/check.h"
#include "base/clock.h"
#include "live/playback.h"
#include "live/remote.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TURN_NS (100 * NS_PER_MS)
#define LOOK_NS (200 * NS_PER_MS)
#define GRACE_NS (20 * NS_PER_S) // so long another server may take to go on with a session

// ---- who serves what ----------------------------------------------------------------------------

static void look(struct live_server *live, int64_t now_ns) {
    struct live_servers *servers = &live->servers;
    if (servers->read_ns && now_ns - servers->read_ns < LOOK_NS)
        return;
    servers->count =
        sessions_whose(live->sessions, servers->others, SERVERS_MAX, servers->served_by);
    servers->read_ns = now_ns;
}

static bool has_pages(const struct live_servers *servers, int index) {
    return index >= 0 && servers->others[index].lives && servers->others[index].pages[0];
}

// ---- what the page watches ----------------------------------------------------------------------

static struct remote *need(struct live_server *live, struct viewer *viewer, int index) {
    struct remote *remote = remote_of(live, viewer, index);
    if (remote)
        remote->needed = true;
    return remote;
}

static void need_wall(struct live_server *live, struct viewer *viewer) {
    const struct live_servers *servers = &live->servers;
    bool serves[SERVERS_MAX] = {false};
    for (int i = 0; i < sessions_config(live->sessions)->station_count; i++)
        if (has_pages(servers, servers->served_by[i]))
            serves[servers->served_by[i]] = true;
    for (int i = 0; i < servers->count; i++)
        if (serves[i])
            need(live, viewer, i);
}

static void follow(struct viewer *viewer, struct remote *remote) {
    struct elsewhere *e = &viewer->elsewhere;
    int now = remote ? (int)(remote - e->remotes) : -1;
    if (remote)
        remote->needed = true;
    if (now == e->followed)
        return;
    e->followed = now;
    follow_anew(viewer);
}

// A session that nobody serves stays where it was: the next server may be about to go on with it.
static void need_station(struct live_server *live, struct viewer *viewer, int64_t now_ns) {
    struct elsewhere *e = &viewer->elsewhere;
    int by = live->servers.served_by[viewer->station];
    struct remote *before = e->followed < 0 ? NULL : &e->remotes[e->followed];
    if (has_pages(&live->servers, by))
        follow(viewer, need(live, viewer, by));
    else if (by == SERVED_NOWHERE && before &&
             (!before->lost_ns || now_ns - before->lost_ns < GRACE_NS))
        follow(viewer, before);
    else
        follow(viewer, NULL);
}

// Another server that has not been asked for the record yet; `name` before all others.
static int untried(const struct live_servers *servers, uint64_t tried, const char *name) {
    int found = -1;
    for (int i = servers->count - 1; i >= 0; i--) {
        if (!has_pages(servers, i) || tried & UINT64_C(1) << i)
            continue;
        found = i;
        if (!strcmp(servers->others[i].name, name))
            return i;
    }
    return found;
}

static struct remote *try_next(struct live_server *live, struct viewer *viewer, const char *name) {
    struct elsewhere *e = &viewer->elsewhere;
    struct remote *remote = NULL;
    for (int i; !remote && (i = untried(&live->servers, e->tried, name)) >= 0;) {
        e->tried |= UINT64_C(1) << i;
        remote = need(live, viewer, i);
    }
    if (remote)
        remote->lost_ns = remote->retry_ns = 0;
    return remote;
}

// It is played here, or at the first server that has it.
static void need_record(struct live_server *live, struct viewer *viewer) {
    struct elsewhere *e = &viewer->elsewhere;
    struct remote *remote = e->followed < 0 ? NULL : &e->remotes[e->followed];
    const char *name;
    if (!playback_is_missing(viewer->playback, &name))
        return;
    if (!remote || remote->lost_ns)
        remote = try_next(live, viewer, name);
    e->followed = remote ? (int)(remote - e->remotes) : -1;
    if (remote) {
        remote->needed = true;
        return;
    }
    viewer->watch.what = arthron_Watch_What_NOTHING;
    viewer_trouble(viewer, arthron_Trouble_Kind_FAILED, arthron_Why_Code_NOT_HERE, NULL,
                   "no server that answers has the trace of session %s", viewer->watch.session);
}

static void need_others(struct live_server *live, struct viewer *viewer, int64_t now_ns) {
    if (viewer->watch.own)
        return;
    if (viewer->watch.what == arthron_Watch_What_WALL)
        need_wall(live, viewer);
    else if (viewer->watch.what == arthron_Watch_What_STATION)
        need_station(live, viewer, now_ns);
    else if (viewer->watch.what == arthron_Watch_What_RECORDED)
        need_record(live, viewer);
}

int64_t elsewhere_turn(struct live_server *live, struct viewer *viewer, int64_t now_ns) {
    struct elsewhere *e = &viewer->elsewhere;
    if (!e->remotes)
        return INT64_MAX;
    if (now_ns < e->due_ns)
        return e->due_ns;
    e->due_ns = now_ns + TURN_NS;
    look(live, now_ns);
    for (int i = 0; i < REMOTES_MAX; i++) {
        e->remotes[i].needed = false;
        if (e->remotes[i].name[0])
            remote_find(&e->remotes[i]);
    }
    need_others(live, viewer, now_ns);
    for (int i = 0; i < REMOTES_MAX; i++)
        if (e->remotes[i].name[0])
            remote_attend(&e->remotes[i], now_ns);
    return e->due_ns;
}

void elsewhere_watch(struct live_server *live, struct viewer *viewer) {
    struct elsewhere *e = &viewer->elsewhere;
    e->watch++;
    e->followed = -1;
    e->tried = 0;
    e->first = false;
    if (e->remotes)
        elsewhere_turn(live, viewer, (e->due_ns = 0, clock_now_ns()));
}

bool elsewhere_is_followed(const struct viewer *viewer) {
    return viewer->elsewhere.followed >= 0;
}

bool elsewhere_tells_here(const struct live_server *live, const struct viewer *viewer,
                          int station) {
    const struct live_servers *servers = &live->servers;
    int by = servers->served_by[station];
    if (viewer->watch.own)
        return by == SERVED_HERE;
    if (!has_pages(servers, by))
        return true;
    for (int i = 0; i < REMOTES_MAX; i++)
        if (viewer->elsewhere.remotes[i].name[0] && viewer->elsewhere.remotes[i].index == by)
            return viewer->elsewhere.remotes[i].complained && !viewer->sent[station].elsewhere;
    return false;
}

// ---- to the page --------------------------------------------------------------------------------

void elsewhere_put(struct viewer *viewer, struct live_batch *batch) {
    struct elsewhere *e = &viewer->elsewhere;
    e->first = batch->full;
    for (int i = 0; e->remotes && i < REMOTES_MAX && !batch->full; i++) {
        struct remote *remote = &e->remotes[e->turn];
        remote_put(remote, batch);
        e->turn = (e->turn + 1) % REMOTES_MAX;
    }
}

// ---- from the page ------------------------------------------------------------------------------

void elsewhere_say(struct viewer *viewer, const arthron_Page *message) {
    struct elsewhere *e = &viewer->elsewhere;
    if (e->followed >= 0 && e->remotes[e->followed].is_in)
        remote_say(&e->remotes[e->followed], message);
}

// The index of the server that has the command's station; -1: this one, or none.
static int server_of(const struct live_server *live, const arthron_Command *command) {
    int station = sessions_find_station(sessions_config(live->sessions), command->station);
    int by = station < 0 ? SERVED_HERE : live->servers.served_by[station];
    return has_pages(&live->servers, by) ? by : -1;
}

// A server never asks for one that asks itself.
static bool may_ask(const struct viewer *viewer) {
    return viewer->elsewhere.remotes && !viewer->watch.own;
}

static bool lists_all(const struct viewer *viewer, const arthron_Command *command) {
    return may_ask(viewer) && command->kind == arthron_Command_Kind_LIST;
}

bool elsewhere_answers(const struct live_server *live, const struct viewer *viewer,
                       const arthron_Command *command) {
    return may_ask(viewer) && !lists_all(viewer, command) && server_of(live, command) >= 0;
}

static uint32_t ask_elsewhere(struct live_server *live, struct viewer *viewer, int index,
                              const arthron_Command *command) {
    struct remote *remote = remote_of(live, viewer, index);
    if (!remote)
        return 0;
    remote_ask(remote, command);
    viewer->elsewhere.due_ns = 0;
    return 1u << remote_number(remote);
}

static uint32_t ask_all(struct live_server *live, struct viewer *viewer,
                        const arthron_Command *command) {
    const struct live_servers *servers = &live->servers;
    uint32_t asked = 0;
    uint64_t done = 0;
    for (int i = 0; i < sessions_config(live->sessions)->station_count; i++) {
        int by = servers->served_by[i];
        if (!has_pages(servers, by) || done & UINT64_C(1) << by)
            continue;
        done |= UINT64_C(1) << by;
        asked |= ask_elsewhere(live, viewer, by, command);
    }
    return asked;
}

bool elsewhere_ask(struct live_server *live, struct viewer *viewer, bool here,
                   const arthron_Command *command) {
    struct elsewhere *e = &viewer->elsewhere;
    uint32_t from = here ? 1u << ANSWER_HERE : 0;
    if (!here)
        from |= ask_elsewhere(live, viewer, server_of(live, command), command);
    else if (command && lists_all(viewer, command))
        from |= ask_all(live, viewer, command);
    if (!from)
        return false;
    answers_expect(&viewer->answers_due, from);
    for (int i = 0; i < REMOTES_MAX; i++)
        if (from & 1u << (1 + i) && !e->remotes[i].relay)
            remote_refuse(&e->remotes[i]);
    return true;
}

// ---- coming and going ---------------------------------------------------------------------------

void elsewhere_init(struct live_server *live, struct viewer *viewer, const char *token) {
    struct elsewhere *e = &viewer->elsewhere;
    *e = (struct elsewhere){.followed = -1};
    if (!live->config.relays)
        return;
    e->remotes = alloc(REMOTES_MAX, sizeof *e->remotes);
    for (int i = 0; i < REMOTES_MAX; i++)
        e->remotes[i] = (struct remote){.live = live, .viewer = viewer};
    snprintf(e->token, sizeof e->token, "%s", token);
}

void elsewhere_fini(struct viewer *viewer) {
    struct elsewhere *e = &viewer->elsewhere;
    for (int i = 0; e->remotes && i < REMOTES_MAX; i++)
        remote_free(&e->remotes[i]);
    free(e->remotes);
    e->remotes = NULL;
}
