// Sessions on worker threads: the one place that joins a session to the network and to its trace.
//
// Threads: a worker for each core (datagrams, steps, replies) and a theatre beside it (cuts, and
// the meshes that they change), one for control connections, one for the console, and the clerk,
// who does what may take time (loading, opening and closing traces), and the recorder, who alone
// waits for the database; and those that pages need (audience.h). They talk through rings; a worker
// never waits for any of the others.
#pragma once

#include "base/result.h"
#include "step/optic.h"
#include "step/session.h"

#define HUB_STATIONS_MAX 64
#define HUB_CASES_MAX 64
#define HUB_NAME_MAX 64
#define HUB_PATH_MAX 256

struct hub_case {
    char name[HUB_NAME_MAX];
    char dir[HUB_PATH_MAX];
};

struct hub_station {
    char name[HUB_NAME_MAX];      // as in the station's certificate
    char case_name[HUB_NAME_MAX]; // one of the hub's cases
    char trainee[HUB_NAME_MAX];
    struct view_optic optic; // of its scope
    bool start_by_command;   // else a session runs as soon as its station is there
    // Buttons of each instrument's handle that are down while its tip touches; 0: none.
    uint32_t contact_buttons[INSTRUMENT_COUNT];
};

struct hub_config {
    char address[HUB_NAME_MAX]; // to listen on; empty for all
    int port;                   // control connections
    int udp_port;               // worker i listens on udp_port + i; 0: any free port
    int workers;                // 0: one for each core
    char keys_dir[HUB_PATH_MAX];
    char traces_dir[HUB_PATH_MAX];
    char socket[HUB_PATH_MAX];  // local socket of the console
    char records[HUB_PATH_MAX]; // the database of sessions (store); empty: none
    bool serve_unfit;           // sessions on cases that a check found unfit, too (check/grade.h)
    int wait_s;                 // how long a session waits for its station
    // What is worse is warned of: age and residuals of a station's calibration, and drift.
    int calibration_days;
    double calibration_mm, calibration_deg;
    struct session_settings settings;
    int case_count;
    struct hub_case cases[HUB_CASES_MAX];
    int station_count;
    struct hub_station stations[HUB_STATIONS_MAX];
};

// The workers that a hub of this config has: one for each core where the config says 0.
int hub_worker_count(const struct hub_config *config);

struct hub;

// Loads all cases, opens all sockets, starts all threads. The config is copied. The error names the
// case, key file, address or folder at fault.
enum result hub_create(const struct hub_config *config, struct hub **out_hub, struct error *err);

// A copy or an undo that somebody waits for is broken off, and that is answered, so that who must
// end before the hub does not wait for it. From any thread.
void hub_break_off(struct hub *hub);

// Tells the stations, ends every session with a whole trace, joins all threads.
void hub_destroy(struct hub **hub);
