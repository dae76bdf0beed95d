// An OpenIGTLink server made of the library's own classes, after its example TrackingDataServer: it
// sends to a client that asked, until it says stop.
#pragma once

#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

struct library_server;

enum library_server_kind {
    SENDS_TDATA,
    SENDS_QTDATA,
    SENDS_BY_ITSELF,
    SENDS_ONE_STAMP, // by itself, with the same stamp in each message
    REPEATS_ITSELF,  // by itself, with the same stamp and pose in each message
    REFUSES,
    ANSWERS_GET,     // one TRANSFORM for each GET_TRANS that names its tool, but the fifth ones
    SENDS_STATUS,    // that it is not ready, and nothing else
    SENDS_VERSION_9, // by itself
    HAS_TWO_DEVICES  // as SENDS_TDATA, from "Tracker" and, 100 mm away, from "Other"
};

// What it did so far; of any thread.
struct library_server_record {
    int requests; // that the library could read, their checksums too
    int interval_ms;
    char coordinates[33];
    int gets, statuses; // GET_TRANS for the tool, GET_STATUS
    char device[21];    // that the newest STT_ named
};

struct library_server *library_server_start(enum library_server_kind kind, int *out_port);
struct library_server_record library_server_told(struct library_server *server);
void library_server_stop(struct library_server *server);

#ifdef __cplusplus
}
#endif
