// What a page sees of stations and records that other servers have: this one asks them for it, as
// the page's account, and passes on what they tell (relay/relay.h). For the web server's thread.
#pragma once

#include "live/answers.h"
#include "sessions/sessions.h"

#define SERVERS_MAX 64

struct live_batch;

// Who serves what, as known some tenths of a second ago.
struct live_servers {
    int64_t read_ns;
    int64_t logged_ns; // when the log was last told that one does not answer; 0: never
    int count;
    struct cluster_peer others[SERVERS_MAX];
    int *served_by;                          // of each station, as cluster_whose
};

struct remote; // another server, for one page

// Of one page.
struct elsewhere {
    struct remote *remotes; // REMOTES_MAX; NULL: this server is alone
    char token[128];        // of the page's account
    int64_t due_ns;
    uint32_t watch; // counts the watches of the page
    int followed;   // RECORDED, STATION: the index of the remote that is followed; -1: this server
    uint64_t tried; // RECORDED: by index of the server, which were asked for the record
    bool first;     // the next batch begins with what the others told
    int turn;       // the remote that is next to tell something
};

void elsewhere_init(struct live_server *live, struct viewer *viewer, const char *token);
void elsewhere_fini(struct viewer *viewer);

// The page watches something new.
void elsewhere_watch(struct live_server *live, struct viewer *viewer);
// Looks who serves what, and asks them for what the page watches. To be called for each batch; it
// says when at the latest it is to be called again.
int64_t elsewhere_turn(struct live_server *live, struct viewer *viewer, int64_t now_ns);
// What they told, as far as it fits.
void elsewhere_put(struct viewer *viewer, struct live_batch *batch);

// Whether the page's wall has the station from this server.
bool elsewhere_tells_here(const struct live_server *live, const struct viewer *viewer, int station);
// Whether the page watches its station or record at another server.
bool elsewhere_is_followed(const struct viewer *viewer);
void elsewhere_say(struct viewer *viewer, const arthron_Page *message); // to that one

// Whether another server alone answers the command.
bool elsewhere_answers(const struct live_server *live, const struct viewer *viewer,
                       const arthron_Command *command);
// Asks the others that are to answer it, and expects their answers; and one from here, where
// `here`. NULL: one that is refused here. False: the page hears of too many servers.
bool elsewhere_ask(struct live_server *live, struct viewer *viewer, bool here,
                   const arthron_Command *command);
