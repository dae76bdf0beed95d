// The configuration of a server's sessions: cases, stations, folders, limits.
#pragma once

#include "case/case.h"
#include "case/content.h"
#include "cluster/cluster.h"
#include "records/recorder.h"
#include "runtime/types.h"
#include "step/optic.h"
#include "step/settings.h"

#define SESSIONS_CASES_MAX 64
#define SESSIONS_PATH_MAX 256
#define SESSIONS_INSTRUMENTS_MAX 32 // that the config names

struct session_case {
    char name[STATION_NAME_MAX];
    char dir[SESSIONS_PATH_MAX];
    char hash[CONTENT_HASH_SIZE]; // of its content; empty: any
};

struct session_station {
    char name[STATION_NAME_MAX];      // as in the station's certificate
    char case_name[STATION_NAME_MAX]; // one of the cases
    char trainee[STATION_NAME_MAX];
    struct view_optic optic; // of its scope
    bool start_by_command;   // else a session runs as soon as its station connects
    // Buttons of each instrument's handle that are down while its tip touches; 0: none.
    uint32_t contact_buttons[INSTRUMENT_COUNT];
};

// Of an instrument that stations describe: the points beside its tip.
struct session_instrument {
    char name[INSTRUMENT_NAME_MAX];
    struct instrument_body body;
};

struct sessions_config {
    char address[STATION_NAME_MAX]; // to listen on; empty for all
    int port;                       // control connections
    int udp_port;                   // worker i listens on udp_port + i; 0: any free port
    int workers;                    // 0: one for each core
    char keys_dir[SESSIONS_PATH_MAX];
    char authority_key_dir[SESSIONS_PATH_MAX];    // of authority.key; empty: keys_dir
    char authority_passphrase[SESSIONS_PATH_MAX]; // the file with its passphrase, or empty
    char traces_dir[SESSIONS_PATH_MAX];
    char socket[SESSIONS_PATH_MAX];    // local socket of the console
    char records[SESSIONS_PATH_MAX];   // the database of sessions (store); empty: none
    char tasks_dir[SESSIONS_PATH_MAX]; // with the tasks' files; a folder that is not there has none
    int keep_days, keep_gb;            // of sessions (records/retention.h); 0: no bound
    bool serve_unfit;                  // open sessions on cases that a check found unfit, too
    int case_memory_mb;                // that reading one case may take
    case_checker check_case;           // before a case is read here; or NULL
    int wait_s;                        // how long a session waits for its station
    // The server warns above these: age and residuals of a station's calibration, and drift.
    int calibration_days;
    double calibration_mm, calibration_deg;
    // As the recorder calls it (records/recorder.h).
    void (*attempt_written)(void *user, struct store *store, const char *session, int number);
    void *attempt_user;
    struct cluster_settings cluster; // of several servers; without a name this one is alone
    struct session_settings settings;
    int instrument_count; // whose bodies are not by their places in `settings`
    struct session_instrument instruments[SESSIONS_INSTRUMENTS_MAX];
    int case_count;
    struct session_case cases[SESSIONS_CASES_MAX];
    int station_count; // at most STATIONS_MAX
    struct session_station *stations;
};

// The number of workers: one for each core if the config says 0.
int sessions_worker_count(const struct sessions_config *config);

// An index, or -1 if no case or station has this name.
int sessions_find_case(const struct sessions_config *config, const char *name);
int sessions_find_station(const struct sessions_config *config, const char *name);
