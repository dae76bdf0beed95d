// The pages that follow the meshes of one seat, beside its station: the theatre's own.
#pragma once

#include "hub/tray.h"
#include "net/mesh_feed.h"

#define ONLOOKERS_MAX 16 // of one seat

// What a page says about the meshes: what it has, as a station does (PROTOCOL.md).
struct look {
    int seat;
    uint64_t session;  // struct live's serial, as the page follows it: not of that one, not heard
    struct tray *tray; // a reference; whoever takes the look releases it
    bool asks;         // else it acknowledges
    union {
        arthron_MeshAsk ask;
        arthron_MeshState ack;
    };
};

struct onlookers {
    struct onlooker {
        struct tray *tray; // NULL: a free place
        struct mesh_cursor cursors[TISSUES_MAX];
    } all[ONLOOKERS_MAX];
};

// A session has ended: nobody has asked for the next one's meshes.
void onlookers_forget(struct onlookers *onlookers);
void onlookers_fini(struct onlookers *onlookers);

// groups: the names of the session's tissues. A page that finds no place is not heard.
void onlookers_hear(struct onlookers *onlookers, const struct look *look,
                    const char *const groups[TISSUES_MAX], int count);

// To each whatever it lacks and can take now. feeds: or NULL inside.
void onlookers_serve(struct onlookers *onlookers, uint64_t session,
                     struct mesh_feed *const feeds[TISSUES_MAX]);
