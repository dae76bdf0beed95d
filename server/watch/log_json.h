// The server's log for programs that gather logs.
#pragma once

// Each line is a JSON object from now on, with time, level, room, station and message; the station
// only where the message begins with one ("station room-1: ..."). Of a text that is no UTF-8, each
// byte that is no ASCII becomes "?". Call it before other threads run.
void log_as_json(void);
