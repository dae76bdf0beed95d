// An OpenIGTLink tracker: plays the tools of the file to every client that connects.
#pragma once

#include "base/result.h"
#include "client.h"
#include "encode.h"
#include "faults.h"
#include "player.h"

#include <stdatomic.h>

struct tracker_server {
    const struct player *player;
    const atomic_bool *stop;
    enum message_type type;
    bool when_asked; // to clients only that asked: TDATA or QTDATA (STT_), else a frame for each
                     // GET_
    int header_version;
    double rate_hz; // 0: each row of the file at its own time; else the file interpolated
    pose T_tracker_mockup, T_tool_tip[CHANNEL_COUNT];
    struct faults *faults;

    char address[300]; // with the port that was taken
    int listener;      // -1: unplugged
};

// *listener and *address become what they are.
enum result tracker_server_listen(struct tracker_server *server, const char *address,
                                  struct error *err);

// A thread: serves until *stop. A client that does not read what it is sent is dropped.
void *tracker_server_run(void *tracker_server);
