#include "cluster/ownership.h"

#include "base/check.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define WANTED_NS (5 * NS_PER_S) // a station that asks no more is not taken

// Of this server's own key it is the members of struct ownership that tell.
struct known_server {
    char name[SERVER_NAME_SIZE];
    uint64_t revision;
    int64_t seen_ns;
    struct server_value value;
};

// One write is under way at most, of each key.
struct pending {
    uint64_t id; // 0: none
    int64_t sent_ns;
};

struct own_station {
    enum station_owner owner;
    bool releases;
    int64_t wanted_ns; // when it was last asked for; 0: it is not
    uint64_t revision, token;
    struct pending pending;
    struct station_value value, written; // written: by what is pending
};

struct ownership {
    struct ownership_handler handler;
    char name[SERVER_NAME_SIZE];
    struct server_value value; // of the own key
    uint64_t revision;         // of the own key, as known
    struct pending pending;
    bool is_in, leaves, has_left;
    int64_t renewed_ns; // the send time of the last answered write
    uint64_t life_before;
    int64_t namesake_ns; // when a living namesake was last seen; 0: never
    uint64_t ids, writes;
    struct known_server *servers;
    struct pending *deposals; // by server
    int server_count;
    int *slots;          // a hash table of the servers' names: index + 1, or 0
    uint32_t slot_count; // a power of two, at least twice as many as servers
    int station_count;
    struct own_station *stations;
};

struct ownership *ownership_create(const char *server, const struct server_value *value,
                                   uint64_t life_before, int station_count,
                                   const struct ownership_handler *handler) {
    struct ownership *o = alloc(1, sizeof *o);
    o->handler = *handler;
    o->value = *value;
    o->value.life = handler->new_life(handler->user);
    o->life_before = life_before;
    o->station_count = station_count;
    o->stations = alloc((size_t)station_count, sizeof *o->stations);
    snprintf(o->name, sizeof o->name, "%s", server);
    return o;
}

void ownership_destroy(struct ownership **ownership) {
    struct ownership *o = *ownership;
    if (!o)
        return;
    free(o->servers);
    free(o->deposals);
    free(o->slots);
    free(o->stations);
    free(o);
    *ownership = NULL;
}

// ---- servers by name ----------------------------------------------------------------------------

// The slot of the name, or the free one where it belongs.
static int *slot_of(const struct ownership *o, const char *name) {
    uint32_t hash = 2166136261; // FNV-1a
    for (const char *c = name; *c; c++)
        hash = (hash ^ (uint8_t)*c) * 16777619;
    uint32_t at = hash;
    while (o->slots[at % o->slot_count] &&
           strcmp(o->servers[o->slots[at % o->slot_count] - 1].name, name) != 0)
        at++;
    return &o->slots[at % o->slot_count];
}

static struct known_server *find_server(const struct ownership *o, const char *name) {
    int slot = o->slot_count ? *slot_of(o, name) : 0;
    return slot ? &o->servers[slot - 1] : NULL;
}

static void make_slots(struct ownership *o) {
    free(o->slots);
    o->slot_count = o->slot_count ? 2 * o->slot_count : 16;
    o->slots = alloc(o->slot_count, sizeof *o->slots);
    for (int i = 0; i < o->server_count; i++)
        *slot_of(o, o->servers[i].name) = i + 1;
}

static struct known_server *add_server(struct ownership *o, const char *name) {
    int index = o->server_count++;
    o->servers = alloc_resize(o->servers, (size_t)o->server_count, sizeof *o->servers);
    o->deposals = alloc_resize(o->deposals, (size_t)o->server_count, sizeof *o->deposals);
    o->servers[index] = (struct known_server){0};
    o->deposals[index] = (struct pending){0};
    snprintf(o->servers[index].name, sizeof o->servers[index].name, "%s", name);
    if (2 * (uint32_t)o->server_count > o->slot_count)
        make_slots(o);
    else
        *slot_of(o, name) = index + 1;
    return &o->servers[index];
}

// ---- writing ------------------------------------------------------------------------------------

static bool is_under_way(const struct pending *pending, int64_t now_ns) {
    return pending->id && now_ns - pending->sent_ns < LEASE_ANSWER_NS;
}

static void send_write(struct ownership *o, struct pending *pending, struct key_write *write,
                       int64_t now_ns) {
    *pending = (struct pending){++o->ids, now_ns};
    write->id = pending->id;
    o->handler.write(o->handler.user, write);
}

static void write_own_key(struct ownership *o, int64_t now_ns) {
    o->value.write = ++o->writes;
    struct key_write write = {.server = o->name, .replaces = o->revision, .of_server = o->value};
    if (o->leaves)
        write.of_server.life = 0;
    send_write(o, &o->pending, &write, now_ns);
}

static void depose(struct ownership *o, int index, int64_t now_ns) {
    const struct known_server *server = &o->servers[index];
    struct key_write write = {
        .server = server->name, .replaces = server->revision, .of_server = server->value};
    write.of_server.life = 0;
    send_write(o, &o->deposals[index], &write, now_ns);
}

static void write_station(struct ownership *o, int station, const char *owner, int64_t now_ns) {
    struct own_station *s = &o->stations[station];
    struct key_write write = {.station = station, .replaces = s->revision};
    write.of_station = (struct station_value){.life = o->value.life, .write = ++o->writes};
    snprintf(write.of_station.server, sizeof write.of_station.server, "%s", owner);
    s->written = write.of_station;
    send_write(o, &s->pending, &write, now_ns);
}

// ---- stations -----------------------------------------------------------------------------------

static void set_owner(struct ownership *o, int station, enum station_owner owner) {
    struct own_station *s = &o->stations[station];
    if (s->owner == owner)
        return;
    s->owner = owner;
    if (owner != OWNER_SELF)
        s->token = 0;
    o->handler.changed(o->handler.user, station, owner);
}

static bool names_self(const struct ownership *o, const struct own_station *s) {
    return !strcmp(s->value.server, o->name) && s->value.life == o->value.life;
}

static bool lives(const struct known_server *server, int64_t now_ns) {
    return server->value.life && now_ns - server->seen_ns < LEASE_DEAD_NS;
}

// Who the key names, where it is not this server in this life.
static enum station_owner named_owner(const struct ownership *o, const struct own_station *s,
                                      int64_t now_ns) {
    const struct known_server *server = find_server(o, s->value.server);
    bool serves = server && server->value.life == s->value.life && lives(server, now_ns);
    return serves ? OWNER_ELSEWHERE : OWNER_NONE;
}

// Where the server's key is older than the station's, what the server has written since is not
// seen yet: it may have begun another life, in which it took the station.
static bool is_free(const struct ownership *o, const struct own_station *s) {
    if (!s->value.server[0] || !strcmp(s->value.server, o->name))
        return true;
    const struct known_server *server = find_server(o, s->value.server);
    return server->value.life != s->value.life && server->revision > s->revision;
}

static void take_station(struct ownership *o, int station, int64_t now_ns) {
    struct own_station *s = &o->stations[station];
    if (!ownership_is_valid(o, now_ns) || o->leaves || is_under_way(&s->pending, now_ns))
        return;
    if (is_free(o, s)) {
        write_station(o, station, o->name, now_ns);
        return;
    }
    const struct known_server *server = find_server(o, s->value.server);
    int index = (int)(server - o->servers);
    if (!lives(server, now_ns) && !is_under_way(&o->deposals[index], now_ns))
        depose(o, index, now_ns);
}

static bool is_to_be_taken(const struct own_station *s) {
    return s->owner == OWNER_TAKING || s->owner == OWNER_DOUBTFUL;
}

enum station_owner ownership_want(struct ownership *o, int station, int64_t now_ns) {
    struct own_station *s = &o->stations[station];
    s->wanted_ns = now_ns;
    s->releases = false;
    if (s->owner == OWNER_SELF || s->owner == OWNER_DOUBTFUL)
        return s->owner;
    enum station_owner owner = named_owner(o, s, now_ns);
    if (owner == OWNER_NONE && ownership_is_valid(o, now_ns))
        owner = OWNER_TAKING;
    set_owner(o, station, owner);
    if (owner == OWNER_TAKING)
        take_station(o, station, now_ns);
    return s->owner;
}

void ownership_release(struct ownership *o, int station, int64_t now_ns) {
    struct own_station *s = &o->stations[station];
    s->wanted_ns = 0;
    s->releases = s->owner == OWNER_SELF;
    if (s->releases)
        write_station(o, station, "", now_ns);
    set_owner(o, station, OWNER_NONE);
}

static void own(struct ownership *o, int station, uint64_t revision) {
    struct own_station *s = &o->stations[station];
    s->token = revision;
    set_owner(o, station, OWNER_SELF);
}

// A server whose key was not seen yet may live all the same.
static void suppose_server(struct ownership *o, const struct station_value *value, int64_t now_ns) {
    struct known_server *server = add_server(o, value->server);
    server->value.life = value->life;
    server->seen_ns = now_ns;
}

void ownership_saw_station(struct ownership *o, int station, const struct station_value *value,
                           uint64_t revision, int64_t now_ns) {
    struct own_station *s = &o->stations[station];
    if (revision <= s->revision)
        return;
    s->revision = revision;
    s->value = *value;
    if (value->server[0] && strcmp(value->server, o->name) != 0 && !find_server(o, value->server))
        suppose_server(o, value, now_ns);
    s->releases = names_self(o, s) && s->owner == OWNER_NONE; // of a late take, too
    if (names_self(o, s) && !s->releases)
        own(o, station, revision);
    else if (s->owner != OWNER_NONE)
        set_owner(o, station, named_owner(o, s, now_ns));
}

// ---- servers ------------------------------------------------------------------------------------

bool ownership_is_valid(const struct ownership *o, int64_t now_ns) {
    return o->is_in && now_ns - o->renewed_ns < LEASE_VALID_NS;
}

int64_t ownership_serves_until_ns(const struct ownership *o) {
    for (int i = 0; i < o->station_count; i++)
        if (o->stations[i].owner == OWNER_DOUBTFUL)
            return 0;
    return o->is_in ? o->renewed_ns + LEASE_VALID_NS : 0;
}

bool ownership_has_left(const struct ownership *o) {
    return o->has_left;
}

bool ownership_has_namesake(const struct ownership *o, int64_t now_ns) {
    return o->namesake_ns && now_ns - o->namesake_ns < LEASE_DEAD_NS;
}

// The stations stay away from others until they were seen to be taken, or are taken again.
static void begin_anew(struct ownership *o) {
    o->is_in = false;
    o->value.life = o->handler.new_life(o->handler.user);
    for (int i = 0; i < o->station_count; i++)
        if (o->stations[i].owner == OWNER_SELF)
            set_owner(o, i, OWNER_DOUBTFUL);
}

static void saw_own_key(struct ownership *o, const struct server_value *value, uint64_t revision,
                        int64_t now_ns) {
    if (revision <= o->revision)
        return;
    o->revision = revision;
    if (value->life == o->value.life)
        return;
    if (value->life && value->life != o->life_before)
        o->namesake_ns = now_ns;
    if (o->is_in && !o->leaves)
        begin_anew(o);
}

void ownership_saw_server(struct ownership *o, const char *name, const struct server_value *value,
                          uint64_t revision, int64_t now_ns) {
    if (!strcmp(name, o->name)) {
        saw_own_key(o, value, revision, now_ns);
        return;
    }
    struct known_server *server = find_server(o, name);
    if (!server)
        server = add_server(o, name);
    if (revision <= server->revision)
        return;
    if (server->value.life != value->life || !server->revision)
        server->value = *value;
    server->value.write = value->write; // in one life nothing else changes
    server->revision = revision;
    server->seen_ns = now_ns;
}

static void own_key_answered(struct ownership *o, enum write_answer answer, uint64_t revision) {
    int64_t sent_ns = o->pending.sent_ns;
    o->pending.id = 0;
    if (answer != WRITE_DONE || revision < o->revision)
        return;
    o->revision = revision;
    o->is_in = !o->leaves;
    o->has_left = o->leaves;
    o->renewed_ns = sent_ns;
}

static void deposal_answered(struct ownership *o, int index, enum write_answer answer,
                             uint64_t revision) {
    struct known_server *server = &o->servers[index];
    o->deposals[index].id = 0;
    if (answer != WRITE_DONE || revision <= server->revision)
        return;
    server->revision = revision;
    server->value.life = 0;
}

void ownership_answered(struct ownership *o, uint64_t id, enum write_answer answer,
                        uint64_t revision, int64_t now_ns) {
    if (o->pending.id == id) {
        own_key_answered(o, answer, revision);
        return;
    }
    for (int i = 0; i < o->server_count; i++)
        if (o->deposals[i].id == id) {
            deposal_answered(o, i, answer, revision);
            return;
        }
    for (int i = 0; i < o->station_count; i++)
        if (o->stations[i].pending.id == id) {
            o->stations[i].pending.id = 0;
            if (answer == WRITE_DONE) // else what is there will be seen
                ownership_saw_station(o, i, &o->stations[i].written, revision, now_ns);
            return;
        }
}

void ownership_leave(struct ownership *o, int64_t now_ns) {
    o->leaves = true;
    o->is_in = false;
    write_own_key(o, now_ns);
}

// ---- time ---------------------------------------------------------------------------------------

static void renew(struct ownership *o, int64_t now_ns) {
    bool due = !o->is_in || now_ns - o->renewed_ns >= LEASE_RENEW_NS;
    if (due && !o->leaves && !is_under_way(&o->pending, now_ns) &&
        !ownership_has_namesake(o, now_ns))
        write_own_key(o, now_ns);
}

void ownership_tick(struct ownership *o, int64_t now_ns) {
    renew(o, now_ns);
    for (int i = 0; i < o->station_count; i++) {
        struct own_station *s = &o->stations[i];
        if (s->owner == OWNER_TAKING && now_ns - s->wanted_ns >= WANTED_NS)
            set_owner(o, i, OWNER_NONE);
        if (is_to_be_taken(s))
            take_station(o, i, now_ns);
        else if (s->releases && !is_under_way(&s->pending, now_ns))
            write_station(o, i, "", now_ns);
    }
}

const char *ownership_named(const struct ownership *o, int station) {
    return o->stations[station].value.server;
}

bool ownership_is_named(const struct ownership *o, int station) {
    return names_self(o, &o->stations[station]);
}

const char *ownership_address(const struct ownership *o, int station) {
    const struct known_server *server = find_server(o, o->stations[station].value.server);
    return server ? server->value.stations : "";
}

const char *ownership_other(const struct ownership *o, int which, int64_t now_ns) {
    for (int i = 0; i < o->server_count; i++) {
        const struct known_server *server = &o->servers[(which + i) % o->server_count];
        if (lives(server, now_ns) && server->revision)
            return server->value.stations;
    }
    return NULL;
}

// While this server gets no answers to its own renewals, it counts no other as dead.
static bool counts_as_living(const struct ownership *o, const struct known_server *server,
                             int64_t now_ns) {
    bool hears = now_ns - o->renewed_ns < LEASE_RENEW_NS + LEASE_ANSWER_NS;
    return server->value.life && (lives(server, now_ns) || !hears);
}

bool ownership_peer(const struct ownership *o, int number, int64_t now_ns,
                    struct cluster_peer *out) {
    if (number >= o->server_count)
        return false;
    const struct known_server *server = &o->servers[number];
    *out = (struct cluster_peer){.lives = counts_as_living(o, server, now_ns)};
    memcpy(out->name, server->name, sizeof out->name);
    memcpy(out->pages, server->value.pages, sizeof out->pages);
    memcpy(out->secret, server->value.secret, sizeof out->secret);
    return true;
}

int ownership_served_by(const struct ownership *o, int station, int64_t now_ns) {
    const struct own_station *s = &o->stations[station];
    const struct known_server *server = find_server(o, s->value.server);
    if (s->owner == OWNER_SELF || s->owner == OWNER_DOUBTFUL)
        return SERVED_HERE;
    bool serves =
        server && server->value.life == s->value.life && counts_as_living(o, server, now_ns);
    return serves ? (int)(server - o->servers) : SERVED_NOWHERE;
}

enum station_owner ownership_of(const struct ownership *o, int station) {
    return o->stations[station].owner;
}

uint64_t ownership_token(const struct ownership *o, int station) {
    return o->stations[station].token;
}
