// Serves the newest poses and the attempt to the programs of this PC that show them: a WebSocket on
// 127.0.0.1 (PROTOCOL.md, "View"). A thread of its own serves the viewers; each gets the newest
// message only, and one that reads slowly skips what it missed.
#pragma once

#include "wire/wire.h"

#define VIEW_VIEWERS_MAX 8
#define VIEW_ORIGINS_MAX 8

struct view_config {
    int port; // 0: any free one
    int origin_count;
    char origins[VIEW_ORIGINS_MAX][128]; // of pages that may look, as "http://localhost:8080"
    char token_path[256];                // made where it is not there (view/token.h)
};

struct view;

// RESULT_IO: the port is taken; else what token_get refuses.
enum result view_create(const struct view_config *config, struct view **out_view,
                        struct error *err);
void view_destroy(struct view **view); // NULL inside is fine; *view becomes NULL

int view_port(const struct view *view);

bool view_is_watched(const struct view *view); // by anybody: else there is nothing to show

// From one thread only, and never waits. Numbers the message.
void view_show(struct view *view, arthron_View *message);

enum view_port_use {
    VIEW_PORT_FREE,
    VIEW_PORT_VIEW, // what has it answers as a view does: a station that runs
    VIEW_PORT_TAKEN
};

// What view_create would find at its port. Waits for at most a second, and tells nobody a token.
enum view_port_use view_look_at_port(int port);
