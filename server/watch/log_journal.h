// The server's log in the journal of systemd.
#pragma once

// If systemd started this program and stderr goes to its journal, each line becomes an entry there
// from now on, without its time: MESSAGE with the room, PRIORITY, ARTHRON_ROOM, and ARTHRON_STATION
// where the message begins with one ("station room-1: ..."). Otherwise lines stay as they are. Call
// it before other threads run.
void log_to_journal(void);
