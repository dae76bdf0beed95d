// Plays the punch's opening of the file as a HID handle.
#pragma once

#include "base/result.h"
#include "faults.h"
#include "player.h"

#include <stdatomic.h>

struct handle_player {
    const struct player *player;
    struct faults *faults;
    const atomic_bool *stop;
    const char *serial;
    double rate_hz; // of reports
    int handle;     // -1: not plugged in
};

enum result handle_player_plug(struct handle_player *handle_player, struct error *err);

void *handle_player_run(void *handle_player); // a thread: sends reports until *stop
