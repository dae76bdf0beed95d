// Another server, for one page: the connection to it, and what it told that waits for the page.
// For the web server's thread.
#pragma once

#include "live/elsewhere.h"
#include "live/passing.h"
#include "live/viewer.h"

#define REMOTE_WAITING_MAX 2 // batches: a server sends no more before they were drawn

struct remote {
    struct live_server *live;
    struct viewer *viewer;
    char name[SERVER_NAME_SIZE], pages[SERVER_ADDRESS_SIZE]; // no name: the place is free
    int index;           // in live->servers; -1: it does not live
    struct relay *relay; // NULL: there is none now
    bool needed;         // by what the page watches
    bool is_in, complained;
    uint32_t told; // the watch that it was told of; 0: none
    int64_t needed_ns, retry_ns;
    int64_t heard_ns; // when it last told something, or was told that the page took it
    int64_t lost_ns;  // since when it is away; 0: it is not
    int failures;
    struct passing_numbers numbers;
    struct parcel *waiting[REMOTE_WAITING_MAX];
    int waiting_count;
    size_t at;       // of the first one's bytes
    uint64_t passed; // batches
};

// Of the server of this index in live->servers; NULL: the page hears of too many.
struct remote *remote_of(struct live_server *live, struct viewer *viewer, int index);
void remote_free(struct remote *remote);
// Its number in answers.h.
int remote_number(const struct remote *remote);

// Finds the server again, which may have come back with another address.
void remote_find(struct remote *remote);
// Sees to the connection: there is one while it is needed or has a command to answer. An unneeded
// remote frees its place.
void remote_attend(struct remote *remote, int64_t now_ns);

// A command. Where there is no relay behind it, none could be opened, and remote_refuse answers it.
void remote_ask(struct remote *remote, const arthron_Command *command);
// No answer comes to what it was asked.
void remote_refuse(struct remote *remote);
void remote_say(struct remote *remote, const arthron_Page *message);

// Puts of one of its batches as much as fits.
void remote_put(struct remote *remote, struct live_batch *batch);
