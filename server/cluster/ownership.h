// Which server serves which station. This server's view of the keys of the lease, and what it
// writes into them: no socket, no clock, no thread.
//
// There are two kinds of keys, and each write names the revision that it replaces, so of two
// writers one learns that it came too late.
//
// A server's key says that the server lives: it writes its key anew every LEASE_RENEW_NS. It serves
// until LEASE_VALID_NS after it sent the last write that was answered. Others count it as dead once
// they have seen no write of it for LEASE_DEAD_NS, and also where they have seen none at all for so
// long since a station's key named it. Who wants a station of a dead server first
// deposes that server: it replaces the key. From then on the dead one cannot renew: should it come
// back, it begins a new life, and owns only what it takes again.
//
// A station's key names the server that serves the station, with its life. It changes only where
// the station is taken or released. Its revision is the fencing token: it rises from owner to
// owner.
#pragma once

#include "base/clock.h"

#include <stdbool.h>
#include <stdint.h>

#define LEASE_RENEW_NS (3 * NS_PER_S)
#define LEASE_VALID_NS (10 * NS_PER_S)
#define LEASE_DEAD_NS (12 * NS_PER_S)
#define LEASE_ANSWER_NS (2 * NS_PER_S) // a write without an answer for so long may be tried again

#define SERVER_NAME_SIZE 64
#define SERVER_ADDRESS_SIZE 128
#define SERVER_SECRET_SIZE 65

struct server_value {
    uint64_t life;                      // random; 0: deposed
    uint64_t write;                     // number of this write in that life
    char stations[SERVER_ADDRESS_SIZE]; // where stations reach it, HOST:PORT
    char pages[SERVER_ADDRESS_SIZE];    // where browsers and other servers do
    char secret[SERVER_SECRET_SIZE];    // by which another server proves itself to it; or empty
};

struct station_value {
    char server[SERVER_NAME_SIZE]; // empty: nobody
    uint64_t life;                 // of the server
    uint64_t write;                // number of the write in that life
};

struct key_write {
    uint64_t id;        // from 1: names the answer
    const char *server; // of a server's key; NULL: of a station's
    int station;        // index
    uint64_t replaces;  // revision; 0: there is no such key yet
    struct server_value of_server;
    struct station_value of_station;
};

enum write_answer {
    WRITE_DONE,
    WRITE_LATE,   // another revision is there
    WRITE_UNKNOWN // no answer: it may be there or not
};

enum station_owner {
    OWNER_NONE,      // nobody, as far as is known
    OWNER_ELSEWHERE, // another server, which lives
    OWNER_TAKING,    // this server is about to own it
    OWNER_SELF,
    OWNER_DOUBTFUL // it was this server's in the life before, which ended without its will
};

struct ownership_handler {
    void *user;
    void (*write)(void *user, const struct key_write *write);
    // From OWNER_DOUBTFUL to OWNER_SELF or away: whether the session goes on. Also any other
    // change.
    void (*changed)(void *user, int station, enum station_owner owner);
    uint64_t (*new_life)(void *user); // random, not 0
};

struct ownership;

// Another server, as its key tells of it.
struct cluster_peer {
    char name[SERVER_NAME_SIZE];
    char pages[SERVER_ADDRESS_SIZE], secret[SERVER_SECRET_SIZE];
    bool lives;
    int stations; // that it serves, where somebody counted them
};

// Handlers are called from within the calls below. `value`: of this server, but for life and write.
// life_before: of the process that had this server's folders last, which has surely ended; or 0.
struct ownership *ownership_create(const char *server, const struct server_value *value,
                                   uint64_t life_before, int station_count,
                                   const struct ownership_handler *handler);
void ownership_destroy(struct ownership **ownership); // NULL inside is fine

// ---- what was seen and answered. Revisions may come late and twice. `name`: of the key.
// station: an index below station_count.
void ownership_saw_server(struct ownership *o, const char *name, const struct server_value *value,
                          uint64_t revision, int64_t now_ns);
void ownership_saw_station(struct ownership *o, int station, const struct station_value *value,
                           uint64_t revision, int64_t now_ns);
void ownership_answered(struct ownership *o, uint64_t id, enum write_answer answer,
                        uint64_t revision, int64_t now_ns);
// Some times a second.
void ownership_tick(struct ownership *o, int64_t now_ns);

// ---- what this server wants

// A station asks for its session here: takes it where that may be. To be called again while the
// station waits. OWNER_NONE: this server cannot take anything now.
enum station_owner ownership_want(struct ownership *o, int station, int64_t now_ns);
// The session has ended, or goes on elsewhere. It is tried until it is done or seen to be needless.
void ownership_release(struct ownership *o, int station, int64_t now_ns);
// A server that ends: its own key is deposed by itself, so that nobody waits for its death.
void ownership_leave(struct ownership *o, int64_t now_ns);

// ---- what is so

enum station_owner ownership_of(const struct ownership *o, int station);
const char *ownership_named(const struct ownership *o, int station); // by the key; empty: nobody
bool ownership_is_named(const struct ownership *o, int station);     // it names this server's life
// Where stations reach the server that the key names; empty: not known.
const char *ownership_address(const struct ownership *o, int station);
// The same of another server that lives; which: any number, which spreads what is asked for. NULL:
// there is none.
const char *ownership_other(const struct ownership *o, int which, int64_t now_ns);
// The other servers that were ever seen, by numbers from 0. While this one gets no answers to its
// own renewals, it counts no other as dead. False: there are no more.
bool ownership_peer(const struct ownership *o, int number, int64_t now_ns,
                    struct cluster_peer *out_peer);
// The number of the one that serves the station and lives, or one of these.
#define SERVED_NOWHERE -1
#define SERVED_HERE -2
int ownership_served_by(const struct ownership *o, int station, int64_t now_ns);
uint64_t ownership_token(const struct ownership *o, int station); // of OWNER_SELF, else 0
// Whether this server may serve: its life is confirmed, and recently.
bool ownership_is_valid(const struct ownership *o, int64_t now_ns);
// Until when that is so for all its stations; 0: for some it is not.
int64_t ownership_serves_until_ns(const struct ownership *o);
bool ownership_has_left(const struct ownership *o); // what ownership_leave wrote was answered
// Another server of this name lives: this one stays out.
bool ownership_has_namesake(const struct ownership *o, int64_t now_ns);
